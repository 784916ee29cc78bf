"""Recognition of English words: pocketsphinx's decoder, with the models and the language model of its package."""

from __future__ import annotations

import re
import threading
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion.speech.audio_files import SPEECH_RATE_HZ
from lipmotion.speech.mfcc import HOP
from lipmotion.speech.voice_activity import Stretch
from lipmotion.types import Audio
from lipmotion.units.lexicon import english_data

VARIANT = re.compile(r"\(\d+\)$")
"""The number of a pronunciation behind a word."""
OPTIONS = {"fwdflat": False, "bestpath": False, "maxhmmpf": 10_000}
"""One pass over the tree of all words finds more phones, and faster, than with a second one over the words that it
found, and with a best path through their lattice (decision 13)."""
FULL_SCALE = 32767
_LOCK = threading.Lock()
"""A decoder works on one recording at a time."""


def stretch_samples(audio: Audio, stretch: Stretch) -> bytes:
    """Return the samples of a stretch as 16-bit integers, which ``words_in`` takes."""
    samples: NDArray[np.float32] = audio.samples[stretch.first * HOP : stretch.end * HOP]
    return (np.clip(samples, -1, 1) * FULL_SCALE).astype("<i2").tobytes()


def words_in(samples: bytes) -> tuple[str, ...]:
    """Return the words that are recognised in a stretch of sound, in lower case; none if there are none.

    samples : 16-bit integers at 16 kHz
    Raises MissingDependencyError: pocketsphinx is not installed, or without its language model.
    """
    decoder = _decoder()
    with _LOCK:
        decoder.start_utt()
        if samples:
            decoder.process_raw(samples, no_search=False, full_utt=True)
        decoder.end_utt()
        found = [segment.word for segment in decoder.seg()] if decoder.hyp() is not None else []
    return tuple(VARIANT.sub("", word) for word in found if not is_filler(word))


def is_filler(word: str) -> bool:
    """Return whether an entry of pocketsphinx's dictionaries is silence or noise: ``<sil>``, ``[NOISE]``."""
    return word[:1] in ("<", "[", "+")


@cache
def _decoder() -> Any:
    """Return the decoder of this process; it is loaded once, in 0.2 s."""
    folder = english_data()
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
