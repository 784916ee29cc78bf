"""Comparison of motion files or videos: ``compare(reference, other, …) → figures``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten_list
from lipmotion.formats.c3d import MILLIMETRES
from lipmotion.measures import curves
from lipmotion.measures.closures import find_threshold, measure_closures
from lipmotion.measures.curves import measure_modulation_distance
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, to_arkit
from lipmotion.pipeline.outputs.motion_files import read_generation
from lipmotion.storage.json_text import replace_nan
from lipmotion.storage.sources import VIDEO_SUFFIXES
from lipmotion.types import WEIGHT, Generation, Monitor, Motion, Track, silent_monitor, with_progress
from lipmotion_faces.tracking.track import track
from lipmotion_faces.tracking.trackers import LIP_POINTS

Source = str | Path | Motion | Track | Generation
Array = NDArray[np.float64]
OPENING = "opening"
HIGHEST_RATE_HZ = 120.0  # motion of a higher rate is compared at this one
MIN_FRAMES = 4  # without them there is no third difference
UPPER_FACE = tuple(name for name in ARKIT_OTHERS if name.startswith(("brow", "eyeBlink", "eyeSquint", "eyeWide")))


@dataclass(frozen=True, eq=False)
class _Side:
    """Motion that is compared, and which of its frames were measured."""

    name: str
    motion: Motion
    seen: NDArray[np.bool_]


def compare(reference: Source, *others: Source, monitor: Monitor = silent_monitor) -> dict[str, Any]:
    """Return how far other motion is from that of a reference, by name (docs/compare.md).

    reference, others : motion files, videos that show a face (they are tracked), or motion
    Motion is compared at the slower rate, where both last; ``notes`` say what was done. Missing figures are None.
    Raises InputError: a file that cannot be read, values that are not finite, no common channel, too few frames.
    Raises MissingDependencyError: videos without the extra ``video``.

    >>> import lipmotion
    >>> motion = lipmotion.animate("examples/welcome.flac").motion
    >>> figures = lipmotion.compare(motion, motion.resampled(50.0))
    >>> (pair,) = figures["others"]
    >>> round(pair["channels"]["opening"]["acc"], 3), pair["notes"]
    (1.0, ['the reference is resampled from 100 to 50 frames a second'])
    """
    if not others:
        raise InputError("there is nothing to compare the reference with; give another motion file or video")
    items = list(enumerate((reference, *others)))
    first, *rest = [_read_side(item, number) for number, item in with_progress(items, "reading", monitor)]
    return replace_nan({"reference": first.name, "others": [_compare_pair(first, other) for other in rest]})


def _read_side(source: Source, number: int) -> _Side:
    """Return the motion of a file, or that is given, with ARKit's names of what programs spell otherwise."""
    name = str(source) if isinstance(source, str | Path) else f"motion {number}" if number else "the reference"
    if isinstance(source, str | Path):
        path = Path(source)
        source = track(path, crops=False) if path.suffix.lower() in VIDEO_SUFFIXES else read_generation(path)
    motion = source if isinstance(source, Motion) else source.motion
    if not len(motion.values):
        raise InputError(f"{name}: the motion has no frames")
    if not np.isfinite(motion.values).all():
        raise InputError(f"{name}: there are values that are not finite; interpolate them first")
    seen = np.asarray(source.seen) if isinstance(source, Track) else np.ones(len(motion.values), bool)
    names = [(to_arkit(each.name) if each.unit == WEIGHT else None) or each.name for each in motion.channels]
    if len(set(names)) == len(names):  # else there are two spellings of one
        channels = (replace(each, name=name) for each, name in zip(motion.channels, names, strict=True))
        motion = replace(motion, channels=tuple(channels))
    return _Side(name, motion, seen)


def _compare_pair(reference: _Side, other: _Side) -> dict[str, Any]:
    """Return the figures of one pair. Raises InputError: as ``compare``."""
    made, original, notes = _select_common_frames(reference, other)
    names = made.names
    axes = {name[2:]: tuple(f"{axis}_{name[2:]}" for axis in "xyz") for name in names if name.startswith("x_")}
    points = {point: parts for point, parts in axes.items() if set(names).issuperset(parts)}
    coordinates = {axis for parts in points.values() for axis in parts}
    channel_figures, still = _measure_channels(made, original, [name for name in names if name not in coordinates])
    if still:
        notes.append(f"left out, for they do not move in the reference: {', '.join(still)}")
    accuracies = [row["acc"] for row in channel_figures.values()]
    figures = {
        "name": other.name,
        "rate_hz": made.rate_hz,
        "frames": len(made.values),
        "notes": notes,
        "channels": channel_figures,
        "acc": float(np.mean(accuracies)) if accuracies else None,
    }
    if OPENING in channel_figures:
        generated, recorded = ([_select_values(side, [OPENING])[:, 0]] for side in (made, original))
        threshold = find_threshold(recorded)
        closures = asdict(measure_closures(generated, recorded, threshold, made.rate_hz))
        figures["closures"] = closures | {"closed_under": threshold}
    if points:
        figures["points"] = _measure_points(made, original, points)
    if upper := [name for name in UPPER_FACE if name in names]:  # weights, which are 0 at rest
        generated, recorded = ([_select_values(side, upper)[:, :, None]] for side in (made, original))
        deviation = curves.measure_upper_face(generated, recorded, rest=np.zeros((len(upper), 1)))
        figures["upper_face"] = {"curves": len(upper), "deviation": deviation}
    return figures


def _select_common_frames(reference: _Side, other: _Side) -> tuple[Motion, Motion, list[str]]:
    """Return motion of the other and of the reference, in the channels and frames of both, and notes on the rest.

    Raises InputError: too few of them.
    """
    names, notes = _match_channels(reference, other)
    rate_hz = min(reference.motion.rate_hz, other.motion.rate_hz, HIGHEST_RATE_HZ)
    for name, side in (("the reference", reference), ("the other", other)):
        if side.motion.rate_hz != rate_hz:
            notes.append(f"{name} is resampled from {side.motion.rate_hz:g} to {rate_hz:g} frames a second")
    first_s, second_s = ((len(side.motion.values) - 1) / side.motion.rate_hz for side in (reference, other))
    last_s = min(first_s, second_s)
    if abs(first_s - second_s) * rate_hz >= 1:
        lasting = f"the reference lasts {first_s:.2f} s, the other {second_s:.2f} s"
        notes.append(f"{lasting}: the first {last_s:.2f} s are compared")
    time_s = np.arange(int(np.floor(last_s * rate_hz + 1e-6)) + 1) / rate_hz
    measured = np.ones(len(time_s), bool)
    for side in (reference, other):  # the frame next to each time
        nearest = np.floor(time_s * side.motion.rate_hz + 0.5).astype(int)
        measured &= side.seen[np.minimum(nearest, len(side.seen) - 1)]
    count = int(measured.sum())
    if count < MIN_FRAMES:
        raise InputError(f"{reference.name}, {other.name}: {count} common frames, required {MIN_FRAMES} or more")
    if count < len(time_s):
        notes.append(f"{len(time_s) - count} of {len(time_s)} frames are left out: the face was not measured")
    channels = tuple(reference.motion.channels[reference.motion.column(name)] for name in names)
    made, original = (
        Motion(side.motion.at(time_s)[measured][:, [side.motion.column(name) for name in names]], rate_hz, channels)
        for side in (other, reference)
    )
    return made, original, notes


def _match_channels(reference: _Side, other: _Side) -> tuple[list[str], list[str]]:
    """Return the names of the channels that both have, in the same unit, and notes on the others."""
    units = {channel.name: channel.unit for channel in other.motion.channels}
    same = [each.name for each in reference.motion.channels if units.get(each.name) == each.unit]
    if not same:
        named = ([f"{channel.name} ({channel.unit})" for channel in s.motion.channels] for s in (other, reference))
        some = [shorten_list(names, 4) for names in named]
        raise InputError(
            f"{other.name} has no channel of {reference.name} in the same unit: it has {some[0]}, required one of "
            f"{some[1]}"
        )
    missing = [name for name in reference.motion.names if name not in same]
    notes = [f"left out, for the other has no such channel in the same unit: {', '.join(missing)}"] if missing else []
    return same, notes


def _select_values(motion: Motion, names: Sequence[str]) -> Array:
    return np.asarray(motion.values[:, [motion.column(name) for name in names]], np.float64)


def _measure_channels(
    made: Motion, original: Motion, names: Sequence[str]
) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Return the figures of every channel of these that moves in the original, and the names of the others."""
    rate_hz, channels = made.rate_hz, [original.channels[original.column(name)] for name in names]
    if not names:
        return {}, []
    generated, reference = [_select_values(made, names)], [_select_values(original, names)]
    figures = {
        "acc": curves.correlate_pooled(generated, reference),
        "rmse": curves.rmse(generated, reference),
        "nrmse": curves.measure_nrmse(generated, reference),
        "variance": curves.measure_variance_ratio(generated, reference),
        "jerk": curves.measure_jerk_ratio(generated, reference),
        "modulation_db": measure_modulation_distance(generated, reference, rate_hz),
    }
    moves = curves.select_moving(reference, [channel.unit for channel in channels])
    rows = {
        channel.name: {
            "unit": channel.unit,
            **{name: float(values[column]) for name, values in figures.items()},
            "lag_ms": curves.measure_lag([generated[0][:, column:]], [reference[0][:, column:]], rate_hz),
        }
        for column, channel in enumerate(channels)
        if moves[column]
    }
    return rows, [name for name in names if name not in rows]


def _measure_points(made: Motion, original: Motion, points: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
    """Return the figures of points in mm (None: no points); at rest, points above the eyes are at their median."""

    def select(side: Motion, wanted: Sequence[str]) -> list[Array]:
        coordinates = _select_values(side, [axis for point in wanted for axis in points[point]])
        return [coordinates.reshape(len(coordinates), -1, 3) * MILLIMETRES]

    lips = [point for point in points if point.isdecimal() and int(point) in LIP_POINTS]
    upper = [point for point in points if np.median(original[f"y_{point}"]) > 0]
    everything, of_lips, of_upper = ((select(made, some), select(original, some)) for some in ([*points], lips, upper))
    rest = np.median(of_upper[1][0], axis=0)
    return {
        "points": len(points),
        "lip_points": len(lips),
        "upper_points": len(upper),
        "landmark_distance_mm": curves.measure_landmarks(*everything),
        "lip_vertex_error_mm": curves.measure_lip_error(*of_lips) if lips else None,
        "upper_face_deviation_mm": curves.measure_upper_face(*of_upper, rest) if upper else None,
    }
