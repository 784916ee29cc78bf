"""What is supplied with a recording: motion curves, labelled phones, and sound that was recorded apart."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from lipmotion.errors import InputError
from lipmotion.formats.base import read_motion
from lipmotion.formats.tables import is_live_link_file, read_curve_table
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, OPENS
from lipmotion.pipeline.outputs.motion_files import correct_rate
from lipmotion.speech.features.mfcc import WINDOW
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.voice_activity import find_sound
from lipmotion.storage.sources import hash_file
from lipmotion.types import Audio, Motion, Span, Timeline, Track, Unit
from lipmotion.units import PAUSE, SILENCE, check_phones, is_silent
from lipmotion.units.phones import SHORT_PAUSE_S
from lipmotion_faces.corpus.captured_faces import MESH, list_mesh_files, read_bare_motion, read_mesh_motion
from lipmotion_faces.corpus.sound_offset import measure_offset
from lipmotion_faces.corpus.source_recordings import MotionFile, SourceRecording

DIGESTS = ("sha256", "motion_sha256", "phones_sha256", "recorder_sha256")
"""Keys of the digests in the source of an utterance; if a digest changes, the recording is prepared again."""
CURVES_MARGIN_S, CURVES_MARGIN_SHARE = 0.5, 0.02
"""Largest difference of duration between curves and sound: seconds, or share of the sound. It is larger where the frame
rate of the curves is wrong."""
PHONES_MARGIN_S = 0.1  # seconds by which labels may end after the sound; labelling programs round times
MIN_COVERED_SHARE = 0.5  # motion that covers less of its sound is reported
MIN_MOVED = 0.01
"""Standard deviation of the opening beneath which lips do not speak (578 clips of speech: 0.0195 and more)."""
SPEECH_CURVES = frozenset(
    (*ARKIT_MOUTH, "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "noseSneerLeft", "noseSneerRight")
)
"""The curves that speech moves: those of mouth, jaw, tongue, cheeks and nose."""


def digest_sources(recording: SourceRecording) -> dict[str, str]:
    """Return file names and digests of motion, phones and sound that are supplied with a recording, by key."""
    digests = {}
    if recording.motion_file is not None:
        file = recording.motion_file.file
        digests["motion_file"] = file.name
        if file.suffix == MESH:  # a sequence of meshes
            meshes = "\n".join(map(hash_file, list_mesh_files(file)))
            digests["motion_sha256"] = hashlib.sha256(meshes.encode()).hexdigest()
        else:
            digests["motion_sha256"] = hash_file(file)
    if recording.recorder is not None:
        digests["recorder_file"] = recording.recorder.name
        digests["recorder_sha256"] = hash_file(recording.recorder)
    if recording.phones is not None:
        text = "\n".join(f"{span.start_s!r} {span.end_s!r} {span.label.phone}" for span in recording.phones)
        digests["phones_sha256"] = hashlib.sha256(text.encode()).hexdigest()
    return digests


def read_speech_curves(motion: Motion) -> Motion:
    """Return the curves that speech moves, without those of eyes, brows and head. Raises InputError: there are none."""
    names = [name for name in motion.names if name in SPEECH_CURVES]
    if not names:
        raise InputError("none of its curves is one of mouth or jaw, required jawOpen, mouthClose, ...")
    return motion.selected(names)


def read_supplied_track(curves: MotionFile, duration_s: float | None) -> Track:
    """Return the motion in a file as a track, without mouth pictures.

    Of a table of Live Link Face, the curves that speech moves; frames without a face are not seen.
    Raises InputError: not a motion file, or of another length than the sound.
    """
    seen = None
    if is_live_link_file(curves.file):
        try:
            motion, seen = read_curve_table(curves.file)
        except InputError as error:
            raise InputError(f"{curves.file}: {error}") from error
        motion = read_speech_curves(motion)
    elif curves.file.suffix == MESH and curves.rate_hz:
        motion = read_mesh_motion(curves.file, curves.rate_hz)
    else:
        motion = read_bare_motion(curves) if curves.channels else read_motion(curves.file)[0]
    if duration_s is not None:
        motion = correct_rate(motion, duration_s, f" ({curves.file})")
    length_s = len(motion.values) / motion.rate_hz
    if duration_s is not None and abs(length_s - duration_s) > max(CURVES_MARGIN_S, CURVES_MARGIN_SHARE * duration_s):
        raise InputError(
            f"{curves.file}: {len(motion.values)} frames at {motion.rate_hz:g} Hz last {length_s:.2f} s, the sound "
            f"lasts {duration_s:.2f} s; required: the same time from the same start"
        )
    return Track(motion, np.ones(len(motion.values), bool) if seen is None else seen)


def doubt_recording(audio: Audio, track: Track) -> tuple[str, ...]:
    """Return notes on sound and motion of which nothing can be learned, or only little."""
    curves, length_s = track.motion, len(track.seen) / track.motion.rate_hz
    if length_s < MIN_COVERED_SHARE * audio.duration_s:
        return (f"motion for {length_s:.1f} of {audio.duration_s:.1f} s of sound",)
    if not find_sound(analysed(audio).log_energy):
        return ("nothing is said in its sound",)
    lips = next((name for name in ("opening", OPENS) if name in curves.names), None)
    if lips is None or not track.seen.any() or (moved := float(np.std(curves[lips][track.seen]))) > MIN_MOVED:
        return ()
    return (f"the lips hardly move in speech ({moved:.4f}): a still picture, somebody else, or a covered mouth?",)


def read_supplied_phones(recording: SourceRecording, duration_s: float) -> Timeline[Unit] | None:
    """Return the labelled phones of a recording, from 0 s to the end of its sound, or None if it has no labels.

    Silence has the phone that recognition gives it: short silence between phones is a pause.
    Raises InputError: the labels end after the sound, or are too many for it.
    """
    if recording.phones is None:
        return None
    try:
        check_phones(len(recording.phones), duration_s)
    except InputError as error:
        raise InputError(f"{recording.file}: {error}") from error
    last = recording.phones[-1]
    end_s = max(last.start_s, 0.0) if last.end_s == float("inf") else last.end_s
    if end_s > duration_s + PHONES_MARGIN_S:
        raise InputError(
            f"{recording.file}: its phones are labelled to {end_s:.2f} s, the sound lasts {duration_s:.2f} s; "
            "are they those of another recording?"
        )
    clipped = [replace(s, start_s=min(s.start_s, duration_s), end_s=min(s.end_s, duration_s)) for s in recording.phones]
    before = Span(0.0, clipped[0].start_s, Unit(SILENCE))
    after = Span(clipped[-1].end_s, duration_s, Unit(SILENCE))
    spans: list[Span[Unit]] = []
    for span in (before, *clipped, after):
        if span.duration_s <= 0:
            continue
        if spans and is_silent(span.label.phone) and is_silent(spans[-1].label.phone):
            spans[-1] = replace(spans[-1], end_s=span.end_s)
        else:
            spans.append(span)
    if _contain_speech(recording.phones) and not _contain_speech(spans):
        labels = f"none of its {len(recording.phones)} labels"
        raise InputError(f"{recording.file}: {labels} is a phone that lasts longer than 0 s")
    for n, span in enumerate(spans):
        if is_silent(span.label.phone):
            is_pause = 0 < n < len(spans) - 1 and span.duration_s < SHORT_PAUSE_S
            spans[n] = replace(span, label=Unit(PAUSE if is_pause else SILENCE))
    return Timeline(tuple(spans))


def _contain_speech(spans: Iterable[Span[Unit]]) -> bool:
    return any(not is_silent(span.label.phone) for span in spans)


GIVEN, ALIKE = "as given", "found by the sound of both"
MIN_SHARED_S = 0.5  # shortest time that sound and motion must share


@dataclass(frozen=True, eq=False)
class SeparateSound:
    """Sound that is ``late_s`` against the motion, and how that is known: ``GIVEN`` or ``ALIKE``."""

    audio: Audio
    late_s: float
    how: str

    @property
    def note(self) -> str:
        """What was done, for the user."""
        return f"sound {abs(self.late_s) * 1000:.1f} ms {'late' if self.late_s >= 0 else 'early'}, {self.how}"


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
        offset = measure_offset(read_audio(recording.file), audio)
    except InputError as error:
        raise InputError(f"{recording.recorder}: {error}") from error
    return SeparateSound(audio, offset.late_s, ALIKE)


def align_sound(sound: SeparateSound, duration_s: float) -> Audio:
    """Return the part of a sound in the time of the motion; silence where it had not begun, or had ended."""
    rate = sound.audio.rate_hz
    shift, count = round(sound.late_s * rate), round(duration_s * rate)
    overlapping = sound.audio.samples[max(shift, 0) : max(shift + count, 0)]
    front = min(max(-shift, 0), count)
    return Audio(np.pad(overlapping, (front, max(count - front - len(overlapping), 0))), rate)


def trim_to_shared(sound: SeparateSound, track: Track) -> tuple[Audio, Track, float]:
    """Return what sound and motion share: the sound, the motion, and the time of the motion at which both begin.

    Motion is cut at whole frames, the sound at the same times. Raises InputError: they share hardly anything.
    """
    rate, hertz, frames = sound.audio.rate_hz, track.motion.rate_hz, len(track.seen)
    first = max(0, math.ceil(-sound.late_s * hertz - 1e-9))
    start_s = first / hertz
    samples = sound.audio.samples[max(round((start_s + sound.late_s) * rate), 0) :]
    last = min(frames, first + int(len(samples) / rate * hertz + 1e-9))
    shared_s = (last - first) / hertz
    if shared_s < MIN_SHARED_S:
        raise InputError(
            f"{sound.note}: {sound.audio.duration_s:.2f} s of sound and {frames / hertz:.2f} s of motion share "
            f"{max(shared_s, 0):.2f} s, required {MIN_SHARED_S:g}"
        )
    samples = samples[: max(round(shared_s * rate), WINDOW)]
    shared = slice(first, last)
    motion = replace(track.motion, values=track.motion.values[shared])
    crops = None if track.crops is None else track.crops[shared]
    notes = (*track.notes, sound.note)
    return Audio(np.ascontiguousarray(samples), rate), Track(motion, track.seen[shared], crops, notes), start_s


def shift_phones(phones: Timeline[Unit] | None, by_s: float) -> Timeline[Unit] | None:
    """Return labelled phones that much earlier, from 0 s on; None where none are left, or there are no labels."""
    if phones is None or by_s <= 0:
        return phones
    spans = [replace(span, start_s=max(span.start_s, 0.0)) for span in phones.shifted(-by_s) if span.end_s > 0]
    return Timeline(tuple(spans)) if spans else None
