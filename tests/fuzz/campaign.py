"""A fuzzing campaign: inputs are changed repeatedly; those that are refused with a new message are changed further.

Of readers of JSON, every other input has a hostile value in one place of a good document, until all have been read.
"""

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import chain, zip_longest
from pathlib import Path
from random import Random

from fuzz.inputs import Files, Good, Reader, digest, lay_out
from fuzz.judge import CRASH, HANG, READ, REFUSED, Result
from fuzz.mutators import mutated
from fuzz.mutators.documents import systematic
from fuzz.worker import Worker

ACCEPTED_SHARE, RECENT_SHARE = 0.7, 0.5
"""Probability that an input that was read is changed, not one that was refused; that one of the last few is."""
STOP_AFTER = 200  # hangs and crashes after which a reader is abandoned: each of them costs a new process


@dataclass
class CampaignRecord:
    """How many inputs of a reader had each result, and the first input of each result by its kind and place."""

    reader: str
    kinds: Counter[str] = field(default_factory=Counter)
    firsts: dict[tuple[str, str], tuple[Result, Files]] = field(default_factory=dict)

    @property
    def findings(self) -> list[tuple[Result, Files]]:
        """The defects."""
        return [each for each in self.firsts.values() if each[0].kind not in (READ, REFUSED)]

    def keep(self, folder: Path) -> list[Path]:
        """Write every defect into a folder of its own, its trace beside it; return the folders."""
        places = []
        for result, files in self.findings:
            name = re.sub(r"[^a-z0-9.]+", "-", f"{result.kind} {result.where}".lower()).strip("-")[:60]
            places.append(folder / self.reader / name)
            places[-1].mkdir(parents=True, exist_ok=True)
            lay_out(files, places[-1])
            places[-1].with_name(f"{name}.trace").write_text(result.detail, encoding="utf-8")
        return places


def campaign(
    reader: Reader, worker: Worker, good: Good, seed: int, going_on: Callable[[CampaignRecord], bool]
) -> CampaignRecord:
    """Read good inputs, then changed inputs while ``going_on`` is true; the same seed makes the same inputs."""
    chance, order, record, seen = (
        Random(f"{seed} {reader.name}"),
        Random(seed),
        CampaignRecord(reader.name),
        set[bytes](),
    )
    pools: dict[bool, list[Files]] = {True: [], False: []}  # inputs that were read, and others
    queue = reader.seeds(good)
    in_turn = zip_longest(*(systematic(files, order) for files in queue))
    planned = (files for files in chain.from_iterable(in_turn) if files is not None)
    while (queue or going_on(record)) and record.kinds[HANG] + record.kinds[CRASH] < STOP_AFTER:
        first = bool(queue)
        files = queue.pop(0) if first else next(planned, None) if len(seen) % 2 else None
        if files is None:
            pool = pools[not pools[False] or (bool(pools[True]) and chance.random() < ACCEPTED_SHARE)]
            chosen = chance.choice(pool[-10:] if chance.random() < RECENT_SHARE else pool)
            files = mutated(chance, chosen, chance.choice(pools[True] + pools[False]))
        if digest(files) in seen:
            continue
        seen.add(digest(files))
        result = worker.read_input(reader.name, files)
        record.kinds[result.kind] += 1
        fresh = (result.kind, result.where) not in record.firsts
        record.firsts.setdefault((result.kind, result.where), (result, files))
        if first or (fresh and result.kind not in (HANG, CRASH)):
            pools[result.kind == READ].append(files)
    return record
