"""How often recorded units are joined, and how smooth the opening is there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.concatenation import pieces_of
from lipmotion.engines.selection.costs import ABUTTING_JOIN
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.search import select
from lipmotion.engines.selection.targets import target_of
from lipmotion.pipeline.evaluation.held_out import OPENING
from lipmotion.types import FRAME_RATE_HZ, Speech, Utterance

Array = NDArray[np.float64]
REACH = 4
"""Frames before and after a frame between which velocities are compared: 40 ms, a picture of a video."""
PERCENTILES = (50, 75, 95)


def join_figures(
    engine: SelectionEngine, model: SelectionModel, speech: Sequence[Speech], utterances: Sequence[Utterance]
) -> dict[str, Any]:
    """Return how many joins some speech takes, and how much the velocity of the opening changes there.

    utterances : the recordings of the speech, whose own changes are the measure
    ``hard`` is the share of joins in which units abut; ``smooth`` that of joins where the velocity changes by no more
    than the 95th percentile of the recordings.
    """
    costs, kinds, changes, recorded = model.costs(engine.config), [], [], []
    for utterance, spoken in zip(utterances, speech, strict=True):
        target = target_of(model, costs, spoken)
        pieces = pieces_of(costs, target, select(costs, target).units)
        opening = engine.generate(model, spoken).motion[OPENING]
        frames = np.array([round(piece.start_s * FRAME_RATE_HZ) for piece in pieces[1:]], np.intp)
        changes.append(velocity_change(opening)[np.minimum(frames, len(opening) - 1)])
        kinds += [piece.join for piece in pieces[1:]]
        motion = utterance.track.motion
        original = np.interp(np.arange(len(opening)) / FRAME_RATE_HZ, motion.time_s, motion[OPENING])
        start_s, end_s = target.windows.times_s[0, 1], target.windows.times_s[-1, 0]
        recorded.append(velocity_change(original)[int(start_s * FRAME_RATE_HZ) : int(end_s * FRAME_RATE_HZ)])
    made, own = np.concatenate(changes), np.concatenate(recorded)
    bound = float(np.percentile(own, PERCENTILES[-1])) if len(own) else float("nan")
    return {
        "joins": len(kinds),
        "per_clip": len(kinds) / len(utterances),
        "hard": kinds.count(ABUTTING_JOIN) / len(kinds) if kinds else float("nan"),
        "smooth": float(np.mean(made <= bound)) if kinds else float("nan"),
        "changes": np.percentile(made, PERCENTILES).tolist() if kinds else None,
        "recorded_changes": np.percentile(own, PERCENTILES).tolist() if len(own) else None,
    }


def velocity_change(curve: NDArray[np.floating[Any]]) -> Array:
    """Return the size of the second difference over 40 ms on both sides of each frame [shape=(T,)]."""
    padded = np.pad(np.asarray(curve, float), REACH, mode="edge")
    return np.abs(padded[2 * REACH :] - 2 * padded[REACH:-REACH] + padded[: -2 * REACH])
