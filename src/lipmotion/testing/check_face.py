"""The contract of faces: ``check_face(face)``."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np

from lipmotion.errors import InputError
from lipmotion.faces.base import Face
from lipmotion.testing.contract import require, require_error
from lipmotion.testing.examples import example
from lipmotion.types import Timeline, Unit


def check_face(face: Face) -> None:
    """Check that a face draws motion as ``Face.render`` says.

    Raises ContractError: what was found.

    >>> from lipmotion.faces import face_named
    >>> check_face(face_named("portrait"))
    """
    one = example(("m", "aa"))
    motion, units = one.motion, one.speech.units
    frames = list(face.render(motion, units, fps=10.0))
    count = int((len(motion.values) - 1) / motion.rate_hz * 10.0 + 1e-9) + 1
    require(len(frames) == count, f"{len(frames)} frames, required {count}")
    shape = frames[0].shape
    even = len(shape) == 3 and shape[2] == 3 and shape[0] % 2 == 0 and shape[1] % 2 == 0
    require(even, f"frames of shape {shape}, required (H, W, 3), H and W even")
    require(all(x.shape == shape and x.dtype == np.uint8 for x in frames), "frames of different shapes, or not uint8")
    require(any(np.any(x != frames[0]) for x in frames), "the picture does not move")
    again = face.render(motion, Timeline[Unit](()), fps=10.0)
    require(next(iter(again)).shape == shape, "without units, frames of another shape")
    same = zip(islice(face.render(motion, units, fps=10.0), 3), frames, strict=False)
    require(all(np.array_equal(a, b) for a, b in same), "the same input gives other pixels")
    broken = replace(motion, values=np.full_like(motion.values, np.nan))
    require_error(InputError, lambda: list(face.render(broken, units, fps=10.0)), "values that are not finite")
    require_error(InputError, lambda: list(face.render(motion, units, fps=0.0)), "fps of 0")
