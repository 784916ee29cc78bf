"""A fuzzing campaign: inputs are changed repeatedly; those that reach new lines or messages are changed further.

Of readers of JSON, every other input has a hostile value in one place of a good document, until all have been read.
Findings are reduced and stored.
"""

import re
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import chain, zip_longest
from pathlib import Path
from random import Random

from fuzz.inputs import Files, Good, Reader, digest, lay_out
from fuzz.judge import CRASH, HANG, READ, REFUSED, WRONG, Result
from fuzz.mutators import mutated
from fuzz.mutators.documents import systematic
from fuzz.worker import Worker

ACCEPTED_SHARE, RECENT_SHARE = 0.7, 0.5
"""Probability that an input that was read is changed, not one that was refused; that one of the last few is."""
STOP_AFTER = 200
"""Hangs and crashes after which a reader is abandoned: each of them costs a new process."""


@dataclass
class Finding:
    """A defect: the first input that showed it, and the number of inputs that did."""

    result: Result
    files: Files
    count: int = 1


@dataclass
class CampaignRecord:
    """Counts and findings of the campaign on one reader.

    made     : number of inputs made, some of them equal
    distinct : number of different inputs, which were read
    kept     : number of inputs that were changed further
    """

    reader: str
    made: int = 0
    distinct: int = 0
    seconds: float = 0.0
    slowest_s: float = 0.0
    kinds: Counter[str] = field(default_factory=Counter)
    findings: dict[tuple[str, str], Finding] = field(default_factory=dict)
    lines: set[str] = field(default_factory=set)
    kept: int = 0

    def add(self, result: Result, files: Files) -> bool:
        """Record one result; return whether its input is worth further changes."""
        self.distinct += 1
        self.kinds[result.kind] += 1
        key = (result.kind, result.where)
        fresh = bool(result.lines - self.lines) or (result.kind == REFUSED and key not in self._messages)
        self.lines |= result.lines
        self._messages.add(key)
        if result.kind in WRONG:
            found = self.findings.setdefault(key, Finding(result, files, 0))
            found.count += 1
        return fresh and result.kind not in (HANG, CRASH)

    _messages: set[tuple[str, str]] = field(default_factory=set)


def campaign(
    reader: Reader, worker: Worker, good: Good, seed: int, going_on: Callable[[CampaignRecord], bool]
) -> CampaignRecord:
    """Read good inputs, then changed inputs while ``going_on`` is true; the same seed makes the same inputs."""
    chance, record, seen = Random(f"{seed} {reader.name}"), CampaignRecord(reader.name), set[bytes]()
    accepted, refused = list[Files](), list[Files]()
    queue = reader.seeds(good)
    order = Random(seed)
    in_turn = zip_longest(*(systematic(files, order) for files in queue))
    planned = (files for files in chain.from_iterable(in_turn) if files is not None)
    start_s = time.monotonic()
    while (queue or going_on(record)) and record.kinds[HANG] + record.kinds[CRASH] < STOP_AFTER:
        first = bool(queue)
        files = queue.pop(0) if first else next(planned, None) if record.made % 2 else None
        if files is None:
            pool = accepted if not refused or (accepted and chance.random() < ACCEPTED_SHARE) else refused
            chosen = chance.choice(pool[-10:] if chance.random() < RECENT_SHARE else pool)
            files = mutated(chance, chosen, chance.choice(accepted + refused))
        record.made += 1
        if digest(files) in seen:
            continue
        seen.add(digest(files))
        begun_s = time.monotonic()
        result = worker.read_input(reader.name, files)
        new = record.add(result, files)
        record.slowest_s = max(record.slowest_s, time.monotonic() - begun_s)
        if new or first:
            (accepted if result.kind == READ else refused).append(files)
    record.kept, record.seconds = len(accepted + refused), time.monotonic() - start_s
    return record


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
