"""What is said: text to words, words to phones, phones to their places in the sound."""

from __future__ import annotations

from pathlib import Path

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import check_generation, good_model, short_speech
from lipmotion.pipeline.animate import animate
from lipmotion.pipeline.request import SpeechRequest

TEXTS = (
    "baby",
    "Hi, 2!\n",
    "Mama's \u201cmap\u201d, ﬁve\n",
    "o'clock: 1,000\n",
    "Hello, you 42 people.\n",
    "baby's mother-in-law has 1,234,567 cats; 3 o'clock! (See two maps.)\nNow £5, 007, ½, twenty-three.\n",
    "naïve qwrx zzyx",
)
"""Those at the end are too long for the sound, or cannot be said."""


def seeds(_: Good) -> list[Files]:
    """Return texts with punctuation, numbers, and words that nobody knows."""
    return [{"said.txt": text.encode()} for text in TEXTS]


def read(folder: Path, good: Good) -> None:
    """Animate a short sound that is told to say this."""
    path = folder / "said.txt"
    check_generation(
        animate(SpeechRequest(short_speech(good), transcript=path, recogniser="own"), model=good_model(good))
    )
