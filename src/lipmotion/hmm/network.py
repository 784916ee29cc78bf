"""Networks of states, in which the best path is searched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.log_likelihoods import LogLikelihoods
from lipmotion.kernels.paths import NetworkArrays, Windows, best_path

KEPT_FRAMES = 12_000
"""Up to so many frames (two minutes), log densities are computed once and kept; those of longer recordings twice."""


@dataclass(frozen=True, eq=False)
class Network:
    """States joined by arcs, in the form that ``kernels.paths.best_path`` takes."""

    emission: NDArray[np.intp]
    arc_from: NDArray[np.intp]
    arc_log: NDArray[np.float32]
    arc_start: NDArray[np.intp]
    log_initial: NDArray[np.float32]
    log_final: NDArray[np.float32]

    @property
    def arrays(self) -> NetworkArrays:
        """The network as kernels take it."""
        return NetworkArrays(
            self.emission, self.arc_from, self.arc_log, self.arc_start, self.log_initial, self.log_final
        )

    def best_path(
        self,
        log_likelihoods: LogLikelihoods,
        chosen: NDArray[np.intp] | None = None,
        beam: float | None = None,
        windows: Windows | None = None,
    ) -> NDArray[np.intp]:
        """Return the states of the best path [shape=(T,)].

        chosen  : the densities that ``emission`` numbers; None: all
        beam    : states with a score lower than the best of the frame by more than this are dropped; None: exact
        windows : the frames that each state may have; None: any
        Raises AlignmentError: no path reaches the end.
        """
        cached = (
            log_likelihoods.log_density(0, log_likelihoods.frames, chosen)
            if log_likelihoods.frames <= KEPT_FRAMES
            else None
        )

        def log_emission(first: int, end: int) -> NDArray[np.float32]:
            return log_likelihoods.log_density(first, end, chosen) if cached is None else cached[first:end]

        path, score = best_path(log_emission, log_likelihoods.frames, self.arrays, beam, windows)
        if not np.isfinite(score):
            raise AlignmentError(
                f"no path through {len(self.emission)} states in {log_likelihoods.frames} frames of 10 ms: "
                "the recording is too short for what should be said in it"
            )
        return path


class NetworkBuilder:
    """Builder of a ``Network``, to which states and arcs are added in any order."""

    def __init__(self) -> None:
        self._emission: list[int] = []
        self._arcs: list[tuple[int, int, float]] = []
        self._initial: dict[int, float] = {}
        self._final: dict[int, float] = {}

    def state(self, density: int, stay: float) -> int:
        """Add a state with an arc to itself of log probability ``stay``; return its number."""
        number = len(self._emission)
        self._emission.append(density)
        self._arcs.append((number, number, stay))
        return number

    def arc(self, source: int, target: int, log_probability: float) -> None:
        """Add an arc between two states."""
        self._arcs.append((target, source, log_probability))

    def initial(self, state: int, log_probability: float = 0.0) -> None:
        """Let paths begin in a state."""
        self._initial[state] = log_probability

    def final(self, state: int, log_probability: float = 0.0) -> None:
        """Let paths end in a state."""
        self._final[state] = log_probability

    def build(self) -> Network:
        """Return the network, with its arcs sorted by target."""
        arcs = sorted(self._arcs, key=lambda arc: arc[0])
        targets = np.array([arc[0] for arc in arcs], np.intp)
        count = len(self._emission)
        return Network(
            emission=np.array(self._emission, np.intp),
            arc_from=np.array([arc[1] for arc in arcs], np.intp),
            arc_log=np.array([arc[2] for arc in arcs], np.float32),
            arc_start=np.searchsorted(targets, np.arange(count)).astype(np.intp),
            log_initial=_dense(self._initial, count),
            log_final=_dense(self._final, count),
        )


def _dense(values: dict[int, float], count: int) -> NDArray[np.float32]:
    """Return the values by number [shape=(count,)], -inf where there is none."""
    full = np.full(count, -np.inf, np.float32)
    full[list(values)] = list(values.values())
    return full
