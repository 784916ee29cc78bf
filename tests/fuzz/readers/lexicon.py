"""Pronunciations, and alignment with them."""

from __future__ import annotations

from pathlib import Path

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import check_generation, good_model, require, short_speech
from lipmotion import animate
from lipmotion.pipeline.request import Request
from lipmotion.units import PHONES, Lexicon

TEXTS = (
    "# mine\nlipmotion L IH1 P M OW1 SH AH0 N\nnäh N EH\nlive(2) l ay v\n",
    "baby B EY1 B IY0\nbaby(2) b ey b ix\n'bout b aw t # short\n\n",
    "two T UW1\n2 t uw\n",
)


def seeds(_: Good) -> list[Files]:
    """Return small lexicons."""
    return [{"words.dict": text.encode()} for text in TEXTS]


def read(folder: Path, good: Good) -> None:
    """Read a lexicon; align short speech with its first word."""
    lexicon = Lexicon.from_file(folder / "words.dict")
    for word, pronunciations in lexicon.user.items():
        require(lexicon.known(word), "a word that is not known")
        require(all(set(phones) <= set(PHONES) for phones in pronunciations), "a phone that is none")
    words = " ".join(list(lexicon.user)[:1])
    request = Request(short_speech(good), words or "baby", lexicon=lexicon, recogniser="own")
    check_generation(animate(request, model=good_model(good)))
