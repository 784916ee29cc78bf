"""Expectation–maximisation of coupled chains over recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Observed, Single, Sums, no_sums, relearned
from lipmotion.engines.coupled.chains.lattice import Lattice
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.errors import InputError

AT_A_TIME = 16
"""Recordings whose sums are added up before they go to those of others."""
LEAST_FRAMES = 3.0
"""A density with less data than so many frames stays as it is."""


@dataclass(frozen=True, eq=False)
class Recording:
    """What is observed, and where the chains can be meanwhile.

    weight : how often it counts
    """

    observed: Observed
    lattice: Lattice
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class Expected:
    """What recordings say.

    groups : sums for each group
    counts : what transitions are learned from
    log_likelihood, frames : of the recordings that have a path

    All by the weights of the recordings.
    """

    groups: tuple[Sums, ...]
    counts: NDArray[np.float64]
    log_likelihood: float
    frames: float

    def plus(self, other: Expected) -> Expected:
        """Return both together."""
        return Expected(
            tuple(a.plus(b) for a, b in zip(self.groups, other.groups, strict=True)),
            self.counts + other.counts,
            self.log_likelihood + other.log_likelihood,
            self.frames + other.frames,
        )


def expected(chains: Chains, recordings: Sequence[Recording], workers: int = 1) -> Expected:
    """Return what recordings say about chains. Raises InputError: none has a path through them."""
    parts = range(0, len(recordings), AT_A_TIME)
    jobs = ((chains, recordings[start : start + AT_A_TIME]) for start in parts)
    total: Expected | None = None
    for part in _each(_together, jobs, workers):
        total = part if total is None else total.plus(part)
    if total is None or not total.frames:
        raise InputError(f"none of {len(recordings)} recordings can be said by these chains; check their labels")
    return total


def maximised(
    chains: Chains,
    said: Expected,
    floors: Sequence[Single],
    *,
    streams: Sequence[int],
    moves: bool = True,
) -> Chains:
    """Return the chains that explain best what recordings said.

    floors  : the least variance of each stream [each shape=(D_s,)]
    streams : those whose densities are learned;  moves : learn the transitions
    """
    groups = [
        relearned(group, sums, [floors[s] for s in group.streams], LEAST_FRAMES, streams)
        if set(group.streams) & set(streams)
        else group
        for group, sums in zip(chains.groups, said.groups, strict=True)
    ]
    transitions = chains.transitions.relearned(said.counts) if moves else chains.transitions
    return replace(chains, groups=tuple(groups), transitions=transitions)


def _together(job: tuple[Chains, Sequence[Recording]]) -> Expected:
    chains, recordings = job
    sums = tuple(no_sums(group) for group in chains.groups)
    counts = np.zeros(chains.transitions.count)
    log_likelihood, frames = 0.0, 0.0
    for recording in recordings:
        observed, lattice, weight = recording.observed, recording.lattice, recording.weight
        evidence = chains.evidence(observed, lattice)
        posteriors = chains.posteriors(evidence, lattice)
        if not np.isfinite(posteriors.log_likelihood):
            continue
        for one, group, chosen, posterior, shares in zip(
            sums, chains.groups, lattice.densities, posteriors.densities, evidence.shares, strict=True
        ):
            one.add(group, observed, chosen, posterior if weight == 1 else posterior * np.float32(weight), shares)
        counts[lattice.counts] += weight * posteriors.counts
        log_likelihood += weight * posteriors.log_likelihood
        frames += weight * observed.frames
    return Expected(sums, counts, log_likelihood, frames)


def _each(function: Callable[[Any], Expected], jobs: Iterable[Any], workers: int) -> Iterator[Expected]:
    """Give the results in order. Kernels and matrix products run without the interpreter's lock."""
    if workers < 2:
        yield from map(function, jobs)
        return
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(function, jobs)
