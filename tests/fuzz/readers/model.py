"""Model files, and the motion generated with them."""

from __future__ import annotations

from pathlib import Path

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import check_generation, short_speech
from lipmotion import animate, load_model
from lipmotion.pipeline.request import Request


def seeds(good: Good) -> list[Files]:
    """Return a model of every engine."""
    return [{"a.lipmotion": path.read_bytes()} for path in good.models]


def read(folder: Path, good: Good) -> None:
    """Load a model; animate short speech, without and with a transcript."""
    model = load_model(folder / "a.lipmotion")
    for text in (None, "baby"):
        check_generation(animate(Request(short_speech(good), transcript=text, recogniser="own"), model=model))
