"""The appearance of a person, serialised as arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.eigenlips import Eigenlips, eigenlips_arrays, eigenlips_from_arrays
from lipmotion.motion.mouth_region import HEIGHT as MOUTH_HEIGHT
from lipmotion.motion.mouth_region import WIDTH as MOUTH_WIDTH
from lipmotion.storage.coded_video import decode_pictures, encode_pictures
from lipmotion.storage.schema import Arrays, ArraySpec, arrays_under, check_arrays, format_errors, refuse_undeclared
from lipmotion_faces.appearance.camera_noise import camera_noise_arrays, camera_noise_from_arrays
from lipmotion_faces.appearance.candidates import LARGEST_COEFFICIENT
from lipmotion_faces.appearance.lower_face import (
    CORNER,
    HEIGHT,
    LARGEST_SCALE,
    NARROWEST_PX,
    WIDEST_PX,
    WIDTH,
    FaceShape,
)
from lipmotion_faces.appearance.motion_map import motion_map_arrays, motion_map_from_arrays
from lipmotion_faces.appearance.person import Appearance

Pictures = NDArray[np.uint8]

CRF = 6.0
"""Quality of the pictures: detail is what they are kept for."""
PARTS = ("mouth", "jaw", "from_motion", "noise")
"""Prefixes of the names of the arrays of parts."""
REMEDY = "build the face again"
"""What to do about a damaged file."""


def appearance_arrays(appearance: Appearance) -> dict[str, NDArray[Any]]:
    """Return the appearance of a person serialised as arrays (``APPEARANCE`` and those of ``PARTS``).

    Pictures are coded (``storage.coded_video``), which changes them by about one grey level.
    """
    parts = {
        "mouth": eigenlips_arrays(appearance.mouth),
        "jaw": eigenlips_arrays(appearance.jaw),
        "from_motion": motion_map_arrays(appearance.from_motion),
        "noise": camera_noise_arrays(appearance.noise),
    }
    arrays = {f"{part}/{name}": array for part, inner in parts.items() for name, array in inner.items()}
    shape = appearance.shape
    return arrays | {
        "shape": np.array([shape.half_width_px, shape.bottom_px]),
        "scale": np.array(appearance.scale),
        "light": appearance.light,
        "mouths": encode_pictures(appearance.mouths, CRF),
        "mouth_codes": appearance.mouth_codes,
        "jaws": encode_pictures(appearance.jaws, CRF),
        "jaw_codes": appearance.jaw_codes,
        "from_mouth": appearance.from_mouth,
        "from_sound": appearance.from_sound,
        **({} if appearance.mouth_distances is None else {"mouth_distances": appearance.mouth_distances}),
    }


def appearance_from_arrays(arrays: Arrays) -> Appearance:
    """Deserialise the appearance of a person.

    Raises ModelFormatError: an array is missing, unknown, out of range, or the parts do not fit together.
    """
    inner = {part: arrays_under(arrays, f"{part}/") for part in PARTS}
    own = {name: array for name, array in arrays.items() if name.partition("/")[0] not in PARTS or "/" not in name}
    with format_errors("the appearance of the person", REMEDY):
        refuse_undeclared(own, APPEARANCE)
        mouth, jaw = (eigenlips_from_arrays(inner[part], REMEDY) for part in ("mouth", "jaw"))
        _check_size("mouth", mouth, (MOUTH_HEIGHT, MOUTH_WIDTH))
        _check_size("jaw", jaw, (HEIGHT, WIDTH))
        codes, jaw_codes = len(mouth.channels), len(jaw.channels)
        stored = check_arrays(own, APPEARANCE, C=codes, K=jaw_codes, F=codes + 1, J=jaw_codes + 1)
        scale = int(stored["scale"])
        half_width_px, bottom_px = stored["shape"].tolist()
        if not NARROWEST_PX <= half_width_px <= WIDEST_PX or not CORNER[1] < bottom_px < CORNER[1] + HEIGHT:
            raise ValueError(f"a lower face of {half_width_px:g} px to {bottom_px:g} px below the eyes")
        return Appearance(
            FaceShape(half_width_px, bottom_px),
            scale,
            stored["light"],
            mouth,
            _decoded(stored["mouths"], len(stored["mouth_codes"]), MOUTH_HEIGHT * scale, MOUTH_WIDTH * scale),
            stored["mouth_codes"],
            stored.arrays.get("mouth_distances"),
            jaw,
            _decoded(stored["jaws"], len(stored["jaw_codes"]), HEIGHT * scale, WIDTH * scale),
            stored["jaw_codes"],
            motion_map_from_arrays(inner["from_motion"], codes + jaw_codes + 1),
            stored["from_mouth"],
            stored["from_sound"],
            camera_noise_from_arrays(inner["noise"]),
        )


APPEARANCE = {
    "shape": ArraySpec(np.float64, "2", 0, 1000),
    "scale": ArraySpec(np.intp, "", 1, LARGEST_SCALE),
    "light": ArraySpec(np.float64, "3", 1, 255),
    "mouths": ArraySpec(np.uint8, "A", 0, 255),
    "mouth_codes": ArraySpec(np.float32, "N C", -LARGEST_COEFFICIENT, LARGEST_COEFFICIENT),
    "mouth_distances": ArraySpec(np.float64, "N 3", -100, 100, optional=True),
    "jaws": ArraySpec(np.uint8, "B", 0, 255),
    "jaw_codes": ArraySpec(np.float32, "M K", -LARGEST_COEFFICIENT, LARGEST_COEFFICIENT),
    "from_mouth": ArraySpec(np.float32, "F J", -LARGEST_COEFFICIENT, LARGEST_COEFFICIENT),
    "from_sound": ArraySpec(np.float32, "2 J", -LARGEST_COEFFICIENT, LARGEST_COEFFICIENT),
}
"""The arrays of an appearance, beside those of its parts."""


def _check_size(name: str, space: Eigenlips, size: tuple[int, int]) -> None:
    if space.size != size:
        raise ValueError(f"pictures of the {name} of {space.size} px, required {size}")


def _decoded(data: Pictures, count: int, height: int, width: int) -> Pictures:
    pictures = decode_pictures(data)
    if pictures.shape != (count, height, width, 3):
        raise ValueError(f"pictures of shape {pictures.shape}, required ({count}, {height}, {width}, 3)")
    return pictures
