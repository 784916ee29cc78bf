"""Motion of chosen units: joined, at rest in digital silence, and where others were wanted leant on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.concatenation import Piece, concatenated
from lipmotion.engines.selection.costs import Costs, Target
from lipmotion.engines.selection.inventory import UnitNumbers
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.motion.generation import Statistics
from lipmotion.motion.rest import find_digital_silence, find_runs, is_away_from_speech, list_speech_intervals
from lipmotion.stats.curves import with_dynamics
from lipmotion.types import FRAME_RATE_HZ, Constraints, Motion, ReducedVariance, Speech, Timeline, Unit
from lipmotion.units import SILENCE, is_silent

Array = NDArray[np.float64]
SETTLED_S = 0.06
"""Half of the rest pose is left so long before the first phone, and reached so long after the last one."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """The unit of each phone of a target [shape=(U,)], and the pieces that they make."""

    target: Target
    units: UnitNumbers
    pieces: list[Piece]


def motion_of_units(
    model: SelectionModel,
    costs: Costs,
    chosen: Chosen,
    speech: Speech,
    constraints: Constraints | None = None,
    *,
    close: bool = False,
) -> tuple[Motion, ReducedVariance]:
    """Return the motion of chosen units, lips closed if wanted, and its variance, as ``LearnedMotion.generate``."""
    frames = len(speech.features.values)
    track = concatenated(costs.inventory, chosen.target, chosen.pieces, frames)
    always = not is_silent(costs.stand_ins.get(SILENCE, SILENCE))
    resting = _resting(np.asarray(speech.features.values), speech.units, always=always)[:, None]
    means = with_dynamics(track + resting * (model.rest - track))
    precisions = np.broadcast_to(1 / model.variances, means.shape)

    def statistics(block: slice) -> Statistics:
        return means[block].copy(), precisions[block].copy()

    learned = model.motion.for_voice(speech.voice)
    reliability = _substituted(costs, chosen.target, chosen.units, frames)
    return learned.generate(statistics, frames, speech.units, constraints, close=close, reliability=reliability)


def _resting(features: NDArray[np.floating], units: Timeline[Unit], *, always: bool) -> Array:
    """Return the weight of the rest pose in every frame, 0 to 1 [shape=(T,)].

    It is 1 in silence of which some is digital, and falls to 0 before the next phone and after the last one: in digital
    silence there is no breath, as there may be in the silence that was recorded with the unit.
    always   : whether it is 1 in every silence, for no silence was recorded
    """
    silent = np.ones(len(features), bool) if always else find_digital_silence(features, units)
    if not silent.any():
        return np.zeros(len(features))
    away = is_away_from_speech(np.arange(len(features)) / FRAME_RATE_HZ, list_speech_intervals(units), SETTLED_S)
    resting = np.zeros(len(features))
    for first, stop in find_runs(away):
        resting[first:stop] = float(silent[first:stop].any())
    width = round(SETTLED_S * FRAME_RATE_HZ)
    window = np.hanning(2 * width + 1)
    padded = np.pad(resting, width, mode="edge")
    return np.convolve(padded, window / window.sum(), "valid")


def _substituted(costs: Costs, target: Target, units: NDArray[np.intp], frames: int) -> Array:
    """Return 1 in the frames whose unit was recorded between other phones than are wanted, else 0 [shape=(T,)].

    There the table of articulation says more than the unit; elsewhere the unit is a recording of what is wanted.
    """
    middle = costs.config.window // 2
    around = slice(middle - 1, middle + 2)
    differs = (costs.index.contexts[units][:, around] != target.contexts[:, around]).any(axis=1) & (not target.by_sound)
    result = np.zeros(frames)
    for (start_s, end_s), other in zip(target.windows.times_s.tolist(), differs.tolist(), strict=True):
        result[int(start_s * FRAME_RATE_HZ) : int(np.ceil(end_s * FRAME_RATE_HZ))] = float(other)
    return result
