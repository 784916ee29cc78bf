"""The record of a line, as the ledger and receipts hold it: what of it can be relied on when it is read again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lipmotion.pipeline.batch.lines import CONTROL
from lipmotion.storage.json_text import from_json

Record = dict[str, Any]
"""What is known of one line; its fields are listed in docs/batch.md."""
DONE, FAILED = "done", "failed"
LARGEST_RECORD_BYTES = 1 << 20
"""Most bytes of a record; one has about a thousand."""
LARGEST_NUMBER = 1e12
"""No duration, level or count of a recording is larger."""
NEEDED = {"name", "recording", "run", "fingerprint", "outcome", "inputs", "outputs"}
TOGETHER = (("words", "confidence"), ("closures_heard", "closures_made"))
"""Fields of which the second is there wherever the first is."""


def read_record(content: bytes) -> Record | None:
    """Return the record in a row of a ledger, or in a receipt; None: it is damaged."""
    try:
        record = from_json(content)
    except ValueError:
        return None
    return record if _is_record(record) else None


def _is_record(record: Any) -> bool:
    if not isinstance(record, dict) or not record.keys() >= NEEDED:
        return False
    if not all(is_such(record[name]) for name, is_such in FIELDS.items() if name in record):
        return False
    if any(first in record and second not in record for first, second in TOGETHER):
        return False
    return not CONTROL.search(record["name"]) and all(
        output.startswith(f"{record['name']}.") and not CONTROL.search(output) for output in record["outputs"]
    )


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) <= LARGEST_NUMBER


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


def _are_inputs(value: Any) -> bool:
    """Return whether a value is a list of the fields of ``InputFile``."""
    kinds = {"path": str, "size": int, "changed_ns": int, "sha256": str}
    return isinstance(value, list) and all(
        isinstance(each, dict)
        and each.keys() == kinds.keys()
        and all(isinstance(each[name], kind) for name, kind in kinds.items())
        for each in value
    )


FIELDS: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(("name", "recording", "run", "fingerprint", "words", "error", "redone"), _is_text),
    **dict.fromkeys(("warnings", "advice"), _are_texts),
    **dict.fromkeys(("duration_s", "seconds", "confidence", "range_db", "widest", "motion"), _is_number),
    **dict.fromkeys(("closures_heard", "closures_made", "least_sure_s"), _is_number),
    "voice": lambda value: value is None or _is_number(value),
    "outcome": lambda value: value in (DONE, FAILED),
    "inputs": _are_inputs,
    "outputs": lambda value: isinstance(value, dict) and all(map(_is_text, value.values())),
}
"""What every known field must hold; a field of a later version may hold anything."""
