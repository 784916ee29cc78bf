"""Filmed faces, and frames that are made with them."""

import tempfile
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np

from fuzz.inputs import Files, Good
from fuzz.plausible import require
from lipmotion import load_face, save_face
from lipmotion.types import Motion
from lipmotion_faces.film.filmed_video import make_film
from testing.toy_face import toy_face

FRAMES = 3
FEW = slice(6)
"""Candidates of the good face: a small file is changed in more places."""
CODES = 1e6
"""Largest plausible coefficient of a picture, grey levels."""


def seeds(_: Good) -> list[Files]:
    """Return a face with few candidates."""
    return [{"a.face": _small()}]


@cache
def _small() -> bytes:
    face = toy_face(3)
    whole = face.appearance
    few = {
        name: getattr(whole, name)[FEW] for name in ("mouths", "mouth_codes", "mouth_distances", "jaws", "jaw_codes")
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.face"
        save_face(replace(face, appearance=replace(whole, **few), takes=face.takes[:1]), path)
        return path.read_bytes()


def read(folder: Path, _: Good) -> None:
    """Load a face, describe it, and make a few frames of motion that its own channels can hold."""
    face = load_face(folder / "a.face")
    require(all(len(line) < 10_000 for line in face.summary.values()), "a description that is too long")
    needed = face.appearance.from_motion
    poses = needed.mean + np.linspace(-1, 1, FRAMES)[:, None] * needed.scale
    channels = face.takes[0].motion.channels if face.takes else ()
    known = {channel.name: channel for channel in channels}
    if any(name not in known for name in needed.names):
        return
    motion = Motion(poses, 25.0, tuple(known[name] for name in needed.names))
    codes = face.appearance.predict_codes(motion)
    for values in (codes.mouth, codes.jaw, codes.chin_px):
        require(bool(np.isfinite(values).all()), "codes that are not finite")
        require(float(np.abs(values).max(initial=0.0)) <= CODES, "codes that are absurd")
    height, width = face.background.video.size
    for frame in islice(make_film(face, motion, fps=25.0).frames, FRAMES):
        require(frame.shape == (height, width, 3) and frame.dtype == np.uint8, "a frame of another shape")
