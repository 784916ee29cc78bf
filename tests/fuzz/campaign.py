"""Good input, changed again and again: what reaches new lines, or new messages, is changed further."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

from fuzz.inputs import Files, Good, Reader, digest
from fuzz.judge import CRASH, HANG, READ, REFUSED, WRONG, Result
from fuzz.mutators import mutated
from fuzz.worker import Worker

ACCEPTED, RECENT = 0.7, 0.5
"""So often, one that was read is changed, which gets further than one that was refused; one of the last few."""
STOP_AFTER = 200
"""Inputs of one kind of hang or crash: each costs a new process, so a reader full of them is left."""


@dataclass
class Finding:
    """A defect: the first input that showed it, and how many did."""

    result: Result
    files: Files
    count: int = 1


@dataclass
class Tally:
    """What was seen of one reader.

    made     : inputs made, some of them alike
    distinct : inputs read
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
        """Take one result; return whether it is new in some way."""
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


def campaign(reader: Reader, worker: Worker, good: Good, seed: int, going_on: Callable[[Tally], bool]) -> Tally:
    """Read good input, then changed input while ``going_on`` says so. The same seed makes the same inputs."""
    chance, tally, seen = Random(f"{seed} {reader.name}"), Tally(reader.name), set[bytes]()
    accepted, refused = list[Files](), list[Files]()
    queue = reader.seeds(good)
    start_s = time.monotonic()
    while (queue or going_on(tally)) and tally.kinds[HANG] + tally.kinds[CRASH] < STOP_AFTER:
        first = bool(queue)
        files = (
            queue.pop(0)
            if first
            else mutated(chance, _chosen(chance, accepted, refused), chance.choice(accepted + refused))
        )
        tally.made += 1
        if digest(files) in seen:
            continue
        seen.add(digest(files))
        begun_s = time.monotonic()
        result = worker.tried(reader.name, files)
        new = tally.add(result, files)
        tally.slowest_s = max(tally.slowest_s, time.monotonic() - begun_s)
        if new or first:
            (accepted if result.kind == READ else refused).append(files)
    tally.kept, tally.seconds = len(accepted + refused), time.monotonic() - start_s
    return tally


def _chosen(chance: Random, accepted: list[Files], refused: list[Files]) -> Files:
    pool = accepted if not refused or (accepted and chance.random() < ACCEPTED) else refused
    return chance.choice(pool[-10:] if chance.random() < RECENT else pool)
