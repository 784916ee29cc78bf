"""A row of a sheet of ten sounds as a test for a reader who does not know which mouth is which.

    python benchmarks/blind_sheet.py docs/images/sounds.png --row 0 --seed 1 -o blind.png --key key.json
    python benchmarks/blind_sheet.py --score "oo p ee ..." --key key.json

The ten mouths are cut out, shuffled, enlarged and numbered; the key says which sound is behind which number. The
reader names one of p b m f v th oo w aa ee for every number, each once. ``--score`` counts the right ones: of the
sounds, and of the visemes (p b m look alike on people, too, and so do f and v).
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from character import SOUNDS, VISEME

TITLE = 22
"""Height of the line of names at the top of a sheet, in pixels."""
HEIGHT = 220
"""Height of an enlarged mouth, in pixels."""


def main() -> None:
    """Write the shuffled picture and its key, or score the answers of a reader."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sheet", type=Path, nargs="?")
    parser.add_argument("--row", type=int, default=0)
    parser.add_argument("--rows", type=int, default=1, help="rows of the sheet")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--key", type=Path, required=True)
    parser.add_argument("--score", help="the reader's ten names, in the order of the numbers")
    options = parser.parse_args()
    if options.score is not None:
        said, right = options.score.split(), json.loads(options.key.read_text())
        same = [VISEME.get(one, one) == VISEME.get(other, other) for one, other in zip(said, right, strict=True)]
        print(sum(one == other for one, other in zip(said, right, strict=True)), "sounds,", sum(same), "visemes of 10")
        return
    from PIL import Image, ImageDraw

    whole = Image.open(options.sheet).convert("RGB")
    high, wide = (whole.height - TITLE) // options.rows, whole.width // len(SOUNDS)
    order = np.random.default_rng(options.seed).permutation(len(SOUNDS))
    size = (HEIGHT * wide // high, HEIGHT)
    picture = Image.new("RGB", (5 * size[0], 2 * (size[1] + TITLE)), "white")
    for number, column in enumerate(order):
        top = TITLE + options.row * high
        mouth = whole.crop((column * wide, top, (column + 1) * wide, top + high)).resize(size, Image.Resampling.LANCZOS)
        x, y = number % 5 * size[0], number // 5 * (size[1] + TITLE)
        picture.paste(mouth, (x, y + TITLE))
        ImageDraw.Draw(picture).text((x + size[0] // 2, y + TITLE // 2), str(number + 1), fill="black", anchor="mm")
    picture.save(options.output)
    options.key.write_text(json.dumps([list(SOUNDS)[column] for column in order]))


if __name__ == "__main__":
    main()
