"""Animations for game engines and Blender, as text, and the add-on for Blender that reads motion files.

``.anim``: an animation clip of Unity that moves blendshapes of the object that it is put on.
``.tres``: an Animation of Godot 4 that moves the blend shapes of the root node of its AnimationPlayer.
``.motion3.json``: a motion of Live2D Cubism: how far the mouth is open, and whether it is wide or puckered.
``.blender.py``: a script that keys shape keys, bones and custom properties when it is run in Blender.
``.zip``: the add-on for Blender 4.2 and later (``extras/lipmotion_blender``; a wheel holds it as data). The script is
made of its modules, the curves, and a call that keys them.

Unity's AnimationClip is as Unity 2019 and later serialise it (YAML), serializedVersion 6; weights go to 100. Godot's
tracks (``TYPE_BLEND_SHAPE``) have keys of time, transition and value, one after another.
In all, everything is linear between keys. Keys that a straight line between others replaces are left out, and held
poses change at once (constant tangents; ``interp`` 0; segments of type 2).

Source: files of Unity; Godot 4, scene/resources/animation.cpp; Live2D, Cubism specifications, "motion3.json".
"""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER, build_mouth
from lipmotion.articulation.mouth import find_mouth
from lipmotion.errors import ExportError
from lipmotion.extensions import find_version
from lipmotion.formats.base import MotionFormat, list_key_frames
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth, arkit_weights
from lipmotion.storage.files import atomic_file, check_target
from lipmotion.storage.json_text import as_json
from lipmotion.types import WEIGHT, Generation, Motion

Array = NDArray[np.float64]
FULL = 100.0  # a blendshape's weight in Unity where it has its whole effect
UNITY_TOLERANCE, GODOT_TOLERANCE = 0.01, 1e-4  # largest error of a curve through the keys that are kept, of 100, of 1
UNITY_DECIMALS, GODOT_DECIMALS = 4, 5
RENDERER = 137  # the class of SkinnedMeshRenderer
LINEAR, CONSTANT = 69, 103
"""Modes of the tangents of a key in Unity: straight, or held until the next key, on both sides."""
RATE_HZ = 60.0
_PLAIN = re.compile(r"[A-Za-z][\w.]*", re.ASCII)  # names that need no quotes
NODE = "."  # the node whose blend shapes move in Godot: the root node of the AnimationPlayer itself
FORBIDDEN = frozenset('".:@/%')  # characters that no name in a path of Godot has


def _list_weights(motion: Motion) -> list[str]:
    return [channel.name for channel in motion.channels if channel.unit == WEIGHT]


def _choose_keys(
    generation: Generation, name: str, full: float, decimals: int, tolerance: float
) -> tuple[Array, Array, bool]:
    """Return times and values of the keys of a weight, and whether it is held between them."""
    motion, held = generation.motion, name in generation.stepped
    values: Array = np.round(full * motion[name].astype(np.float64), decimals) + 0.0
    frames = list_key_frames(motion.time_s, values, tolerance, stepped=held)
    return motion.time_s[frames], values[frames], held


def write_unity(path: Path, generation: Generation, source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write one clip, named as the recording, with a curve for each weight of the motion."""
    motion, name = generation.motion, Path(source.get("path", "")).stem or "speech"
    curves = "".join(_format_curve(generation, weight) for weight in _list_weights(motion)).removesuffix("\n")
    members = {"name": _quote(name), "curves": curves, "rate_hz": f"{motion.rate_hz:.9g}"}
    text = _read_form("unity_clip.yaml").substitute(**members, end_s=f"{motion.time_s[-1]:.6f}")
    path.write_text(text, encoding="utf-8", newline="\n")


@cache
def _read_form(file: str) -> Template:
    """Return the text of a file of this package, in which names stand for members."""
    return Template(resources.files(__package__).joinpath(file).read_text(encoding="ascii"))


def _quote(name: str) -> str:
    """Return a name as YAML has it: in quotes, where it needs some."""
    return name if _PLAIN.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _format_curve(generation: Generation, name: str) -> str:
    times_s, keys, steps = _choose_keys(generation, name, FULL, UNITY_DECIMALS, UNITY_TOLERANCE)
    slopes = np.diff(keys) / np.diff(times_s)
    rows, mode = "", f"{CONSTANT if steps else LINEAR}"
    for number, (time_s, key) in enumerate(zip(times_s.tolist(), keys.tolist(), strict=True)):
        sides = (max(number - 1, 0), min(number, len(slopes) - 1))
        before, after = ("Infinity" if steps else f"{slopes[side]:.6g}" for side in sides)
        members = {"time_s": f"{time_s:.6f}", "value": f"{key:.{UNITY_DECIMALS}f}", "before": before, "after": after}
        rows += _read_form("unity_key.yaml").substitute(**members, mode=mode)
    attribute = _quote(f"blendShape.{name}")
    return _read_form("unity_curve.yaml").substitute(keys=rows, attribute=attribute, path="", kind=RENDERER)


def check_godot(motion: Motion) -> None:
    """Raise ExportError if a weight has a name that no path of Godot can have."""
    for name in _list_weights(motion):
        if FORBIDDEN & {*name}:
            letters = '. : @ / % "'
            raise ExportError(f"the blendshape {name!r} has one of the letters {letters}, which Godot replaces: rename")


def write_godot(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write one resource with a track for each weight of the motion."""
    motion = generation.motion
    length, step = f"{float(motion.time_s[-1]):.9g}", f"{1 / motion.rate_hz:.6g}"
    text = _read_form("godot_animation.txt").substitute(length=length, step=step)
    for number, name in enumerate(_list_weights(motion)):
        times_s, values, steps = _choose_keys(generation, name, 1.0, GODOT_DECIMALS, GODOT_TOLERANCE)
        rows = zip(times_s, values, strict=True)
        keys = ", ".join(f"{time_s:.9g}, 1, {value:.{GODOT_DECIMALS}g}" for time_s, value in rows)
        node = json.dumps(f"{NODE}:{name}", ensure_ascii=False)
        text += _read_form("godot_track.txt").substitute(number=number, node=node, interp=int(not steps), keys=keys)
    path.write_text(text, encoding="utf-8", newline="\n")


_WEIGHTS: dict[str, Any] = {"needs": (WEIGHT,), "curves": "face", "other_curves": True, "keyed": True}
UNITY = MotionFormat(write_unity, rate_hz=RATE_HZ, min_frames=2, **_WEIGHTS)
GODOT = MotionFormat(write_godot, check=check_godot, **_WEIGHTS)
OPEN, FORM = "ParamMouthOpenY", "ParamMouthForm"
"""Live2D's standard parameters: 0 closed to 1 open; −1 puckered to 1 wide, as in a smile."""
FULL_GAP = 0.20  # the gap between the lips that is drawn as wholly open, eye distances
LARGEST_WIDENING, LARGEST_NARROWING = 0.08, 0.12
"""By how much the mouth is wider and narrower than at rest where the form is 1 and −1, eye distances."""
FPS = 30.0  # the frame rate that the file states; its keys are at any time
TOLERANCE = 0.005  # largest error of a curve through the keys that are kept
DECIMALS = 3
LINEAR_SEGMENT, STEPPED_SEGMENT = 0, 2  # types of segments: straight to the next key, or held until it
SHOWING = ("opening", "jawOpen")  # channels that say how far the mouth is open


def write_live2d(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write two curves, and how many keys they have."""
    motion = generation.motion
    curves, points, steps = [], 0, bool({*SHOWING} & {*generation.stepped})
    for name, values in ((OPEN, measure_mouth_open(generation)), (FORM, measure_mouth_form(generation))):
        rounded = np.round(values, DECIMALS) + 0.0
        frames = list_key_frames(motion.time_s, rounded, TOLERANCE, stepped=steps)
        keys = [(round(float(motion.time_s[frame]), 6), float(rounded[frame])) for frame in frames]
        segments: list[float] = [*keys[0]]
        for time_s, value in keys[1:]:
            segments += [STEPPED_SEGMENT if steps else LINEAR_SEGMENT, time_s, value]
        curves.append({"Target": "Parameter", "Id": name, "Segments": segments})
        points += len(keys)
    meta = {
        **{"Duration": round(float(motion.time_s[-1]), 6), "Fps": FPS, "Loop": False, "AreBeziersRestricted": True},
        **{"CurveCount": len(curves), "TotalSegmentCount": points - len(curves), "TotalPointCount": points},
        **{"UserDataCount": 0, "TotalUserDataSize": 0},
    }
    path.write_text(as_json({"Version": 3, "Meta": meta, "Curves": curves}) + "\n", encoding="utf-8")


def measure_mouth_open(generation: Generation) -> Array:
    """Return how far the mouth is open, 0 to 1 [shape=(T,)]; 0 where the lips touch."""
    motion, measured = generation.motion, "opening" in generation.motion.names
    gap = find_mouth(motion, generation.units).gap if measured else _sum_effects(motion, arkit_mouth().gap)
    return np.clip(gap / FULL_GAP, 0.0, 1.0)


def measure_mouth_form(generation: Generation) -> Array:
    """Return the form of the mouth, −1 puckered to 1 wide [shape=(T,)]; 0 at rest, and where no channel says it."""
    motion = generation.motion
    if "opening" in motion.names and "width" in motion.names:
        wider = (find_mouth(motion, generation.units).width - 1) * build_mouth().width
    else:
        template = build_mouth()
        corners = arkit_mouth().moved[:, [template.row(LEFT_CORNER), template.row(RIGHT_CORNER)], 0]
        wider = _sum_effects(motion, corners[:, 0] - corners[:, 1])
    return np.clip(wider / np.where(wider > 0, LARGEST_WIDENING, LARGEST_NARROWING), -1.0, 1.0)


def _sum_effects(motion: Motion, effects: Array) -> Array:
    """Return the sum of the effects of blendshapes by their weights [shape=(T,)]."""
    known, weights = zip(arkit_mouth().known, effects, strict=True), arkit_weights(motion)
    return sum((effect * weights[name] for name, effect in known if name in weights), np.zeros(len(motion.values)))


LIVE2D = MotionFormat(write_live2d, needs=SHOWING, min_frames=2, mouth=True)
SCRIPT_MODULES = ("takes.py", "curves.py", "keying.py", "script.py")
"""The modules of the add-on that a script holds, one after another."""
COPIED = "# -- what follows is copied into scripts\n"
FOLDER = "lipmotion_blender"
ADDON_PLACES = (Path(__file__).parents[1] / "addons", Path(__file__).parents[3] / "extras")
"""Where the add-on's folder is: in an installed package; in a copy of the repository."""
MODULES = ("__init__.py", "curves.py", "keying.py", "panel.py", "takes.py")
OLDEST = (1980, 1, 1, 0, 0, 0)  # the time of every file in an archive: the same version gives the same bytes
NO_VERSION = "0.0.0"  # the version where lipmotion is not installed; Blender takes three numbers
SCRIPT_DECIMALS = 5
_BEGINNING = re.compile(r'\A""".*?"""\n', re.DOTALL)
_IMPORT = re.compile(r"^from (\.\w*|__future__) import .*\n", re.MULTILINE)


def write_blender(path: Path, generation: Generation, source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write the code of the add-on, the curves, and a call that keys them; names are literals of Python in ASCII."""
    motion = generation.motion
    texts = read_addon(SCRIPT_MODULES).values()
    *code, main = (_IMPORT.sub("", _BEGINNING.sub("", text)) for text in texts)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(_read_form("blender_script_head.txt").template + "".join(each.strip() + "\n\n\n" for each in code))
        file.write(f"RATE_HZ = {motion.rate_hz!r}\nSOUND = {source.get('path', '')!a}\n")
        file.write(f"SOUND_S = {float(source.get('start_s', 0.0))!r}\n")
        stepped = "".join(f"{name!a}, " for name in motion.names if name in generation.stepped)
        file.write(f"STEPPED = ({stepped})\nMOTION = {{\n")
        for name in motion.names:
            values = ", ".join(f"{value + 0.0:.{SCRIPT_DECIMALS}g}" for value in motion[name].tolist())
            file.write(f"    {name!a}: [{values}],\n")
        file.write("}\n" + main.split(COPIED)[1] + '\n\nif __name__ == "__main__":\n    main()\n')


BLENDER = MotionFormat(write_blender, curves="face", other_curves=True, names_sound=True)


def read_addon(names: Iterable[str]) -> dict[str, str]:
    """Return the text of modules of the add-on, by name. Raises ExportError: this installation lacks the add-on."""
    folder = next((place / FOLDER for place in ADDON_PLACES if (place / FOLDER).is_dir()), None)
    if folder is None:
        raise ExportError("this installation of lipmotion lacks its add-on for Blender; install lipmotion again")
    return {name: (folder / name).read_text(encoding="utf-8") for name in names}


def write_addon(program: str, path: str | Path) -> None:
    """Write the add-on for Blender 4.2 and later to a ``.zip``. Raises ExportError: another program or suffix."""
    path = Path(path)
    if program != "blender":
        raise ExportError(f"there is no add-on for {program!r}, required blender")
    if path.suffix.lower() != ".zip":
        raise ExportError(f"{path}: unknown format {path.suffix!r}; Blender installs a .zip")
    check_target(path)
    texts = read_addon(MODULES)
    version = re.match(r"\d+\.\d+\.\d+", find_version())
    shown = version[0] if version else NO_VERSION
    # makes it an extension
    texts["blender_manifest.toml"] = _read_form("blender_manifest.toml").substitute(version=shown)
    with atomic_file(path) as unfinished, zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in texts.items():
            archive.writestr(zipfile.ZipInfo(f"{FOLDER}/{name}", OLDEST), text.encode(), zipfile.ZIP_DEFLATED)
