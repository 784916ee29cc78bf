"""Sentences to record for training, in an order that covers most units early."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import chain, groupby, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lipmotion.corpora import Corpus, read_entry
from lipmotion.errors import InputError
from lipmotion.formats.label_files import read_plain_text
from lipmotion.units import SILENCE, VISEME_OF, Lexicon, is_silent, split_words

PHONE, DIPHONE, CONTEXT = "phone", "diphone", "beside"
WEIGHTS = {PHONE: 8.0, DIPHONE: 2.0, CONTEXT: 1.0}
"""Weight of the first occurrence of each kind of unit: a phone; a phone after a phone; a phone beside a viseme class.
The engines back off from the last kind to the first, so the more general kinds must be covered."""

UnitName = tuple[str, ...]  # the kind of a unit, and its phones or classes


@dataclass(frozen=True)
class Prompt:
    """A sentence, and the number of phones and diphones that are covered after it has been recorded."""

    text: str
    phones: int
    diphones: int


@dataclass(frozen=True)
class Prompts:
    """The sentences to record, and statistics of all sentences.

    chosen           : the sentences to record, in this order
    phones, diphones : number of different phones and diphones in all sentences and in the existing corpus
    sentences        : number of sentences among which was chosen
    left_out         : sentences that cannot be used, with the word that is neither in the dictionary nor in the lexicon
    """

    chosen: tuple[Prompt, ...]
    phones: int
    diphones: int
    sentences: int
    left_out: dict[str, str]


def prompts(
    text: str | Path | None = None, *, count: int = 50, have: Corpus | None = None, lexicon: Lexicon | None = None
) -> Prompts:
    """Return the sentences that cover most units for the time it takes to speak them.

    text    : a file with a sentence a line; None: the list in the package
    count   : largest number of sentences; fewer are returned if further ones would cover nothing new
    have    : a corpus whose units count as covered; its utterances without words or phones are ignored
    lexicon : pronunciations of words, ahead of those of the dictionary
    Raises InputError: no such file, no sentence that can be used, or a count under 1.
    Source: greedy weighted set cover (Chvátal 1979).
    """
    if count < 1:
        raise InputError(f"{count} prompts asked for, required at least 1")
    lexicon = lexicon or Lexicon()
    usable, left_out = pronounce_sentences(text, lexicon)
    index: dict[UnitName, int] = {}
    units = [_numbered(find_units(phones), index) for phones in usable.values()]
    runs = chain.from_iterable(read_corpus_phones(have, lexicon)) if have else ()
    recorded = _numbered({unit for run in runs for unit in find_units(run)}, index)
    weights = np.array([WEIGHTS[name[0]] for name in index])
    weights[recorded] = 0
    costs = [len(phones) for phones in usable.values()]
    order = cover_greedily(units, costs, weights.copy(), count)
    covered = weights == 0
    is_phone, is_diphone = (np.array([name[0] == kind for name in index]) for kind in (PHONE, DIPHONE))
    chosen, sentences = [], list(usable)
    for number in order:
        covered[units[number]] = True
        chosen.append(Prompt(sentences[number], int((covered & is_phone).sum()), int((covered & is_diphone).sum())))
    return Prompts(tuple(chosen), int(is_phone.sum()), int(is_diphone.sum()), len(usable), left_out)


def find_units(phones: Sequence[str]) -> set[UnitName]:
    """Return the units in a sequence of phones between two silences; silence counts as a neighbour only."""
    sequence = [SILENCE, *phones, SILENCE]
    units: set[UnitName] = {(DIPHONE, left, right) for left, right in pairwise(sequence)}
    for left, phone, right in zip(sequence, phones, sequence[2:], strict=False):
        before, after = f"[{VISEME_OF[left]}]-{phone}", f"{phone}+[{VISEME_OF[right]}]"
        units |= {(PHONE, phone), (CONTEXT, before), (CONTEXT, after)}
    return units


def cover_greedily(
    sets: Sequence[NDArray[np.intp]], costs: Sequence[float], weights: NDArray[np.float64], count: int
) -> list[int]:
    """Return the numbers of the sets to take, in order: each time the set that adds most weight for its cost.

    sets    : elements of each set, as indices into ``weights``
    weights : of each element [shape=(E,)]; set to 0 for the elements that are covered
    """
    ends = np.cumsum([0, *map(len, sets)])
    holds = csr_array((np.ones(ends[-1]), np.concatenate(sets), ends), (len(sets), len(weights)))
    taken: list[int] = []
    while len(taken) < count:
        gains = holds @ weights / np.array(costs)
        best = int(gains.argmax())
        if not gains[best]:
            break
        taken.append(best)
        weights[sets[best]] = 0
    return taken


def _numbered(units: set[UnitName], index: dict[UnitName, int]) -> NDArray[np.intp]:
    return np.array([index.setdefault(unit, len(index)) for unit in sorted(units)], np.intp)


def pronounce_sentences(text: str | Path | None, lexicon: Lexicon) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Return the phones of the sentences of a file, and the unknown word of every sentence that cannot be used.

    text    : a file with a sentence a line; None: the list in the package
    lexicon : pronunciations of words; the first one of each word is taken
    Raises InputError: no such file, or no sentence that can be used.
    """
    path = Path(text) if text is not None else Path(str(resources.files("lipmotion") / "prompts" / "english.txt"))
    usable: dict[str, tuple[str, ...]] = {}
    left_out: dict[str, str] = {}
    lines = (" ".join(line.split()) for line in read_plain_text(path).splitlines())
    for line in dict.fromkeys(filter(None, lines)):
        try:
            words = split_words(line)
        except InputError:  # a line of dashes
            continue
        unknown = next((word for word in words if not lexicon.known(word)), None)
        if unknown is None:
            usable[line] = tuple(phone for word in words for phone in lexicon.pronunciations(word)[0])
        else:
            left_out[line] = unknown
    if not usable:
        reason = f"; {next(iter(left_out.values()))!r} is not in the dictionary: --lexicon" if left_out else ""
        raise InputError(f"{path}: no sentence to choose from{reason}; required: a sentence a line")
    return usable, left_out


def read_corpus_phones(corpus: Corpus, lexicon: Lexicon) -> Iterator[list[tuple[str, ...]]]:
    """Yield for each utterance of a corpus the sequences of phones between silences, those of its labels or words.

    An utterance without labels, and without words that the lexicon knows, has none.
    """
    for name in corpus.names():
        entry = read_entry(corpus.folder(name))
        if entry.get("phones"):
            phones = [row[2] for row in entry["phones"]]
            yield [tuple(run) for silent, run in groupby(phones, key=is_silent) if not silent]
        elif entry["words"] and all(map(lexicon.known, entry["words"])):
            yield [tuple(phone for word in entry["words"] for phone in lexicon.pronunciations(word)[0])]
        else:
            yield []
