"""Excerpts of long recordings: what an edit changes in the motion, computed around it alone."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from lipmotion.motion.closure import clip_at_zero
from lipmotion.motion.network_steps import STEP
from lipmotion.pipeline.analysis.speech_analysis import SpeechAnalysis
from lipmotion.types import (
    FRAME_RATE_HZ,
    Constraints,
    Features,
    Generation,
    Pin,
    PriorOutput,
    Speech,
    SpeechPart,
    Timeline,
    Unit,
)

MARGIN_S = 2.5
"""Motion is computed so far before and after an edit; a second from an edit it hardly depends on it."""
GRID_S = 2.0
"""Excerpts begin and end at multiples of this, so that those of edits that are near to one another are the same."""
LONGEST_S = 40.0
"""If edits lie further apart, the full motion is computed."""


@dataclass(frozen=True)
class Excerpt:
    """What has changed between two sets of edits of one recording.

    frames    : in which motion may differ
    unchanged : number of phones that are the same at the beginning, and at the end
    """

    frames: slice
    unchanged: tuple[int, int]

    def units_in(self, units: Timeline[Unit]) -> Timeline[Unit]:
        """Return the phones in these frames, cut at the ends, with times from the first of them."""
        return units.between(self.frames.start / FRAME_RATE_HZ, (self.frames.stop - 1) / FRAME_RATE_HZ)

    def pins_in(self, pins: Collection[Pin]) -> Constraints:
        """Return the pins in these frames, with times from the first of them."""
        first_s, last_s = self.frames.start / FRAME_RATE_HZ, (self.frames.stop - 1) / FRAME_RATE_HZ
        inside = [pin for pin in pins if first_s <= pin.time_s <= last_s]
        return Constraints(tuple(replace(pin, time_s=pin.time_s - first_s) for pin in inside))


def find_excerpt(before: Timeline[Unit], after: Timeline[Unit], pins: Collection[Pin], frames: int) -> Excerpt | None:
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


def cut_analysis(analysis: SpeechAnalysis, frames: slice) -> SpeechAnalysis:
    """Return analysed speech of some frames alone, without phones; its first frame is a multiple of 4."""
    return replace(analysis, speech=_cut_speech(analysis.speech, frames), tags=(), events=())


def _cut_speech(speech: Speech, frames: slice) -> Speech:
    features = Features(speech.features.values[frames], (frames.stop - 1 - frames.start) / FRAME_RATE_HZ)
    steps, halves = (slice(frames.start // each, -(-frames.stop // each)) for each in (STEP, 2))
    posteriors, prior, confidence, parts = speech.posteriors, speech.prior, speech.confidence, None
    if speech.parts is not None:
        parts = tuple(
            _cut_part(part, frames)
            for part in speech.parts
            if max(part.inside.start, frames.start) < min(part.inside.stop, frames.stop)
        )
    return Speech(
        features,
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


def _cut_part(part: SpeechPart, frames: slice) -> SpeechPart:
    first = max(frames.start - part.first, 0) // STEP * STEP
    inside = _cut_speech(part.speech, slice(first, min(frames.stop - part.first, part.frames)))
    own = slice(max(part.own.start - frames.start, 0), min(part.own.stop, frames.stop) - frames.start)
    return SpeechPart(part.first + first - frames.start, own, inside)


def apply_excerpt(
    full: Generation, before: Generation, after: Generation, excerpt: Excerpt, units: Timeline[Unit]
) -> Generation:
    """Return motion with what an excerpt changes.

    full, before, after : the motion before the change; in the excerpt alone, before and after it
    What differs between excerpt and recording, as the mean pose at rest, is in both motions of the excerpt and cancels.
    Deviations and states stay as they were.
    """
    values, frames, (first, last) = full.motion.values.copy(), excerpt.frames, excerpt.unchanged
    changed = values[frames] + (after.motion.values - before.motion.values)
    clip_at_zero(replace(full.motion, values=changed))
    values[frames] = changed
    named = full.units.spans
    spans = (*named[:first], *units.spans[first : len(units) - last], *named[len(named) - last :])
    return replace(full, motion=replace(full.motion, values=values), units=Timeline(spans))
