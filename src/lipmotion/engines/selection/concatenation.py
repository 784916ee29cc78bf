"""Concatenation: recorded motion of the chosen units, warped to the times of the target, overlapping where joined.

Source: Minnis & Breen 2000, §4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from lipmotion.engines.selection.costs import ABUTTING_JOIN, JOIN_AFTER, JOIN_BEFORE, NO_JOIN, Costs, Target
from lipmotion.engines.selection.inventory import PROTECTED_PHONES, RecordedUnits, UnitNumbers
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.motion.frame_labels import find_digital_silence, find_runs, mark_distant
from lipmotion.stats.curves import with_dynamics
from lipmotion.types import FRAME_RATE_HZ, Constraints, Motion, ReducedVariance, Speech, Timeline, Unit
from lipmotion.units import PHONES, SILENCE, is_silent

Array = NDArray[np.float64]
SMOOTHED_SHARE = 0.05
"""Share of two abutting pieces, at the end of the first and at the start of the second, that is smoothed (§4)."""
MIN_OVERLAP_S, MAX_OVERLAP_S = 0.02, 0.15
"""Pieces overlap from at least so much, two frames, to at most so much before and after a soft join."""
MIN_WEIGHT = 1e-9
ROUNDING_S = 1e-6
SHORTEST_S = 1e-3  # two joins are never closer


@dataclass(frozen=True)
class Piece:
    """Units that were recorded in succession, and where they are used.

    first, stop : the phones of the target
    used        : these, and those beside them in which it overlaps with another piece
    join        : kind of the join with the piece before: ``ABUTTING_JOIN``, ``JOIN_BEFORE`` or ``JOIN_AFTER``
    start_s     : time of that join in the target; the piece counts for half there
    overlap_s   : the pieces overlap from so much before this time to so much after it; 0 for a hard join
    """

    first: int
    stop: int
    used: range
    unit: int
    join: int
    start_s: float
    overlap_s: float


def to_pieces(costs: Costs, target: Target, units: UnitNumbers) -> list[Piece]:
    """Return the pieces of a selection, in order; of two overlaps in one phone, the second gives way."""
    kinds = [ABUTTING_JOIN]
    for number in range(1, len(units)):
        pair = int(units[number - 1]), int(units[number])
        is_cut = kinds[-1] == JOIN_AFTER  # the phone before is one in which two pieces overlap already
        kinds.append(costs.join_kind(target, number, *pair, may_be_before=not is_cut))
    firsts = [number for number, kind in enumerate(kinds) if number == 0 or kind != NO_JOIN]
    times_s = target.windows.times_s
    pieces = []
    latest_s = -np.inf
    for first, stop in zip(firsts, [*firsts[1:], len(units)], strict=True):
        start_s, overlap_s = float(times_s[first, 0]), 0.0
        if first and kinds[first] in (JOIN_BEFORE, JOIN_AFTER):
            shared = first - 1 if kinds[first] == JOIN_BEFORE else first
            share, (begin_s, end_s) = costs.forward_share(target, shared), times_s[shared].tolist()
            start_s = begin_s + share * (end_s - begin_s)
            overlap_s = float(np.clip(min(share, 1 - share) * (end_s - begin_s), MIN_OVERLAP_S, MAX_OVERLAP_S))
        start_s = latest_s = max(start_s, latest_s + SHORTEST_S)
        is_shared = kinds[stop : stop + 1] == [JOIN_AFTER]
        used = range(first - (kinds[first] == JOIN_BEFORE), stop + is_shared)
        pieces.append(Piece(first, stop, used, int(units[first]), kinds[first], start_s, overlap_s))
    return pieces


def join_pieces(inventory: RecordedUnits, target: Target, pieces: list[Piece], frames: int) -> Array:
    """Return the motion of some pieces in the motion space, 100 frames a second [shape=(frames, Q)].

    Where pieces overlap, the next one's weight rises along a raised cosine. Abutting pieces are bent together.
    """
    time_s = np.arange(frames) / FRAME_RATE_HZ
    result, total = np.zeros((frames, inventory.values.shape[1])), np.zeros((frames, 1))
    nexts = [*pieces[1:], None]
    clocks = [TimeMap.of(inventory, target, piece) for piece in pieces]
    for number, (piece, following, clock) in enumerate(zip(pieces, nexts, clocks, strict=True)):
        begin_s = piece.start_s - piece.overlap_s if number else -np.inf
        end_s = following.start_s + following.overlap_s if following is not None else np.inf
        used = np.flatnonzero((time_s >= begin_s) & (time_s <= end_s))
        if not len(used):
            continue
        motion = inventory.at(np.full(len(used), inventory.windows.recording[piece.unit]), clock(time_s[used]))
        weight = _rise(time_s[used], piece) if number else np.ones(len(used))
        if following is not None:
            weight = weight * (1 - _rise(time_s[used], following))
        result[used] += weight[:, None] * motion
        total[used] += weight[:, None]
    result /= np.maximum(total, MIN_WEIGHT)
    for sides in pairwise(zip(pieces, clocks, strict=True)):
        if sides[1][0].join == ABUTTING_JOIN:
            _smooth(inventory, target, sides, time_s, result)
    return result


def list_shown_units(target: Target, pieces: Sequence[Piece], frames: int) -> UnitNumbers:
    """Return the unit that leads in every frame: where pieces overlap, the one with the larger weight [shape=(T,)]."""
    time_s = np.arange(frames) / FRAME_RATE_HZ + ROUNDING_S
    leading = np.maximum(np.searchsorted([piece.start_s for piece in pieces], time_s, side="right") - 1, 0)
    numbers = np.maximum(np.searchsorted(target.windows.times_s[:, 0], time_s, side="right") - 1, 0)
    bounds = [(piece.used.start, piece.used.stop - 1, piece.unit - piece.first) for piece in pieces]
    lowest, highest, shift = np.array(bounds)[leading].T
    return np.clip(numbers, lowest, highest) + shift


@dataclass(frozen=True, eq=False)
class TimeMap:
    """The time in a recording for every time in the target, for one piece: monotone and smooth.

    target_s, recorded_s : times that belong together [each shape=(K,)]
    Edges of phones fall on edges of phones. A silence is not stretched: what is missing in its middle is a pause in
    which the motion stands still. Outside, the recording goes on at its own speed.
    """

    target_s: Array
    recorded_s: Array

    @classmethod
    def of(cls, inventory: RecordedUnits, target: Target, piece: Piece) -> TimeMap:
        """Return the map of a piece."""
        shift = piece.unit - piece.first
        pairs = []  # the start and the end of each phone, in the target and in the recording; of a silence, its pause
        for number in piece.used:
            start_s, end_s = target.windows.times_s[number].tolist()
            from_s, to_s = inventory.windows.times_s[number + shift].tolist()
            pairs.append((start_s, from_s))
            missing_s = (end_s - start_s) - (to_s - from_s)
            silent = is_silent(PHONES[target.windows.phones[number]]) and not target.by_sound
            if silent and missing_s > 0:
                half_s = (to_s - from_s) / 2
                pairs += [(start_s + half_s, from_s + half_s), (end_s - half_s, from_s + half_s)]
            pairs.append((end_s, to_s))
        times = np.array(pairs)
        apart = np.append(np.diff(times[:, 0]) > SHORTEST_S, True)
        return cls(times[apart, 0], times[apart, 1])

    def __call__(self, time_s: Array) -> Array:
        """Return times in the recording [shape=(N,)]."""
        if len(self.target_s) < 2:
            return self.recorded_s[0] + time_s - self.target_s[0]
        inside = np.clip(time_s, self.target_s[0], self.target_s[-1])
        return PchipInterpolator(self.target_s, self.recorded_s)(inside) + (time_s - inside)


def _rise(time_s: Array, piece: Piece) -> Array:
    """Return the weight of a piece beside the one before it, 0 to 1 [shape=(N,)]."""
    if not piece.overlap_s:
        return (time_s >= piece.start_s).astype(float)
    phase = np.clip((time_s - piece.start_s) / piece.overlap_s, -1, 1)
    return (1 + np.sin(phase * np.pi / 2)) / 2


def _smooth(
    inventory: RecordedUnits, target: Target, sides: Sequence[tuple[Piece, TimeMap]], time_s: Array, motion: Array
) -> None:
    """Bend two abutting pieces towards one another, in place; a protected phone beside another one keeps its shape."""
    (before, _), (after, _) = sides
    join_s, times_s = after.start_s, target.windows.times_s
    recording = inventory.windows.recording
    left, right = (inventory.at(recording[[piece.unit]], clock(np.array([join_s])))[0] for piece, clock in sides)
    jump = right - left
    phones = (PHONES[target.windows.phones[number]] for number in (after.first - 1, after.first))
    one, other = (phone in PROTECTED_PHONES for phone in phones)
    shares = (0.0, 1.0) if one and not other else (1.0, 0.0) if other and not one else (0.5, 0.5)
    begin_s, end_s = times_s[before.first, 0], times_s[after.stop - 1, 1]
    spans_s = SMOOTHED_SHARE * (join_s - begin_s), SMOOTHED_SHARE * (end_s - join_s)
    for side, (share, span_s) in enumerate(zip(shares, spans_s, strict=True)):
        width_s = float(np.clip(span_s, MIN_OVERLAP_S, MAX_OVERLAP_S))
        away_s = (join_s - time_s) if side == 0 else (time_s - join_s)
        near = (away_s > 0 if side == 0 else away_s >= 0) & (away_s < width_s)
        bend = (1 + np.cos(np.pi * away_s[near] / width_s)) / 2
        motion[near] += (share if side == 0 else -share) * bend[:, None] * jump


SETTLED_S = 0.06  # half of the rest pose is left so long before the first phone, and reached so long after the last one


def join_motion(
    model: SelectionModel,
    costs: Costs,
    target: Target,
    units: UnitNumbers,
    pieces: list[Piece],
    speech: Speech,
    constraints: Constraints | None = None,
) -> tuple[Motion, ReducedVariance]:
    """Return the motion of units and pieces chosen for a target, and its variance, as ``LearnedMotion.generate``."""
    frames = len(speech.features.values)
    track = join_pieces(costs.inventory, target, pieces, frames)
    always = not is_silent(costs.stand_ins.get(SILENCE, SILENCE))
    resting = _resting(np.asarray(speech.features.values), speech.units, always=always)[:, None]
    means = with_dynamics(track + resting * (model.rest - track))
    precisions = np.broadcast_to(1 / model.variances, means.shape)
    middle = costs.config.window // 2
    around = slice(middle - 1, middle + 2)  # units that were recorded between other phones may be corrected
    differs = (costs.index.contexts[units][:, around] != target.contexts[:, around]).any(axis=1)
    reliability = np.zeros(frames)
    for (start_s, end_s), other in zip(target.windows.times_s.tolist(), differs.tolist(), strict=True):
        within = slice(int(start_s * FRAME_RATE_HZ), int(np.ceil(end_s * FRAME_RATE_HZ)))
        reliability[within] = float(other and not target.by_sound)
    return model.motion.generate(
        lambda block: (means[block].copy(), precisions[block].copy()),
        frames,
        speech.units,
        constraints,
        close=costs.config.closures,
        reliability=reliability,
    )


def _resting(features: NDArray[np.floating], units: Timeline[Unit], *, always: bool) -> Array:
    """Return the weight of the rest pose in every frame: 1 in silence that is partly digital (``always``: in all)."""
    silent = np.ones(len(features), bool) if always else find_digital_silence(features, units)
    if not silent.any():
        return np.zeros(len(features))
    away = mark_distant(units, len(features), SETTLED_S)
    resting = np.zeros(len(features))
    for first, stop in find_runs(away):
        resting[first:stop] = float(silent[first:stop].any())
    width = round(SETTLED_S * FRAME_RATE_HZ)
    window = np.hanning(2 * width + 1)
    padded = np.pad(resting, width, mode="edge")
    return np.convolve(padded, window / window.sum(), "valid")
