"""``.c3d``: lip and jaw points as markers of motion capture, other channels as analog curves; and markers as motion.
``.bvh``: lip and jaw points as joints that shift, for programs that know motion capture of bodies.

A ``.c3d`` has labelled points, a place of each in every frame, and analog channels. Written points are in millimetres,
with two markers more, ``EYE_L`` and ``EYE_R``, at the outer eye corners. Markers of others become channels ``x_NAME``,
``y_NAME``, ``z_NAME`` in the head's frame: eye distances, origin between the outer eye corners, x to the speaker's
left, y up, z out of the face. Points are read as fractions or as scaled whole numbers, of Intel's processors.

A ``.bvh`` is in centimetres, y up, z out of the face: an eye distance is ``CENTIMETRES``. Every point is a joint
``LIP_13`` or ``JAW_152`` under the joint ``head``, with three channels of its place; offsets are the rest pose. It is
not read back.

Source: The C3D File Format, A Technical User Guide (Motion Lab Systems); c3d.org, "The C3D frame count"; M. Meredith
and S. Maddock, "Motion Capture File Formats Explained", 2001.
"""

from __future__ import annotations

import logging
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import CHIN, build_mouth
from lipmotion.errors import ExportError, InputError, shorten
from lipmotion.formats.base import MotionFormat, format_rows
from lipmotion.formats.steady_rate import exact_rate
from lipmotion.meshes.fitting.blendshape_motion import move_points
from lipmotion.types import EYE_DISTANCE, Channel, Generation, Motion, Timeline, Unit

Array = NDArray[np.float64]
Values = list[str] | NDArray[np.floating[Any]] | NDArray[np.integer[Any]]
"""The values of a parameter: texts, or numbers in the order of the file."""
BLOCK = 512
MARK = 0x50
INTEL_PROCESSOR = 84  # the lowest byte first; others (DEC, MIPS) are no more
MAX_FRAMES, OVERFLOW = 65_535, 65_536  # most frames that the header can number, and after how many it begins at 0 again
MAX_POINTS, MAX_ANALOG_CHANNELS = 2_000, 5_000
LONGEST_LABEL_CHARACTERS = 64
LOG = logging.getLogger("lipmotion")
SOFTWARE = "lipmotion"
EYES = (("EYE_L", 0.5), ("EYE_R", -0.5))
MIN_SEEN_SHARE = 0.5
"""Markers that are seen in a smaller share of the frames are left out; shorter gaps are bridged by straight lines."""
MAX_CURVES = 255
_POINT = re.compile(r"[xyz]_(\d{1,3})$")
_UNLABELLED = re.compile(r"\*|[uc]_?\d+$|unlabel|point\d+$", re.IGNORECASE)


def _numbers(content: bytes, kind: str, count: int, at: int = 0) -> Array:
    """Return numbers as doubles; ``kind``: that of NumPy. Raises ValueError: there are not so many."""
    with np.errstate(invalid="ignore"):  # damaged numbers become NaN, as of markers that were not seen
        return np.frombuffer(content, f"<{kind}", count, at).astype(np.float64)


@dataclass(frozen=True, eq=False)
class C3dFile:
    """What a C3D file holds.

    labels        : names of the N points
    points        : places [shape=(T, N, 3)], in ``unit``; NaN where a marker was not seen
    rate_hz       : frames per second
    unit          : of the places: ``mm``, for instance
    software      : the program that wrote it
    analog        : curves beside the points, one sample a frame [shape=(T, A)]; none where there are several a frame
    analog_labels, analog_units : of the A curves
    """

    labels: tuple[str, ...]
    points: Array
    rate_hz: float
    unit: str = "mm"
    software: str = ""
    analog: Array = field(default_factory=lambda: np.zeros((0, 0)))
    analog_labels: tuple[str, ...] = ()
    analog_units: tuple[str, ...] = ()


def read_c3d(path: Path) -> C3dFile:
    """Return the points of a file, and its analog channels if they have one sample a frame.

    Raises InputError: not a C3D file, cut short, or of another processor. ValueError, IndexError, OverflowError,
    struct.error: sizes that disagree.
    """
    content = path.read_bytes()
    if len(content) < 2 * BLOCK or content[1] != MARK:
        raise InputError("not a C3D file: its first bytes are not those of the format; export the capture again")
    start = (content[0] - 1) * BLOCK
    if content[start + 3] != INTEL_PROCESSOR:
        raise InputError(f"its processor type is {content[start + 3]}, required 84 (Intel); export the capture so")
    parameters = _read_parameters(content, start + 4)
    words: list[int] = _numbers(content, "u2", 10).astype(int).tolist()
    _, points, analog, first, last, _, _, _, block, samples = words
    rate_hz = _number(parameters, "POINT.RATE", _numbers(content, "f4", 1, 20)[0])
    scale = _number(parameters, "POINT.SCALE", _numbers(content, "f4", 1, 12)[0])
    if not (0 <= points <= MAX_POINTS and 0 <= analog <= MAX_ANALOG_CHANNELS and points + analog > 0):
        raise InputError(f"{points} points and {analog} analog values a frame, required at least one of each")
    if not 0 < rate_hz <= 1e5 or not np.isfinite(scale) or not scale:
        raise InputError(f"the rate is {rate_hz:g} Hz and the scale {scale:g}, required positive numbers")
    kind, width = "f4" if scale < 0 else "i2", points * 4 + analog
    data = content[(block - 1) * BLOCK :] if block > 1 else b""
    held, spare = len(data) // (width * int(kind[1])), BLOCK // (width * int(kind[1])) + 1
    frames = _count_frames(parameters, last - first + 1, held, spare)
    rows = _numbers(data, kind, frames * width).reshape(frames, width)
    placed = rows[:, : points * 4].reshape(len(rows), points, 4)
    places = placed[..., :3] * (1.0 if scale < 0 else scale)
    unseen = (placed[..., 3] < 0) | ~np.isfinite(places).all(axis=2) | (places == 0).all(axis=2)
    places[unseen] = np.nan
    labels = [label for n in ("", "2", "3") for label in _texts(parameters, f"POINT.LABELS{n}")]
    labels = [*labels, *(f"point{number}" for number in range(len(labels) + 1, points + 1))][:points]
    curves = rows[:, points * 4 :] if samples == 1 else rows[:, :0]
    count = curves.shape[1]
    names = [*_texts(parameters, "ANALOG.LABELS"), *(f"analog{n}" for n in range(count))][:count]
    units = [*_texts(parameters, "ANALOG.UNITS"), *[""] * count][:count]
    unit, software = (next(iter(_texts(parameters, name)), "") for name in ("POINT.UNITS", "MANUFACTURER.SOFTWARE"))
    exact_hz = exact_rate(float(f"{rate_hz:.7g}"), 5e-6)
    return C3dFile(tuple(labels), places, exact_hz, unit or "mm", software, curves, tuple(names), tuple(units))


def _count_frames(parameters: dict[str, Values], numbered: int, held: int, spare: int) -> int:
    """Return how many frames there are: the largest number that is stated and held."""
    start, end = _number(parameters, "TRIAL.ACTUAL_START_FIELD", 1), _number(parameters, "TRIAL.ACTUAL_END_FIELD", 0)
    counted, long = _number(parameters, "POINT.FRAMES", 0), _number(parameters, "POINT.LONG_FRAMES", 0)
    stated = sorted({int(each) for each in (numbered, counted % (1 << 31), long, end - start + 1) if each >= 1})
    fitting = [count for count in stated if count <= held]
    if not fitting:
        raise InputError(f"cut short: {held} frames of data, required {stated[0] if stated else 1}")
    frames = fitting[-1]
    for over in range(frames + OVERFLOW, held + 1, OVERFLOW):
        if held < over + spare:  # a number that began at 0 again
            frames = over
    if frames == MAX_FRAMES and held > frames + spare:  # the end of what can be counted, and nothing beside it
        frames = held
    if frames != stated[-1]:
        LOG.warning("it states %s frames and holds %d: %d are read", " or ".join(map(str, stated)), held, frames)
    return frames


def _texts(parameters: dict[str, Values], name: str) -> list[str]:
    values = parameters.get(name, [])
    return values if isinstance(values, list) else []


def _number(parameters: dict[str, Values], name: str, otherwise: float) -> float:
    """Return a parameter; of two whole numbers the first is the lower half."""
    values = parameters.get(name)
    if not isinstance(values, np.ndarray) or not len(values):
        return float(otherwise)
    return float(values[0] + (1 << 16) * values[1] if len(values) == 2 else values[0])


def _read_parameters(content: bytes, at: int) -> dict[str, Values]:
    groups: dict[int, str] = {}
    stored: list[tuple[int, str, Values]] = []
    while at + 2 <= len(content) and content[at]:
        length, group = abs(struct.unpack_from("b", content, at)[0]), struct.unpack_from("b", content, at + 1)[0]
        name = content[at + 2 : at + 2 + length].decode("ascii").strip().upper()
        body = at + 2 + length
        (step,) = struct.unpack_from("<h", content, body)
        if group < 0:
            groups[-group] = name
        else:
            stored.append((group, name, _read_values(content, body + 2)))
        if step == 0:
            break
        if step < 0:
            raise InputError(f"the parameter {shorten(name)!r} is before its own place; export the capture again")
        at = body + step
    return {f"{groups.get(group, '')}.{name}": values for group, name, values in stored}


def _read_values(content: bytes, at: int) -> Values:
    """Return the values of a parameter whose type stands at a place."""
    kind, dimensions = struct.unpack_from("bB", content, at)
    sizes = list(content[at + 2 : at + 2 + dimensions])
    count = int(np.prod(sizes, dtype=np.int64)) if sizes else 1
    data = content[at + 2 + dimensions : at + 2 + dimensions + count * abs(kind)]
    if kind == -1:
        width = sizes[0] if sizes else 1
        texts = [data[start : start + width] for start in range(0, len(data), max(width, 1))]
        return [text.decode("latin-1").rstrip("\0 ")[:LONGEST_LABEL_CHARACTERS] for text in texts]
    if kind not in {1, 2, 4} or len(data) < count * kind:
        raise InputError(f"a parameter of type {kind} and sizes {sizes} does not fit; export the capture again")
    return _numbers(data, {1: "u1", 2: "u2", 4: "f4"}[kind], count)


def write_c3d(path: Path, content: C3dFile) -> None:
    """Write a file; texts are ASCII, numbers have single precision.

    More frames than the header can number stand in ``TRIAL`` as two whole numbers each, and in ``POINT:LONG_FRAMES``.
    """
    frames, points = content.points.shape[:2]
    numbered = min(frames, MAX_FRAMES)
    curves = len(content.analog_labels)
    groups: dict[str, dict[str, int | float | Values]] = {
        "POINT": {
            **{"USED": points, "SCALE": -1.0, "RATE": content.rate_hz, "DATA_START": 0, "FRAMES": numbered},
            **{"LABELS": list(content.labels), "DESCRIPTIONS": [""] * points, "UNITS": [content.unit]},
        },
        "ANALOG": {
            **{"USED": curves, "LABELS": list(content.analog_labels), "DESCRIPTIONS": [""] * curves},
            **{"GEN_SCALE": 1.0, "OFFSET": np.zeros(curves, np.int16), "SCALE": np.ones(curves, np.float32)},
            **{"UNITS": list(content.analog_units), "RATE": content.rate_hz},
        },
        "MANUFACTURER": {"SOFTWARE": [content.software]},
    }
    if frames > numbered:
        groups["POINT"]["LONG_FRAMES"] = float(frames)
        start, end = (np.array([number % OVERFLOW, number // OVERFLOW]) for number in (1, frames))
        groups["TRIAL"] = {"ACTUAL_START_FIELD": start, "ACTUAL_END_FIELD": end}
    blocks = -(-(4 + len(_pack(groups))) // BLOCK)
    groups["POINT"]["DATA_START"] = 2 + blocks
    section = bytes([1, MARK, blocks, INTEL_PROCESSOR]) + _pack(groups)
    header = struct.pack("<BB5HfHHf", 2, MARK, points, curves, 1, numbered, 10, -1.0, 2 + blocks, 1, content.rate_hz)
    seen = np.isfinite(content.points).all(axis=2)
    data = np.zeros((frames, points * 4 + curves), "<f4")
    placed = np.concatenate([content.points, np.where(seen, 0.0, -1.0)[..., None]], axis=2)
    data[:, : points * 4] = np.nan_to_num(placed).reshape(frames, -1)
    if curves:
        data[:, points * 4 :] = content.analog
    with path.open("wb") as file:
        file.write(header.ljust(BLOCK, b"\0") + section.ljust(blocks * BLOCK, b"\0") + data.tobytes())
        file.write(b"\0" * (-data.nbytes % BLOCK))


def _pack(groups: dict[str, dict[str, int | float | Values]]) -> bytes:
    parts = []
    for number, (group, parameters) in enumerate(groups.items(), 1):
        parts.append(struct.pack("<bb", len(group), -number) + group.encode() + struct.pack("<hB", 3, 0))
        for name, value in parameters.items():
            if isinstance(value, list):
                texts = [text.encode("ascii", "replace") for text in value]
                width = max(map(len, texts), default=0)
                body = struct.pack("<bBBB", -1, 2, width, len(value)) + b"".join(text.ljust(width) for text in texts)
            else:
                numbers = np.asarray(value)
                size, kind = (2, "<u2") if numbers.dtype.kind == "i" else (4, "<f4")
                body = bytes([size, numbers.ndim, *numbers.shape]) + numbers.astype(kind).tobytes()
            head = struct.pack("<bb", len(name), number) + name.encode()
            parts.append(head + struct.pack("<h", 3 + len(body)) + body + b"\0")
    return b"".join(parts) + b"\0\0"


def check(motion: Motion) -> None:
    """Raise ExportError if motion has names that are no labels, or too many channels."""
    if "" in motion.names:
        raise ExportError("a channel has no name, required one in .c3d; write .json or .npz")
    for text in [text for channel in motion.channels for text in (channel.name, channel.unit)]:
        plain = text.isascii() and text.isprintable() and text == text.strip()
        if not plain or len(text) > LONGEST_LABEL_CHARACTERS:
            what = f"the name or unit {text[:60]!r} of a channel does not fit into .c3d,"
            raise ExportError(f"{what} required up to 64 ASCII characters, without blanks at its ends")
    points = len(_list_points(motion))
    if max(len(motion.names) - 3 * points, points + len(EYES)) > MAX_CURVES:
        raise ExportError(f"more than {MAX_CURVES} points, or other channels, which .c3d cannot name; write .npz")


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write all channels of the motion; points are those with x, y and z."""
    motion, points = generation.motion, _list_points(generation.motion)
    frames = len(motion.values)
    places = [np.stack([motion[f"{axis}_{point}"] for axis in "xyz"], axis=1) for point in points]
    places += [np.broadcast_to([x, 0.0, 0.0], (frames, 3)) for _, x in EYES]
    placed = {f"{axis}_{point}" for point in points for axis in "xyz"}
    others = [column for column, name in enumerate(motion.names) if name not in placed]
    template = build_mouth()
    jaw = {CHIN, *np.array(template.points)[template.jaw].tolist()}
    content = C3dFile(
        labels=(*(f"{'JAW' if point in jaw else 'LIP'}_{point}" for point in points), *(name for name, _ in EYES)),
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
        points = {column: match[1] for column, match in numbers.items() if match}
        curves = zip(content.analog_labels, content.analog_units, strict=True)
        channels = [Channel(name, unit or EYE_DISTANCE) for name, unit in curves]
        channels += [Channel(f"{axis}_{point}") for point in points.values() for axis in "xyz"]
        places = content.points[:, list(points)].reshape(len(content.points), -1) / MILLIMETRES
        analog = content.analog[:, : len(content.analog_labels)]
        values = np.concatenate([analog, places], axis=1) if len(analog) else places
        return Motion(values, content.rate_hz, tuple(channels)), Timeline(())
    subjects, named = dict[str, dict[str, int]](), dict[str, int]()
    for column, label in enumerate(content.labels):
        subject, _, name = label.replace("|", ":").rpartition(":")
        if name.strip() and not _UNLABELLED.match(name.strip()):
            subjects.setdefault(subject, {}).setdefault(name.strip(), column)
    for subject, those in subjects.items():
        if named.keys() & those.keys():
            LOG.warning("%s: the markers of %r have names of another subject: they are left out", path, subject)
        else:
            named |= those
    markers, frames = dict[str, Array](), np.arange(len(content.points))
    for name, column in named.items():
        places = content.points[:, column]
        seen = np.isfinite(places).all(axis=1)
        if seen.any() and seen.mean() >= MIN_SEEN_SHARE:
            markers[name] = np.stack([np.interp(frames, frames[seen], axis[seen]) for axis in places.T], axis=1)
    lost = [name for name in named if name not in markers]
    if not markers:
        some = ", ".join(content.labels[:6])
        raise InputError(f"no marker with a name is seen in half of the frames; the labels: {some or 'none'}")
    if lost:
        what = f"{len(lost)} of {len(lost) + len(markers)} markers are seen in less than half of the frames"
        LOG.warning("%s: %s and left out: %s", path, what, ", ".join(lost[:8]))
    return measure_markers(to_head_frame(markers, content.unit), content.rate_hz), Timeline(())


def _list_points(motion: Motion) -> list[int]:
    """Return the numbers of the points that have all three channels, in order."""
    numbers = [int(match[1]) for name in motion.names if (match := _POINT.match(name)) and name.startswith("x")]
    known = set(motion.channels)
    return [point for point in numbers if all(Channel(f"{axis}_{point}") in known for axis in "xyz")]


MOTION_FORMAT = MotionFormat(write, read, check, min_frames=1, max_bytes=1 << 28)
MILLIMETRES = 90.0  # the distance between the outer eye corners of a grown person, where markers do not show it
UNITS = {"mm": 1.0, "millimeter": 1.0, "cm": 10.0, "m": 1000.0, "meter": 1000.0, "in": 25.4, "inch": 25.4}
UNITS |= {"millimetre": 1.0, "centimeter": 10.0, "centimetre": 10.0, "metre": 1000.0, "inche": 25.4}
"""Units of length in millimetres, without the ``s`` of several."""
MAX_BEHIND = 0.15  # eye distances that the markers of a face are behind the corners of the eyes on the mean
SMALLEST_FACE = 0.2  # eye distances that the markers of a face lie apart at least
OUTER_EYES = [re.compile(rf"(eye({s[0]}|{s})|({s[0]}|{s})eye|ex{s[0]}|{s[0]}ex)(outer)?") for s in ("left", "right")]
"""Names of markers at the outer corners of the speaker's eyes: without capitals, spaces and underscores."""
RIGID = re.compile("(left|right|.)?(forehead|head|nasion|nosebridge|glabella|temple|ear|mastoid|[lr]?fhd)")
"""Beginnings of names, after a side, of other markers that do not move against the skull."""
MIN_RIGID_MARKERS = 3
LARGEST_COORDINATE = 1e6
MIN_DISTANCE = 1e-3  # least distance of the eye corners in any frame, as a share of the median
DISTANCES = {"opening": (13, 14), "width": (61, 291), "outer": (0, 17)}  # channels that are the distance of two points
MARKER = re.compile(r"(?:lip|jaw|p|point)[ _]?(\d{1,3})$", re.IGNORECASE)  # at a point of the face mesh


def measure_markers(markers: Mapping[str, Array], rate_hz: float) -> Motion:
    """Return the channels of markers in the head's frame, and the distances between those of the lips."""
    points = {int(match[1]): places for name, places in markers.items() if (match := MARKER.match(name))}
    names = [str(int(match[1])) if (match := MARKER.match(name)) else name for name in markers]
    curves = {
        name: np.linalg.norm(points[one] - points[other], axis=1)
        for name, (one, other) in DISTANCES.items()
        if one in points and other in points
    }
    curves |= {
        f"{axis}_{name}": places[:, column]
        for name, places in zip(names, markers.values(), strict=True)
        for column, axis in enumerate("xyz")
    }
    return Motion(np.stack(list(curves.values()), axis=1), rate_hz, tuple(map(Channel, curves)))


def to_head_frame(markers: Mapping[str, Array], unit: str) -> dict[str, Array]:
    """Return the places of all markers but the rigid ones, in the head's frame [each shape=(T, 3)].

    markers : places by name, in ``unit`` [each shape=(T, 3)]
    With both eye corners and a further rigid marker, movements of the head are taken out whole. With the eye corners
    alone, its shifts and the turns that they show. Without them, places are as they were recorded, and an eye distance
    is ``MILLIMETRES``. Axes are turned by quarters, so that the mouth is below the eyes.
    Raises InputError: an unknown unit, or eye corners in one place.
    """
    millimetres = UNITS.get(unit.strip().lower().removesuffix("s"))
    if millimetres is None:
        raise InputError(f"its unit of length is {unit[:20]!r}, required mm, cm, m or inch")
    if max(float(np.abs(places).max()) for places in markers.values()) > LARGEST_COORDINATE:
        raise InputError(f"a marker is further than {LARGEST_COORDINATE:g} {unit} away; export the capture again")
    left, right = (next((name for name in markers if each.fullmatch(_clean(name))), "") for each in OUTER_EYES)
    if not (left and right):
        size = float(np.ptp([places.mean(axis=0) for places in markers.values()], axis=0).max()) * millimetres
        if len(markers) > 1 and size < SMALLEST_FACE * MILLIMETRES:
            required = f"required {SMALLEST_FACE * MILLIMETRES:g}: is its unit of length {unit!r} right?"
            raise InputError(f"the markers lie at most {size:.2g} mm apart, {required}")
        LOG.warning("no markers EYE_L and EYE_R: required a still head, x to its left, y up, z out, of grown people")
        return {name: places * millimetres / MILLIMETRES for name, places in markers.items()}
    rigid = [left, right, *(name for name in markers if name not in {left, right} and RIGID.match(_clean(name)))]
    moving = [name for name in markers if name not in rigid]
    if not moving:
        raise InputError(f"all markers are those of the head ({', '.join(rigid[:6])}), required markers of the mouth")
    places = np.stack([markers[name] for name in (*rigid, *moving)], axis=1)
    if len(rigid) >= MIN_RIGID_MARKERS:
        places = _steady(places, len(rigid))
    centre = places[:, :2].mean(axis=1, keepdims=True)
    across = places[:, 0] - places[:, 1]
    distances = np.linalg.norm(across, axis=1)
    distance = float(np.median(distances))
    if not distances.min() > MIN_DISTANCE * max(distance, MIN_DISTANCE):
        raise InputError("the two eye corners are in one place, required the outer corners of both eyes")
    if len(rigid) >= MIN_RIGID_MARKERS:
        across = np.broadcast_to(across.mean(axis=0), across.shape)
    turned = np.einsum("tij,tnj->tni", _find_rotations(across), (places - centre)) / distance
    _, y, z = turned[:, len(rigid) :].mean(axis=(0, 1))  # about x by quarters, so that the mouth is below the eyes
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[round(float(np.arctan2(z, -y) / (np.pi / 2))) % 4]
    turned = turned @ np.array([[1.0, 0, 0], [0, cosine, -sine], [0, sine, cosine]]).T
    behind = -float(turned[:, len(rigid) :, 2].mean())
    if behind > MAX_BEHIND:
        what = f"the markers are {behind:.2f} eye distances behind the eyes, required in front of them: are its axes"
        LOG.warning("%s left-handed, or %s and %s exchanged? Export it with right-handed axes", what, left, right)
    return {name: turned[:, len(rigid) + column] for column, name in enumerate(moving)}


def _clean(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())


def _steady(places: Array, rigid: int) -> Array:
    """Return places [shape=(T, N, 3)] moved so that the first ones lie as in the first frame (Kabsch 1976)."""
    centres = places[:, :rigid].mean(axis=1, keepdims=True)
    covariances = np.einsum("tni,nj->tij", places[:, :rigid] - centres, places[0, :rigid] - centres[0])
    left, _, right = np.linalg.svd(covariances)
    signs = np.ones((len(places), 3))
    signs[:, 2] = np.sign(np.linalg.det(left @ right))
    rotations = np.einsum("tji,tj,tkj->tik", right, signs, left)
    return np.einsum("tij,tnj->tni", rotations, (places - centres)) + centres[0]


def _find_rotations(across: Array) -> Array:
    """Return the least rotations that turn directions into the axis x [shape=(T, 3, 3)]; half turns are about y."""
    x, y, z = (across / np.linalg.norm(across, axis=1, keepdims=True)).T
    opposite = x < -1 + 1e-9
    share = 1 / np.where(opposite, 1.0, 1 + x)
    rows = np.array([[x, y, z], [-y, 1 - y * y * share, -y * z * share], [-z, -y * z * share, 1 - z * z * share]])
    rotations = np.moveaxis(rows, 2, 0)
    rotations[opposite] = np.diag([-1.0, 1.0, -1.0])
    return rotations


CENTIMETRES = 9.0
ROOT_CHANNELS = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"
POINT_CHANNELS = "Xposition Yposition Zposition"


def write_bvh(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write the points; of motion with distances alone, they move as mouths do (``fitting.blendshape_motion``)."""
    motion, template = generation.motion, build_mouth()
    displacements = move_points(motion, generation.units).expressed
    offsets = [" ".join(f"{value:.5f}" for value in place * CENTIMETRES) for place in template.places]
    lines = ["HIERARCHY", "ROOT head", "{", "  OFFSET 0 0 0", f"  CHANNELS 6 {ROOT_CHANNELS}"]
    for point, jaw, offset in zip(template.points, template.jaw, offsets, strict=True):
        lines += [f"  JOINT {'JAW' if jaw else 'LIP'}_{point}", "  {", f"    OFFSET {offset}"]
        lines += [f"    CHANNELS 3 {POINT_CHANNELS}", "    End Site", "    {", "      OFFSET 0 0 0.5", "    }", "  }"]
    lines += ["}", "MOTION", f"Frames: {len(motion.values)}", f"Frame Time: {1 / motion.rate_hz:.9f}"]
    places = ((template.places + displacements) * CENTIMETRES).reshape(len(displacements), -1)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(lines) + "\n")
        for row in format_rows(places):
            file.write(f"0 0 0 0 0 0 {row.replace(',', ' ')}\n")


BVH = MotionFormat(write_bvh, needs=("opening",), mouth=True)
