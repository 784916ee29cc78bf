"""Photographs of ten sounds: a person's mouth beside the drawn ones of ``character.py``.

    python benchmarks/photographs.py CORPUS --sheet docs/images/sounds-photographs.png [--clips 200] [--rows 1]

Phones are found by aligning the words of the ``train`` recordings. Of every sound, the pictures are shown whose
opening, width and outer height in the middle of the sound are the nearest to the medians of that sound: the typical
mouths, not the most beautiful ones.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from character import LEAST_S, SOUNDS
from numpy.typing import NDArray

import lipmotion
from lipmotion.corpora.store import Corpus

CHANNELS = ("opening", "width", "outer")
ENLARGEMENT = 2


def pictures_of(corpus: Corpus, clips: int) -> dict[str, list[tuple[NDArray[np.float64], NDArray[np.uint8]]]]:
    """Return for every sound measures and picture of the middle of each of its phones, the recordings in turn."""
    phones = {phone: sound for sound, names in SOUNDS.items() for phone in names.split()}
    found: dict[str, list[tuple[NDArray[np.float64], NDArray[np.uint8]]]] = {sound: [] for sound in SOUNDS}
    for name in corpus.names("train")[:clips]:
        recording = corpus.utterance(name)
        units = lipmotion.animate(recording.audio, transcript=" ".join(recording.words or ())).units
        motion, crops = recording.track.motion, recording.track.crops
        for span in units:
            sound = phones.get(span.label.phone)
            frame = round((span.start_s + span.end_s) / 2 * motion.rate_hz)
            if sound and span.duration_s >= LEAST_S and crops is not None and frame < len(crops):
                values = np.array([motion[channel][frame] for channel in CHANNELS])
                found[sound].append((values, crops[frame]))
    return found


def main() -> None:
    """Write the sheet; print how many phones there were of each sound, and their median measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--sheet", type=Path, required=True)
    parser.add_argument("--clips", type=int, default=200)
    parser.add_argument("--rows", type=int, default=1)
    options = parser.parse_args()
    from PIL import Image, ImageDraw

    found = pictures_of(Corpus.open(options.corpus), options.clips)
    columns = []
    for sound, samples in found.items():
        values = np.array([measures for measures, _ in samples])
        median = np.median(values, axis=0)
        near = np.square(values - median).sum(axis=1).argsort(kind="stable")[: options.rows]
        columns.append(np.vstack([samples[k][1] for k in near]))
        print(
            f"{sound:3} {len(samples):4}",
            *(f"{name} {value:.3f}" for name, value in zip(CHANNELS, median, strict=True)),
        )
    picture = Image.fromarray(np.hstack(columns))
    picture = picture.resize((picture.width * ENLARGEMENT, picture.height * ENLARGEMENT), Image.Resampling.LANCZOS)
    whole = Image.new("RGB", (picture.width, picture.height + 22), "white")
    whole.paste(picture, (0, 22))
    step = picture.width // len(found)
    for n, sound in enumerate(found):
        ImageDraw.Draw(whole).text((n * step + step // 2, 11), sound, fill="black", anchor="mm", font_size=15)
    whole.save(options.sheet, optimize=True)


if __name__ == "__main__":
    main()
