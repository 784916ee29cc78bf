"""Sentences and recordings as sequences of phones: what a text needs, and what a corpus has."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import resources
from itertools import groupby
from pathlib import Path

from lipmotion.corpora.entry import read_entry
from lipmotion.corpora.store import Corpus
from lipmotion.errors import InputError
from lipmotion.formats.label_files import read_plain_text
from lipmotion.units import Lexicon, is_silent, split_words

SHIPPED = "english.txt"


def pronounced_sentences(
    text: str | Path | None, lexicon: Lexicon
) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Return the phones of the sentences of a file, and the unknown word of every sentence that cannot be used.

    text    : a file with a sentence a line; None: the list in the package
    lexicon : pronunciations of words; the first one of each word is taken
    Raises InputError: no such file, or no sentence that can be used.
    """
    path = Path(text) if text is not None else Path(str(resources.files("lipmotion") / "prompts" / SHIPPED))
    usable, left_out = _pronounced(_lines(path), lexicon)
    if not usable:
        reason = f"; {next(iter(left_out.values()))!r} is not in the dictionary: --lexicon" if left_out else ""
        raise InputError(f"{path}: no sentence to choose from{reason}; required: a sentence a line")
    return usable, left_out


def recorded_phones(corpus: Corpus, lexicon: Lexicon) -> Iterator[list[tuple[str, ...]]]:
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


def _lines(path: Path) -> list[str]:
    lines = (" ".join(line.split()) for line in read_plain_text(path).splitlines())
    return list(dict.fromkeys(line for line in lines if line))


def _pronounced(lines: Iterable[str], lexicon: Lexicon) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Return the phones of the sentences that can be used, and the unknown word of every other sentence."""
    usable: dict[str, tuple[str, ...]] = {}
    left_out: dict[str, str] = {}
    for line in lines:
        try:
            words = split_words(line)
        except InputError:  # a line of dashes
            continue
        unknown = next((word for word in words if not lexicon.known(word)), None)
        if unknown is None:
            usable[line] = tuple(phone for word in words for phone in lexicon.pronunciations(word)[0])
        else:
            left_out[line] = unknown
    return usable, left_out
