"""The tree of English words by their phones, and how probable words are after others: what a search for words needs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion.units import PHONES, is_silent
from lipmotion.units.lexicon import find_english_data
from lipmotion.units.phones import FULL_FORMS

SOUNDS = tuple(phone for phone in PHONES if not is_silent(phone) and phone not in FULL_FORMS)
"""The phones of the dictionary."""
NUMBER = {spelling: number for number, phone in enumerate(SOUNDS) for spelling in (phone, phone.upper())}
MOST_WORDS = 40_000
"""So many words are searched, the most probable ones."""
LONGEST_WORD = 20
"""Words of more phones are not searched."""
LANGUAGE_WEIGHT = 0.8
"""Weight of the logarithms of the probabilities of words beside those of the posteriors."""
LEAST_LOG_PROBABILITY = -40.0
"""Words that are less probable are not in the language model."""
NO_WORD = -1

Indices = NDArray[np.int32]


class LanguageModel:
    """The trigrams of pocketsphinx's language model of English.

    words : what the numbers of words stand for
    """

    def __init__(self, words: tuple[str, ...], model: Any, log_base: float):
        self.words = words
        self._model, self._log_base = model, log_base
        self._known: dict[tuple[int, ...], float] = {}

    def score(self, word: int, before: tuple[int, ...]) -> float:
        """Return the weighted logarithm of the probability of a word after up to two others, the last one first."""
        key = (word, *before)
        score = self._known.get(key)
        if score is None:
            names = [self.words[number] for number in key]
            score = self._known[key] = LANGUAGE_WEIGHT * self._model.prob(names) * self._log_base
        return score


@dataclass(frozen=True, eq=False)
class WordTree:
    """The tree of V nodes and A arcs in which words that begin alike share their first phones.

    sound      : the phone of each node, in ``SOUNDS`` [shape=(V,)]; that of the root, the first node, does not count
    score      : of the most probable word below each node, 0 for the root [shape=(V,)]
    first_arc, arcs : the arcs that leave each node [each shape=(V,)]
    target     : the node that each arc leads to [shape=(A,)]
    ends       : numbers of the words that end in a node, where there are some
    is_end     : whether there are some [shape=(V,)]
    free       : the first of those nodes, one of each phone, that follow one another in any order, outside of words
    """

    sound: Indices
    score: NDArray[np.float64]
    first_arc: Indices
    arcs: Indices
    target: Indices
    ends: dict[int, list[int]]
    is_end: NDArray[np.bool_]
    free: int


class EnglishWords(NamedTuple):
    """What a search for English words needs."""

    tree: WordTree
    language: LanguageModel


@cache
def english_words() -> EnglishWords:
    """Return tree and language model of English; they are made once, in about a second.

    Raises MissingDependencyError: pocketsphinx is not installed, or without its language model.
    """
    try:
        from pocketsphinx import Config, LogMath, NGramModel

        log_math = LogMath()
        model = NGramModel(Config(), log_math, str(find_english_data() / "en-us.lm.bin"))
    except (ImportError, RuntimeError) as error:
        raise MissingDependencyError(
            f"words are recognised with the language model of pocketsphinx ({error}): pip install pocketsphinx"
        ) from error
    base = float(np.log(log_math.exp(1)))
    pronounced = _pronunciations()
    names = list(pronounced)
    scores = np.array([model.prob([word]) for word in pronounced]) * base
    chosen = np.argsort(-scores, kind="stable")[:MOST_WORDS]
    chosen = chosen[scores[chosen] > LEAST_LOG_PROBABILITY]
    words = np.array([names[number] for number in chosen.tolist()])
    numbers = [_numbers(pronounced[word]) for word in words.tolist()]
    del pronounced, names  # no string of theirs is kept, which would keep the memory of many
    tree = word_tree(numbers, scores[chosen] * LANGUAGE_WEIGHT)
    return EnglishWords(tree, LanguageModel(tuple(words.tolist()), model, base))


def _pronunciations() -> dict[str, list[str]]:
    """Return the pronunciations of every word: those of the dictionary, and those that phone networks write."""
    found: dict[str, list[str]] = {}
    written = resources.files(__package__).joinpath("written_words.txt").read_text(encoding="ascii")
    lines = (find_english_data() / "cmudict-en-us.dict").read_text(encoding="utf-8")
    for line in (lines + written).splitlines():
        word, _, phones = line.partition(" ")
        if word[-1] == ")":
            word = word[:-3]
        if word in found:
            found[word].append(phones)
        else:
            found[word] = [phones]
    return found


def _numbers(pronunciations: list[str]) -> list[bytes]:
    """Return the numbers of the phones in ``SOUNDS``, a byte a phone, of all pronunciations that are short enough."""
    each = (bytes(map(NUMBER.__getitem__, pronunciation.split())) for pronunciation in pronunciations)
    return [phones for phones in each if len(phones) <= LONGEST_WORD]


def word_tree(pronunciations: list[list[bytes]], scores: NDArray[np.float64]) -> WordTree:
    """Return the tree of words.

    pronunciations : of each word, as numbers in ``SOUNDS``
    scores         : of each word [shape=(W,)]
    """
    pairs = sorted((phones, word) for word, variants in enumerate(pronunciations) for phones in set(variants))
    padded = [phones.ljust(LONGEST_WORD, b"\xff") for phones, _ in pairs]
    rows = np.frombuffer(b"".join(padded), np.uint8).reshape(-1, LONGEST_WORD)
    lengths = np.array([len(phones) for phones, _ in pairs])
    words = np.array([word for _, word in pairs])
    inside = np.arange(LONGEST_WORD) < lengths[:, None]
    differs = np.ones(rows.shape, bool)
    differs[1:] = np.logical_or.accumulate(rows[1:] != rows[:-1], axis=1)
    new = differs & inside
    node = np.where(new, np.cumsum(new, dtype=np.int32).reshape(rows.shape), 0)
    node = np.maximum.accumulate(node, axis=0)  # rows of the same beginning share its nodes
    count = int(new.sum()) + 1
    score = np.full(count + len(SOUNDS), -np.inf)
    np.maximum.at(score, node[inside], np.broadcast_to(scores[words][:, None], rows.shape)[inside])
    score[0] = 0
    score[count:] = 0
    parent = np.concatenate([np.zeros((len(rows), 1), np.intp), node[:, :-1]], axis=1)[new]
    sound = np.concatenate([[0], rows[new], np.arange(len(SOUNDS))]).astype(np.int32)
    free = np.arange(count, count + len(SOUNDS))
    sources = np.concatenate([parent, np.zeros(len(SOUNDS), np.intp), np.repeat(free, len(SOUNDS))])
    targets = np.concatenate([np.arange(1, count), free, np.tile(free, len(SOUNDS))])
    order = np.argsort(sources, kind="stable")
    arcs = np.bincount(sources, minlength=count + len(SOUNDS))
    ends: dict[int, list[int]] = {}
    last = node[np.arange(len(rows)), lengths - 1]
    for place, word in zip(last.tolist(), words.tolist(), strict=True):
        ends.setdefault(place, []).append(word)
    ends |= {place: [NO_WORD] for place in free.tolist()}
    return WordTree(
        sound,
        score,
        (np.cumsum(arcs) - arcs).astype(np.int32),
        arcs.astype(np.int32),
        targets[order].astype(np.int32),
        ends,
        np.isin(np.arange(count + len(SOUNDS)), list(ends)),
        count,
    )
