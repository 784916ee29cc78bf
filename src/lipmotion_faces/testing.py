"""The check of the contract of faces."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.testing.check_engine import example, require, require_error
from lipmotion.types import Timeline, Unit
from lipmotion_faces.base import TRANSPARENT, Face, Stageable, Staging


def check_face(face: Face) -> None:
    """Check that a face draws motion as ``Face.render`` says, and is staged as ``Stageable`` says if it can be.

    Raises ContractError: what was found.
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
    if isinstance(face, Stageable):

        def draw_first(**settings: Any) -> NDArray[np.uint8]:
            return next(iter(face.with_staging(Staging(**settings)).render(one.motion, one.speech.units, fps=10.0)))

        small = draw_first(size=64)
        require(small.shape[0] == 64, f"a picture {small.shape[0]} pixels high, required the 64 that were asked for")
        clear = draw_first(size=64, background=TRANSPARENT)
        require(clear.shape == (*small.shape[:2], 4), f"transparent frames of shape {clear.shape}, required RGBA")
        require(bool(np.any(clear[..., 3] == 0)), "no pixel is transparent")
        require(isinstance(face.with_staging(Staging()), Face), "a staged face is no face")
