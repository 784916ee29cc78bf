"""The most probable paths of factorial hidden Markov models (``kernels.sequences.loops``)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import numba_works
from lipmotion.kernels.sequences.factorial import kept_frames
from lipmotion.kernels.sequences.factorial_logs import LogTransitions
from lipmotion.kernels.sequences.loops import Array, FactorialLogLikelihoods, Index, Loop


def factorial_best_path(
    audio: Loop, visual: Loop, logs: FactorialLogLikelihoods, stretch: int | None = None
) -> tuple[Index, Index, float]:
    """Return the most probable states of both loops [shapes=(T,)], and the log probability of path and recording.

    logs    : log densities of the recording
    stretch : frames whose decisions are stored at once; those of the others are computed twice; None: as
        ``factorial_posteriors``
    Where there is no path: states 0, and -inf.  Of equally probable paths, any one.
    Source: the Viterbi recursion, along one loop's axis and then along the other's.
    Cost: time O(T·Na·Nv·(Ua + Uv)), memory O(stretch + T/stretch) times Na·Nv.
    """
    frames = len(logs.audio)
    stretch = stretch or kept_frames(frames, 2 * logs.audio.shape[1] * logs.visual.shape[1])
    search = _FactorialSearch(_ViterbiTransitions.of(audio), _ViterbiTransitions.of(visual), logs)
    with np.errstate(divide="ignore"):
        initial, final = (
            np.add.outer(*(np.log(getattr(loop, name).ravel()) for loop in (audio, visual)))
            for name in ("initial", "final")
        )
    score = initial + logs.joint(0)
    befores, decisions = [], list[_Decisions]()
    for start in range(1, frames, stretch):
        befores.append((start, score))
        score, decisions = search.through(start, min(start + stretch, frames), score)
    path = np.zeros((frames, 2), np.intp)
    score = score + final
    best = float(score.max())
    if best == -np.inf:
        return path[:, 0], path[:, 1], best
    path[-1] = np.unravel_index(int(score.argmax()), score.shape)
    for start, before in reversed(befores):
        if start != befores[-1][0]:
            _, decisions = search.through(start, min(start + stretch, frames), before)
        for t in range(start + len(decisions) - 1, start - 1, -1):
            path[t - 1] = search.previous(decisions[t - start], *path[t])
    return path[:, 0], path[:, 1], best


_Decisions = tuple[NDArray[Any], NDArray[Any]]
"""For each loop, the decision at each joint state [shape=(N, M)], the loop's own states along axis 0."""


class _ViterbiTransitions(LogTransitions):
    """Log transition probabilities of a loop, and the best of the transitions into each state."""

    def best_forward(self, score: Array) -> tuple[Array, NDArray[Any]]:
        """Return the best scores one frame on, along axis 0, and the decisions.

        A decision is U for staying, U + 1 for the next state, else the unit that was left.
        """
        units = len(self.leaving)
        after = score + self.stay[:, None]
        decision = np.full(score.shape, units, np.min_scalar_type(units + 1))
        moved = score[: len(self.onward)] + self.onward[:, None]
        _take_better(after[units:], decision[units:], moved, units + 1)
        last, first = score[len(score) - units :], (after[:units], decision[:units])
        if numba_works():
            from lipmotion.kernels.compiled.factorial import take_best_entering

            take_best_entering(last, self.leaving, *first)
        else:
            for unit, weight in enumerate(self.leaving):
                _take_better(*first, last[unit] + weight[:, None], unit)
        return after, decision

    def previous(self, state: int, decision: int) -> int:
        """Return the state one frame before, given the decision."""
        units = len(self.leaving)
        if decision < units:
            return len(self.stay) - units + decision
        return state - units if decision > units else state


def _take_better(score: Array, decision: NDArray[Any], other: Array, number: int) -> None:
    """Replace scores by greater ones, and their decisions by a number."""
    np.copyto(decision, number, where=other > score)
    np.maximum(score, other, out=score)


class _FactorialSearch(NamedTuple):
    """The search in both loops for one recording."""

    audio: _ViterbiTransitions
    visual: _ViterbiTransitions
    logs: FactorialLogLikelihoods

    def through(self, start: int, stop: int, score: Array) -> tuple[Array, list[_Decisions]]:
        """Return the scores after the frames of a stretch, and the decisions of each frame."""
        decisions = []
        for t in range(start, stop):
            score, by_audio = self.audio.best_forward(score)
            turned, by_visual = self.visual.best_forward(np.ascontiguousarray(score.T))
            score = turned.T + self.logs.joint(t)
            decisions.append((by_audio, by_visual))
        return score, decisions

    def previous(self, decisions: _Decisions, audio: int, visual: int) -> tuple[int, int]:
        """Return both states one frame before; the decision of the visual loop was the later one."""
        by_audio, by_visual = decisions
        visual = self.visual.previous(visual, int(by_visual[visual, audio]))
        return self.audio.previous(audio, int(by_audio[audio, visual])), visual
