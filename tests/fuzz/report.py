"""The findings of a fuzzing run: reduced, stored, and with all figures as JSON."""

import json
import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fuzz.campaign import CampaignRecord, Finding
from fuzz.inputs import Files, lay_out
from fuzz.judge import CRASH, HANG, MEMORY, READ, REFUSED, WRONG
from fuzz.worker import Worker

PATIENCE_S = 30.0
"""Time for the reduction of the inputs of one reader."""


def keep(record: CampaignRecord, worker: Worker, folder: Path) -> list[Path]:
    """Write every finding of a reader, reduced, into a folder of its own; return the folders."""
    patience_s = PATIENCE_S / max(len(record.findings), 1)
    return [_kept(record.reader, finding, worker, folder, patience_s) for finding in record.findings.values()]


def _kept(reader: str, finding: Finding, worker: Worker, folder: Path, patience_s: float) -> Path:
    result = finding.result

    def same(files: Files) -> bool:
        found = worker.read_input(reader, files)
        return (found.kind, found.where) == (result.kind, result.where)

    files = finding.files if result.kind == HANG else smallest(finding.files, same, patience_s)
    name = re.sub(r"[^a-z0-9.]+", "-", f"{result.kind} {result.where}".lower()).strip("-")[:60]
    place = folder / reader / name
    place.mkdir(parents=True, exist_ok=True)
    lay_out(files, place)
    place.with_name(f"{name}.trace").write_text(f"{finding.count} inputs\n{result.detail}", encoding="utf-8")
    return place


def smallest(files: Files, same: Callable[[Files], bool], patience_s: float) -> Files:
    """Return shorter files with the same result: ever smaller parts are left out."""
    end_s = time.monotonic() + patience_s
    for name in sorted(files):
        size = max(len(files[name]) // 2, 1)
        while size and time.monotonic() < end_s:
            at = 0
            while at < len(files[name]) and time.monotonic() < end_s:
                shorter = files | {name: files[name][:at] + files[name][at + size :]}
                if same(shorter):
                    files = shorter
                else:
                    at += size
            size //= 2
    return files


OTHERS = tuple(kind for kind in WRONG if kind not in (CRASH, HANG, MEMORY))


def row(record: CampaignRecord) -> dict[str, Any]:
    counts = {name: record.kinds[kind] for name, kind in {"read": READ, "refused": REFUSED}.items()}
    wrong = {"crashes": record.kinds[CRASH], "hangs": record.kinds[HANG], "memory": record.kinds[MEMORY]}
    rate = round(record.distinct / record.seconds, 1) if record.seconds else 0.0
    return {
        **{"reader": record.reader, "tried": record.made, "distinct": record.distinct, **counts, **wrong},
        **{"errors": sum(record.kinds[kind] for kind in OTHERS), "defects": len(record.findings)},
        **{"kept": record.kept, "lines": len(record.lines), "per_s": rate, "slowest_s": round(record.slowest_s, 1)},
    }


def write_json(path: Path, records: Sequence[CampaignRecord], seed: int, minutes: float) -> None:
    """Write the figures as JSON, and every defect with its trace."""
    found = [
        {"reader": record.reader, "kind": finding.result.kind, "where": finding.result.where, "inputs": finding.count}
        | {"detail": finding.result.detail}
        for record in records
        for finding in record.findings.values()
    ]
    whole = {"seed": seed, "minutes": minutes, "readers": [row(record) for record in records], "defects": found}
    path.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
