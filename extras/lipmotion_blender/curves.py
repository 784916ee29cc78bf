"""Curves for Blender: read from motion files, matched with names, sampled at frames. Runs inside Blender: no imports of
lipmotion, nothing but the standard library.
"""

from __future__ import annotations

import csv
import json
import math
import re
from bisect import bisect_left

from .takes import read_take

Curves = dict[str, list[float]]

OPEN_BELOW, NEAR = 0.02, 3
"""Lips are held to be closed where the shapes that part them add up to less than this, and to less than in this many
frames before and after."""
MOUTH = ("jaw", "mouth")
"""Beginnings of the names of shapes that part or close the lips."""
_SIDES = {"l": "left", "r": "right"}
_BONE = re.compile(r"^(?P<bone>.+)\.(?P<kind>location|rotation|scale)\.(?P<axis>[xyz])$")
_PROPERTY = re.compile(r"^(?P<bone>[^\[\]]*)\[(?P<property>[^\[\]]+)\]$")


def read_motion(path: str) -> tuple[Curves, list[float]]:
    """Return the curves of a motion file by their names, and the times of their values in seconds.

    Reads lipmotion's ``.json`` and ``.csv``, and takes of Live Link Face. Raises ValueError: it is none of these.
    """
    if path.lower().endswith(".json"):
        with open(path, encoding="utf-8") as file:  # noqa: PTH123
            document = json.load(file)
        if not isinstance(document, dict) or document.get("format") != "lipmotion.motion":
            raise ValueError("this .json is not lipmotion's: its 'format' must be 'lipmotion.motion'")
        names = [channel["name"] for channel in document["channels"]]
        times = [number / document["rate_hz"] for number in range(len(document["values"]))]
        return _columns(names, document["values"]), times
    with open(path, encoding="utf-8-sig", newline="") as file:  # noqa: PTH123
        rows = [row for row in csv.reader(file) if row]
    if not rows or rows[0][0].lower() not in {"time_s", "timecode"}:
        raise ValueError("the first column is neither 'time_s' (lipmotion) nor 'Timecode' (Live Link Face)")
    if rows[0][0].lower() == "timecode":
        names, times, values = read_take(rows)
        return _columns(names, values), times
    times = [float(row[0]) for row in rows[1:]]
    return _columns(rows[0][1:], [list(map(float, row[1:])) for row in rows[1:]]), times


def spelling(name: str) -> str:
    """Return a name as it is compared: ``head.mouthSmile_L.001`` and ``MouthSmileLeft`` are ``mouthsmileleft``."""
    name = re.sub(r"[._ ]\d{1,4}$", "", name)
    words = [word for word in re.split(r"[\s_\-]+", re.split(r"[.:|]", name)[-1]) if word]
    if not words:
        return ""
    return "".join([*words[:-1], _SIDES.get(words[-1].lower(), words[-1])]).lower()


def matched(names: list[str], keys: list[str]) -> dict[str, str]:
    """Return for each curve the shape key of its name, or else of its spelling; curves without one are left out."""
    spelt: dict[str, str] = {}
    for key in keys:
        spelt.setdefault(spelling(key), key)
    keys_of = {name: name if name in keys else spelt.get(spelling(name), "") for name in names}
    return {name: key for name, key in keys_of.items() if key}


def control(name: str) -> tuple[str, str, str] | None:
    """Return bone, kind and axis of a control as ``Bone.rotation.x``, or bone, ``property`` and name of
    ``Bone[name]``; the bone of ``[name]`` is empty. None: it is no control."""
    match = _BONE.match(name)
    if match:
        return match["bone"], match["kind"], match["axis"]
    match = _PROPERTY.match(name)
    return (match["bone"], "property", match["property"]) if match else None


def at_frames(curves: Curves, times: list[float], fps: float, stepped: tuple[str, ...] = ()) -> Curves:
    """Return the values at every frame, frame n at ``n / fps`` seconds, to the last frame that begins in the motion.

    Between values by a straight line. Where the lips close, the curves of jaw and mouth have at the nearest frame the
    values of that moment, so that no p, b or m is lost between two frames.
    stepped : names of curves that hold each value until the next one: a frame has the value that is held at its time
    """
    if not times:
        return {name: [] for name in curves}
    count = math.floor((times[-1] - times[0]) * fps + 1e-6) + 1
    places = [_place(times, times[0] + number / fps) for number in range(count)]
    closed = list(places)
    for moment in closures(curves, len(times)):
        nearest = round((times[moment] - times[0]) * fps)
        if nearest < count:
            closed[nearest] = (moment, 0.0)
    sampled = {}
    for name, values in curves.items():
        if name in stepped:
            sampled[name] = [values[low] for low, _ in places]
            continue
        chosen = closed if spelling(name).startswith(MOUTH) else places
        sampled[name] = [_between(values, *place) for place in chosen]
    return sampled


def closures(curves: Curves, count: int) -> list[int]:
    """Return the moments at which the lips are closed most, of curves that are blendshapes of ARKit."""
    spelt = {spelling(name): values for name, values in curves.items()}
    if "jawopen" not in spelt:
        return []
    none = [0.0] * count
    close = spelt.get("mouthclose", none)
    gap = [max(jaw - shut, 0.0) for jaw, shut in zip(spelt["jawopen"], close)]  # noqa: B905
    for name in ("mouthfunnel", "mouthlowerdownleft", "mouthlowerdownright", "mouthupperupleft", "mouthupperupright"):
        gap = [sum(both) for both in zip(gap, spelt.get(name, none))]  # noqa: B905
    moments = []
    for moment, value in enumerate(gap):
        around = gap[max(moment - NEAR, 0) : moment + NEAR + 1]
        if value < OPEN_BELOW and value <= min(around) and max(around) > value:
            moments.append(moment)
    return moments


def _between(values: list[float], low: int, share: float) -> float:
    return values[low] + share * (values[low + 1] - values[low]) if share else values[low]


def _place(times: list[float], time_s: float) -> tuple[int, float]:
    """Return the value before a time, and how far the time is towards the next one, 0 to 1."""
    low = min(max(bisect_left(times, time_s + 1e-9) - 1, 0), len(times) - 1)
    if low == len(times) - 1:
        return low, 0.0
    return low, min(max((time_s - times[low]) / (times[low + 1] - times[low]), 0.0), 1.0)


def _columns(names: list[str], rows: list[list[float]]) -> Curves:
    return {name: [row[column] for row in rows] for column, name in enumerate(names)}
