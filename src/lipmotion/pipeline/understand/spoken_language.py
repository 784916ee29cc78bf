"""Whether a recording is in English, by the words that a network for the phones of any speaker divides it into."""

from __future__ import annotations

from importlib.util import find_spec
from itertools import groupby

import numpy as np

from lipmotion.types import Audio
from lipmotion.units.ipa_phones import token_phones
from lipmotion.units.languages_told import is_english

PART_S, PARTS = 14.0, 2
"""The first seconds of a recording are listened to, in parts of this length: the network's memory grows with it."""
WORD_BOUNDARY, BLANK = "<wb>", "<blank>"


def english_spoken(audio: Audio) -> bool | None:
    """Return whether a recording is in English; None: not known, or ``hama`` is not installed.

    audio : at 16 kHz
    The network writes every language with the phones of English: it cannot say which other one it is.
    """
    if find_spec("hama") is None:
        return None
    try:
        from hama.asr import ASRModel  # type: ignore[import-untyped]

        model, tokens = ASRModel(), list[str]()
    except (ImportError, OSError, RuntimeError):  # it has no library for this system
        return None
    count = int(PART_S * audio.rate_hz)
    for first in range(0, min(len(audio.samples), PARTS * count), count):
        samples = np.ascontiguousarray(audio.samples[first : first + count], np.float32)
        frames = model(samples, audio.rate_hz).frame_token_ids
        tokens += [model.decoder_tokens[number] for number, _ in groupby(frames)] + [WORD_BOUNDARY]
    spoken = (token for token in tokens if token != BLANK)
    words = (list(group) for ends, group in groupby(spoken, WORD_BOUNDARY.__eq__) if not ends)
    return is_english(tuple(phone for phone, _ in token_phones(word)) for word in words)
