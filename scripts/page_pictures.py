"""Draw the pictures of the pages "for ..." (docs/for) that need no other program.

python scripts/page_pictures.py     (needs matplotlib, which the dev requirements bring)
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from numpy.typing import NDArray

import lipmotion
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion_faces import Staging, stage_face

IMAGES = Path(__file__).parent.parent / "docs" / "images"
SENTENCE = "Five big boats follow you far up the little river. My father will call."
FPS = 24.0
SHAPES = "ABCDEFGHX"
CURVES = ("jawOpen", "mouthFunnel", "mouthPucker", "mouthStretchLeft", "mouthPressLeft")
Frame = NDArray[np.uint8]


def main() -> None:
    """Write docs/images/for-rhubarb.png, for-2d.png and for-arkit.png."""
    mpl.use("agg")
    _, spoken = lipmotion.speak(SENTENCE)
    sheet = lipmotion.cues(spoken, fps=FPS)
    cartoon = drawn("cartoon", spoken, 480)
    mouths = shapes(sheet, cartoon, spoken.motion)
    strip(sheet, mouths)
    curves(spoken, drawn("head", spoken, 480))


def drawn(face: str, spoken: lipmotion.Generation, size: int) -> list[Frame]:
    """Return the frames of a face of which only the mouth moves."""
    still = dict.fromkeys(("blinks", "gaze", "brows", "head"), False)
    return list(stage_face(face, Staging(size=size, **still)).render(spoken.motion, spoken.units, fps=FPS))


def mouth(frame: Frame) -> Frame:
    """Return the mouth of a cartoon."""
    high, wide = frame.shape[:2]
    return frame[int(0.53 * high) : int(0.83 * high), int(0.34 * wide) : int(0.66 * wide)]


def shapes(sheet: lipmotion.CueSheet, frames: list[Frame], motion: lipmotion.Motion) -> dict[str, Frame]:
    """Draw and return the mouth in the middle of the longest cue of every shape; of C and D, where it opens most."""
    mouths = {}
    opening = motion.resampled(FPS)["opening"]
    for cue in sorted(sheet.cues, key=lambda cue: cue.duration_s):
        shown = int((cue.start_s + cue.end_s) / 2 * FPS)
        if cue.label in "CD":
            held = [n for each in sheet.cues if each.label == cue.label for n in frames_of(each)]
            shown = max(held, key=lambda n: float(opening[n]))
        mouths[cue.label] = mouth(frames[shown])
    figure, row = plt.subplots(1, len(SHAPES), figsize=(12, 1.5), dpi=100)
    for axes, shape in zip(row, SHAPES, strict=True):
        axes.imshow(mouths[shape])
        axes.set_title(shape)
        axes.axis("off")
    figure.savefig(IMAGES / "for-rhubarb.png", bbox_inches="tight")
    return mouths


def frames_of(cue: lipmotion.Span[str]) -> range:
    """Return the frames in which a cue is held."""
    return range(int(cue.start_s * FPS), int(cue.end_s * FPS))


def strip(sheet: lipmotion.CueSheet, mouths: dict[str, Frame]) -> None:
    """Draw the first cues one after the other, with the frames at which they begin."""
    first = [cue for cue in sheet.cues if cue.label != "X"][:14]
    figure, row = plt.subplots(1, len(first), figsize=(12, 1.2), dpi=100)
    for axes, cue in zip(row, first, strict=True):
        axes.imshow(mouths[cue.label])
        axes.set_title(f"{1 + int(FPS * cue.start_s)} {cue.label}", family="monospace", fontsize=9)
        axes.axis("off")
    figure.subplots_adjust(wspace=0.02)
    figure.savefig(IMAGES / "for-2d.png", bbox_inches="tight")


def curves(spoken: lipmotion.Generation, frames: list[Frame]) -> None:
    """Plot blendshape weights below the head that shows the same motion."""
    weights = make_curves(spoken.motion, spoken.units, "arkit")
    from_s, to_s, shown = 0.3, 2.7, 8
    figure, (above, below) = plt.subplots(2, 1, figsize=(12, 4), dpi=100, height_ratios=(1, 1.2))
    times = from_s + (np.arange(shown) + 0.5) * (to_s - from_s) / shown
    heads = [frames[int(time_s * FPS)] for time_s in times]
    high, wide = heads[0].shape[:2]
    cut = slice(int(0.42 * high), int(0.85 * high)), slice(wide // 2 - int(0.26 * high), wide // 2 + int(0.26 * high))
    above.imshow(np.hstack([head[cut] for head in heads]), aspect="auto")
    above.axis("off")
    for name in CURVES:
        below.plot(weights.time_s, weights[name], label=name)
    below.set_xlim(from_s, to_s)
    below.set_ylim(0, 0.5)
    below.set_xlabel("time (s)")
    below.set_ylabel("weight")
    below.spines[["top", "right"]].set_visible(False)
    below.legend(loc="upper right", fontsize=7, ncols=len(CURVES))
    figure.subplots_adjust(hspace=0.03)
    figure.savefig(IMAGES / "for-arkit.png", bbox_inches="tight")


if __name__ == "__main__":
    main()
