"""The places of markers in the head's frame: eye distances, origin between the outer eye corners, x to the speaker's
left, y up, z out of the face; and the motion that they make."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion

Array = NDArray[np.float64]

MILLIMETRES = 90.0
"""The distance between the outer eye corners of a grown person, where markers do not show it."""
UNITS = {"mm": 1.0, "millimeter": 1.0, "cm": 10.0, "m": 1000.0, "meter": 1000.0, "in": 25.4, "inch": 25.4}
"""Units of length in millimetres."""
LEFT_EYE = frozenset(("eyel", "leye", "lefteye", "eyeleft", "exl", "lex", "leyeouter", "eyelouter", "lefteyeouter"))
"""Names of a marker at the outer corner of the speaker's left eye: without capitals, spaces and underscores."""
RIGHT_EYE = frozenset(("eyer", "reye", "righteye", "eyeright", "exr", "rex", "reyeouter", "eyerouter", "righteyeouter"))
RIGID = ("forehead", "head", "nasion", "nosebridge", "glabella", "temple", "ear", "mastoid", "fhd", "lfhd", "rfhd")
"""Beginnings of names, after a side, of other markers that do not move against the skull."""
MIN_RIGID_MARKERS = 3
LARGEST_COORDINATE = 1e6
MIN_DISTANCE = 1e-3
"""Least distance of the eye corners in any frame, as a share of the median."""

DISTANCES = {"opening": (13, 14), "width": (61, 291), "outer": (0, 17)}
"""Channels that are the distance of two points."""
MARKER = re.compile(r"(?:lip|jaw|p|point)[ _]?(\d{1,3})$", re.IGNORECASE)
"""The name of a marker at a point of the face mesh."""


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
        raise InputError(f"its unit of length is {unit[:20]!r}, required one of {', '.join(UNITS)}")
    if max(float(np.abs(places).max()) for places in markers.values()) > LARGEST_COORDINATE:
        raise InputError(f"a marker is further than {LARGEST_COORDINATE:g} {unit} away; export the capture again")
    left, right = (next((name for name in markers if _plain(name) in names), "") for names in (LEFT_EYE, RIGHT_EYE))
    if not (left and right):
        return {name: places * millimetres / MILLIMETRES for name, places in markers.items()}
    rigid = [left, right]
    for name in markers:
        plain = _plain(name)
        beginnings = (plain.removeprefix("left").removeprefix("right"), plain[1:])
        if name not in rigid and any(each.startswith(RIGID) for each in beginnings):
            rigid.append(name)
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
    return {name: turned[:, len(rigid) + column] for column, name in enumerate(moving)}


def _plain(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())


def _steady(places: Array, rigid: int) -> Array:
    """Return places moved so that the first markers lie as in the first frame, by least squares [shape=(T, N, 3)].

    Source: Kabsch 1976, "A solution for the best rotation to relate two sets of vectors".
    """
    centres = places[:, :rigid].mean(axis=1, keepdims=True)
    wanted = places[0, :rigid] - centres[0]
    covariances = np.einsum("tni,nj->tij", places[:, :rigid] - centres, wanted)
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
