"""What was measured of synthetic video, clip by clip, on disk: a long run can be stopped and continued."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from video_sheets import Sheets

from lipmotion.storage.files import whole_file


@dataclass(eq=False)
class Judged:
    """What was measured of one clip, made one way.

    figures   : of its pictures
    curves    : opening, width and outer lips [each shape=(T, 3)]: ``made`` (tracked again), ``true``, ``driver``
    landmarks : mean distance of the lip points in every frame [shape=(T,)], eye distances
    seen      : frames in which both videos show a face [shape=(T,)]
    eyes_px   : distance between the eyes in the video
    sheets    : pictures to look at
    """

    figures: dict[str, float]
    curves: dict[str, NDArray[np.float64]]
    landmarks: NDArray[np.float64]
    seen: NDArray[np.bool_]
    eyes_px: float
    sheets: Sheets


def save_judged(path: Path, judged: dict[str, Judged]) -> None:
    """Write what was measured of one clip."""
    header, arrays = {}, {}
    for number, (way, each) in enumerate(judged.items()):
        worst = {name: (bad, frame) for name, (bad, frame, _) in each.sheets.worst.items()}
        header[way] = {"figures": each.figures, "eyes_px": each.eyes_px, "worst": worst}
        arrays |= {f"{number}/landmarks": each.landmarks, f"{number}/seen": each.seen}
        arrays |= {f"{number}/curves/{name}": values for name, values in each.curves.items()}
        arrays |= {f"{number}/spaced/{frame}": np.stack(pair) for frame, pair in each.sheets.spaced.items()}
        arrays |= {f"{number}/worst/{name}": np.stack(pair) for name, (_, _, pair) in each.sheets.worst.items()}
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, header=np.array(json.dumps(header)), **arrays)


def load_judged(path: Path) -> dict[str, Judged]:
    """Return what was measured of one clip."""
    judged = {}
    with np.load(path, allow_pickle=False) as stored:
        header = json.loads(str(stored["header"]))
        for number, (way, known) in enumerate(header.items()):
            parts = {name.removeprefix(f"{number}/"): stored[name] for name in stored if name.startswith(f"{number}/")}
            curves = {name[7:]: values for name, values in parts.items() if name.startswith("curves/")}
            spaced = {int(name[7:]): tuple(pair) for name, pair in parts.items() if name.startswith("spaced/")}
            worst = {name: (bad, n, tuple(parts[f"worst/{name}"])) for name, (bad, n) in known["worst"].items()}
            sheets = Sheets(spaced, worst)
            judged[way] = Judged(known["figures"], curves, parts["landmarks"], parts["seen"], known["eyes_px"], sheets)
    return judged
