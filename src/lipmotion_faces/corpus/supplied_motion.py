"""Motion curves and labelled phones that are supplied with a recording."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lipmotion.corpora.facegood import read_bare_motion
from lipmotion.corpora.source_recordings import MotionFile, SourceRecording
from lipmotion.corpora.vocaset import MESH, mesh_files, read_mesh_motion
from lipmotion.errors import InputError
from lipmotion.formats.base import read_motion
from lipmotion.formats.tables import is_live_link_file, read_curve_table, speech_curves
from lipmotion.pipeline.outputs.motion_input import correct_rate
from lipmotion.storage.files import sha256_of
from lipmotion.types import Span, Timeline, Track, Unit
from lipmotion.units import PAUSE, SILENCE, check_phones, is_silent
from lipmotion.units.phones import SHORT_PAUSE_S

DIGESTS = ("sha256", "motion_sha256", "phones_sha256", "recorder_sha256")
"""Keys of the digests in the source of an utterance; if a digest changes, the recording is prepared again."""
CURVES_MARGIN_S, CURVES_MARGIN_SHARE = 0.5, 0.02
"""Largest difference of duration between curves and sound: seconds, or share of the sound. It is larger where the frame
rate of the curves is wrong."""
PHONES_MARGIN_S = 0.1
"""Seconds by which labels may end after the sound; labelling programs round times."""


def source_digests(recording: SourceRecording) -> dict[str, str]:
    """Return file names and digests of motion, phones and sound that are supplied with a recording, by key."""
    digests = {}
    if recording.motion_file is not None:
        digests["motion_file"] = recording.motion_file.file.name
        digests["motion_sha256"] = _motion_digest(recording.motion_file.file)
    if recording.recorder is not None:
        digests["recorder_file"] = recording.recorder.name
        digests["recorder_sha256"] = sha256_of(recording.recorder)
    if recording.phones is not None:
        text = "\n".join(f"{span.start_s!r} {span.end_s!r} {span.label.phone}" for span in recording.phones)
        digests["phones_sha256"] = hashlib.sha256(text.encode()).hexdigest()
    return digests


def _motion_digest(file: Path) -> str:
    """Return the digest of a motion file, of a sequence of meshes that of all their digests."""
    if file.suffix != MESH:
        return sha256_of(file)
    return hashlib.sha256("\n".join(map(sha256_of, mesh_files(file))).encode()).hexdigest()


def supplied_track(curves: MotionFile, duration_s: float | None) -> Track:
    """Return the motion in a file as a track, without mouth pictures.

    duration_s : of the sound that is in step with it; None: there is none, so any length is right
    Of a table of Live Link Face, the curves that speech moves; frames without a face are not seen.
    Raises InputError: not a motion file, or of another length than the sound.
    """
    seen = None
    if is_live_link_file(curves.file):
        try:
            motion, seen = read_curve_table(curves.file)
        except InputError as error:
            raise InputError(f"{curves.file}: {error}") from error
        motion = speech_curves(motion)
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


def supplied_phones(recording: SourceRecording, duration_s: float) -> Timeline[Unit] | None:
    """Return the labelled phones of a recording, from 0 s to the end of its sound, or None if it has no labels.

    duration_s : of the sound
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
    whole = _merged([span for span in (before, *clipped, after) if span.duration_s > 0])
    if _contain_speech(recording.phones) and not _contain_speech(whole):
        raise InputError(
            f"{recording.file}: none of its {len(recording.phones)} labels is a phone that lasts longer than 0 s"
        )
    return Timeline(tuple(_with_silence_named(span, inside=0 < i < len(whole) - 1) for i, span in enumerate(whole)))


def _contain_speech(spans: Iterable[Span[Unit]]) -> bool:
    """Return whether any label is not silence."""
    return any(not is_silent(span.label.phone) for span in spans)


def _merged(spans: list[Span[Unit]]) -> list[Span[Unit]]:
    """Return the spans, with neighbouring silences merged into one."""
    merged: list[Span[Unit]] = []
    for span in spans:
        if merged and is_silent(span.label.phone) and is_silent(merged[-1].label.phone):
            merged[-1] = replace(merged[-1], end_s=span.end_s)
        else:
            merged.append(span)
    return merged


def _with_silence_named(span: Span[Unit], *, inside: bool) -> Span[Unit]:
    """Return a span; silence gets the phone of a pause or of longer silence.

    inside : whether the span is between phones
    """
    if not is_silent(span.label.phone):
        return span
    return replace(span, label=Unit(PAUSE if inside and span.duration_s < SHORT_PAUSE_S else SILENCE))
