"""Motion in JSON: lipmotion's own documents, and weights of blendshapes of other programs.

``.json``: the document with its values, one row of values per line.
``.npz``: the values without rounding, and the rest as JSON in a string array. Nothing is pickled.
``.a2f.json``: weights of ARKit's 52 blendshapes as NVIDIA Audio2Face exports them.
``.jsonl``: frames of weights as services and trackers give them: one document, a list, or one document a line.

The document has ``format``, ``version``, ``rate_hz``, ``channels`` (name and unit), ``units`` (phones in time),
``recognised`` (if phones were), ``outlook`` (if known), ``source`` and ``model``. The confidence of every frame is a
member of it, or an array beside the values; the standard deviations are an array.

Audio2Face's ``facsNames`` names the columns of ``weightMat``, one row a frame: ARKit's 52 names, or the 46 of its own
solver, which ``meshes.model.shape_names`` understands. Frames are read alone. Azure's voices: ``{"FrameIndex": 0,
"BlendShapes": [[55 weights], …]}``, 60 frames a second, alone or in the ``Animation`` of viseme events. MediaPipe's and
Audio2Face-3D's: frames with a time and weights by name, or a list of categories with scores.

Source: NVIDIA, "Audio2Face, Export" and "Blendshape conversion"; files of versions 2022 and 2023. Microsoft, "Get
facial position with viseme"; results of these programs.
"""

from __future__ import annotations

import json
import logging
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.formats import steady_rate
from lipmotion.formats.base import MotionFormat, iterate_json, read_members, write_json
from lipmotion.formats.steady_rate import TIME_COLUMN, clean_column, convert_times, resample_rows, tabulate_frames
from lipmotion.meshes.model.shape_names import ARKIT_52, is_known
from lipmotion.printable import is_line
from lipmotion.storage.archive import check_archive, take_array
from lipmotion.storage.json_text import as_json, catch_errors
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Span, Timeline, Unit
from lipmotion.types.values import items, members, number, require, text, truth
from lipmotion.units import RECOGNISED, RecognisedPhone, list_recognised_phones, restore_confidences

FORMAT = "lipmotion.motion"
VERSION = 1
FRAMES_AT_ONCE = 4096  # frames whose variance is computed at once


def _describe(
    generation: Generation, source: Mapping[str, str], model: Mapping[str, str]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the members before the values, and after. Raises InputError: a channel's name would not be read."""
    motion = generation.motion
    channels = [{"name": channel.name, "unit": channel.unit} for channel in motion.channels]
    checked = require(items(members(_CHANNEL)), channels, "channels")
    outlook = {} if generation.outlook is None else {"outlook": asdict(generation.outlook)}
    after = {**list_unit_rows(generation.units), **outlook, "source": dict(source), "model": dict(model)}
    return {"format": FORMAT, "version": VERSION, "rate_hz": float(motion.rate_hz), "channels": checked}, after


def list_unit_rows(units: Timeline[Unit]) -> dict[str, Any]:
    """Return the members ``units`` and ``recognised`` (if phones were), for ``parse_units``."""
    rows = []
    for span in units:
        label = span.label
        row = {"start_s": span.start_s, "end_s": span.end_s, "phone": label.phone, "unit": label.unit}
        rows.append(row | ({"word": label.word} if label.word else {}) | ({"again": True} if label.again else {}))
    recognised = list_recognised_phones(units)
    return {"units": rows} | ({RECOGNISED: recognised} if recognised else {})


def parse(document: Any, values: Any) -> tuple[Motion, Timeline[Unit]]:
    """Return motion and units of a document and its values. Raises InputError: another one, newer, or damaged."""
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f"not a motion document: its 'format' must be {FORMAT!r}")
    version = document.get("version")
    if version != VERSION:
        what = f"the motion document has version {version!r}, this lipmotion reads {VERSION}"
        raise InputError(f"{what}: upgrade lipmotion, or export it again")
    with catch_errors("the motion document"):
        checked = _DOCUMENT(document)
        channels = tuple(Channel(**channel) for channel in checked["channels"])
        if isinstance(values, np.ndarray) and values.dtype.kind not in "fiu":
            raise InputError(f"the motion document has values of {values.dtype}, required numbers; export it again")
        array = np.asarray(values, dtype=np.float64)
        motion = Motion(array.reshape(0, len(channels)) if array.size == 0 else array, checked["rate_hz"], channels)
    return motion, parse_units(document.get("units"), document.get(RECOGNISED))


def parse_units(rows: Any, recognised: Any = None) -> Timeline[Unit]:
    """Return the units of the member ``units``: objects with ``start_s``, ``end_s`` and ``phone`` or ``unit``.

    recognised : the member ``recognised``, where there is one: units that are in it, too, are not known
    Raises InputError: rows of another kind, without a time or a name, or with times that no recording has.
    """
    with catch_errors("the motion document"):
        confidences = [
            RecognisedPhone(_TIME(start_s), _TIME(end_s), _TEXT(name), number(0, 1)(confidence))
            for start_s, end_s, name, confidence in _ROWS(recognised or [])
        ]
        return restore_confidences(Timeline(tuple(map(_read_span, _UNITS(rows)))), confidences)


def _read_span(row: Any) -> Span[Unit]:
    unit = Unit(row["phone"], row.get("unit", ""), row.get("word", ""), again=row.get("again", False))
    span = Span(row["start_s"], row["end_s"], unit)
    if not is_line(span.label.phone + span.label.unit + span.label.word):
        label = shorten(repr(span.label))
        raise InputError(f"{label} has a line end, a control character or half a character in it; correct it")
    if not span.start_s >= 0 or span.end_s == float("inf"):
        lasts = f"the unit {span.label.phone!r} lasts from {span.start_s} to {span.end_s} s"
        raise InputError(f"{lasts}, required: finite times from 0")
    return span


_TEXT, _TIME = text(10_000), number()
_UNIT = {"start_s": _TIME, "end_s": _TIME, "phone": _TEXT, "unit": _TEXT, "word": _TEXT, "again": truth}
_UNITS = items(members(_UNIT, ("start_s", "end_s", "phone")))
_ROWS = items(items(lambda value: value, 4, 4))
_CHANNEL = {"name": _TEXT, "unit": _TEXT}
_DOCUMENT = members(
    {"channels": items(members(_CHANNEL, _CHANNEL)), "rate_hz": number(), "units": lambda value: value},
    ("channels", "rate_hz", "units"),
)
"""What is used of a document, and its types."""


def write_json_file(path: Path, generation: Generation, source: Mapping[str, str], model: Mapping[str, str]) -> None:
    """Write one JSON object: format, version, rate_hz, channels, values, confidence, units, source, model."""
    certain = {} if (confidence := generation.confidence) is None else {"confidence": confidence.round(2).tolist()}
    before, after = _describe(generation, source, model)
    write_json(path, before, "values", generation.motion.values, certain | after)


def read_json(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return motion and units of a file. Raises InputError: not JSON, or not a motion document."""
    with catch_errors("the motion document"):
        text = path.read_text(encoding="utf-8-sig")
        if text.lstrip().startswith("["):
            raise InputError(f"not a motion document: its 'format' must be {FORMAT!r}")
        document = read_members(text, "values", "confidence")
    return parse(document, document.get("values"))


def read_json_units(path: Path) -> Timeline[Unit] | None:
    """Return the units of a file without values and channels; None of another one. Raises InputError: damaged units."""
    try:
        text = path.read_text(encoding="utf-8-sig")
        document = json.loads(text) if '"values"' not in text and text.lstrip().startswith("{") else None
    except (ValueError, RecursionError):  # reported by ``read_json``
        return None
    if document is None or "units" not in document or "channels" in document:
        return None
    return parse_units(document["units"], document.get(RECOGNISED))


def write_npz(path: Path, generation: Generation, source: Mapping[str, str], model: Mapping[str, str]) -> None:
    """Write ``values`` and ``standard_deviations`` [each shape=(T, P)] and ``document``, the JSON without its values.

    A standard deviation is the model's, in the unit of its channel: the square root of ``Generation.variance``.
    ``confidence`` [shape=(T,)] is ``Generation.confidence``, where that is known.
    """
    before, after = _describe(generation, source, model)
    document = as_json(before | after, ensure_ascii=False)
    values = generation.motion.values
    rows: dict[str, Callable[[slice], NDArray[np.floating[Any]]]] = {
        "values": lambda frames: values[frames],
        "standard_deviations": lambda frames: np.sqrt(np.maximum(generation.variance_of(frames), 0)).astype(np.float32),
    }
    with zipfile.ZipFile(path, "w") as file:  # as ``np.savez``, which would want all deviations at once
        for name, some in rows.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                head = {"descr": some(slice(0, 1)).dtype.str, "fortran_order": False, "shape": values.shape}
                np.lib.format.write_array_header_1_0(member, head)
                for start in range(0, len(values), FRAMES_AT_ONCE):
                    member.write(np.ascontiguousarray(some(slice(start, start + FRAMES_AT_ONCE))).data)
        arrays = {"document": np.array(document)}
        if (confidence := generation.confidence) is not None:
            arrays["confidence"] = confidence.astype(np.float32)
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def read_npz(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return motion and units of a file. Raises InputError: not an .npz file, or not a motion document."""
    with zipfile.ZipFile(path) as file:
        check_archive(file)
        values = take_array(file.read("values.npy"))
        document = json.loads(str(take_array(file.read("document.npy"))))
    return parse(document, values)


JSON = MotionFormat(write_json_file, read_json, units=read_json_units)
NPZ = MotionFormat(write_npz, read_npz)
LOG = logging.getLogger("lipmotion")
NAMES, WEIGHTS, RATE = "facsNames", "weightMat", "exportFps"
SOUND, POSES, FRAMES = "trackPath", "numPoses", "numFrames"  # the members of a file
RATE_HZ = 60.0  # what Audio2Face exports by default
AZURE_NAMES, AZURE_HZ = (*ARKIT_52, "headRoll", "leftEyeRoll", "rightEyeRoll"), 60.0
"""The 55 facial positions of Azure in their order, and how many frames of them make a second."""
TICKS_PER_S = 1e7
ANIMATION, AUDIO_OFFSET = ("animation", "privanimation"), ("audiooffset", "privaudiooffset")
RATES = ("fps", "framerate", "exportfps", "ratehz")
NUMBERED = ("frame", "frameindex", "framenumber", "frameid")  # members that are the number of a frame
NAMED, SCORED = ("categoryname", "blendshape", "blendshapename", "name", "shape"), ("score", "value", "weight")
DEEPEST, MAX_FRAMES = 6, 1 << 22


def write_audio2face(path: Path, generation: Generation, source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write one JSON object; blendshapes that the motion does not have are 0."""
    motion = generation.motion
    still = np.zeros(len(motion.values))
    table = np.stack([motion[name] if name in motion.names else still for name in ARKIT_52], axis=1)
    before = {RATE: motion.rate_hz, SOUND: source.get("path", ""), POSES: len(ARKIT_52), FRAMES: len(table)}
    write_json(path, before | {NAMES: list(ARKIT_52)}, WEIGHTS, table, {})


def read_audio2face(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the weights of a file; joints are passed over. Raises InputError: no rate, or rows of another length."""
    with catch_errors("the file of Audio2Face"):
        document = read_members(path.read_text(encoding="utf-8-sig"), WEIGHTS)
        checked = _AUDIO2FACE(document)
        names, rows, rate_hz = checked[NAMES], document[WEIGHTS], checked[RATE]
    stated = document.get(FRAMES)
    if isinstance(stated, int) and stated != len(rows):
        LOG.warning("%s: %d frames are stated, %d are there", path, stated, len(rows))
    if not isinstance(rows, np.ndarray) or rows.ndim != 2 or rows.shape[1] != len(names):
        shape = rows.shape if isinstance(rows, np.ndarray) else "no"
        raise InputError(f"the member {WEIGHTS!r} has {shape} rows and columns, required a column for each of {NAMES}")
    return Motion(rows, rate_hz, tuple(Channel(name, WEIGHT) for name in names)), Timeline(())


_AUDIO2FACE = members({NAMES: items(text(1000)), RATE: number()}, (NAMES, RATE))
AUDIO2FACE = MotionFormat(write_audio2face, read_audio2face, curves="face", rate_hz=RATE_HZ, names_sound=True)


def read_frames(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the weights of a file. Raises InputError: none of these forms, no times, or contradicting pieces."""
    with catch_errors("the file of frames of weights"):
        documents = [value for _, value in iterate_json(path.read_text(encoding="utf-8-sig"))]
        objects = [_list_key_members(each) for each in _find_objects(documents, DEEPEST)]
        pieces = [each for each in objects if "frameindex" in each and each.get("blendshapes")]
        if pieces:
            return _place_azure(pieces), Timeline(())
        frames = [(each, weights) for each in objects if (weights := _find_weights(each)) is not None]
        for each, weights in frames:
            if any(steady_rate.is_unseen(value, name) for name, value in each.items()):
                weights.clear()
        if not any(weights for _, weights in frames):
            raise InputError("no frames of blendshapes by their names, required a list of {time, blendshapes}")
        timed = next((key for key in frames[0][0] if TIME_COLUMN.fullmatch(key)), None)
        names, values = tabulate_frames([weights for _, weights in frames])
        if timed is not None:
            missing = sum(each.get(timed) is None for each, _ in frames)
            if missing:
                raise InputError(f"{missing} of {len(frames)} frames have no {timed!r}, required a time in each")
            time_s = convert_times(np.array([float(each[timed]) for each, _ in frames]), timed)
        else:
            rate_hz = next((float(each[key]) for each in objects for key in RATES if each.get(key)), 0.0)
            if not rate_hz > 0:
                raise InputError(f"{len(frames)} frames have no time, required one in each, or a member fps")
            counted = next((key for key in NUMBERED if key in frames[0][0]), "")
            time_s = np.array([float(each.get(counted, n)) for n, (each, _) in enumerate(frames)]) / rate_hz
        return resample_rows(names, time_s, values)[0], Timeline(())


def _find_objects(value: Any, deepest: int) -> Iterator[dict[str, Any]]:
    """Yield objects in order, and those in their lists, but for what is in frames of weights."""
    if isinstance(value, list) and deepest:
        for each in value:
            yield from _find_objects(each, deepest - 1)
    elif isinstance(value, dict):
        yield value
        for name, each in value.items() if _find_weights(value) is None else ():
            if clean_column(name) in ANIMATION and isinstance(each, str) and each.strip():
                offset = next((value[key] for key in value if clean_column(key) in AUDIO_OFFSET), None)
                yield {**json.loads(each), "AudioOffset": offset}
            elif isinstance(each, list) and each and isinstance(each[0], dict):
                yield from _find_objects(each, deepest - 1)


def _list_key_members(each: dict[str, Any]) -> dict[str, Any]:
    return {name if is_known(name) else clean_column(name): value for name, value in each.items()}


def _place_azure(pieces: list[dict[str, Any]]) -> Motion:
    """Return the frames of all pieces in their places; frames between pieces count as without a face."""
    rows = [np.array(each["blendshapes"], float).reshape(len(each["blendshapes"]), -1) for each in pieces]
    for each, table in zip(pieces, rows, strict=True):
        if table.shape[1] != len(AZURE_NAMES):
            number = each["frameindex"]
            raise InputError(f"frame {number} has {table.shape[1]} weights, required {len(AZURE_NAMES)} as Azure's")
    starts = [int(each["frameindex"]) for each in pieces]
    offsets = [each["audiooffset"] for each in pieces if each.get("audiooffset") is not None]
    if len(set(starts)) < len(starts) == len(offsets):  # every event counts from 0: its place is its time
        starts = [round(offset / TICKS_PER_S * AZURE_HZ) for offset in offsets]
    count = max(start + len(table) for start, table in zip(starts, rows, strict=True))
    if min(starts) < 0 or count > MAX_FRAMES:
        raise InputError(f"the frames are {min(starts)} to {count}, required 0 to {MAX_FRAMES}")
    values = np.full((count, len(AZURE_NAMES)), np.nan)
    for start, table in sorted(zip(starts, rows, strict=True), key=lambda each: each[0]):
        place = values[start : start + len(table)]
        if not (np.isnan(place) | (place == table)).all():
            twice = f"frames from {start} on are there twice, with other weights"
            raise InputError(f"{twice}; required: the pieces of one utterance")
        place[:] = table
    return resample_rows(AZURE_NAMES, np.arange(count) / AZURE_HZ, values)[0]


def _find_weights(frame: Mapping[str, Any]) -> dict[str, float] | None:
    """Return the weights of a frame by their names; none where there is no face, and None where it is no frame."""
    keyed = _list_key_members(dict(frame))
    for key in ("blendshapes", "faceblendshapes", "categories", "weights", "coefficients"):
        if key in keyed:
            return _name_weights(keyed[key])
    flat = {name: value for name, value in keyed.items() if is_known(name) and isinstance(value, int | float)}
    return _name_weights(flat) if flat else None


def _name_weights(value: Any) -> dict[str, float] | None:
    """Return weights by their names, of an object or a list of categories; of several faces those of the first."""
    if isinstance(value, dict) and "categories" in value:
        return _name_weights(value["categories"])
    if isinstance(value, dict):
        return {str(name): float(each) for name, each in value.items() if isinstance(each, int | float)}
    weights: dict[str, float] = {}
    if value is None:
        return weights
    for each in value if isinstance(value, list) else ():
        if not isinstance(each, dict) or "categories" in each:
            return _name_weights(each)
        keyed = {clean_column(name): member for name, member in each.items()}
        name = next((str(keyed[key]) for key in NAMED if keyed.get(key)), None)
        score = next((keyed[key] for key in SCORED if key in keyed), None)
        if name is None or score is None:
            raise InputError(f"{shorten(repr(each)[:200])} is no blendshape, required a name and a score")
        weights[name] = float(score)
    return weights if isinstance(value, list) else None
