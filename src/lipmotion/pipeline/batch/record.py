"""The record of a line, as the ledger and receipts hold it: what of it can be relied on when it is read again."""

from __future__ import annotations

from typing import Any

from lipmotion.pipeline.batch.lines import CONTROL
from lipmotion.storage.json_text import from_json
from lipmotion.types.values import any_members, items, members, number, one_of, optional, text, whole

Record = dict[str, Any]
"""What is known of one line; its fields are listed in docs/batch.md."""
DONE, FAILED = "done", "failed"
LARGEST_RECORD_BYTES = 1 << 20
"""Most bytes of a record; one has about a thousand."""
LARGEST_NUMBER = 1e12
"""No duration, level or count of a recording is larger."""
TOGETHER = (("words", "confidence"), ("closures_heard", "closures_made"))
"""Fields of which the second is there wherever the first is."""


_TEXT, _NUMBER = text(LARGEST_RECORD_BYTES), number(-LARGEST_NUMBER, LARGEST_NUMBER)
_INPUT = {"path": _TEXT, "size": whole(0, 1 << 63), "changed_ns": whole(-(1 << 63), 1 << 63), "sha256": _TEXT}
_CHECKED = members(
    {
        **dict.fromkeys(("name", "recording", "run", "fingerprint", "words", "error", "redone"), _TEXT),
        **dict.fromkeys(("warnings", "advice"), items(_TEXT)),
        **dict.fromkeys(("duration_s", "seconds", "confidence", "range_db", "widest", "motion"), _NUMBER),
        **dict.fromkeys(("closures_heard", "closures_made", "least_sure_s"), _NUMBER),
        "voice": optional(_NUMBER),
        "outcome": one_of((DONE, FAILED)),
        "inputs": items(members(_INPUT, _INPUT, alone=True)),
        "outputs": any_members(_TEXT),
    },
    ("name", "recording", "run", "fingerprint", "outcome", "inputs", "outputs"),
)
"""What every known field must hold; a field of a later version may hold anything."""


def read_record(content: bytes) -> Record | None:
    """Return the record in a row of a ledger, or in a receipt; None: it is damaged."""
    try:
        record: Record = from_json(content)
        _CHECKED(record)
    except ValueError:
        return None
    if any(first in record and second not in record for first, second in TOGETHER):
        return None
    names = [record["name"], *record["outputs"]]
    belong = all(output.startswith(f"{record['name']}.") for output in record["outputs"])
    return record if belong and not any(map(CONTROL.search, names)) else None
