"""Curves and phones to cues: the cheapest sequence of shapes that are all held long enough."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.export.cues.costs import frame_costs
from lipmotion.export.cues.shapes import OPTIONAL, SHAPES, drawn_shape
from lipmotion.export.cues.sheet import CueSheet, drawn_shapes, frame_count, cue_sheet
from lipmotion.kernels.segments import best_segments
from lipmotion.types import Generation

CHANGE = 0.35
"""What a change of shape costs, in the unit of ``evidence``: one that lasts must be worth it."""
HOLD_S = 2 / 24


def default_hold_frames(fps: float) -> int:
    """Return the frames nearest to two at 24 a second, the least that an animator holds a mouth."""
    return max(1, int(HOLD_S * fps + 0.5))


def choose_cues(
    generation: Generation, fps: float = 24.0, hold_frames: int | None = None, optional: str = OPTIONAL
) -> CueSheet:
    """Return the cues of a result.

    fps         : frames per second of the animation, 1 to 60
    hold_frames : frames that every cue lasts at least, > 0; a recording shorter than that has one cue
    optional    : which of the shapes G, H and X the character has
    Exact: of all sequences that keep the hold, the one of least cost (``evidence``, ``kernels.segments``).
    Cost: about 10 µs a frame.
    """
    motion, drawn = generation.motion, drawn_shapes(optional)
    duration_s = max(0.0, (len(motion.values) - 1) / motion.rate_hz, *(span.end_s for span in generation.units))
    frames = frame_count(duration_s, fps)
    cost = _costs_of_drawn_shapes(frame_costs(generation, frames, fps), drawn) if frames else np.empty((0, len(drawn)))
    segments = best_segments(cost, hold_frames or default_hold_frames(fps), CHANGE)
    return cue_sheet([(frame, drawn[label]) for frame, label in segments], duration_s, fps, drawn)


def _costs_of_drawn_shapes(cost: NDArray[np.float64], drawn: str) -> NDArray[np.float64]:
    """Return the cost of the shapes that are drawn; one that stands for another costs what is cheaper."""
    names = list(SHAPES)
    groups = [[column for column, other in enumerate(names) if drawn_shape(other, drawn) == name] for name in drawn]
    return np.stack([cost[:, group].min(axis=1) for group in groups], axis=1)
