"""The label files of one recording; the kind of each is recognised by its content."""

from __future__ import annotations

import codecs
from dataclasses import dataclass
from pathlib import Path

from lipmotion.corpora.labels.plain_text import check_no_labels
from lipmotion.corpora.labels.textgrid import MARK, is_textgrid, parse_interval_tiers
from lipmotion.corpora.labels.tier import LabelTier, holds_phones, is_named_as_words, phone_timeline, tier_words
from lipmotion.corpora.labels.timed_lines import parse_timed_lines
from lipmotion.errors import InputError
from lipmotion.types import Timeline, Unit
from lipmotion.units import phone_named, words_of
from lipmotion.units.length_limits import LARGEST_TRANSCRIPT

FOR_WORDS = (".txt", ".TextGrid", ".textgrid", ".lab")
"""Suffixes in whose files words are searched, in order: plain text first, as labels in time may not be words."""
FOR_PHONES = (".TextGrid", ".textgrid", ".lab", ".txt")
"""Suffixes in whose files phones are searched, in order."""
LARGEST_LABELS = 1 << 24
"""Most bytes of a label file: labels of a day."""


@dataclass(frozen=True)
class RecordingLabels:
    """The transcript and the phones of a recording, from its label files.

    words  : the transcript, lower case, or None
    phones : phones in time without gaps, or None; the end of the last may be infinite
    """

    words: tuple[str, ...] | None = None
    phones: Timeline[Unit] | None = None


def labels_beside(recording: Path, *, ignored: frozenset[Path] = frozenset()) -> RecordingLabels:
    """Return the labels from the files beside a recording that have its name: ``.txt``, ``.TextGrid``, ``.lab``.

    ignored : files that are no labels (the lists of the splits)
    Raises InputError: one of them cannot be read.
    """
    found: dict[str, tuple[Path, RecordingLabels]] = {}
    for suffix in FOR_WORDS:
        path = recording.with_suffix(suffix)
        if path not in ignored and path.is_file() and not any(path.samefile(other) for other, _ in found.values()):
            found[suffix] = path, read_labels(path)
    words = [found[suffix][1].words for suffix in FOR_WORDS if suffix in found]
    phones = [found[suffix][1].phones for suffix in FOR_PHONES if suffix in found]
    return RecordingLabels(next(filter(None, words), None), next(filter(None, phones), None))


def read_labels(path: Path) -> RecordingLabels:
    """Return the words and phones of one file: a TextGrid, labels with times, or plain text.

    Raises InputError: not text, damaged, overlapping labels, or labels among phones that are no phones.
    """
    text = _text(path)
    if is_textgrid(text):
        return _chosen(parse_interval_tiers(text, str(path)), str(path))
    lines = parse_timed_lines(text, str(path))
    if lines is not None:
        return _chosen([lines], str(path))
    if len(text) > LARGEST_TRANSCRIPT:
        raise InputError(f"{path}: {len(text)} characters, required at most {LARGEST_TRANSCRIPT}: is it a transcript?")
    check_no_labels(text, str(path))
    tokens = text.split()
    one_a_line = len(tokens) == sum(bool(line.strip()) for line in text.splitlines())
    if len(tokens) > 1 and one_a_line and all(map(phone_named, tokens)):
        raise InputError(f"{path}: a list of phones without times; add their times, or give the words instead")
    return RecordingLabels(words_of(text) if tokens else None)


def _chosen(tiers: list[LabelTier], where: str) -> RecordingLabels:
    """Return the phones of the only tier of phones, and the words of the tier named so, else of the first other."""
    phones = [tier for tier in tiers if holds_phones(tier)]
    if len(phones) > 1:
        raise InputError(f"{where}: {phones[0].name} and {phones[1].name} both hold phones; keep one")
    others = [tier for tier in tiers if tier not in phones and any(label.text for label in tier.labels)]
    words = next(filter(is_named_as_words, others), others[0] if others else None)
    if not phones and words is None:
        return RecordingLabels()
    timed = words if words is not None and all(len(label.text.split()) < 2 for label in words.labels) else None
    return RecordingLabels(
        tier_words(words, where) if words else None,
        phone_timeline(phones[0], timed, where) if phones else None,
    )


def _text(path: Path) -> str:
    """Return the text of a label file, in UTF-8 or UTF-16. Raises InputError: it is not such a text, or too large."""
    try:
        size = path.stat().st_size
        if size > LARGEST_LABELS:
            raise InputError(f"{path}: {size} bytes, required at most {LARGEST_LABELS}: is it a transcript or labels?")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        binary = MARK.match(content[:40].decode("latin-1"))
        kind = "a binary TextGrid; save it as a text file" if binary else "not UTF-8 text; save it as UTF-8"
        raise InputError(f"{path}: is {kind}") from error
    if text.startswith("ooBinaryFile"):
        raise InputError(f"{path}: is a binary TextGrid; save it as a text file")
    return text
