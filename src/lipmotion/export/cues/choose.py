"""Selection of cues: the sequence of held shapes with the least total cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.export.cues.shape_costs import frame_costs
from lipmotion.export.cues.sheet import CueSheet, cue_frame_count, cue_sheet, drawn_shapes
from lipmotion.kernels.sequences.segments import best_segments
from lipmotion.types import Generation, Timeline
from lipmotion.units import words_in_time
from lipmotion.units.mouth_chart import OPTIONAL, SHAPES, drawn_shape

CHANGE_COST = 0.35
"""Cost of a change of shape, in the unit of ``costs``."""
HOLD_S = 2 / 24


def default_hold_frames(fps: float) -> int:
    """Return the number of frames nearest to two frames at 24 fps, the shortest hold of a mouth in animation."""
    return max(1, int(HOLD_S * fps + 0.5))


def choose_cues(
    generation: Generation,
    fps: float = 24.0,
    hold_frames: int | None = None,
    optional: str = OPTIONAL,
    intensity: float = 1.0,
) -> CueSheet:
    """Return the cues of generated motion.

    fps         : frames per second of the animation, 1 to 100
    hold_frames : minimum length of a cue in frames, > 0; a shorter recording has one cue
    optional    : which of the shapes G, H and X the character has
    intensity   : openings and spread so many times as large, before shapes are chosen
    The result is exact: of all sequences that keep the hold, the one of least cost (``costs``, ``sequences.segments``).
    Cost: about 10 µs a frame.
    """
    motion, drawn = generation.motion, drawn_shapes(optional)
    duration_s = max(0.0, (len(motion.values) - 1) / motion.rate_hz, *(span.end_s for span in generation.units))
    frames = cue_frame_count(duration_s, fps)
    cost = np.empty((0, len(drawn)))
    if frames:
        cost = _costs_of_drawn_shapes(frame_costs(generation, frames, fps, intensity), drawn)
    segments = best_segments(cost, hold_frames or default_hold_frames(fps), CHANGE_COST)
    sheet = cue_sheet([(frame, drawn[label]) for frame, label in segments], duration_s, fps, drawn)
    return replace(sheet, words=Timeline(tuple(span for span in words_in_time(generation.units) if span.label)))


def _costs_of_drawn_shapes(cost: NDArray[np.float64], drawn: str) -> NDArray[np.float64]:
    """Return the cost of the drawn shapes [shape=(frames, drawn)]: the least cost of those that each one stands for."""
    names = list(SHAPES)
    groups = [[column for column, other in enumerate(names) if drawn_shape(other, drawn) == name] for name in drawn]
    return np.stack([cost[:, group].min(axis=1) for group in groups], axis=1)
