"""Draw the strip at the top of the README: a recorded speaker, and beside them the 3D head, moved by the sound alone.

python scripts/moving_strip.py MODEL VIDEO     (needs the extra 'video')

MODEL must not have learned from VIDEO. What stands there: GRID s1, a model of ``train``, clip lgiz5a of ``test``.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import lipmotion
from lipmotion.motion.eigenlips import EYE_DISTANCE_PX
from lipmotion_faces import Staging
from lipmotion_faces.tracking.track import Footage, decode_footage, track_footage

STRIP = Path(__file__).parent.parent / "docs" / "images" / "strip.webp"
WIDTH_PX, HEIGHT_PX = 300, 340
EYES_PX, EYES_AT_PX = 112.0, (150.0, 145.0)
"""Distance between the outer eye corners in both halves, and the place of its middle."""
QUALITY = 72


def main() -> None:
    """Write docs/images/strip.webp."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("video", type=Path)
    given = parser.parse_args()
    recorded = track_footage(given.video)
    said = lipmotion.animate(given.video, model=lipmotion.load_model(given.model))
    with tempfile.TemporaryDirectory() as folder:
        head = Path(folder) / "head.mp4"
        lipmotion.write(said, head, speech=given.video, face="head", staging=Staging(size=720), fps=recorded.rate_hz)
        drawn = track_footage(head)
        halves = [pictures(footage) for footage in (recorded, drawn)]
    frames = [Image.fromarray(np.hstack(pair)) for pair in zip(*halves, strict=False)]
    frames[0].save(
        STRIP,
        save_all=True,
        append_images=frames[1:],
        loop=0,
        duration=round(1000 / recorded.rate_hz),
        quality=QUALITY,
        method=6,
    )
    print(f"{len(frames)} frames, {STRIP.stat().st_size / 1e6:.2f} MB")


def pictures(footage: Footage) -> list[NDArray[np.uint8]]:
    """Return the frames of a tracked video, cut and scaled alike by where the eyes are in the middle of all frames."""
    place = np.median(footage.face_to_image, axis=0)
    px = float(np.sqrt(abs(np.linalg.det(place[:, :2])))) * EYE_DISTANCE_PX / EYES_PX
    left, top = place[:, 2] - px * np.array(EYES_AT_PX)
    cut = (left, top, left + px * WIDTH_PX, top + px * HEIGHT_PX)
    whole = [Image.fromarray(frame) for frame in decode_footage(footage)]
    return [np.asarray(each.resize((WIDTH_PX, HEIGHT_PX), Image.Resampling.LANCZOS, cut)) for each in whole]


if __name__ == "__main__":
    main()
