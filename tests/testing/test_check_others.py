from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.formats import MotionFormat
from lipmotion.formats.base import MOTION_FORMATS
from lipmotion.testing import ContractError, check_exporter
from lipmotion_faces import Face, make_face
from lipmotion_faces.testing import check_face


class Bars(Face):
    """A small face that keeps the contract."""

    def render(self, motion: Any, units: Any, *, fps: float = 25.0) -> Iterator[Any]:  # noqa: ARG002
        if not fps > 0 or not np.isfinite(motion.values).all():
            raise InputError("not drawable")
        for value in motion.resampled(fps)["opening"]:
            yield np.full((64, 64, 3), int(np.clip(value, 0, 1) * 255), np.uint8)


def draw(frames: Callable[[list[Any]], list[Any]], *, checked: bool = True) -> Face:
    class Changed(Bars):
        def render(self, motion: Any, units: Any, *, fps: float = 25.0) -> Iterator[Any]:
            if not checked:
                motion, fps = replace(motion, values=np.nan_to_num(motion.values)), max(fps, 1.0)
            return iter(frames(list(super().render(motion, units, fps=fps))))

    return Changed()


def test_faces_that_keep_the_contract():
    check_face(Bars())
    check_face(make_face("portrait"))


def test_faces_that_break_it():
    for face, words in (
        (draw(lambda frames: frames[1:]), "frames, required"),
        (draw(lambda frames: [frame[:63] for frame in frames]), "H and W even"),
        (draw(lambda frames: [frame.astype(float) for frame in frames]), "not uint8"),
        (draw(lambda frames: [frames[0]] * len(frames)), "does not move"),
        (
            draw(lambda frames: [np.random.default_rng().integers(0, 255, x.shape).astype(np.uint8) for x in frames]),
            "other pixels",
        ),
        (draw(lambda frames: frames, checked=False), "not finite: no error"),
    ):
        with pytest.raises(ContractError, match=words):
            check_face(face)


def test_formats_that_keep_the_contract():
    for name in MOTION_FORMATS.names:
        check_exporter(MOTION_FORMATS.load(name))


def nothing(path: Path, *_: Any) -> None:
    """Write an empty file."""
    path.write_bytes(b"")


def by_chance(path: Path, *_: Any) -> None:
    """Write other bytes each time."""
    path.write_bytes(np.random.default_rng().bytes(16))


def test_formats_that_break_it():
    npz = MOTION_FORMATS.load("npz")

    def wrong(path: Path) -> Any:
        motion, units = npz.read(path)  # type: ignore[misc]
        return replace(motion, values=motion.values + 0.01), units

    def slower(path: Path) -> Any:
        motion, units = npz.read(path)  # type: ignore[misc]
        return replace(motion, rate_hz=motion.rate_hz / 2), units

    for broken, words in (
        (MotionFormat(nothing), "no file, or an empty one"),
        (MotionFormat(by_chance), "other bytes"),
        (MotionFormat(npz.write, wrong), "values come back that differ"),
        (MotionFormat(npz.write, slower), "Hz come back"),
    ):
        with pytest.raises(ContractError, match=words):
            check_exporter(broken)
