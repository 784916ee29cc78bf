"""``.c3d``: lip and jaw points as markers of motion capture, other channels as analog curves; and markers as motion.

Written points are in millimetres, with two markers more, ``EYE_L`` and ``EYE_R``, at the outer eye corners. Markers of
others become channels ``x_NAME``, ``y_NAME``, ``z_NAME`` in the head's frame (``marker_frame``).
"""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import CHIN, mouth_template
from lipmotion.errors import ExportError, InputError
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.c3d_file import LONGEST_LABEL_CHARACTERS, C3dFile, read_c3d, write_c3d
from lipmotion.export.motion.marker_frame import MARKER, MILLIMETRES, in_head_frame, motion_of_markers
from lipmotion.types import EYE_DISTANCE, Channel, Generation, Motion, Timeline, Unit

Array = NDArray[np.float64]

LOG = logging.getLogger("lipmotion")
SOFTWARE = "lipmotion"
EYES = (("EYE_L", 0.5), ("EYE_R", -0.5))
LEAST_SEEN_SHARE = 0.5
"""Markers that are seen in a smaller share of the frames are left out; shorter gaps are bridged by straight lines."""
MOST_CURVES = 255
_POINT = re.compile(r"[xyz]_(\d{1,3})$")
_UNLABELLED = re.compile(r"\*|[uc]_?\d+$|unlabel|point\d+$", re.IGNORECASE)


def check(motion: Motion) -> None:
    """Raise ExportError if motion does not fit: no frames, or names that are no labels."""
    if not len(motion.values):
        raise ExportError("the motion has no frames, required at least one in .c3d")
    if "" in motion.names:
        raise ExportError("a channel has no name, required one in .c3d; write .json or .npz")
    for text in [text for channel in motion.channels for text in (channel.name, channel.unit)]:
        if not (
            text.isascii() and text.isprintable() and text == text.strip() and len(text) <= LONGEST_LABEL_CHARACTERS
        ):
            raise ExportError(
                f"the name or unit {text[:60]!r} of a channel does not fit into .c3d, required up to 64 ASCII "
                "characters, without blanks at its ends"
            )
    points = len(_points(motion))
    if max(len(motion.names) - 3 * points, points + len(EYES)) > MOST_CURVES:
        raise ExportError(f"more than {MOST_CURVES} points, or other channels, which .c3d cannot name; write .npz")


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write all channels of the motion; points are those with x, y and z."""
    motion, points = generation.motion, _points(generation.motion)
    frames = len(motion.values)
    places = [np.stack([motion[f"{axis}_{point}"] for axis in "xyz"], axis=1) for point in points]
    places += [np.broadcast_to([x, 0.0, 0.0], (frames, 3)) for _, x in EYES]
    held = {f"{axis}_{point}" for point in points for axis in "xyz"}
    others = [column for column, name in enumerate(motion.names) if name not in held]
    content = C3dFile(
        labels=(*map(_label, points), *(name for name, _ in EYES)),
        points=np.stack(places, axis=1) * MILLIMETRES,
        rate_hz=motion.rate_hz,
        software=SOFTWARE,
        analog=motion.values[:, others].astype(np.float64),
        analog_labels=tuple(motion.names[column] for column in others),
        analog_units=tuple(motion.channels[column].unit for column in others),
    )
    write_c3d(path, content)


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the markers of a file as motion in the head's frame, and an empty timeline.

    Markers named ``LIP_13`` or ``P13`` are that point of the face mesh; with the middles and corners of the lips among
    them, ``opening``, ``width`` and ``outer`` are computed. Markers without a name are left out.
    Raises InputError: not a C3D file, or no marker that is seen in half of the frames.
    """
    content = read_c3d(path)
    if content.software == SOFTWARE:
        eyes = {name for name, _ in EYES}
        numbers = {column: MARKER.match(label) for column, label in enumerate(content.labels) if label not in eyes}
        points = {column: found[1] for column, found in numbers.items() if found}
        curves = zip(content.analog_labels, content.analog_units, strict=True)
        channels = [Channel(name, unit or EYE_DISTANCE) for name, unit in curves]
        channels += [Channel(f"{axis}_{point}") for point in points.values() for axis in "xyz"]
        places = content.points[:, list(points)].reshape(len(content.points), -1) / MILLIMETRES
        analog = content.analog[:, : len(content.analog_labels)]
        values = np.concatenate([analog, places], axis=1) if len(analog) else places
        return Motion(values, content.rate_hz, tuple(channels)), Timeline(())
    named = {label.split(":")[-1].strip(): column for column, label in enumerate(content.labels)}
    markers = {
        name: bridged
        for name, column in named.items()
        if name and not _UNLABELLED.match(name) and (bridged := _bridged(content.points[:, column])) is not None
    }
    lost = [name for name in named if name and not _UNLABELLED.match(name) and name not in markers]
    if not markers:
        some = ", ".join(content.labels[:6])
        raise InputError(f"no marker with a name is seen in half of the frames; the labels: {some or 'none'}")
    if lost:
        what = f"{len(lost)} of {len(lost) + len(markers)} markers are seen in less than half of the frames"
        LOG.warning("%s: %s and left out: %s", path, what, ", ".join(lost[:8]))
    return motion_of_markers(in_head_frame(markers, content.unit), content.rate_hz), Timeline(())


def _points(motion: Motion) -> list[int]:
    """Return the numbers of the points that have all three channels, in order."""
    numbers = [int(found[1]) for name in motion.names if (found := _POINT.match(name)) and name.startswith("x")]
    eyes = {Channel(f"{axis}_{point}") for point in numbers for axis in "xyz"} & set(motion.channels)
    return [point for point in numbers if all(Channel(f"{axis}_{point}") in eyes for axis in "xyz")]


def _label(point: int) -> str:
    template = mouth_template()
    return f"JAW_{point}" if point == CHIN or point in np.array(template.points)[template.jaw] else f"LIP_{point}"


def _bridged(places: Array) -> Array | None:
    """Return the places of a marker [shape=(T, 3)] without gaps, or None where it is hardly ever seen."""
    seen = np.isfinite(places).all(axis=1)
    if seen.mean() < LEAST_SEEN_SHARE or not seen.any():
        return None
    frames = np.arange(len(places))
    return np.stack([np.interp(frames, frames[seen], axis[seen]) for axis in places.T], axis=1)


MOTION_FORMAT = MotionFormat(write, read, check)
