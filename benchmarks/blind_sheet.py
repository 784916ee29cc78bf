"""Ten mouths as a test for a reader who does not know which sound is behind which.

    python benchmarks/blind_sheet.py --face head --seed 1 -o blind.png --key key.json
    python benchmarks/blind_sheet.py --photographs CORPUS --seed 1 -o blind.png --key key.json
    python benchmarks/blind_sheet.py --face head --tokens 20 --seed 1 -o blind.png --key key.json
    python benchmarks/blind_sheet.py --score "oo p ee ..." --key key.json

Of each of the sounds p b m f v th oo w aa ee one mouth is shown, in the middle of the sound: the one whose opening,
width and outer height in the motion are the nearest to the medians of that sound (of the sentences of
``character.py``, or of the photographs of ``photographs.py``). They are shuffled, enlarged and numbered; the key says
which sound is behind which number. The reader names one of the ten for every number, each once. ``--score`` counts
the right ones: of the sounds, and of the visemes (p b m look alike on people, too, and so do f and v). With
``--tokens`` that many mouths are shown, each of a random sound and a random phone of it: sounds may come twice or not
at all, and nothing follows by elimination. For the portrait of an earlier version: PYTHONPATH=OLD/src, ``--face
portrait``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from character import LEAST_S, SENTENCES, SOUNDS, VISEME, drawn
from numpy.typing import NDArray

import lipmotion

CHANNELS = ("opening", "width", "outer")
FPS = 50.0
MOUTHS = {"head": (0.60, 0.86, 0.17)}
"""Upper and lower edge, and half the width of the mouth's picture, in parts of the height of the face's picture."""
MOUTH = (0.545, 0.82, 0.145)
HEIGHT, TITLE = 220, 22
"""Height of an enlarged mouth and of its number, in pixels."""
Pictures = dict[str, list[tuple[NDArray[np.float64], NDArray[np.uint8]]]]


def drawn_mouths(face: str) -> Pictures:
    """Return measures and picture of the middle of every phone of the ten sounds."""
    top, bottom, half = MOUTHS.get(face, MOUTH)
    phones = {phone: sound for sound, names in SOUNDS.items() for phone in names.split()}
    found: Pictures = {sound: [] for sound in SOUNDS}
    for sentence in SENTENCES:
        _, spoken = lipmotion.speak(sentence)
        motion = spoken.motion
        frames = list(drawn(face, motion, spoken.units, FPS, True))
        for span in spoken.units:
            sound, middle = phones.get(span.label.phone), (span.start_s + span.end_s) / 2
            if sound and span.duration_s >= LEAST_S:
                frame = frames[min(round(middle * FPS), len(frames) - 1)]
                high, wide = frame.shape[:2]
                left, right = int(wide / 2 - half * high), int(wide / 2 + half * high)
                values = [
                    motion[name][min(round(middle * motion.rate_hz), len(motion.values) - 1)] for name in CHANNELS
                ]
                found[sound].append((np.array(values), frame[int(top * high) : int(bottom * high), left:right]))
    return found


def typical(samples: list[tuple[NDArray[np.float64], NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """Return the picture whose measures are the nearest to the medians."""
    values = np.array([measures for measures, _ in samples])
    return samples[int(np.square(values - np.median(values, axis=0)).sum(axis=1).argmin())][1]


def main() -> None:
    """Write the shuffled picture and its key, or score the answers of a reader."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--face")
    parser.add_argument("--photographs", type=Path, metavar="CORPUS")
    parser.add_argument("--tokens", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--key", type=Path, required=True)
    parser.add_argument("--score", help="the reader's ten names, in the order of the numbers")
    options = parser.parse_args()
    if options.score is not None:
        said, right = options.score.split(), json.loads(options.key.read_text())
        same = [VISEME.get(one, one) == VISEME.get(other, other) for one, other in zip(said, right, strict=True)]
        sounds = sum(one == other for one, other in zip(said, right, strict=True))
        print(f"{sounds} sounds, {sum(same)} visemes of {len(right)}")
        return
    from PIL import Image, ImageDraw

    if options.photographs:
        from photographs import pictures_of

        from lipmotion.corpora.store import Corpus

        found = pictures_of(Corpus.open(options.photographs), 200)
    else:
        found = drawn_mouths(options.face)
    rng = np.random.default_rng(options.seed)
    if options.tokens:
        order = rng.choice(list(SOUNDS), options.tokens).tolist()
        mouths = [found[sound][rng.integers(len(found[sound]))][1] for sound in order]
    else:
        order = rng.permutation(list(SOUNDS)).tolist()
        mouths = [typical(found[sound]) for sound in order]
    wide, high = HEIGHT * mouths[0].shape[1] // mouths[0].shape[0], HEIGHT + TITLE
    picture = Image.new("RGB", (5 * wide, -(-len(mouths) // 5) * high), "white")
    for number, mouth in enumerate(mouths):
        x, y = number % 5 * wide, number // 5 * high
        picture.paste(Image.fromarray(mouth).resize((wide, HEIGHT), Image.Resampling.LANCZOS), (x, y + TITLE))
        ImageDraw.Draw(picture).text((x + wide // 2, y + TITLE // 2), str(number + 1), fill="black", anchor="mm")
    picture.save(options.output)
    options.key.write_text(json.dumps(order))


if __name__ == "__main__":
    main()
