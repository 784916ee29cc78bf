"""A fuzzing campaign: inputs are changed repeatedly; those that reach new lines or messages are changed further.

Of readers of JSON, every other input has a hostile value in one place of a good document, until all have been read.
"""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import chain, zip_longest
from random import Random

from fuzz.inputs import Files, Good, Reader, digest
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
            files = mutated(chance, _chosen(chance, accepted, refused), chance.choice(accepted + refused))
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


def _chosen(chance: Random, accepted: list[Files], refused: list[Files]) -> Files:
    pool = accepted if not refused or (accepted and chance.random() < ACCEPTED_SHARE) else refused
    return chance.choice(pool[-10:] if chance.random() < RECENT_SHARE else pool)
