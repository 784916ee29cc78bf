"""Networks of states that the best path is searched in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.log_likelihoods import LogLikelihoods
from lipmotion.kernels.arcs import Layout, laid_out
from lipmotion.kernels.network import Expectation
from lipmotion.kernels.viterbi import best_path

KEPT_FRAMES = 12_000
"""Two minutes: up to here densities are computed once and kept; those of longer recordings twice, by blocks."""


@dataclass(frozen=True, eq=False)
class Network:
    """States joined by arcs, ready for the Viterbi kernel."""

    emission: NDArray[np.intp]
    arc_from: NDArray[np.intp]
    arc_log: NDArray[np.float32]
    arc_start: NDArray[np.intp]
    log_initial: NDArray[np.float32]
    log_final: NDArray[np.float32]

    @cached_property
    def layout(self) -> Layout:
        """Where the arcs lie for compiled kernels."""
        return laid_out(self.arc_from, self.arc_start)

    def expectation(self) -> Expectation:
        """Return the network ready for forward–backward."""
        return Expectation.of(self.arc_from, self.arc_log, self.arc_start, self.log_initial, self.log_final)

    def best_path(
        self, evidence: LogLikelihoods, chosen: NDArray[np.intp] | None = None, beam: float | None = None
    ) -> NDArray[np.intp]:
        """Return the best path's states [shape=(T,)].

        chosen : the densities that ``emission`` counts; all by default
        beam   : states whose score falls more than this under the frame's best are dropped; None: exact
        Raises AlignmentError: no path reaches the end.
        """
        kept = evidence.log_density(0, evidence.frames, chosen) if evidence.frames <= KEPT_FRAMES else None

        def log_emission(first: int, end: int) -> NDArray[np.float32]:
            return evidence.log_density(first, end, chosen) if kept is None else kept[first:end]

        path, score = best_path(
            log_emission,
            evidence.frames,
            self.emission,
            self.arc_from,
            self.arc_log,
            self.arc_start,
            self.log_initial,
            self.log_final,
            beam,
            lambda: self.layout,
        )
        if not np.isfinite(score):
            raise AlignmentError(
                f"no path through {len(self.emission)} states in {evidence.frames} frames of 10 ms: "
                "the recording is too short for what should be said in it"
            )
        return path


class NetworkBuilder:
    """Collects states and arcs; ``build`` sorts them for the kernel."""

    def __init__(self) -> None:
        self._emission: list[int] = []
        self._arcs: list[tuple[int, int, float]] = []
        self._initial: dict[int, float] = {}
        self._final: dict[int, float] = {}

    def state(self, density: int, stay: float) -> int:
        """Add a state with its loop; return its number."""
        number = len(self._emission)
        self._emission.append(density)
        self._arcs.append((number, number, stay))
        return number

    def arc(self, source: int, target: int, log_probability: float) -> None:
        """Add an arc."""
        self._arcs.append((target, source, log_probability))

    def initial(self, state: int, log_probability: float = 0.0) -> None:
        """Let paths begin here."""
        self._initial[state] = log_probability

    def final(self, state: int, log_probability: float = 0.0) -> None:
        """Let paths end here."""
        self._final[state] = log_probability

    def build(self) -> Network:
        """Return the network."""
        arcs = sorted(self._arcs, key=lambda arc: arc[0])
        targets = np.array([arc[0] for arc in arcs], np.intp)
        count = len(self._emission)
        return Network(
            emission=np.array(self._emission, np.intp),
            arc_from=np.array([arc[1] for arc in arcs], np.intp),
            arc_log=np.array([arc[2] for arc in arcs], np.float32),
            arc_start=np.searchsorted(targets, np.arange(count)).astype(np.intp),
            log_initial=_sparse(self._initial, count),
            log_final=_sparse(self._final, count),
        )


def _sparse(values: dict[int, float], count: int) -> NDArray[np.float32]:
    full = np.full(count, -np.inf, np.float32)
    full[list(values)] = list(values.values())
    return full
