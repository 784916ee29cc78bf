"""JSON of speech recognisers: Whisper and its relatives, and Vosk."""

from __future__ import annotations

from typing import Any

from lipmotion.corpora.labels.json_documents import json_documents, json_seconds
from lipmotion.corpora.labels.tier import check_count
from lipmotion.errors import InputError, shortened
from lipmotion.types import TimedTranscript, TimedWord, TranscriptLine, in_order
from lipmotion.units.spoken_text import check_word_count, lines_by_pauses, spoken_text, timed_words

MS_PER_S = 1000
ROUNDING_S = 1.0
"""An end may be so much before its start; recognisers write that at the edges of their windows."""
LISTS = ("segments", "transcription", "chunks", "result", "words")
"""The members that hold what was recognised: of Whisper, whisper.cpp, transformers, Vosk, and lists of words alone."""


def parse_recognised(text: str, where: str) -> TimedTranscript | None:
    """Return the words of the JSON of a recogniser, or None for JSON of another kind.

    Read are documents of Whisper, faster-whisper, WhisperX and OpenAI's API (``segments``, with ``words`` or without),
    whisper.cpp (``transcription``), transformers (``chunks``), Vosk (``result``, ``alternatives``), a list of segments
    or of documents, and several documents one after another. Words without times may stand between others.
    where : the file's name, for messages
    Raises InputError: damaged JSON (with its line), or times that are none (with the number of the segment).
    """
    documents = [value for _, value in json_documents(text, where)]
    if len(documents) == 1 and isinstance(documents[0], list):
        documents = documents[0]
    if not all(isinstance(document, dict) and _is_recognised(document) for document in documents):
        return None
    segments = [segment for document in documents for segment in _segments(document, where)]
    check_count(len(segments), where)
    lines: list[TranscriptLine] = []
    count = 0
    for number, segment in enumerate(segments, 1):
        line = _lines(segment, f"{where}: segment {number}")
        count += sum(len(part.words) for part in line)
        check_word_count(count, where)
        lines += line
    return in_order(lines)


def _is_recognised(document: dict[str, Any]) -> bool:
    """Return whether an object is what a recogniser writes: a document, a segment, or a result without words."""
    if "format" in document and "channels" in document:  # motion
        return False
    if any(isinstance(document.get(name), list) for name in (*LISTS, "alternatives")):
        return True
    timed = document.keys() & {"start", "timestamp", "offsets"}
    return bool("text" in document and timed) or not document.keys() - {"text", "partial"}


def _segments(document: dict[str, Any], where: str) -> list[dict[str, Any]]:
    """Return the segments of a document; one that is itself a segment, alone."""
    if document.get("alternatives"):
        return _segments(_required_objects(document["alternatives"], "alternatives", where)[0], where)
    for name in ("segments", "transcription", "chunks"):
        if isinstance(document.get(name), list):
            segments = _required_objects(document[name], name, where)
            only_outside = document.get("words") and not any(segment.get("words") for segment in segments)
            return [{"words": document["words"]}] if only_outside else segments
    if isinstance(document.get("result"), list):
        return [{"words": document["result"]}]
    return [document]


def _required_objects(items: list[Any], name: str, where: str) -> list[dict[str, Any]]:
    """Return the items of a list. Raises InputError: one is no object."""
    wrong = next((number for number, item in enumerate(items, 1) if not isinstance(item, dict)), None)
    if wrong is not None:
        found = shortened(repr(items[wrong - 1])[:200])
        raise InputError(f"{where}: {name!r}, item {wrong} is {found}, required an object with text and times")
    return items


def _lines(segment: dict[str, Any], where: str) -> list[TranscriptLine]:
    """Return the lines of a segment: one; of a list of words alone, one up to each pause."""
    start_s, end_s = _times(segment, where)
    items = segment.get("words") or []
    if isinstance(items, list) and items:
        words = _words(_required_objects(items, "words", where), where)
        if start_s is None and end_s is None:
            return lines_by_pauses(words)
        return [TranscriptLine(tuple(words), start_s, end_s)]
    text = segment.get("text", "")
    if not isinstance(text, str):
        raise InputError(f"{where}: its text is {shortened(repr(text)[:200])}, required a text")
    return [TranscriptLine(tuple(timed_words(spoken_text(text), where=where)), start_s, end_s)]


def _words(items: list[dict[str, Any]], where: str) -> list[TimedWord]:
    check_word_count(len(items), where)
    words: list[TimedWord] = []
    for number, item in enumerate(items, 1):
        text, place = item.get("word", item.get("text")), f"{where}, word {number}"
        if not isinstance(text, str):
            raise InputError(f"{place}: no text; required a member 'word'")
        words += timed_words(spoken_text(text), *_times(item, place), where=place)
    return words


def _times(item: dict[str, Any], where: str) -> tuple[float | None, float | None]:
    """Return the start and the end of a segment or a word in seconds, None where they are not given."""
    offsets, stamp = item.get("offsets"), item.get("timestamp")
    if isinstance(offsets, dict):
        start_s, end_s = (json_seconds(offsets.get(name), where, MS_PER_S) for name in ("from", "to"))
    elif isinstance(stamp, list) and len(stamp) == 2:
        start_s, end_s = (json_seconds(value, where) for value in stamp)
    else:
        start_s, end_s = (json_seconds(item.get(name), where) for name in ("start", "end"))
    if start_s is not None and end_s is not None and end_s < start_s:
        if end_s < start_s - ROUNDING_S:
            raise InputError(f"{where} ends at {end_s:g} s, before its start at {start_s:g} s; correct it")
        end_s = start_s
    return start_s, end_s
