"""The label files of one recording; the kind of each is recognised by its content."""

from __future__ import annotations

import codecs
import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from lipmotion.corpora.labels.json_documents import DamagedJsonError, is_json
from lipmotion.corpora.labels.plain_text import check_no_labels
from lipmotion.corpora.labels.recognised_words import parse_recognised
from lipmotion.corpora.labels.subtitles import is_subtitles, parse_subtitles
from lipmotion.corpora.labels.textgrid import MARK, is_textgrid, parse_interval_tiers
from lipmotion.corpora.labels.tier import (
    LabelTier,
    holds_phones,
    is_named_as_phones,
    is_named_as_recognised,
    is_named_as_words,
    phone_timeline,
    tier_transcript,
    with_recognised,
    with_words,
)
from lipmotion.corpora.labels.timed_lines import parse_timed_lines
from lipmotion.corpora.labels.timings.ipa import in_inventory
from lipmotion.corpora.labels.timings.services import timing_tiers
from lipmotion.corpora.labels.word_lists import is_ctm, is_lrs, parse_ctm, parse_lrs
from lipmotion.errors import InputError
from lipmotion.storage.files import check_regular
from lipmotion.types import TimedTranscript, TimedWord, Timeline, TranscriptLine, Unit
from lipmotion.units import phone_named
from lipmotion.units.length_limits import LARGEST_TRANSCRIPT_BYTES
from lipmotion.units.mood_tags import tagged_text, without_known_tags
from lipmotion.units.text_normalisation import checked_tokens
from lipmotion.units.written_forms import readings

LOG = logging.getLogger("lipmotion")
RECOGNISED = (".srt", ".vtt", ".ass", ".ssa", ".json", ".ctm", ".tsv")
"""Suffixes of subtitles and of what recognisers write."""
FOR_WORDS = (".txt", ".TextGrid", ".textgrid", ".lab", *RECOGNISED)
"""Suffixes in whose files words are searched, in order: plain text first, as labels in time may not be words, and what
may be recognised last."""
FOR_PHONES = (".TextGrid", ".textgrid", ".lab", ".txt")
"""Suffixes in whose files phones are searched, in order."""
CONTROL = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
"""Characters that no text has."""
LARGEST_LABELS = 1 << 24
"""Most bytes of a label file: labels of a day."""
MOTION, MOTION_HEAD = re.compile(rb'"lipmotion\.motion"|time_s,'), 64
"""How our own motion files begin, and in how many bytes: a quick answer for large ones."""


@dataclass(frozen=True)
class RecordingLabels:
    """The transcript and the phones of a recording, from its label files.

    transcript : what is said, with the times that the file gives, or None
    phones     : phones in time without gaps, or None; the end of the last may be infinite
    """

    transcript: TimedTranscript | None = None
    phones: Timeline[Unit] | None = None

    @property
    def words(self) -> tuple[str, ...] | None:
        """The words of the transcript, lower case, as they are usually read, or None."""
        said = self.transcript.words if self.transcript else ()
        return tuple(word for token in said for word in readings(token)[0]) or None


def labels_beside(recording: Path, *, ignored: frozenset[Path] = frozenset()) -> RecordingLabels:
    """Return the labels from the files beside a recording that have its name, with a suffix of ``FOR_WORDS``.

    Those of ``RECOGNISED`` may have a language as well (``take.en.vtt``), or the whole name (``take.mp4.srt``); JSON
    that is no transcript, as motion, is passed over.
    ignored : files that are no labels (the lists of the splits)
    Raises InputError: one of them cannot be read.
    """
    found = list(each_labels_beside(recording, ignored=ignored))
    transcripts = [labels.transcript for _, labels in found if labels.transcript]
    in_order = sorted(found, key=lambda item: FOR_PHONES.index(item[0]) if item[0] in FOR_PHONES else len(FOR_PHONES))
    phones = [labels.phones for _, labels in in_order if labels.phones]
    return RecordingLabels(next(iter(transcripts), None), next(iter(phones), None))


def each_labels_beside(
    recording: Path, *, ignored: frozenset[Path] = frozenset()
) -> Iterator[tuple[str, RecordingLabels]]:
    """Yield the suffix and the labels of each file that ``labels_beside`` reads, in the order of ``FOR_WORDS``.

    Raises InputError: one of them cannot be read.
    """
    seen: list[Path] = []
    for suffix in FOR_WORDS:
        for path in _named(recording, suffix):
            if path in ignored or any(path.samefile(other) for other in seen):
                continue
            seen.append(path)
            labels = _read(path, unknown_json=suffix == ".json")
            if labels is not None:
                yield suffix, labels


def label_files_beside(recording: Path) -> list[Path]:
    """Return the files beside a recording that ``labels_beside`` reads, in the order of ``FOR_WORDS``."""
    return [path for suffix in FOR_WORDS for path in _named(recording, suffix)]


def _named(recording: Path, suffix: str) -> list[Path]:
    """Return the files that have a recording's name and a suffix."""
    names = [recording.with_suffix(suffix)]
    if suffix in RECOGNISED:
        names += [recording.with_suffix(f".en{suffix}"), recording.with_name(recording.name + suffix)]
    return [path for path in names if path.is_file()]


def read_labels(path: Path) -> RecordingLabels:
    """Return the words and phones of one file.

    Read are TextGrids, labels with times (HTK, Audacity), subtitles (SubRip, WebVTT, SubStation), the JSON and tables
    of recognisers (Whisper, Vosk), NIST's CTM, the texts of LRS, and plain text; the content decides, not the name.
    Raises InputError: not text, damaged, overlapping labels, or labels among phones that are no phones.
    """
    return _read(path, unknown_json=False) or RecordingLabels()


def read_transcript(path: Path) -> str | TimedTranscript:
    """Return the text of a file of plain text, or the words in time of one of another kind that ``read_labels`` reads.

    Raises InputError: as ``read_labels``, no such file, or phones without words.
    """
    check_regular(path, "transcript file")
    if not path.exists():
        raise InputError(f"{path}: no such transcript file")
    text = _text(path)
    labels = _timed(text, path)
    if labels is None:
        check_size(path, text)
        check_no_labels(without_known_tags(text), str(path))
        return text
    if labels.transcript is None:
        what = "phones in time, but no words; give them as units" if labels.phones else "no word"
        raise InputError(f"{path}: the transcript holds {what}")
    return labels.transcript


def read_phones(path: Path) -> Timeline[Unit]:
    """Return the phones in time of a TextGrid or of a file of labels with times; they may have gaps.

    Those of a TextGrid have the words of its tier of words, and are recognised, not known, where its tier of recognised
    phones has the same.
    Vowels stay as they are labelled, whatever words another tier has; the end of the last phone may be infinite.
    Raises InputError: no such file, as ``read_labels``, or no phones in time.
    """
    check_regular(path, "units file")
    if not path.exists():
        raise InputError(f"{path}: no such units file")
    text, where = _text(path), str(path)
    tiers = _tiers(text, where)
    if tiers is None:
        lines = parse_timed_lines(text, where)
        tiers = [] if lines is None else [lines]
    silent = [tier for tier in tiers if is_named_as_phones(tier) and tier.labels]
    phones = _tiers_of_phones(tiers, where) or silent
    if not phones and any(map(is_named_as_words, tiers)):
        raise InputError(f"{where}: holds words in time, but no phones; give it as a transcript (--transcript)")
    if not phones:
        raise InputError(
            f"{where}: holds no phones in time, required a motion file (.json, .npz), a TextGrid with a tier of "
            "phones, or labels with times, one phone a line"
        )
    units = phone_timeline(phones[0], None, where, with_gaps=True)
    words = next(filter(is_named_as_words, tiers), None)
    recognised = next(filter(is_named_as_recognised, tiers), None)
    units = units if words is None else with_words(units, words)
    return units if recognised is None else with_recognised(units, recognised)


def holds_timings(path: Path) -> bool:
    """Return whether a file has the timings of a voice or an aligner; False: it is another file, or no file at all.

    Raises InputError: it has, and a symbol or a time in it is none.
    """
    if not path.is_file() or not 0 < path.stat().st_size <= LARGEST_LABELS:
        return False
    with path.open("rb") as file:
        if MOTION.search(file.read(MOTION_HEAD)):
            return False
    try:
        return timing_tiers(_text(path), str(path)) is not None
    except DamagedJsonError:  # said by the reader of motion
        return False


def _tiers_of_phones(tiers: list[LabelTier], where: str) -> list[LabelTier]:
    """Return the tier of phones, or an empty list. Raises InputError: there are several."""
    phones = [tier for tier in tiers if holds_phones(tier)]
    if len(phones) > 1:
        raise InputError(f"{where}: {phones[0].name} and {phones[1].name} both hold phones; keep one")
    return phones


def _read(path: Path, *, unknown_json: bool) -> RecordingLabels | None:
    """Return the labels of a file; None for JSON of another kind, if that is expected, else an error."""
    if unknown_json and path.stat().st_size > LARGEST_LABELS:
        return None
    text = _text(path)
    labels = _timed(text, path) if is_json(text) or not unknown_json else None
    if labels is not None or unknown_json:
        return labels
    check_size(path, text)
    check_no_labels(without_known_tags(text), str(path))
    text, tags = tagged_text(text)
    tokens = text.split()
    one_a_line = len(tokens) == sum(bool(line.strip()) for line in text.splitlines())
    if len(tokens) > 1 and one_a_line and all(map(phone_named, tokens)):
        raise InputError(f"{path}: a list of phones without times; add their times, or give the words instead")
    if not tokens:
        LOG.warning("%s: is empty: it counts as no transcript; write the words that are said, or remove it", path)
        return RecordingLabels()
    return RecordingLabels(TimedTranscript((TranscriptLine(tuple(map(TimedWord, checked_tokens(text)))),), tags))


def _timed(text: str, path: Path) -> RecordingLabels | None:
    """Return the labels of a text whose form has times; None of any other text."""
    where = str(path)
    tiers = _tiers(text, where)
    if tiers is not None:
        return _chosen(tiers, where)
    if is_subtitles(text):
        return _spoken(parse_subtitles(text, where))
    if is_lrs(text):
        return _spoken(parse_lrs(text, where))
    transcript = parse_recognised(text, where) if is_json(text) else None
    if transcript is not None:
        return _spoken(transcript)
    lines = parse_timed_lines(text, where)
    if lines is not None:
        return _chosen([lines], where)
    return _spoken(parse_ctm(text, where)) if is_ctm(text) else None


def _tiers(text: str, where: str) -> list[LabelTier] | None:
    """Return the tiers of a TextGrid, or of the timings of a service; None: of another text.

    Phones in IPA are those of the inventory that look like them.
    """
    if not is_textgrid(text):
        return timing_tiers(text, where)
    return [
        replace(tier, labels=tuple(in_inventory(tier.labels, where))) if is_named_as_phones(tier) else tier
        for tier in parse_interval_tiers(text, where)
    ]


def _spoken(transcript: TimedTranscript) -> RecordingLabels:
    """Return the labels of a transcript, without it if it has no word."""
    return RecordingLabels(transcript if transcript.lines else None)


def check_size(path: Path, text: str) -> None:
    """Raise InputError for more plain text than a transcript has."""
    if len(text) > LARGEST_TRANSCRIPT_BYTES:
        raise InputError(
            f"{path}: {len(text)} characters, required at most {LARGEST_TRANSCRIPT_BYTES}: is it a transcript?"
        )


def _chosen(tiers: list[LabelTier], where: str) -> RecordingLabels:
    """Return the phones of the only tier of phones, and the words of the tier named so, else of the first other."""
    phones = _tiers_of_phones(tiers, where)
    passed_over = (*phones, *filter(is_named_as_recognised, tiers))
    others = [tier for tier in tiers if tier not in passed_over and any(label.text for label in tier.labels)]
    words = next(filter(is_named_as_words, others), others[0] if others else None)
    if not phones and words is None:
        return RecordingLabels()
    timed = words if words is not None and all(len(label.text.split()) < 2 for label in words.labels) else None
    return RecordingLabels(
        tier_transcript(words, where) if words else None,
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
        if wide:
            raise InputError(f"{path}: is not UTF-16 text, as its first bytes say; save it as UTF-8") from error
        text = _western(path, content, error)
    if text.startswith("ooBinaryFile"):
        raise InputError(f"{path}: is a binary TextGrid; save it as a text file")
    return text


def _western(path: Path, content: bytes, error: UnicodeDecodeError) -> str:
    """Return the text of a file that is not UTF-8, in the code page of Windows in western Europe and America.

    Logs a warning. Raises InputError: it has bytes that stand for no character there, or control characters.
    """
    if MARK.match(content[:40].decode("latin-1")):
        raise InputError(f"{path}: is a binary TextGrid; save it as a text file") from error
    try:
        text = content.decode("cp1252")
    except UnicodeDecodeError:
        text = "\0"
    if CONTROL.search(text):
        raise InputError(f"{path}: is not UTF-8 text; save it as UTF-8") from error
    LOG.warning("%s: not UTF-8; read as Windows-1252 (western Europe); save it as UTF-8 if letters are wrong", path)
    return text
