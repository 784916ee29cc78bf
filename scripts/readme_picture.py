"""Draw the picture of the README from real output: the face, its mouth over time, the curve behind it.

python scripts/readme_picture.py     (needs matplotlib, which the dev requirements bring)
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

import lipmotion
from lipmotion_faces import Staging, stage_face

ROOT = Path(__file__).parent.parent
FPS = 25.0
SHOWN_S = (0.45, 2.55)
PORTRAIT_S = 1.3
COLUMNS = 7


def main() -> None:
    """Write docs/images/welcome.png."""
    mpl.use("agg")
    speech = ROOT / "examples" / "welcome.flac"
    result = lipmotion.animate(speech, transcript=(ROOT / "examples" / "welcome.txt").read_text())
    frames = list(stage_face("head", Staging(size=720)).render(result.motion, result.units, fps=FPS))
    figure = plt.figure(figsize=(12, 4.2), dpi=110)
    grid = figure.add_gridspec(2, COLUMNS + 4, height_ratios=(1, 1.7), hspace=0, wspace=0.05)
    portrait = figure.add_subplot(grid[:, :4])
    portrait.imshow(frames[round(PORTRAIT_S * FPS)][:, 280:1000])
    portrait.axis("off")
    for column, time_s in enumerate(telling_times(result)):
        mouth = figure.add_subplot(grid[0, 4 + column])
        mouth.imshow(frames[round(time_s * FPS)][440:610, 540:740])
        mouth.axis("off")
    curve(figure.add_subplot(grid[1, 4:]), result)
    figure.savefig(ROOT / "docs" / "images" / "welcome.png", bbox_inches="tight")


def telling_times(result: lipmotion.Generation) -> list[float]:
    """Return when the first closures and open vowels are reached."""
    opening, times = result.motion["opening"], []
    for span in result.units:
        frames = np.arange(int(span.start_s * 100), int(span.end_s * 100) + 1)
        if span.label.phone in ("p", "m"):
            times.append(frames[opening[frames].argmin()] / 100)
        elif span.label.phone in ("iy", "ay"):
            times.append(frames[opening[frames].argmax()] / 100)
    return times[:COLUMNS]


def curve(axes: plt.Axes, result: lipmotion.Generation) -> None:
    """Plot the opening with its error band, and the phones below it."""
    time_s, opening = result.motion.time_s, result.motion["opening"]
    band = 2 * np.sqrt(result.variance[:, result.motion.names.index("opening")])
    axes.fill_between(time_s, np.maximum(opening - band, 0), opening + band, color="#d9695f", alpha=0.2, lw=0)
    axes.plot(time_s, opening, color="#b0413e")
    for span in result.units:
        axes.axvline(span.start_s, color="#cccccc", lw=0.5)
        if SHOWN_S[0] <= (span.start_s + span.end_s) / 2 <= SHOWN_S[1]:
            axes.text((span.start_s + span.end_s) / 2, -0.018, span.label.phone, ha="center", fontsize=8)
    axes.set_xlim(*SHOWN_S)
    axes.set_ylim(-0.03, 1.1 * float(opening[(time_s > 0.45) & (time_s < 2.55)].max()))
    axes.set_xlabel("time (s)")
    axes.yaxis.tick_right()
    axes.yaxis.set_label_position("right")
    axes.set_ylabel("opening (eye distances)")
    axes.spines[["top", "left"]].set_visible(False)


if __name__ == "__main__":
    main()
