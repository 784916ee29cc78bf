"""Excerpts of long recordings: what an edit changes in the motion, computed around it alone."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from lipmotion.motion.closure import clip_at_zero
from lipmotion.motion.network_steps import STEP
from lipmotion.pipeline.understand.understood_speech import UnderstoodSpeech
from lipmotion.types import (
    FRAME_RATE_HZ,
    Constraints,
    Features,
    Generation,
    Motion,
    Pin,
    PriorOutput,
    Speech,
    SpeechPart,
    Timeline,
    Unit,
)

MARGIN_S = 2.5
"""So far before and after an edit the motion is computed; motion a second from an edit hardly depends on it."""
GRID_S = 2.0
"""Excerpts begin and end at multiples of this, so that those of edits that are near to one another are the same."""
LONGEST_S = 40.0
"""Motion whose edits lie further apart is made whole."""


@dataclass(frozen=True)
class Excerpt:
    """What has changed between two sets of edits of one recording.

    frames : in which motion may differ
    kept   : how many phones are the same at the beginning, and at the end
    """

    frames: slice
    kept: tuple[int, int]

    @property
    def _times_s(self) -> tuple[float, float]:
        """The times of the first and the last frame."""
        return self.frames.start / FRAME_RATE_HZ, (self.frames.stop - 1) / FRAME_RATE_HZ

    def within(self, units: Timeline[Unit]) -> Timeline[Unit]:
        """Return the phones in these frames, cut at the ends, with times from the first of them."""
        return units.between(*self._times_s)

    def pinned(self, pins: Collection[Pin]) -> Constraints:
        """Return the pins in these frames, with times from the first of them."""
        first_s, last_s = self._times_s
        inside = [pin for pin in pins if first_s <= pin.time_s <= last_s]
        return Constraints(tuple(replace(pin, time_s=pin.time_s - first_s) for pin in inside))


def excerpt_of_change(
    before: Timeline[Unit], after: Timeline[Unit], pins: Collection[Pin], frames: int
) -> Excerpt | None:
    """Return the excerpt outside of which motion is the same; None: it is too long, outside, or nothing has changed.

    pins   : that are there before or after, but not both
    frames : of the recording at 100 Hz
    """
    shorter = min(len(before), len(after))
    first = next((n for n in range(shorter) if before[n] != after[n]), shorter)
    last = next((n for n in range(shorter - first) if before[-1 - n] != after[-1 - n]), shorter - first)
    changed = [*before.spans[first : len(before) - last], *after.spans[first : len(after) - last]]
    times_s = [time_s for span in changed for time_s in (span.start_s, span.end_s)] + [pin.time_s for pin in pins]
    if not times_s:
        return None
    start = GRID_S * math.floor(max(min(times_s) - MARGIN_S, 0) / GRID_S)
    end = GRID_S * math.ceil((max(times_s) + MARGIN_S) / GRID_S)
    if end - start > LONGEST_S or start * FRAME_RATE_HZ >= frames:
        return None
    return Excerpt(slice(round(start * FRAME_RATE_HZ), min(round(end * FRAME_RATE_HZ) + 1, frames)), (first, last))


def speech_within(understood: UnderstoodSpeech, frames: slice) -> UnderstoodSpeech:
    """Return understood speech of some frames alone, without phones; its first frame is a multiple of 4."""
    return replace(understood, speech=_within(understood.speech, frames), tags=(), events=())


def _within(speech: Speech, frames: slice) -> Speech:
    """Return the speech of some frames, and of the passages in them."""
    some = Features(speech.features.values[frames], (frames.stop - 1 - frames.start) / FRAME_RATE_HZ)
    steps, halves = (slice(frames.start // each, -(-frames.stop // each)) for each in (STEP, 2))
    posteriors, prior, confidence, parts = speech.posteriors, speech.prior, speech.confidence, None
    if speech.parts is not None:
        parts = tuple(
            _part_within(part, frames)
            for part in speech.parts
            if max(part.inside.start, frames.start) < min(part.inside.stop, frames.stop)
        )
    return Speech(
        some,
        Timeline(()),
        log_f0=None if speech.log_f0 is None else speech.log_f0[frames],
        units_known=speech.units_known,
        spectrum=None if speech.spectrum is None else speech.spectrum[frames],
        confidence=confidence[frames] if isinstance(confidence, np.ndarray) else confidence,
        prior=None
        if prior is None
        else PriorOutput(prior.articulators[steps], prior.hidden[steps], prior.distortion[steps]),
        voice=speech.voice,
        posteriors=None if posteriors is None else replace(posteriors, values=posteriors.values[halves]),
        encoding=None if speech.encoding is None else speech.encoding[frames],
        times_given=True,
        parts=parts,
    )


def _part_within(part: SpeechPart, frames: slice) -> SpeechPart:
    """Return a passage without what lies outside of some frames of the recording, in which its time is counted."""
    first = max(frames.start - part.first, 0) // STEP * STEP
    inside = _within(part.speech, slice(first, min(frames.stop - part.first, part.frames)))
    own = slice(max(part.own.start - frames.start, 0), min(part.own.stop, frames.stop) - frames.start)
    return SpeechPart(part.first + first - frames.start, own, inside)


def with_excerpt(
    whole: Generation, before: Generation, after: Generation, excerpt: Excerpt, units: Timeline[Unit]
) -> Generation:
    """Return motion with what an excerpt changes.

    whole, before, after : the motion before the change; in the excerpt alone, before and after it
    units : the phones in time after the change
    What an excerpt knows otherwise than the whole, as the mean pose at rest, is in both of its motions and cancels out.
    Deviations and states stay those of before.
    """
    values, frames, (first, last) = whole.motion.values.copy(), excerpt.frames, excerpt.kept
    changed = values[frames] + (after.motion.values - before.motion.values)
    clip_at_zero(Motion(changed, whole.motion.rate_hz, whole.motion.channels))
    values[frames] = changed
    named = whole.units.spans
    spans = (*named[:first], *units.spans[first : len(units) - last], *named[len(named) - last :])
    motion = Motion(values, whole.motion.rate_hz, whole.motion.channels)
    return replace(whole, motion=motion, units=Timeline(spans))
