"""Cue sheets: the mouth shape of every span of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lipmotion.types import Span, Timeline
from lipmotion.units.mouth_chart import REST, SHAPES, drawn_shape

CUES_FPS = 24.0
"""Frame rate of cues where none is given."""


@dataclass(frozen=True)
class CueSheet:
    """The cues of one recording.

    cues  : shapes without gaps from 0 to the end, at least one; times are whole hundredths of a second
    fps   : the frame rate that they were chosen for; ``int(fps * start_s)`` is a cue's first frame, the first is 0
    drawn : the shapes that the character has
    words : the words in time, where they are known
    blair : whether shapes have Preston Blair's names where a format has no letters of its own, ``.dat``

    >>> sheet = CueSheet(Timeline((Span(0.0, 0.5, "X"), Span(0.5, 0.62, "A"))), fps=24.0, drawn="ABCDEFX")
    >>> sheet.duration_s, sheet.rest
    (0.62, 'X')
    """

    cues: Timeline[str]
    fps: float
    drawn: str
    words: Timeline[str] = field(default_factory=lambda: Timeline(()))
    blair: bool = True

    @property
    def rest(self) -> str:
        """The shape before and after speech."""
        return drawn_shape(REST, self.drawn)

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.cues.spans[-1].end_s


def drawn_shapes(optional: str) -> str:
    """Return the basic shapes and the given optional ones."""
    return "".join(name for name, shape in SHAPES.items() if not shape.fallback or name in optional)


def start_s(frame: int, fps: float) -> float:
    """Return the first hundredth of a second in which a frame is shown.

    Rounded up, so that ``int(fps * start)``, which readers of Rhubarb's and Moho's files compute, is the frame again.
    Frame 1 at 24 fps, 0.0417 s, becomes 0.05 s; rounded to 0.04 s it would be in frame 0. At 100 fps a frame is a
    hundredth, and none is left to round to.
    """
    hundredths = int(np.ceil(frame / fps * 100 - 1e-6))
    return (hundredths + (fps < 100 and int(fps * (hundredths / 100)) < frame)) / 100


def cue_frame_count(duration_s: float, fps: float) -> int:
    """Return the number of frames that begin before the end, which is cut to hundredths of a second."""
    end_s = whole_hundredths(duration_s)
    frames = int(np.ceil(end_s * fps))
    while frames and start_s(frames - 1, fps) >= end_s:
        frames -= 1
    return frames


def whole_hundredths(duration_s: float) -> float:
    """Return a duration cut to hundredths of a second."""
    return int(duration_s * 100 + 1e-6) / 100


def cue_sheet(segments: Sequence[tuple[int, str]], duration_s: float, fps: float, drawn: str) -> CueSheet:
    """Return the cue sheet of segments (first frame, shape); without segments, the mouth is at rest."""
    starts = [start_s(frame, fps) for frame, _ in segments] or [0.0]
    shapes = [shape for _, shape in segments] or [drawn_shape(REST, drawn)]
    ends = [*starts[1:], whole_hundredths(duration_s)]
    return CueSheet(Timeline(tuple(map(Span, starts, ends, shapes))), fps, drawn)


def shown_shapes(sheet: CueSheet) -> list[str]:
    """Return the shape of every frame of the animation, to the end of the sheet."""
    frames = max(1, int(sheet.fps * sheet.duration_s + 1 - 1e-9))
    starts = [min(int(sheet.fps * cue.start_s), frames) for cue in sheet.cues] + [frames]
    shown: list[str] = []
    for cue, end in zip(sheet.cues, starts[1:], strict=True):
        shown += [cue.label] * (end - len(shown))
    return shown
