"""Transcripts: text to words, words to phones, and forced alignment of the phones."""

from __future__ import annotations

from pathlib import Path

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import check_generation, good_model, short_speech
from lipmotion import animate
from lipmotion.pipeline.request import Request

TEXTS = (
    "baby",
    "Hi, 2!\n",
    "Mama's \u201cmap\u201d, ﬁve\n",
    "o'clock: 1,000\n",
    "Hello, you 42 people.\n",
    "baby's mother-in-law has 1,234,567 cats; 3 o'clock! (See two maps.)\nNow £5, 007, ½, twenty-three.\n",
    "naïve qwrx zzyx",
    "1\n00:00:00,100 --> 00:00:00,600\n<i>Baby</i>\n",
    '{"result": [{"word": "baby", "start": 0.1, "end": 0.5}], "text": "baby"}',
)
"""Some are too long for the sound, or have words without a pronunciation; the last ones have times."""


def seeds(_: Good) -> list[Files]:
    """Return texts with punctuation, numbers, and unknown words."""
    return [{"said.txt": text.encode()} for text in TEXTS]


def read(folder: Path, good: Good) -> None:
    """Animate short speech with the transcript."""
    path = folder / "said.txt"
    check_generation(animate(Request(short_speech(good), transcript=path, recogniser="own"), model=good_model(good)))
