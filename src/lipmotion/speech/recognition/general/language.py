"""A bigram of English phones."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion.speech.recognition.general.acoustic import GENERAL_PHONE_NAMES, PHONES
from lipmotion.units.lexicon import find_english_data

PROBABILITY_SHARE = {
    "ah": 0.3, "ax": 0.7, "er": 0.4, "axr": 0.6, "ih": 0.55, "ix": 0.45,
    "l": 0.93, "el": 0.07, "m": 0.99, "em": 0.01, "n": 0.96, "en": 0.04, "sp": 1e-4, "+nsn+": 0.05, "+spn+": 0.05,
}  # fmt: skip
"""The share of each of our phones in the probability of the general phone that it is a form of; all others: 1."""


def english_bigram(units: Sequence[str]) -> NDArray[np.float64]:
    """Return P(next | unit) among some of our phones and the noises [shape=(V, V)]; the noises count as silence.

    Raises MissingDependencyError: pocketsphinx is not installed.
    """
    kinds = _phones()
    spelt = ["SIL" if unit.startswith("+") else GENERAL_PHONE_NAMES.get(unit, unit.upper()) for unit in units]
    rows = [kinds.index(name) for name in spelt]
    pairs = _phone_bigram()[np.ix_(rows, rows)] * np.array([PROBABILITY_SHARE.get(unit, 1.0) for unit in units])
    return pairs / pairs.sum(axis=1, keepdims=True)


def _phones() -> list[str]:
    return [phone for phone in PHONES if not phone.startswith("+")]


@cache
def _phone_bigram() -> NDArray[np.float64]:
    """Return P(next | phone) of the phone language model that comes with pocketsphinx."""
    try:
        from pocketsphinx import Config, LogMath, NGramModel
    except ImportError as error:
        raise MissingDependencyError(
            "the phone language model comes with pocketsphinx: pip install pocketsphinx"
        ) from error
    log_math = LogMath()
    model = NGramModel(Config(), log_math, str(find_english_data() / "en-us-phone.lm.bin"))
    names = _phones()
    return np.array([[log_math.exp(model.prob([following, phone])) for following in names] for phone in names])
