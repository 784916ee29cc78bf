"""Sound that was recorded apart from the motion is brought into step with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from lipmotion.corpora.source_recordings import SourceRecording
from lipmotion.errors import InputError
from lipmotion.speech.features.mfcc import WINDOW
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.sound_offset import sound_offset
from lipmotion.types import Audio, Timeline, Track, Unit

GIVEN = "as given"
LEAST_SHARED_S = 0.5
"""Shortest time that sound and motion must share."""


@dataclass(frozen=True, eq=False)
class SeparateSound:
    """Sound, and by how much it is late against the motion.

    audio  : the whole sound
    late_s : moment ``late_s`` of the sound is moment 0 of the motion; negative: the sound begins later
    how    : ``clap``, ``beep``, ``the sound of both``, ``as given``
    """

    audio: Audio
    late_s: float
    how: str

    @property
    def note(self) -> str:
        """What was done, for the user."""
        found = self.how if self.how == GIVEN else f"found by the {self.how.removeprefix('the ')}"
        return f"sound {abs(self.late_s) * 1000:.1f} ms {'late' if self.late_s >= 0 else 'early'}, {found}"


def separate_sound(recording: SourceRecording) -> SeparateSound | None:
    """Return the sound of a recording that is not in step with its motion; None: its own sound is.

    A recorder's sound is compared with the recording's own, which is in step, unless the offset is given.
    Raises InputError: a sound cannot be read, or its offset is not clear.
    """
    if recording.recorder is None and recording.offset_s is None:
        return None
    audio = read_audio(recording.recorder or recording.file)
    if recording.offset_s is not None:
        return SeparateSound(audio, recording.offset_s, GIVEN)
    try:
        found = sound_offset(read_audio(recording.file), audio)
    except InputError as error:
        raise InputError(f"{recording.recorder}: {error}") from error
    return SeparateSound(audio, found.late_s, found.how)


def on_own_time(sound: SeparateSound, duration_s: float) -> Audio:
    """Return the part of a sound in the time of the motion; silence where it had not begun, or had ended."""
    rate = sound.audio.rate_hz
    shift, count = round(sound.late_s * rate), round(duration_s * rate)
    overlapping = sound.audio.samples[max(shift, 0) : max(shift + count, 0)]
    front = min(max(-shift, 0), count)
    return Audio(np.pad(overlapping, (front, max(count - front - len(overlapping), 0))), rate)


def correct_rate(sound: SeparateSound, track: Track) -> tuple[Audio, Track, float]:
    """Return what sound and motion share: the sound, the motion, and the time of the motion at which both begin.

    Motion is cut at whole frames, the sound at the same times. Raises InputError: they share hardly anything.
    """
    rate, hertz, frames = sound.audio.rate_hz, track.motion.rate_hz, len(track.seen)
    first = max(0, math.ceil(-sound.late_s * hertz - 1e-9))
    start_s = first / hertz
    samples = sound.audio.samples[max(round((start_s + sound.late_s) * rate), 0) :]
    last = min(frames, first + int(len(samples) / rate * hertz + 1e-9))
    shared_s = (last - first) / hertz
    if shared_s < LEAST_SHARED_S:
        raise InputError(
            f"{sound.note}: {sound.audio.duration_s:.2f} s of sound and {frames / hertz:.2f} s of motion share "
            f"{max(shared_s, 0):.2f} s, required {LEAST_SHARED_S:g}"
        )
    samples = samples[: max(round(shared_s * rate), WINDOW)]
    kept = slice(first, last)
    motion = replace(track.motion, values=track.motion.values[kept])
    crops = None if track.crops is None else track.crops[kept]
    notes = (*track.notes, sound.note)
    return Audio(np.ascontiguousarray(samples), rate), Track(motion, track.seen[kept], crops, notes), start_s


def earlier_phones(phones: Timeline[Unit] | None, by_s: float) -> Timeline[Unit] | None:
    """Return labelled phones that much earlier, from 0 s on; None where none are left, or there are no labels."""
    if phones is None or by_s <= 0:
        return phones
    spans = [replace(span, start_s=max(span.start_s, 0.0)) for span in phones.shifted(-by_s) if span.end_s > 0]
    return Timeline(tuple(spans)) if spans else None
