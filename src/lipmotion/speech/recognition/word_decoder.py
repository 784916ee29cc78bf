"""Recognition of English words: pocketsphinx's decoder, with the models and the language model of its package."""

from __future__ import annotations

import re
import threading
from functools import cache
from typing import Any, NamedTuple

from lipmotion.errors import MissingDependencyError
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.units.lexicon import find_english_data


class FoundWord(NamedTuple):
    """A word in lower case, and its posterior probability among all words of the search, 0 to 1."""

    text: str
    posterior: float


VARIANT = re.compile(r"\(\d+\)$")
"""The number of a pronunciation behind a word."""
OPTIONS = {"fwdflat": False, "maxhmmpf": 10_000}
"""One pass over the tree of all words finds more phones, and faster, than with a second one over the words that it
found (docs/decisions/recognition.md)."""
_LOCK = threading.Lock()
"""A decoder works on one recording at a time."""


def words_in(samples: bytes) -> tuple[FoundWord, ...]:
    """Return the words that are recognised in a stretch of sound; none if there are none.

    samples : 16-bit integers at 16 kHz
    The words are those of the best path of the search. Their posteriors are those of the best path through its lattice,
    0 where that has another word: it finds fewer words, but knows how many others were possible.
    Raises MissingDependencyError: pocketsphinx is not installed, or without its language model.
    """
    decoder = _decoder()
    with _LOCK:
        decoder.reinit_feat()  # else its estimate of the noise depends on what it decoded before
        decoder.start_utt()
        if samples:
            decoder.process_raw(samples, no_search=False, full_utt=True)
        found = _segments(decoder)
        decoder.end_utt()
        lattice = _segments(decoder)
    return tuple(
        FoundWord(one.word, max((two.posterior for two in lattice if _same(one, two)), default=0.0)) for one in found
    )


class _Segment(NamedTuple):
    word: str
    first: int
    last: int
    posterior: float


def _segments(decoder: Any) -> list[_Segment]:
    """Return the words of the decoder's present best path, and their frames."""
    entries = decoder.seg() if decoder.hyp() is not None else ()
    return [
        _Segment(VARIANT.sub("", entry.word), entry.start_frame, entry.end_frame, min(max(entry.prob, 0.0), 1.0))
        for entry in entries
        if not is_filler(entry.word)
    ]


def _same(one: _Segment, two: _Segment) -> bool:
    return one.word == two.word and max(one.first, two.first) <= min(one.last, two.last)


def is_filler(word: str) -> bool:
    """Return whether an entry of pocketsphinx's dictionaries is silence or noise: ``<sil>``, ``[NOISE]``."""
    return word[:1] in ("<", "[", "+")


@cache
def _decoder() -> Any:
    """Return the decoder of this process; it is loaded once, in 0.2 s."""
    folder = find_english_data()
    try:
        from pocketsphinx import Decoder

        return Decoder(
            hmm=str(folder / "en-us"),
            lm=str(folder / "en-us.lm.bin"),
            dict=str(folder / "cmudict-en-us.dict"),
            samprate=SPEECH_RATE_HZ,
            loglevel="FATAL",
            **OPTIONS,
        )
    except (ImportError, RuntimeError) as error:
        raise MissingDependencyError(
            f"words are recognised by pocketsphinx and its language model ({error}): pip install pocketsphinx"
        ) from error
