"""Sheets of a panel: strips of mouths, all enlarged alike."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

Pictures = NDArray[np.uint8]
PAIR_PX, ROW_PX = 310, {"closures": 176, "sounds": 206}
"""Width of an enlarged picture, px."""
ACROSS, STRIPS = 4, 6
"""Pictures in a row of a pair, and strips on a sheet."""
LINE, MARGIN = 18, 40
"""Height of a line of text, and width of the column of names, px."""


def write_pair(path: Path, number: int, both: Sequence[Pictures], labels: Sequence[str]) -> None:
    """Write two strips, A above B, each in rows, with a label for every picture."""
    rows = []
    for name, strip in zip("AB", both, strict=True):
        for start in range(0, len(strip), ACROSS):
            part = slice(start, start + ACROSS)
            rows.append(_row(f"{number} {name}" if not start else "", strip[part], labels[part], PAIR_PX))
    _save(path, rows)


def write_rows(folder: Path, sheet: str, strips: Sequence[tuple[int, Pictures]]) -> None:
    """Write strips below one another, a few on a sheet; their pictures are numbered."""
    for start in range(0, len(strips), STRIPS):
        rows = [
            _row(str(number), strip, [str(n + 1) for n in range(len(strip))], ROW_PX[sheet])
            for number, strip in strips[start : start + STRIPS]
        ]
        _save(folder / f"{sheet}-{start // STRIPS + 1:02}.png", rows)


def _row(name: str, strip: Pictures, labels: Sequence[str], wide: int) -> Image.Image:
    high = round(wide * strip.shape[1] / strip.shape[2])
    row = Image.new("RGB", (MARGIN + wide * len(strip), LINE + high), "white")
    text = ImageDraw.Draw(row)
    text.text((4, LINE + high // 2), name, fill="black", anchor="lm", font_size=15)
    for n, (frame, label) in enumerate(zip(strip, labels, strict=True)):
        enlarged = Image.fromarray(frame).resize((wide, high), Image.Resampling.LANCZOS)
        row.paste(enlarged, (MARGIN + n * wide, LINE))
        text.text((MARGIN + n * wide + wide // 2, LINE // 2), label, fill="black", anchor="mm", font_size=14)
    return row


def _save(path: Path, rows: Sequence[Image.Image]) -> None:
    whole = Image.new("RGB", (max(row.width for row in rows), sum(row.height for row in rows)), "white")
    below = 0
    for row in rows:
        whole.paste(row, (0, below))
        below += row.height
    whole.save(path, compress_level=1)
