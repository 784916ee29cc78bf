"""Pronunciations of words that are in no dictionary, by the network of ``hama``, where it is installed.

Of 1,000 words of the dictionary that it is not shown, 8 % of the phones are wrong, 27 % by rules (``units.spelling``);
but it was probably trained on these words. Of 400 made-up words, 20 % and 23 % are not those of espeak-ng
(docs/results/languages.md).
"""

from __future__ import annotations

from functools import cache, lru_cache
from importlib.util import find_spec
from typing import Any

from lipmotion.units.ipa_phones import token_phones

LONGEST_WORD = 30
"""Letters of the longest word that is read by the network: longer ones are web addresses and noise."""


@lru_cache(maxsize=4096)
def network_pronunciation(word: str) -> tuple[str, ...]:
    """Return the phones of a lower-case word in plain letters; empty: ``hama`` is not installed, or has no phones."""
    network = _network() if len(word) <= LONGEST_WORD else None
    if network is None:
        return ()
    return tuple(phone for phone, _ in token_phones([each.phoneme for each in network.predict(word).alignments]))


@cache
def _network() -> Any:
    """Return the network; None: it is not installed, or has no library for this system."""
    if find_spec("hama") is None:
        return None
    try:
        from hama.inference import G2PModel

        return G2PModel()
    except (ImportError, OSError, RuntimeError):
        return None
