"""Weights of blendshapes in the JSON of other programs.

``.a2f.json``: weights of ARKit's 52 blendshapes as NVIDIA Audio2Face exports them.
``.jsonl``: frames of weights as services and trackers give them: one document, a list, or one document a line.

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
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.errors import InputError, shorten
from lipmotion.formats.base import MotionFormat, read_members, write_json
from lipmotion.formats.steady_rate import TIME_COLUMN, column_key, resample_rows, tabulate_frames, times_to_seconds
from lipmotion.meshes.model.shape_names import ARKIT_52, is_known
from lipmotion.storage.json_text import json_errors
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Timeline, Unit
from lipmotion.types.values import items, members, number, text

LOG = logging.getLogger("lipmotion")
NAMES, WEIGHTS, RATE = "facsNames", "weightMat", "exportFps"
SOUND, POSES, FRAMES = "trackPath", "numPoses", "numFrames"
"""The members of a file."""
RATE_HZ = 60.0
"""What Audio2Face exports by default."""
AZURE_NAMES, AZURE_HZ = (*ARKIT_52, "headRoll", "leftEyeRoll", "rightEyeRoll"), 60.0
"""The 55 facial positions of Azure in their order, and how many frames of them make a second."""
TICKS_PER_S = 1e7
ANIMATION, AUDIO_OFFSET = ("animation", "privanimation"), ("audiooffset", "privaudiooffset")
RATES = ("fps", "framerate", "exportfps", "ratehz")
NAMED, SCORED = ("categoryname", "blendshape", "blendshapename", "name", "shape"), ("score", "value", "weight")
DEEPEST, MAX_FRAMES = 6, 1 << 22
_DECODER = json.JSONDecoder()


def write_audio2face(path: Path, generation: Generation, source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write one JSON object; blendshapes that the motion does not have are 0."""
    motion = generation.motion
    table = np.zeros((len(motion.values), len(ARKIT_52)))
    for column, name in enumerate(ARKIT_52):
        if name in motion.names:
            table[:, column] = motion[name]
    before = {RATE: motion.rate_hz, SOUND: source.get("path", ""), POSES: len(ARKIT_52), FRAMES: len(table)}
    write_json(path, before | {NAMES: list(ARKIT_52)}, WEIGHTS, table, {})


def read_audio2face(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the weights of a file, and an empty timeline. Joints, where a file has them, are passed over.

    Raises InputError: not such a file, no rate, or rows that do not fit the names.
    """
    with json_errors("the file of Audio2Face"):
        document = read_members(path.read_text(encoding="utf-8-sig"), WEIGHTS)
        checked = _AUDIO2FACE(document)
        names, rows, rate_hz = checked[NAMES], document[WEIGHTS], checked[RATE]
    stated = document.get(FRAMES)
    if isinstance(stated, int) and stated != len(rows):
        LOG.warning("%s: %d frames are stated, %d are there", path, stated, len(rows))
    if not isinstance(rows, np.ndarray) or rows.ndim != 2 or rows.shape[1] != len(names):
        shape = rows.shape if isinstance(rows, np.ndarray) else "no"
        raise InputError(
            f"the member {WEIGHTS!r} has {shape} rows and columns, required a column for each of {NAMES!r}"
        )
    return Motion(rows, rate_hz, tuple(Channel(name, WEIGHT) for name in names)), Timeline(())


_AUDIO2FACE = members({NAMES: items(text(1000)), RATE: number()}, (NAMES, RATE))


AUDIO2FACE = MotionFormat(write_audio2face, read_audio2face, curves="face", rate_hz=RATE_HZ, names_sound=True)


def read_frames(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the weights of a file, and an empty timeline.

    Raises InputError: not JSON, none of these forms, frames without a time, or pieces that contradict one another.
    """
    with json_errors("the file of frames of weights"):
        documents = list(_decode_documents(path.read_text(encoding="utf-8-sig")))
        objects = [_key_members(each) for each in _find_objects(documents, DEEPEST)]
        pieces = [each for each in objects if "frameindex" in each and each.get("blendshapes")]
        if pieces:
            return _place_azure(pieces), Timeline(())
        frames = [(each, weights) for each in objects if (weights := _find_weights(each)) is not None]
        if not any(weights for _, weights in frames):
            raise InputError("no frames of blendshapes by their names, required a list of {time, blendshapes}")
        timed = next((key for key in frames[0][0] if TIME_COLUMN.fullmatch(key)), None)
        names, values = tabulate_frames([weights for _, weights in frames])
        if timed is not None:
            missing = sum(each.get(timed) is None for each, _ in frames)
            if missing:
                raise InputError(f"{missing} of {len(frames)} frames have no {timed!r}, required a time in each")
            time_s = times_to_seconds(np.array([float(each[timed]) for each, _ in frames]), timed)
        else:
            rate_hz = next((float(each[key]) for each in objects for key in RATES if each.get(key)), 0.0)
            if not rate_hz > 0:
                raise InputError(f"{len(frames)} frames have no time, required one in each, or a member fps")
            time_s = np.arange(len(frames)) / rate_hz
        return resample_rows(names, time_s, values)[0], Timeline(())


def _decode_documents(text: str) -> Iterator[Any]:
    """Yield the documents of a text: one, or several one after the other."""
    at = 0
    while at < len(text):
        if text[at].isspace() or text[at] == ",":
            at += 1
        else:
            value, at = _DECODER.raw_decode(text, at)
            yield value


def _find_objects(value: Any, deepest: int) -> Iterator[dict[str, Any]]:
    """Yield objects in order, and those in their lists, but for what is in frames of weights."""
    if isinstance(value, list) and deepest:
        for each in value:
            yield from _find_objects(each, deepest - 1)
    elif isinstance(value, dict):
        yield value
        for name, each in value.items() if _find_weights(value) is None else ():
            if column_key(name) in ANIMATION and isinstance(each, str) and each.strip():
                offset = next((value[key] for key in value if column_key(key) in AUDIO_OFFSET), None)
                yield {**json.loads(each), "AudioOffset": offset}
            elif isinstance(each, list) and each and isinstance(each[0], dict):
                yield from _find_objects(each, deepest - 1)


def _key_members(each: dict[str, Any]) -> dict[str, Any]:
    return {name if is_known(name) else column_key(name): value for name, value in each.items()}


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
    keyed = _key_members(dict(frame))
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
        keyed = {column_key(name): member for name, member in each.items()}
        name = next((str(keyed[key]) for key in NAMED if keyed.get(key)), None)
        score = next((keyed[key] for key in SCORED if key in keyed), None)
        if name is None or score is None:
            raise InputError(f"{shorten(repr(each)[:200])} is no blendshape, required a name and a score")
        weights[name] = float(score)
    return weights if isinstance(value, list) else None
