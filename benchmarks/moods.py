"""Moods of the faces: a sheet of all, a test for a reader who does not know which mood is which, and closures in each.

    python benchmarks/moods.py --sheet docs/images/moods.jpg
    python benchmarks/moods.py --blind blind.png --key key.json --seed 1
    python benchmarks/moods.py --score "sad happy ..." --key key.json
    python benchmarks/moods.py --closures

The sheet shows every mood on four faces, on two of them at rest, on two in a vowel. The test shows stills of random
faces, moods (the neutral one among them, each may come several times) and moments of a sentence; the reader names one
mood for every number before the key is read. The closures are those of p, b and m: in how many the lips touch.
"""

from __future__ import annotations

import argparse
import json
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

import lipmotion
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.pipeline.outputs.delivered import shown
from lipmotion.types.moods import MOODS, NEUTRAL
from lipmotion.units import closing_phones
from lipmotion_faces.base import DrawsSingly, Staging
from lipmotion_faces.registry import staged_face

EXAMPLES = Path(__file__).parents[1] / "examples"
FACES = ("woman", "man", "cartoon", "head")
ALL = (NEUTRAL, *MOODS)
FPS = 25.0
REST_S, VOWEL_S = 0.2, 1.04
LABEL = 14
QUALITY = 88
Picture = NDArray[np.uint8]


@cache
def spoken() -> lipmotion.Generation:
    """Return the motion of the example."""
    said = lipmotion.Request(EXAMPLES / "welcome.flac", transcript=EXAMPLES / "welcome.txt")
    return lipmotion.animate(said)


def still(face: str, mood: str, time_s: float, size: int, seed: int = 0) -> Picture:
    """Return one picture of a face in a mood, square."""
    seen = shown(spoken(), lipmotion.Delivery(mood=mood), FPS)
    staged = staged_face(face, Staging(size=size, seed=seed, blinks=False))
    assert isinstance(staged, DrawsSingly)
    picture = staged.drawn(seen.motion, seen.units, fps=FPS).picture(round(time_s * FPS))
    left = (picture.shape[1] - size) // 2
    return np.asarray(picture[:, left : left + size])


def pasted(pictures: list[tuple[str, Picture]], columns: int) -> Image.Image:
    """Return pictures with a text over each, row by row."""
    size = len(pictures[0][1])
    sheet = Image.new("RGB", (columns * size, -(-len(pictures) // columns) * (size + LABEL)), "white")
    draw = ImageDraw.Draw(sheet)
    for number, (text, picture) in enumerate(pictures):
        x, y = number % columns * size, number // columns * (size + LABEL)
        draw.text((x + 4, y + 1), text, fill="black")
        sheet.paste(Image.fromarray(picture), (x, y + LABEL))
    return sheet


def sheet(path: Path, size: int) -> None:
    """Write every mood on every face, at rest or in a vowel."""
    rows = list(zip(FACES, (REST_S, VOWEL_S) * 2, strict=True))
    pictures = [
        (mood if face == FACES[0] else "", still(face, mood, time_s, size)) for face, time_s in rows for mood in ALL
    ]
    pasted(pictures, len(ALL)).save(path, quality=QUALITY, optimize=True)


def blind(path: Path, key: Path, seed: int, count: int, size: int) -> None:
    """Write numbered stills of random moods, and which these are."""
    draw = np.random.default_rng(seed)
    last_s = spoken().motion.time_s[-1] - 0.3
    chosen = [(str(draw.choice(FACES)), str(draw.choice(ALL)), float(draw.uniform(0.1, last_s))) for _ in range(count)]
    pictures = [(str(number + 1), still(*each, size, number)) for number, each in enumerate(chosen)]
    pasted(pictures, 8).save(path)
    key.write_text(json.dumps(chosen), encoding="utf-8")


def score(answers: list[str], key: Path) -> None:
    """Print how many answers are right, by mood, and which are not."""
    chosen = json.loads(key.read_text(encoding="utf-8"))
    assert len(answers) == len(chosen), f"{len(answers)} answers, required {len(chosen)}"
    right = [answer == mood for answer, (_, mood, _) in zip(answers, chosen, strict=True)]
    print(f"{sum(right)} of {len(right)} right")
    for mood in ALL:
        found = [hit for hit, (_, asked, _) in zip(right, chosen, strict=True) if asked == mood]
        print(f"  {mood:10} {sum(found)} of {len(found)}")
    for number, (answer, each) in enumerate(zip(answers, chosen, strict=True), 1):
        if answer != each[1]:
            print(f"  {number}: {each[0]}, {each[1]} at {each[2]:.2f} s read as {answer}")


def closures() -> None:
    """Print in how many p, b and m the lips touch, and in how many frames, in each mood."""
    for mood in ALL:
        seen = shown(spoken(), lipmotion.Delivery(mood=mood), FPS)
        mouth, time_s = spoken_mouth(seen.motion, seen.units), seen.motion.time_s
        pairs = zip(seen.units, closing_phones(seen.units), strict=True)
        touching = [
            int(mouth.contact[(span.start_s <= time_s) & (time_s <= span.end_s)].sum())
            for span, closing in pairs
            if closing
        ]
        print(f"{mood:10} closures {sum(map(bool, touching))} of {len(touching)}, frames {sum(touching)}")


def main() -> None:
    """Do what the options ask for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--blind", type=Path)
    parser.add_argument("--key", type=Path)
    parser.add_argument("--score")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--size", type=int, default=200)
    parser.add_argument("--closures", action="store_true")
    options = parser.parse_args()
    if options.sheet:
        sheet(options.sheet, options.size)
    if options.blind:
        blind(options.blind, options.key, options.seed, options.count, options.size)
    if options.score:
        score(options.score.split(), options.key)
    if options.closures:
        closures()


if __name__ == "__main__":
    main()
