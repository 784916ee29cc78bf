"""Tools for tests of faces: the check of their contract, and the toy corpus as videos."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.storage.files import atomic_file, make_folder
from lipmotion.testing.check_engine import require, require_error
from lipmotion.testing.examples import example
from lipmotion.testing.toy import CAMERA_HZ, MOTION_HZ, toy_motion, toy_sentences
from lipmotion.types import Timeline, Unit
from lipmotion.units import is_silent
from lipmotion_faces.base import TRANSPARENT, Face, Stageable, Staging
from lipmotion_faces.portrait import Woman
from lipmotion_faces.video.mp4 import write_mp4

FACE_HEIGHT = 256


def check_face(face: Face) -> None:
    """Check that a face draws motion as ``Face.render`` says, and is staged as ``Stageable`` says if it can be.

    Raises ContractError: what was found.

    >>> from lipmotion_faces import make_face
    >>> check_face(make_face("portrait"))
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

        def first(**settings: Any) -> NDArray[np.uint8]:
            return next(iter(face.with_staging(Staging(**settings)).render(one.motion, one.speech.units, fps=10.0)))

        small = first(size=64)
        require(small.shape[0] == 64, f"a picture {small.shape[0]} pixels high, required the 64 that were asked for")
        clear = first(size=64, background=TRANSPARENT)
        require(clear.shape == (*small.shape[:2], 4), f"transparent frames of shape {clear.shape}, required RGBA")
        require(bool(np.any(clear[..., 3] == 0)), "no pixel is transparent")
        require(isinstance(face.with_staging(Staging()), Face), "a staged face is no face")


def write_toy_recordings(directory: Path, *, sentences: int = 12, seed: int = 0, fps: float = CAMERA_HZ) -> list[Path]:
    """Write the toy corpus as recordings: ``toy00.mp4``, ``toy00.txt``, ..., and the three lists; return the videos.

    directory : made if it does not exist; files of the same names are replaced
    Each video takes about half a second.
    Raises InputError: fewer than three sentences, or fps not positive; ExportError: a file cannot be written.
    """
    spoken = toy_sentences(sentences, seed)
    make_folder(directory)
    videos = [directory / f"{sentence.name}.mp4" for sentence in spoken]
    face = Woman(Staging(size=FACE_HEIGHT, blinks=False, gaze=False, brows=False, head=False))
    for sentence, video in zip(spoken, videos, strict=True):
        motion = toy_motion(sentence.units, MOTION_HZ)
        silence = Timeline(tuple(span for span in sentence.units if is_silent(span.label.phone)))  # no shapes of phones
        write_mp4(video, face.render(motion, silence, fps=fps), fps=fps, audio=sentence.audio)
        _write_lines(video.with_suffix(".txt"), [" ".join(sentence.words)])
    for split in ("train", "val", "test"):
        _write_lines(directory / f"{split}.txt", [sentence.name for sentence in spoken if sentence.split == split])
    return videos


def _write_lines(path: Path, lines: list[str]) -> None:
    with atomic_file(path) as temporary:
        temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
