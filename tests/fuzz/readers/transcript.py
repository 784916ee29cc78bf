"""What is said: text to words, words to phones, phones to their places in the sound."""

from __future__ import annotations

from pathlib import Path

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import check_generation, good_model, short_speech
from lipmotion.pipeline.animate import animate

TEXTS = (
    "Hello, you 42 people.\n",
    "baby",
    "baby's mother-in-law has 1,234,567 cats; 3 o'clock!",
    "Mama. Papa? (See two maps.)\nNow five.\n",
    "ﬁve naïve ½ twenty-three £5 007 don’t",
    "qwrx zzyx bimab",
)


def seeds(_: Good) -> list[Files]:
    """Return texts with punctuation, numbers, and words that nobody knows."""
    return [{"said.txt": text.encode()} for text in TEXTS]


def read(folder: Path, good: Good) -> None:
    """Animate a short sound that is told to say this."""
    path = folder / "said.txt"
    check_generation(animate(short_speech(good), transcript=path, model=good_model(good), recogniser="own"))
