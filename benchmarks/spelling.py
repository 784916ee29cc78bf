"""Measures of letter-to-sound: our rules and the network of ``hama``, on words that both read without a dictionary.

    python benchmarks/spelling.py [--words 1000] [--made-up 400]

One JSON object a line: shares of phones and of visemes that are wrong (edit distance over the length of the nearest
pronunciation), and of words that are right. ``dictionary``: words of pocketsphinx's dictionary, against it; the network
was probably trained on these words. ``made up``: the beginning of one word and the end of another, against espeak-ng.
"""

from __future__ import annotations

import argparse
import json
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from lipmotion.speech.voices.pronunciations import espeak_pronunciations
from lipmotion.units import VISEME_OF, Pronunciation
from lipmotion.units.lexicon import english_data, network_pronunciation
from lipmotion.units.spelling import guess_pronunciation

FULL = {"ax": ("ah",), "axr": ("er",), "ix": ("ih",), "el": ("ah", "l"), "en": ("ah", "n"), "em": ("ah", "m")}
"""Phones that the dictionary writes otherwise."""
WAYS = {"rules": guess_pronunciation, "network": network_pronunciation}


def main() -> None:
    """Measure both ways on both kinds of words."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--words", type=int, default=1000)
    parser.add_argument("--made-up", type=int, default=400)
    options = parser.parse_args()
    said: dict[str, list[Pronunciation]] = defaultdict(list)
    for line in (english_data() / "cmudict-en-us.dict").read_text(encoding="utf-8").lower().splitlines():
        word, *phones = line.split()
        said[re.sub(r"\(\d+\)$", "", word)].append(tuple(phones))
    words = [word for word in said if re.fullmatch("[a-z]{3,}", word)]
    chance = np.random.default_rng(28)
    sample = [str(word) for word in chance.choice(words, options.words, replace=False)]
    made_up: dict[str, None] = {}
    while len(made_up) < options.made_up:
        first, last = map(str, chance.choice(words, 2))
        word = first[: len(first) // 2 + 1] + last[len(last) // 2 :]
        if word not in said and len(word) <= 10:
            made_up[word] = None
    by_espeak = espeak_pronunciations(list(made_up), "en-us")
    for kind, right in (("dictionary", {word: said[word] for word in sample}), ("made up", by_espeak)):
        for name, way in WAYS.items():
            found = {word: _full(way(word)) for word in right}
            print(json.dumps({"words": kind, "by": name} | scores(found, right)), flush=True)


def scores(found: Mapping[str, Pronunciation], right: Mapping[str, Sequence[Pronunciation]]) -> dict[str, float]:
    """Return the shares of wrong phones and visemes, and of right words."""
    wrong = visemes = length = whole = 0
    for word, phones in found.items():
        nearest = min(map(_full, right[word]), key=lambda other: distance(phones, other))
        errors = distance(phones, nearest)
        wrong, length, whole = wrong + errors, length + len(nearest), whole + (not errors)
        visemes += distance([VISEME_OF[phone] for phone in phones], [VISEME_OF[phone] for phone in nearest])
    return {
        "phones wrong": round(wrong / length, 3),
        "visemes wrong": round(visemes / length, 3),
        "words right": round(whole / len(found), 3),
    }


def distance(one: Sequence[str], other: Sequence[str]) -> int:
    """Return the edit distance of two sequences."""
    costs = list(range(len(other) + 1))
    for row, left in enumerate(one, 1):
        before, costs[0] = costs[0], row
        for column, right in enumerate(other, 1):
            before, costs[column] = (
                costs[column],
                min(costs[column] + 1, costs[column - 1] + 1, before + (left != right)),
            )
    return costs[-1]


def _full(phones: Pronunciation) -> Pronunciation:
    return tuple(full for phone in phones for full in FULL.get(phone, (phone,)))


if __name__ == "__main__":
    main()
