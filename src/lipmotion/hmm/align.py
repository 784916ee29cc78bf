"""Forced alignment: the first frame of each unit of a known sequence, and the choice of pronunciations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import LogLikelihoods, NetworkBuilder, build_chain
from lipmotion.kernels.paths import Windows

FIT_BLOCK = 2048  # frames whose log densities are in memory at a time
MAX_BASE_ARCS, ARCS_A_FRAME = 1_000_000, 10
"""The largest number of arcs of a network, and how many more for each frame; sentences need about one a frame."""


@dataclass(frozen=True, eq=False)
class StateSequence:
    """The states of a sequence of units, one after another.

    names     : of each state, its full name in context
    densities : [shape=(S,)], the density of each state
    plain     : [shape=(S,)], its density without context, which has its duration
    positions : [shape=(S,)], the unit of the sequence that it belongs to
    """

    names: tuple[str, ...]
    densities: NDArray[np.intp]
    plain: NDArray[np.intp]
    positions: NDArray[np.intp]


def expand_states(hmm: UnitHmm, units: Sequence[str]) -> StateSequence:
    """Return the context-dependent states of a unit sequence; beyond its ends lies silence."""
    table, silence = hmm.table, hmm.table.free[0]
    neighbours = [silence, *(silence if unit in table.free else unit for unit in units), silence]
    names, densities, plain, positions = list[str](), list[int](), list[int](), list[int]()
    for i, unit in enumerate(units):
        context = {"<": neighbours[i], ">": neighbours[i + 2], "": ""}
        for state in range(table.count(unit)):
            names.append(table.name(neighbours[i], unit, neighbours[i + 2], state))
            plain.append(table.density(unit, state))
            densities.append(table.density(unit, state, context[table.side(unit, state)]))
            positions.append(i)
    return StateSequence(tuple(names), *(np.array(numbers, np.intp) for numbers in (densities, plain, positions)))


def align_states(
    hmm: UnitHmm, log_likelihoods: LogLikelihoods, units: Sequence[str], windows: Windows | None = None
) -> tuple[StateSequence, NDArray[np.intp]]:
    """Return a unit sequence's states, and that of every frame [shape=(T,)]. Raises AlignmentError: too few frames."""
    chain = expand_states(hmm, units)
    used, local = np.unique(chain.densities, return_inverse=True)
    if windows is not None:
        windows = Windows(windows.first[chain.positions], windows.end[chain.positions])
    log_stay = hmm.log_stay[chain.plain].astype(float)
    network = build_chain(local, log_stay, np.log(-np.expm1(log_stay)))
    return chain, network.best_path(log_likelihoods, used, windows=windows)


def align_units(
    hmm: UnitHmm, log_likelihoods: LogLikelihoods, units: Sequence[str], windows: Windows | None = None
) -> NDArray[np.intp]:
    """Return each unit's first frame, and the frame count [shape=(len(units) + 1,)]. Raises as ``align_states``."""
    chain, path = align_states(hmm, log_likelihoods, units, windows)
    return np.append(np.searchsorted(chain.positions[path], np.arange(len(units))), log_likelihoods.frames)


class SpokenWord(NamedTuple):
    """A word as it was pronounced, or a silence.

    word    : its position in the transcript; -1 for silence and pauses
    variant : the number of the pronunciation
    units   : those of the pronunciation, without pauses that were possible but not made
    """

    word: int
    variant: int
    units: tuple[str, ...]


class PlacedWord(NamedTuple):
    """A word or a silence as it was pronounced, and where.

    fit    : how its states compare with the best of all states, mean of its frames in nats, up to 0; NaN: not computed
    """

    spoken: SpokenWord
    start: int
    fit: float


def place_words(
    hmm: UnitHmm,
    log_likelihoods: LogLikelihoods,
    words: Sequence[Sequence[Sequence[str]]],
    pause: str,
    windows: Windows | None = None,
) -> list[PlacedWord]:
    """Return the most probable pronunciation of each word, with silence and the pauses between words, in order.

    words   : for each word, its possible pronunciations; a pause inside of one may be left out
    pause   : the unit that may stand between words; silence (the first free unit) surrounds them all
    windows : frames that each word may have, and a pause those of both words beside it; with them, fits are computed
    Only states without context are used: then the states of a pronunciation do not depend on the words beside it.
    Raises AlignmentError: the words do not fit into the frames, or into their windows.
    """
    _check_room(hmm, log_likelihoods.frames, words)
    silence = SpokenWord(-1, 0, (hmm.table.free[0],))
    slots: list[list[SpokenWord]] = [[silence]]
    for word, variants in enumerate(words):
        if word:
            slots.append([SpokenWord(-1, 0, (pause,)), SpokenWord(-1, 1, ())])
        slots.append([SpokenWord(word, number, tuple(variant)) for number, variant in enumerate(variants)])
    slots.append([silence])
    builder = NetworkBuilder()
    nodes: list[tuple[SpokenWord, int, int]] = []  # of each state the pronunciation, its slot, the unit within it
    open_ends: list[tuple[int, float]] = []
    for slot, choices in enumerate(slots):
        ends: list[tuple[int, float]] = []
        for choice in choices:
            if slot == 0:
                builder.initial[len(nodes)] = 0.0
            ends += _append_units(builder, hmm, choice.units, open_ends, pause if choice.word >= 0 else "")
            counts = [hmm.table.count(unit) for unit in choice.units]
            nodes += [(choice, slot, place) for place, count in enumerate(counts) for _ in range(count)]
        open_ends = ends
    builder.final.update(open_ends)
    plain = np.arange(len(hmm.log_stay), dtype=np.intp)
    slot_of = np.array([slot for _, slot, _ in nodes])
    of_states = None
    if windows is not None:
        of_slots = _list_slot_windows(windows, log_likelihoods.frames)
        of_states = Windows(of_slots.first[slot_of], of_slots.end[slot_of])
    network = builder.build()
    path = network.best_path(log_likelihoods, plain, windows=of_states)
    starts = np.flatnonzero(np.diff(slot_of[path], prepend=-1))
    fits = np.full(len(starts), np.nan)
    if windows is not None:
        densities = network.emission[path]
        frame_fits = np.empty(len(densities))
        for first in range(0, len(densities), FIT_BLOCK):
            end = min(first + FIT_BLOCK, len(densities))
            values = log_likelihoods.log_density(first, end, plain)
            frame_fits[first:end] = values[np.arange(end - first), densities[first:end]] - values.max(axis=1)
        fits = np.add.reduceat(frame_fits, starts) / np.diff(starts, append=len(densities))
    placed = []
    for states, start, fit in zip(np.split(path, starts[1:]), starts.tolist(), fits.tolist(), strict=True):
        spoken = nodes[states[0]][0]
        units = tuple(spoken.units[place] for place in dict.fromkeys(nodes[state][2] for state in states.tolist()))
        placed.append(PlacedWord(spoken._replace(units=units), start, fit))
    return placed


def _list_slot_windows(windows: Windows, frames: int) -> Windows:
    """Return the windows of words with the silences and pauses before, between and after them [shape=(2 W + 1,)]."""
    first, end = np.zeros(2 * len(windows.first) + 1, np.intp), np.full(2 * len(windows.end) + 1, frames, np.intp)
    first[1::2], end[1::2] = windows
    first[2::2], end[:-1:2] = windows
    return Windows(first, end)


def spread_windows(spoken: Sequence[SpokenWord], windows: Windows, frames: int) -> Windows:
    """Return the windows of all units of words with silences and pauses, from those of the words."""
    of_slots = _list_slot_windows(windows, frames)
    slots, word = [], -1
    for item in spoken:
        word = max(word, item.word)
        slots += [2 * word + (1 if item.word >= 0 else 2)] * len(item.units)
    return Windows(of_slots.first[slots], of_slots.end[slots])


def _check_room(hmm: UnitHmm, frames: int, words: Sequence[Sequence[Sequence[str]]]) -> None:
    """Raise AlignmentError if no path fits into the frames, or if the network might fill the memory."""
    count_of = dict(zip(hmm.table.units, hmm.table.counts, strict=True))
    different = {id(variants): variants for variants in words}  # equal words share one object: few of many are counted
    states = {number: [sum(map(count_of.__getitem__, v)) for v in variants] for number, variants in different.items()}
    fewest = sum(min(states[id(variants)]) for variants in words)
    if fewest > frames:
        raise AlignmentError(
            f"{len(words)} words take at least {fewest} frames of 10 ms, found {frames}: the recording "
            "is too short for what should be said in it; give its own transcript"
        )
    ends = [1, *(len(variants) + 1 for variants in words)]  # of the word before, and of the pause
    arcs = sum(2 * sum(states[id(v)]) + len(v) * before for v, before in zip(words, ends, strict=False))
    if arcs > MAX_BASE_ARCS + ARCS_A_FRAME * frames:
        raise AlignmentError(
            f"{len(words)} words in all their pronunciations make {arcs} arcs, required at most "
            f"{MAX_BASE_ARCS + ARCS_A_FRAME * frames} for {frames} frames of 10 ms; give fewer pronunciations"
        )


def _append_units(
    builder: NetworkBuilder, hmm: UnitHmm, units: Sequence[str], open_ends: list[tuple[int, float]], pause: str
) -> list[tuple[int, float]]:
    """Add states of some units to all open ends (states, log P(leave)); return the new ends. ``pause`` is optional."""
    ends = open_ends
    for unit in units:
        before = ends if unit == pause else []
        for state in range(hmm.table.count(unit)):
            number = builder.state(hmm.table.density(unit, state), hmm.stay(unit, state))
            for source, move in ends:
                builder.arc(source, number, move)
            ends = [(number, hmm.move(unit, state))]
        ends = [*before, *ends]
    return ends
