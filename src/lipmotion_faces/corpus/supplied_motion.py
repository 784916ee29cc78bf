"""Motion curves and labelled phones that are supplied with a recording."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.facegood import read_bare_motion
from lipmotion.corpora.source_recordings import MotionFile, SourceRecording
from lipmotion.errors import InputError, shortened
from lipmotion.export.base import read_motion
from lipmotion.export.motion.marker_frame import in_head_frame, motion_of_markers
from lipmotion.meshes.files.curve_table import is_live_link_file, read_curve_table, speech_curves
from lipmotion.pipeline.outputs.motion_input import in_step
from lipmotion.storage.files import sha256_of
from lipmotion.types import Motion, Span, Timeline, Track, Unit
from lipmotion.units import PAUSE, SILENCE, check_phones, is_silent
from lipmotion.units.phones import SHORT_PAUSE_S

SUFFIX = ".ply"
FLAME_VERTICES = 5023
FLAME_MARKERS = {
    **{"EYE_L": 1162, "EYE_R": 2431, "NASION": 3553},
    **{"LIP_0": 3541, "LIP_13": 3533, "LIP_14": 3504, "LIP_17": 3511, "LIP_61": 2845, "LIP_291": 1730, "JAW_152": 3414},
}
"""The vertices at the outer eye corners, at the root of the nose, and at points of the face mesh.
Found by looking at a mesh of a face at rest: where the lips meet, the edges of their red, their corners, the chin."""
METRES = "m"
LARGEST_HEADER_BYTES = 1 << 14
LARGEST_MESH_BYTES = 1 << 26
MOST_MESHES = 1 << 20
"""Meshes of four hours."""
NUMBER = re.compile(r"(\d+)$")
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}


def mesh_files(first: Path) -> list[Path]:
    """Return the files of the sequence that a mesh is of: all beside it whose names differ in their last number."""
    start = NUMBER.sub("", first.stem)
    return sorted(path for path in first.parent.glob(f"*{SUFFIX}") if NUMBER.sub("", path.stem) == start)


def read_mesh_motion(first: Path, rate_hz: float) -> Motion:
    """Return lip distances and lip points of a sequence of meshes, in the head's frame, in eye distances.

    first   : one of its meshes; where numbers are missing, the motion is interpolated
    rate_hz : meshes a second
    Raises InputError: a file that is no mesh with the vertices of FLAME, in metres.
    """
    files = mesh_files(first)
    numbers = [int(found[1]) if (found := NUMBER.search(path.stem)) else 1 for path in files]
    if not files or max(numbers) > MOST_MESHES:
        raise InputError(
            f"{first}: {len(files)} meshes up to number {max(numbers, default=0)}, required 1 to {MOST_MESHES}"
        )
    vertices = list(FLAME_MARKERS.values())
    places = np.stack([read_vertices(path, vertices) for path in files])
    frames = np.arange(1, max(numbers) + 1)
    markers = {
        name: np.stack([np.interp(frames, numbers, axis) for axis in places[:, column].T], axis=1)
        for column, name in enumerate(FLAME_MARKERS)
    }
    try:
        return motion_of_markers(in_head_frame(markers, METRES), rate_hz)
    except InputError as error:
        raise InputError(f"{first}: {error}") from error


def read_vertices(path: Path, chosen: Sequence[int]) -> NDArray[np.float64]:
    """Return the places of some vertices of a ``.ply`` [shape=(N, 3)].

    Raises InputError: damaged, without ``x``, ``y``, ``z``, not finite, or not ``FLAME_VERTICES`` vertices.
    """
    size = path.stat().st_size
    if size > LARGEST_MESH_BYTES:
        raise InputError(f"{path}: {size} bytes, required at most {LARGEST_MESH_BYTES}: is it the mesh of a head?")
    head, mark, body = path.read_bytes().partition(b"end_header")
    lines = [line.split() for line in head[:LARGEST_HEADER_BYTES].decode("ascii", "replace").splitlines()]
    try:
        order, columns = _vertex_columns(lines)
        if not mark:
            raise ValueError("its header has no end")
        body = body[body.index(b"\n") + 1 :]
        if order:
            rows = np.frombuffer(body, np.dtype([(name, order + kind) for name, kind in columns]), FLAME_VERTICES)
            found = np.stack([rows[axis][list(chosen)] for axis in "xyz"], axis=1).astype(np.float64)
        else:
            lines_of_text, names = body.split(b"\n", FLAME_VERTICES), [name for name, _ in columns]
            texts = [lines_of_text[vertex].split() for vertex in chosen]
            found = np.array([[float(row[names.index(axis)]) for axis in "xyz"] for row in texts])
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f"{path}: not a mesh of FLAME in .ply ({shortened(str(error))}); export it again") from error
    if not np.isfinite(found).all():
        raise InputError(f"{path}: has vertices that are not finite; export it again")
    return found


def _vertex_columns(lines: Sequence[Sequence[str]]) -> tuple[str, list[tuple[str, str]]]:
    """Return the order of bytes (empty: as text), and name and type of each number of a vertex, from a header.

    Raises ValueError, KeyError, IndexError: not such a header.
    """
    if not lines or list(lines[0]) != ["ply"]:
        raise ValueError("its first line is not 'ply'")
    (order,) = (ORDERS[words[1]] for words in lines if words[:1] == ["format"])
    first, *others = [number for number, words in enumerate(lines) if words[:1] == ["element"]]
    _, element, count = lines[first]
    if element != "vertex" or int(count) != FLAME_VERTICES:
        wanted = f"{FLAME_VERTICES} vertices: of others, no lip points are known"
        raise ValueError(f"it begins with {count} of {element!r}, required {wanted}")
    properties = [words for words in lines[first + 1 : others[0] if others else None] if words[:1] == ["property"]]
    return order, [(name, TYPES[kind]) for _, kind, name in properties]


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
    if file.suffix != SUFFIX:
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
    elif curves.file.suffix == SUFFIX and curves.rate_hz:
        motion = read_mesh_motion(curves.file, curves.rate_hz)
    else:
        motion = read_bare_motion(curves) if curves.channels else read_motion(curves.file)[0]
    if duration_s is not None:
        motion = in_step(motion, duration_s, f" ({curves.file})")
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
