"""Write how the phone network ``hama`` spells English words, for the search of words in its posteriors.

    python scripts/written_words.py

It was trained on phones that its own letter-to-sound network wrote, so it finds "w ey" where somebody says "we".
Of the most frequent words of pocketsphinx's language model, those spellings are kept that are not in the dictionary.
hama is licensed under Apache-2.0.
"""

from __future__ import annotations

import unicodedata
from pathlib import Path

from hama.inference import G2PModel

from lipmotion.speech.recognition.network.beam_search import load_english
from lipmotion.speech.recognition.network.posteriors import PhoneRecogniser
from lipmotion.units import Lexicon
from lipmotion.units.ipa_phones import read_tokens
from lipmotion.units.phones import FULL_FORMS

MAX_WORDS = 4000
TARGET = Path(__file__).parents[1] / "src" / "lipmotion" / "speech" / "recognition" / "network" / "written_words.txt"


def main() -> None:
    """Write the file."""
    network = G2PModel()
    tokens = sorted((token for token in PhoneRecogniser().tokens if not token.startswith("<")), key=len, reverse=True)
    lines = []
    for word in load_english().words[:MAX_WORDS]:
        known = {tuple(FULL_FORMS.get(phone, phone) for phone in each) for each in Lexicon().pronunciations(word)}
        ipa = unicodedata.normalize("NFC", network.predict(word).ipa).replace("ɾ", "ɹ")  # it spells many an r as a tap
        phones = spelt(ipa, tokens)
        if word.replace("'", "").isalpha() and phones and phones not in known:
            lines.append(f"{word} {' '.join(phones)}\n")
    TARGET.write_text("".join(lines), encoding="ascii")


def spelt(ipa: str, tokens: list[str]) -> tuple[str, ...]:
    """Return the phones of a word in IPA, as the dictionary tells them apart.

    tokens : of the network, the longest first
    """
    found, at = [], 0
    while at < len(ipa):
        token = next((token for token in tokens if ipa.startswith(token, at)), "")
        found.append(token)
        at += len(token) or 1
    return tuple(FULL_FORMS.get(phone, phone) for phone, _ in read_tokens(list(filter(None, found))))


if __name__ == "__main__":
    main()
