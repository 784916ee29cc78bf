from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from lipmotion.testing.toy import toy_motion
from lipmotion.types import Generation, Motion, Span, StateTrace, Timeline, Unit


def timeline(phones: Sequence[tuple[str, float]]) -> Timeline[Unit]:
    """Return a timeline of phones, each with its duration in seconds."""
    ends = list(accumulate(duration_s for _, duration_s in phones))
    starts = [0.0, *ends[:-1]]
    return Timeline(
        tuple(Span(start, end, Unit(phone)) for start, end, (phone, _) in zip(starts, ends, phones, strict=True))
    )


def result(units: Timeline[Unit], motion: Motion | None = None) -> Generation:
    """Return a generation with these phones; its motion is that of the toy face, unless another is given."""
    motion = motion or toy_motion(units, 100.0)
    trace = StateTrace(("a",), np.zeros(len(motion.values), np.intp))
    return Generation(motion, np.ones_like(motion.values), units, trace)


def spoken(text: str, duration_s: float = 0.1, silence_s: float = 0.3) -> Generation:
    """Return a generation of phones of equal length between silences, with the motion of the toy face."""
    said = [(phone, duration_s) for phone in text.split()]
    return result(timeline([("sil", silence_s), *said, ("sil", silence_s)]))
