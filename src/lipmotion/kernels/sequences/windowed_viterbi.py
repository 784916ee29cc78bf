"""The best state path through a network in which every state has a window of frames."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lipmotion.kernels.choice import compiled_pays
from lipmotion.kernels.sequences.arcs import NetworkArrays
from lipmotion.kernels.sequences.viterbi import ARC_S, FRAME_S, Index, LogEmission, PathSearch, Scores, path_search

BLOCK = 512
"""Frames that are searched at a time, through the states that may have one of them; scores before them are computed
again from checkpoints."""


class Windows(NamedTuple):
    """The frames that each state may have: from the first one to the end, which is excluded [shape=(S,)].

    Neither may decrease from state to state.
    """

    first: Index
    end: Index


def best_path_within(
    log_emission: LogEmission, count: int, network: NetworkArrays, windows: Windows
) -> tuple[Index, float]:
    """Return the most probable path of which every state lies in its window, and its log probability (-inf: no path).

    log_emission, count, network : as of ``viterbi.best_path``
    Cost: O(T·E') time and O(T / BLOCK·S' + BLOCK·(S' + G)) memory, where S' states and E' arcs have windows in one
    block: both are linear in the duration where windows are short.
    """
    blocks = [
        _Block(network, windows, start, min(start + BLOCK + 1, count)) for start in range(0, max(count - 1, 1), BLOCK)
    ]
    if any(block.is_empty for block in blocks):
        return np.full(count, -1, np.intp), -np.inf
    arcs = sum(block.most_arcs for block in blocks)
    compiled = compiled_pays(2 * (count * FRAME_S + BLOCK * arcs * ARC_S))
    rows, total = [blocks[0].first_row(log_emission)], 0.0
    for block, following in pairwise(blocks):
        search, delta, shift = block.search(rows[-1], log_emission, compiled)
        rows.append(following.row_after(block, delta[-1, search.place]))
        total += shift
    path = np.full(count, -1, np.intp)
    state = -1
    for block, row in zip(reversed(blocks), reversed(rows), strict=True):
        search, delta, shift = block.search(row, log_emission, compiled)
        if state < 0:
            last = delta[-1, search.place] + network.log_final[block.states]
            state = int(last.argmax())
            total += shift + float(last[state])
            path[-1] = block.states.start + state
            if not np.isfinite(total):
                break
        search.trace(path[block.start : block.stop - 1], delta, int(path[block.stop - 1]) - block.states.start)
        path[block.start : block.stop - 1] += block.states.start
    return path, total


class _Block:
    """Some frames, and the states that may have one of them: consecutive ones, in a network of their own.

    The last frame is the first one of the block that follows.
    """

    def __init__(self, network: NetworkArrays, windows: Windows, start: int, stop: int):
        self.network, self.windows, self.start, self.stop = network, windows, start, stop
        self.states = slice(
            int(np.searchsorted(windows.end, start, side="right")), int(np.searchsorted(windows.first, stop))
        )
        edges = np.append(network.arc_start, len(network.arc_from))
        self._arcs = slice(int(edges[self.states.start]), int(edges[self.states.stop]))
        self.most_arcs = self._arcs.stop - self._arcs.start

    @property
    def is_empty(self) -> bool:
        """Whether no state may have a frame of the block."""
        return self.states.start >= self.states.stop

    def first_row(self, log_emission: LogEmission) -> Scores:
        """Return the scores of the states in the first frame of all."""
        return self.network.log_initial[self.states] + self._log_emission(log_emission, 0, 1)[0]

    def row_after(self, before: _Block, last: Scores) -> Scores:
        """Return the scores in the first frame, from those of the block before in its last frame."""
        row = np.full(self.states.stop - self.states.start, -np.inf, np.float32)
        first, stop = max(self.states.start, before.states.start), min(self.states.stop, before.states.stop)
        if first < stop:
            row[first - self.states.start : stop - self.states.start] = last[
                first - before.states.start : stop - before.states.start
            ]
        return row

    def search(self, row: Scores, log_emission: LogEmission, compiled: bool) -> tuple[PathSearch, Scores, float]:
        """Return the search through the states, the scores of all frames by place, and the sum of their best scores.

        row : the scores in the first frame
        """
        search = path_search(self._own_network(), compiled)
        values = self._log_emission(log_emission, self.start, self.stop)
        delta, shift = search.scores(row[search.order], values)
        return search, delta, shift

    def _log_emission(self, log_emission: LogEmission, start: int, stop: int) -> Scores:
        """Return the log density of every state [shape=(stop - start, S')], -inf outside its window."""
        values = log_emission(start, stop)[:, self.network.emission[self.states]]
        frames = np.arange(start, stop)[:, None]
        outside = (frames < self.windows.first[self.states]) | (frames >= self.windows.end[self.states])
        values[outside] = -np.inf
        return values

    def _own_network(self) -> NetworkArrays:
        """Return the network of the states; arcs from others are left out."""
        first, network = self.states.start, self.network
        kept = (network.arc_from[self._arcs] >= first) & (network.arc_from[self._arcs] < self.states.stop)
        starts = network.arc_start[self.states] - self._arcs.start
        position = np.append(0, np.cumsum(kept))
        return NetworkArrays(
            np.arange(self.states.stop - first),
            network.arc_from[self._arcs][kept] - first,
            network.arc_log[self._arcs][kept],
            position[starts],
            network.log_initial[self.states],
            network.log_final[self.states],
        )
