"""The findings of a fuzzing run, reduced and stored, and its figures."""

import re
import time
from collections.abc import Callable
from pathlib import Path

from fuzz.campaign import CampaignRecord, Finding
from fuzz.inputs import Files, lay_out
from fuzz.judge import HANG
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


def row(record: CampaignRecord) -> str:
    """Return the figures of a reader in one line."""
    rate = record.distinct / record.seconds if record.seconds else 0.0
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(record.kinds.items()))
    return (
        f"{record.reader}: {record.made} tried, {record.distinct} distinct ({kinds}), {len(record.findings)} defects, "
        f"{record.kept} kept, {len(record.lines)} lines, {rate:.1f} a second, the slowest {record.slowest_s:.1f} s"
    )
