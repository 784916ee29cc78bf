"""The search for words in posteriors: the most probable sequence of words, and of phones outside of words.

Words and their neighbours decide together: a path says the phones of one word after the other, each in a row of
posteriors or several, with blanks between. Where no word fits, as of names, a path may say any phones.

Source: Graves, Fernández, Gomez and Schmidhuber 2006, "Connectionist temporal classification" (paths with blanks); Ney,
Haeb-Umbach, Tran and Oerder 1992, "Improvements in beam search" (the tree of words, and the score of the most probable
word below a node). The best path counts, not the sum of all.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion.speech.recognition.network.posteriors import WORD_BOUNDARY, PhonePosteriors
from lipmotion.units import PHONES, is_silent
from lipmotion.units.lexicon import find_english_data
from lipmotion.units.phones import FULL_FORMS

SOUNDS = tuple(phone for phone in PHONES if not is_silent(phone) and phone not in FULL_FORMS)
"""The phones of the dictionary."""
NUMBER = {spelling: number for number, phone in enumerate(SOUNDS) for spelling in (phone, phone.upper())}
MAX_WORDS = 40_000  # so many words are searched, the most probable ones
LONGEST_WORD = 20  # words of more phones are not searched
LANGUAGE_WEIGHT = 0.8  # weight of the logarithms of the probabilities of words beside those of the posteriors
MIN_LOG_PROBABILITY = -40.0  # words that are less probable are not in the language model
NO_WORD = -1

Nodes = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class WordTree:
    """The tree of V nodes and A arcs in which words that begin alike share their first phones."""

    sound: Nodes  # the phone of each node, in ``SOUNDS`` [shape=(V,)]; that of the root, the first node, does not count
    score: NDArray[np.float64]  # of the most probable word below each node, 0 for the root [shape=(V,)]
    first_arc: Nodes  # the first arc that leaves each node [shape=(V,)]
    arcs: Nodes  # how many leave it [shape=(V,)]
    target: Nodes  # the node that each arc leads to [shape=(A,)]
    ends: dict[int, list[int]]  # numbers of the words that end in a node, where there are some
    is_end: NDArray[np.bool_]  # whether there are some [shape=(V,)]
    free: int  # the first of the nodes, one of each phone, that follow one another in any order, outside of words


class EnglishWords(NamedTuple):
    """What a search for English words needs."""

    tree: WordTree
    words: tuple[str, ...]  # what the numbers of words stand for
    score: Callable[[int, tuple[int, ...]], float]
    """Returns the weighted logarithm of the probability of a word after up to two others, the last one first."""


@cache
def load_english() -> EnglishWords:
    """Return tree and language model of English; they are made once, in about a second.

    Raises MissingDependencyError: pocketsphinx is not installed, or without its language model.
    """
    try:
        from pocketsphinx import Config, LogMath, NGramModel

        log_math = LogMath()
        model = NGramModel(Config(), log_math, str(find_english_data() / "en-us.lm.bin"))
    except (ImportError, RuntimeError) as error:
        message = f"words are recognised with the language model of pocketsphinx ({error}): pip install pocketsphinx"
        raise MissingDependencyError(message) from error
    base = float(np.log(log_math.exp(1)))
    pronounced = _read_pronunciations()
    names = list(pronounced)
    scores = np.array([model.prob([word]) for word in pronounced]) * base
    chosen = np.argsort(-scores, kind="stable")[:MAX_WORDS]
    chosen = chosen[scores[chosen] > MIN_LOG_PROBABILITY]
    words = tuple(np.array([names[number] for number in chosen.tolist()]).tolist())
    coded = ([bytes(map(NUMBER.__getitem__, said.split())) for said in pronounced[word]] for word in words)
    numbers = [[phones for phones in each if len(phones) <= LONGEST_WORD] for each in coded]
    del pronounced, names  # no string of theirs is kept, which would keep the memory of many
    tree = build_word_tree(numbers, scores[chosen] * LANGUAGE_WEIGHT)

    @cache
    def score(word: int, before: tuple[int, ...]) -> float:
        return float(LANGUAGE_WEIGHT * model.prob([words[number] for number in (word, *before)]) * base)

    return EnglishWords(tree, words, score)


def _read_pronunciations() -> dict[str, list[str]]:
    """Return the pronunciations of every word: those of the dictionary, and those that phone networks write."""
    variants = defaultdict[str, list[str]](list)
    written = resources.files(__package__).joinpath("written_words.txt").read_text(encoding="ascii")
    lines = (find_english_data() / "cmudict-en-us.dict").read_text(encoding="utf-8")
    for line in (lines + written).splitlines():
        word, _, phones = line.partition(" ")
        variants[word[:-3] if word[-1] == ")" else word].append(phones)
    return variants


def build_word_tree(pronunciations: list[list[bytes]], scores: NDArray[np.float64]) -> WordTree:
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
    first_arc, is_end = (np.cumsum(arcs) - arcs).astype(np.int32), np.isin(np.arange(count + len(SOUNDS)), list(ends))
    target = targets[order].astype(np.int32)
    return WordTree(sound, score, first_arc, arcs.astype(np.int32), target, ends, is_end, count)


BEAM, MAX_PATHS = 10.0, 1000
"""Paths that are so many nats less probable than the best one, or not among so many best ones, are given up."""
MAX_ENDS = 60  # words end in so many paths of a row at most
MIN_POSTERIOR = 1e-3  # no posterior counts as less: the network is sure too often
BLANK_LOSS = 1.0
"""Nats by which no phone is less probable than the network says: it leaves phones out rather than adding some."""
WORD_GAIN = 1.0  # nats that a path wins with every word
FREE_WORD_LOSS, FREE_PHONE_LOSS = 4.0, 2.5  # nats that a path loses with phones outside of words, and with each of them
INNER_BOUNDARY_LOSS = 2.0  # nats that a path loses with a boundary of words within a word
SILENT_ROW = -0.02  # where no phone is more probable than this, as a logarithm, paths stay where they are
NEVER = -1e9

Scores = NDArray[np.float64]
Indices = NDArray[np.int64]


class DecodedWord(NamedTuple):
    """A word, and the rows of posteriors from the end of the word before to its own; empty: phones outside of words."""

    text: str
    first: int
    end: int


class Scored(NamedTuple):
    """Logarithms of what a path may do in every row."""

    sounds: Scores  # say each of ``SOUNDS`` [shape=(N, S)]
    blank: Scores  # say nothing, within a word [shape=(N,)]
    between: Scores  # the same between words [shape=(N,)]


def score_stretch(posteriors: PhonePosteriors) -> Scored:
    """Return what paths may do, by posteriors."""
    phones = np.exp(posteriors.of_phones.astype(float))
    sounds = np.zeros((len(phones), len(SOUNDS)))
    for column, phone in enumerate(PHONES):
        form = FULL_FORMS.get(phone, phone)
        if form in SOUNDS:
            sounds[:, SOUNDS.index(form)] += phones[:, column]
    boundary = np.zeros(len(phones))
    if WORD_BOUNDARY in posteriors.tokens:
        boundary = np.exp(posteriors.values[:, posteriors.tokens.index(WORD_BOUNDARY)].astype(float))
    blank = (phones[:, -1] - boundary).clip(min=0) * np.exp(-BLANK_LOSS)
    total = sounds.sum(axis=1) + blank + boundary
    sounds, blank, boundary = (
        each / total.reshape(-1, *[1] * (each.ndim - 1)) + MIN_POSTERIOR for each in (sounds, blank, boundary)
    )
    inside = blank + boundary * np.exp(-INNER_BOUNDARY_LOSS)
    return Scored(np.log(sounds), np.log(inside), np.log(np.maximum(blank, boundary)))


@dataclass
class _Paths:
    """The P paths that are followed: the best one for each node and each two last words [each shape=(P,)].

    ``blank`` and ``sound`` score the path whose last row said nothing, and said the phone of the node; ``origin`` is
    the last word that ended, by number in the history, or -1.
    """

    node: Indices
    context: Indices
    blank: Scores
    sound: Scores
    origin: Indices

    @property
    def best(self) -> Scores:
        """The better score of each path."""
        return np.maximum(self.blank, self.sound)

    def select(self, which: NDArray[np.bool_] | Indices) -> _Paths:
        """Return some of the paths."""
        return _Paths(self.node[which], self.context[which], self.blank[which], self.sound[which], self.origin[which])

    def join(self, other: _Paths) -> _Paths:
        """Return these paths and others; of those with the same node and context the better one."""
        both = _Paths(*(np.concatenate(pair) for pair in zip(vars(self).values(), vars(other).values(), strict=True)))
        key = both.node << 32 | both.context
        order = np.lexsort((both.best, key))
        ordered = key[order]
        first = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
        best = both.select(order[np.concatenate([first[1:], [len(ordered)]]) - 1])
        best.blank = np.maximum.reduceat(both.blank[order], first)
        best.sound = np.maximum.reduceat(both.sound[order], first)
        return best


@dataclass
class _BeamSearch:
    """The search through one stretch: words that ended (the one before, the word, the row after it), and contexts."""

    english: EnglishWords
    history: list[tuple[int, int, int]] = field(default_factory=list)
    contexts: dict[tuple[int, ...], int] = field(default_factory=lambda: {(): 0})
    named: list[tuple[int, ...]] = field(default_factory=lambda: [()])

    def step(self, paths: _Paths, rows: Scored, row: int) -> _Paths:
        """Return the paths after one more row of posteriors."""
        tree = self.english.tree
        sounds, between, inside = rows.sounds[row], rows.between[row], rows.blank[row]
        root = paths.node == 0
        said = np.where(root, NEVER, paths.sound + sounds[tree.sound[paths.node]])
        stay = _Paths(paths.node, paths.context, paths.best + np.where(root, between, inside), said, paths.origin)
        if max(between, inside) > SILENT_ROW:
            stay.sound = np.full(len(said), NEVER)
            return stay
        entered = self._enter(paths, sounds)
        limit = max(float(stay.best.max()), float(entered.sound.max(initial=NEVER))) - BEAM
        after = stay.select(stay.best > limit).join(entered.select(entered.sound > limit))
        after = self._end_words(after, limit, row)
        best = after.best
        within = best > best.max() - BEAM
        if within.sum() > MAX_PATHS:
            within = best >= np.partition(best, -MAX_PATHS)[-MAX_PATHS]
        return after.select(within)

    def _enter(self, paths: _Paths, sounds: Scores) -> _Paths:
        """Return the paths that go on to the next phone; between two that are the same there is a blank."""
        tree, counts = self.english.tree, self.english.tree.arcs[paths.node]
        source = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(source)) - np.repeat(np.cumsum(counts) - counts, counts)
        target = tree.target[tree.first_arc[paths.node][source] + within].astype(np.int64)
        before, sound = paths.node[source], tree.sound[target]
        same = (sound == tree.sound[before]) & (before != 0)
        score = np.where(same, paths.blank[source], paths.best[source]) + sounds[sound]
        score += tree.score[target] - tree.score[before] - FREE_PHONE_LOSS * (target >= tree.free)
        return _Paths(target, paths.context[source], np.full(len(target), NEVER), score, paths.origin[source])

    def _end_words(self, paths: _Paths, limit: float, row: int) -> _Paths:
        """Return the paths with those whose word ends in a row, which are at the root again."""
        tree = self.english.tree
        ending = np.flatnonzero(tree.is_end[paths.node] & (paths.sound > limit))
        if len(ending) > MAX_ENDS:
            ending = ending[np.argsort(-paths.sound[ending], kind="stable")[:MAX_ENDS]]
        ended: dict[tuple[int, ...], tuple[float, int, int]] = {}
        for place in ending.tolist():
            node, before = int(paths.node[place]), self.named[int(paths.context[place])]
            base, origin = float(paths.sound[place] - tree.score[node]), int(paths.origin[place])
            for word in tree.ends[node]:
                free = word == NO_WORD
                score = base - FREE_WORD_LOSS if free else base + WORD_GAIN + self.english.score(word, before)
                context = () if free else (word, *before[:1])
                if score > limit and score > ended.get(context, (NEVER,))[0]:
                    ended[context] = score, word, origin
        if not ended:
            return paths
        for context in ended:
            if context not in self.contexts:
                self.contexts[context] = len(self.named)
                self.named.append(context)
        contexts = np.array([self.contexts[context] for context in ended], np.int64)
        origins = len(self.history) + np.arange(len(ended), dtype=np.int64)
        self.history += [(origin, word, row + 1) for _, word, origin in ended.values()]
        scores, root = np.array([score for score, _, _ in ended.values()]), np.zeros(len(ended), np.int64)
        return paths.join(_Paths(root, contexts, scores, np.full(len(ended), NEVER), origins))


def decode_words(english: EnglishWords, rows: Scored) -> list[DecodedWord]:
    """Return the words of the best path, in order; none where every path has been given up within a word."""
    search, none = _BeamSearch(english), np.zeros(1, np.int64)
    paths = _Paths(none, none, np.zeros(1), np.full(1, NEVER), none - 1)
    for row in range(len(rows.sounds)):
        paths = search.step(paths, rows, row)
    ended = np.where(paths.node == 0, paths.best, NEVER)
    number = int(paths.origin[ended.argmax()]) if ended.max() > NEVER else -1
    words: list[DecodedWord] = []
    while number >= 0:
        before, word, end = search.history[number]
        first = search.history[before][2] if before >= 0 else 0
        words.append(DecodedWord(english.words[word] if word != NO_WORD else "", first, end))
        number = before
    return words[::-1]
