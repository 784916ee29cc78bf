"""Coverage: which phones, diphones and triphones of a text a corpus lacks, and which recorded ones are nearest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import Corpus
from lipmotion.errors import CorpusError
from lipmotion.pipeline.training.prompts import pronounce_sentences, read_corpus_phones
from lipmotion.printable import printable
from lipmotion.units import PHONES, SILENCE, SIMILAR_PHONES, VISEME_OF, Lexicon, find_similar_lips
from lipmotion.units.phones import CLASSES

KINDS = ("phones", "diphones", "triphones")  # sequences of one, two and three phones; silence is a neighbour only
OTHER_VISEME_COST, DISSIMILAR_COST = 1.0, 0.5
"""What it costs that a phone has another viseme, and that it is not among the similar phones of ``SIMILAR_PHONES``.
Different classes of articulation cost up to 1 more."""
MIDDLE_WEIGHT = 2.0  # weight of the middle phone of a triphone; its neighbours have 1
Phones = tuple[str, ...]


@dataclass(frozen=True)
class MissingUnit:
    """A sequence of phones (``t-r``) that a text needs and a corpus lacks, and the nearest that it has."""

    unit: str
    count: int
    share: float
    stand_in: str
    recorded: int


@dataclass(frozen=True)
class KindCoverage:
    """The coverage of the sequences of one length."""

    kind: str
    needed: int  # how many different ones the text needs
    covered: int  # how many of these the corpus has
    share: float  # of the text that these cover, 0 to 1: each counts as often as the text needs it
    missing: tuple[MissingUnit, ...]


@dataclass(frozen=True)
class Coverage:
    """What a corpus has of the sounds of a text.

    sentences  : number of sentences of the text that were used
    left_out   : sentences that cannot be used, with the word that is neither in the dictionary nor in the lexicon
    unknown    : number of utterances that were not counted: without labelled phones, and without words that are known
    """

    kinds: tuple[KindCoverage, ...]
    sentences: int
    left_out: Mapping[str, str]
    utterances: int
    unknown: int


def measure_coverage(corpus: Corpus, text: str | Path | None = None, *, lexicon: Lexicon | None = None) -> Coverage:
    """Return which phones, diphones and triphones of some sentences a corpus has, and what stands in for the others.

    corpus  : its labelled phones count, else the phones of its words (the first pronunciation of each)
    text    : a file with a sentence a line; None: the list in the package
    lexicon : pronunciations of words, ahead of those of the dictionary
    For a phone, the nearest one is that of ``find_similar_lips``, which the engines take; for sequences it is the one
    with the least sum of distances of phones (``measure_phone_distances``), the most recorded one of several.
    Raises InputError: no such file, or no usable sentence. Raises CorpusError: no utterance has words or phones.
    """
    lexicon = lexicon or Lexicon()
    usable, left_out = pronounce_sentences(text, lexicon)
    utterances = list(read_corpus_phones(corpus, lexicon))
    runs = [run for utterance in utterances for run in utterance]
    if not runs:
        raise CorpusError(
            f"{corpus.path}: none of {len(utterances)} utterances has labelled phones or words that are known; put "
            "transcripts beside the recordings and prepare them again, or give the unknown words (--lexicon)"
        )
    kinds = []
    for length, kind in enumerate(KINDS, start=1):
        needed, recorded = _count_sequences(usable.values(), length), _count_sequences(runs, length)
        total = sum(needed.values())
        missing = sorted((unit for unit in needed if unit not in recorded), key=lambda unit: (-needed[unit], unit))
        units = tuple(
            MissingUnit("-".join(unit), needed[unit], needed[unit] / total, "-".join(other), recorded[other])
            for unit, other in zip(missing, _find_nearest(missing, recorded), strict=True)
        )
        share = 1 - sum(needed[unit] for unit in missing) / total
        kinds.append(KindCoverage(kind, len(needed), len(needed) - len(missing), share, units))
    return Coverage(tuple(kinds), len(usable), left_out, len(utterances), sum(not each for each in utterances))


def measure_phone_distances() -> NDArray[np.float64]:
    """Return how different any two phones of ``PHONES`` look, 0 for the same phone to 2.5 [shape=(47, 47)].

    1 for another viseme, 0.5 for a phone that is not among the similar ones, and the share of their classes of
    articulation that only one of the two has.
    """
    classes = [frozenset(name for name, members in CLASSES.items() if phone in members) for phone in PHONES]
    distances = np.zeros((len(PHONES), len(PHONES)))
    for i, wanted in enumerate(PHONES):
        for j, other in enumerate(PHONES):
            if wanted != other:
                apart = len(classes[i] ^ classes[j]) / max(len(classes[i] | classes[j]), 1)
                viseme = OTHER_VISEME_COST * (VISEME_OF[wanted] != VISEME_OF[other])
                distances[i, j] = apart + viseme + DISSIMILAR_COST * (other not in SIMILAR_PHONES[wanted])
    return distances


def format_coverage(result: Coverage, lines: int) -> Iterator[str]:
    """Yield the coverage as text: shares, then ``lines`` missing sequences of each kind, the most frequent first."""
    yield f"{result.utterances - result.unknown} of {result.utterances} utterances, {result.sentences} sentences"
    for each in result.kinds:
        yield f"{each.kind:10} {each.covered:5} of {each.needed:5} different, {each.share:6.1%} of all in the sentences"
    for each in result.kinds:
        if each.missing:
            yield ""
            yield f"{'missing ' + each.kind:20} {'needed':>8} {'share':>8}   nearest recorded"
        for unit in each.missing[:lines]:
            yield f"{unit.unit:20} {unit.count:8} {unit.share:8.2%}   {unit.stand_in} ({unit.recorded})"
        if len(each.missing) > lines:
            yield f"and {len(each.missing) - lines} more {each.kind}"


def coverage_to_json(result: Coverage) -> dict[str, Any]:
    """Return the coverage as an object of JSON, with all missing sequences."""
    document = asdict(result)
    document["left_out"] = {printable(text): word for text, word in result.left_out.items()}
    return document


def _count_sequences(runs: Iterable[Sequence[str]], length: int) -> Counter[Phones]:
    counts: Counter[Phones] = Counter()
    for run in runs:
        sequence = tuple(run) if length == 1 else (SILENCE, *run, SILENCE)
        counts.update(sequence[first : first + length] for first in range(len(sequence) - length + 1))
    return counts


def _find_nearest(missing: Sequence[Phones], recorded: Counter[Phones]) -> list[Phones]:
    """Return for each sequence the nearest one that is recorded."""
    if missing and len(missing[0]) == 1:
        known = {phone for (phone,) in recorded}
        return [(find_similar_lips(phone, known),) for (phone,) in missing]
    number = {phone: n for n, phone in enumerate(PHONES)}
    candidates = sorted(recorded, key=lambda unit: (-recorded[unit], unit))  # of equal distance, the most recorded
    columns = np.array([[number[phone] for phone in unit] for unit in candidates])
    distances = measure_phone_distances()
    weights = (1.0, MIDDLE_WEIGHT, 1.0) if columns.shape[1] == len(KINDS) else (1.0, 1.0)
    chosen = []
    for unit in missing:
        terms = zip(weights, unit, columns.T, strict=True)
        cost = sum(weight * distances[number[phone]][column] for weight, phone, column in terms)
        chosen.append(candidates[int(np.argmin(cost))])
    return chosen
