"""Contact sheets of synthetic video, original above, synthetic below; and what was measured of it, kept on disk."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from lipmotion.storage.files import atomic_file

Pictures = NDArray[np.uint8]
Pair = tuple[Pictures, Pictures]
BOX = (-75, -45, 75, 135)
"""Left, upper, right and lower edge of what is shown, px from the point between the eyes, which are 90 px apart."""
SHOWN = (225, 270)  # width and height of a picture in a sheet, px
LINE = 16  # height of a line of text, px
ROW = 9  # pictures in a row


@dataclass(eq=False)
class Sheets:
    """Crops of one clip, made one way.

    spaced : recorded and synthetic crop by number of the frame
    worst  : by name of a measure: how bad, the number of the frame, and the crops
    """

    spaced: dict[int, Pair]
    worst: dict[str, tuple[float, int, Pair]]


def face_crop(frame: Pictures, to_image: NDArray[np.float64]) -> Pictures:
    """Return the face in a frame [shape=(270, 225, 3)], as it is turned, but always of one size.

    to_image : map from the plane of the lips, as of ``map_face``
    """
    scale = float(np.sqrt(abs(np.linalg.det(to_image[:, :2]))))
    x, y = to_image[:, 2]
    left, top, right, bottom = (edge * scale for edge in BOX)
    box = (x + left, y + top, x + right, y + bottom)
    return np.asarray(Image.fromarray(frame).transform(SHOWN, Image.Transform.EXTENT, box, Image.Resampling.BICUBIC))


def write_sheets(folder: Path, sheets: Mapping[str, Mapping[str, Sheets]]) -> None:
    """Write the sheets of every way and clip: evenly spaced frames, frames in a row, worst frames, all ways.

    sheets : by way and name of the clip
    """
    folder.mkdir(parents=True, exist_ok=True)
    for way, clips in sheets.items():
        stem = re.sub(r"[^a-z0-9]+", "-", way.lower()).strip("-")
        for name, sheet in clips.items():
            if sheet.spaced:
                numbers = list(sheet.spaced)
                spaced, together = numbers[:ROW], numbers[ROW:]
                write(folder / f"{stem}-{name}.png", [(f"{name} {n}", sheet.spaced[n]) for n in spaced])
                following = [(f"{name} {n}", sheet.spaced[n]) for n in sorted({*together, *spaced}) if n >= 30]
                write(folder / f"{stem}-{name}-in-a-row.png", following[: 2 * ROW])
        for measure in {key for sheet in clips.values() for key in sheet.worst}:
            found = [(*sheet.worst[measure], name) for name, sheet in clips.items() if measure in sheet.worst]
            found.sort(key=lambda each: -each[0])
            worst = [(f"{name} {n}: {abs(bad):.3g}", pair) for bad, n, pair, name in found[: 2 * ROW]]
            write(folder / f"{stem}-worst-{measure}.png", worst)
    write_ways(folder, {way: clips for way, clips in sheets.items() if any(sheet.spaced for sheet in clips.values())})


def write_ways(folder: Path, sheets: Mapping[str, Mapping[str, Sheets]]) -> None:
    """Write one sheet a clip with a row a way."""
    first = next(iter(sheets.values()), {})
    for name, sheet in first.items():
        if not sheet.spaced:
            continue
        numbers = list(sheet.spaced)[:ROW]
        rows = []
        for way, clips in sheets.items():
            pictures = np.concatenate([clips[name].spaced[n][1] for n in numbers], axis=1)
            rows += [text(way, pictures.shape[1]), pictures]
        save(folder / f"ways-{name}.png", rows)


def write(path: Path, pairs: Sequence[tuple[str, Pair]]) -> None:
    """Write pairs of pictures, the first above the second, with a line of text."""
    rows = []
    for start in range(0, len(pairs), ROW):
        part = list(pairs[start : start + ROW])
        blank = np.zeros_like(part[0][1][0])
        part += [("", (blank, blank))] * (ROW - len(part) if start else 0)
        rows += [np.concatenate([text(label, SHOWN[0]) for label, _ in part], axis=1)]
        rows += [np.concatenate([pair[side] for _, pair in part], axis=1) for side in (0, 1)]
    if rows:
        save(path, rows)


def save(path: Path, rows: Sequence[Pictures]) -> None:
    """Write rows of pictures as a PNG, quickly: there are hundreds of sheets."""
    Image.fromarray(np.concatenate(rows)).save(path, compress_level=1)


def text(label: str, width: int) -> Pictures:
    """Return a line of text as a picture."""
    image = Image.new("RGB", (width, LINE), "white")
    ImageDraw.Draw(image).text((4, 2), label, fill="black")
    return np.asarray(image)


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
    with atomic_file(path) as temporary, temporary.open("wb") as file:
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
