"""JSON of services: words and phones in time of recognisers, voices and aligners, by one table of their shapes.

What a file is follows from the names in it, whatever their spelling (``start_time``, ``StartTime``, ``privStartTime``),
and the unit of its times from how long its words last (``label_times.csv``). Parallel lists, and phones with durations
alone, become lists of items first. Whatever else a service writes is passed over.

Source: the public documentation of each service; figures and names of fields alone.
"""

from __future__ import annotations

import json
import logging
import math
import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any, NamedTuple

from lipmotion.errors import InputError, shorten
from lipmotion.formats.base import iterate_json
from lipmotion.formats.label_tiers import (
    EARLIEST_S,
    LINES,
    PHONE_LABELS,
    WORDS,
    LabelTier,
    TimedLabel,
    add_pauses,
    check_count,
    find_tier,
    find_time_unit,
    holds_phones,
    split_ipa,
)
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import values
from lipmotion.types.values import parse_clock, parse_number, require
from lipmotion.units import SILENCE
from lipmotion.units.spelling import parse_table, read_patterns, read_table
from lipmotion.units.spoken_text import extract_spoken_text
from lipmotion.units.text_normalisation import find_words

LOG = logging.getLogger("lipmotion")
_TEXT = values.text(1 << 20)
Objects = list[tuple[str, dict[str, Any]]]  # objects of a file, each with its place, for messages
LATEST_S = 1e6  # times beyond eleven days are an error, or in another unit
SINGLE_SHARE, LONGEST_JUDGED, DEEPEST = 0.9, 1000, 12
"""A list is one of words where so many of its texts are single ones; letters of a text that are judged; how deep lists
are searched in lists."""
ROUNDING_S = 1.0  # an end may be so much before its start; recognisers write that at the edges of their windows


class Times(NamedTuple):
    """The names of the times of an item: a row of ``label_times.csv``, of which the first that an item has counts.

    per_s  : how many of its times are a second, 0: how long words last decides
    usual  : how many usually are, where nothing can be told; 0: their own form must say it, else they are frames
    kind   : ``event``: it lasts to the next one; ``sentence``: times begin at 0 in every message; ``pieces``: tokens
             are pieces of words, and one without a blank before it goes on with the word ahead of it; or empty
    """

    start: str
    end: str = ""
    duration: str = ""
    per_s: int = 0
    usual: int = 1
    kind: str = ""


UNTIMED, POLLY = Times(""), Times("time", usual=1000, kind="event")
SPEECHIFY = Times("starttime", "endtime", "duration", 1000)  # of marks, whose start and end are places in the text
KNOWN_TIMES = tuple(
    Times(row["start"], row["end"], row["duration"], int(row["per_s"]), int(row["usual"]), row["kind"])
    for row in read_shipped_table("lipmotion.formats", "label_times.csv")
)
NAMES = {row["kind"]: row["names"].split() for row in read_shipped_table("lipmotion.formats", "label_names.csv")}
"""Names of members by what they hold, the best ones first."""
MISSED, OMITTED = "not-found-in-audio", "Omission"  # Gentle's case, and Azure's error, of a word that is not said
MARKS = read_patterns(Path(__file__).with_name("label_services.tsv"))
"""Patterns of what services write, by their names in the table."""
PHONE_OF_VISEME = read_table("voice_visemes")
KOKORO_LETTERS = {"A": "eɪ", "I": "aɪ", "W": "aʊ", "Y": "ɔɪ", "O": "oʊ", "Q": "əʊ", "ᵊ": "ə", "T": "ɾ"}
KOKORO_FRAMES_PER_S = 40  # durations are in frames of 600 samples at 24 kHz
PARALLEL_LISTS = tuple(
    (row["items"], parse_table(row["members"])) for row in read_shipped_table("lipmotion.formats", "label_lists.csv")
)
"""Parallel lists: the list of items that they become, and the member that each is of them."""
PARTIAL = "AddPartialTranscript"  # Speechmatics' message
UNFINISHED = {"isfinal": False, "final": False, "endofturn": False, "ispartial": True, "message": PARTIAL}
"""Members of what a service heard while somebody spoke, and says again when it is sure."""
KNOWN_SHAPES = "segments, words, results, utterances, monologues, alignment, tiers, fragments, ..."


class DamagedJsonError(InputError):
    """A text that begins as JSON is none."""


@dataclass(frozen=True, eq=False)
class Row:
    """An item of a list: its times as they stand, NaN where they are missing, their names, what it is, and its line."""

    start: float
    end: float
    text: str
    place: str
    times: Times = UNTIMED
    speaker: str = ""
    role: str = ""
    is_symbol: bool = False  # of IPA, or a pause of a voice
    parts: tuple[Row, ...] = ()
    owner: Row | None = None


Place = tuple[str, ...]
Lists = dict[tuple[Place, bool], list[Row]]
"""Items by the names of the members that lead to their list, and whether they are phones."""


def is_json(text: str) -> bool:
    """Return whether a text begins as an object or a list of objects does."""
    return re.match(r'\s*(?:\{\s*["}]|\[\s*[\[{\]])', text) is not None


def parse_service_tiers(text: str, where: str) -> list[LabelTier] | None:
    """Return the tiers of the JSON of a service; None: it has none. Raises InputError: it is damaged, with its line."""
    numbered = [(f"line {line}", value) for line, value in _decode_documents(text, where)]
    if len(numbered) == 1 and isinstance(numbered[0][1], list):
        if numbered[0][1] and all(map(_read_stamp, numbered[0][1])):
            numbered = [("", [{"segments": numbered[0][1]}])]
        numbered = [(f"item {number}", value) for number, value in enumerate(numbered[0][1], 1)]
    objects = [(place, item) for place, item in numbered if isinstance(item, dict)]
    if not objects or any("mouthcues" in item or {"format", "channels"} <= item.keys() for _, item in objects):
        return None
    tiers = _read_named_tiers(objects, where)
    if tiers is None and len(objects) == len(numbered):
        tiers = _read_lists(objects, where)
    if tiers is not None and not any(tier.labels for tier in tiers):
        raise InputError(f"{where}: holds no word and no phone in time; ask the service for them")
    return tiers and [replace(t, labels=add_pauses(t.labels)) if t.role == PHONE_LABELS else t for t in tiers]


def describe_json(text: str, where: str) -> str:
    """Return what JSON is that holds no words in time, for a message."""
    value = next(_decode_documents(text, where), (1, None))[1]
    first = value[0] if isinstance(value, list) and value else value
    names = list(first) if isinstance(first, dict) else []
    if "blendshapes" in names or {"mouthcues", "viseme", "visemes"} & {*names}:
        what = "weights of blendshapes (as Azure's 55)" if "blendshapes" in names else "mouth cues"
        return f"holds {what}, which is motion and no labels; render it"
    named = ", ".join(map(shorten, names[:8])) or "no names"
    return f"is JSON in which no words in time are found (it has {named}; known are {KNOWN_SHAPES})"


def _decode_documents(text: str, where: str) -> Iterator[tuple[int, Any]]:
    """Yield the values of a text, one after another, each with the number of its first line."""

    def plain(name: str) -> str:
        return name if " " in name else name.replace("_", "").lower().removeprefix("priv")

    decoder = json.JSONDecoder(
        object_pairs_hook=lambda pairs: {plain(name): value for name, value in pairs},
        parse_constant=lambda _: None,  # NaN: missing
    )
    line, counted = 1, 0
    try:
        for at, value in iterate_json(text, decoder):
            line, counted = line + text.count("\n", counted, at), at
            yield line, value
    except json.JSONDecodeError as error:
        what = f"line {error.lineno}: damaged JSON ({error.msg})"
        raise DamagedJsonError(f"{where}: {what}; write it again") from error
    except (ValueError, RecursionError) as error:
        raise DamagedJsonError(f"{where}: damaged JSON: nested too deeply, or a number too long") from error


def _parse_number(value: Any, where: str, per_s: int = 0) -> tuple[float, int]:
    """Return a time, NaN: it is missing, and how many such are a second, where its form says that, else ``per_s``."""
    value = value.get("relative", value) if isinstance(value, dict) else value
    if isinstance(value, dict) and value.keys() <= {"seconds", "nanos"}:  # 0 is left out
        seconds, nanos = (_parse_number(value.get(name, 0), where)[0] for name in ("seconds", "nanos"))
        return seconds + nanos / 1e9, 1
    if not isinstance(value, str):
        missing = value in (None, -1)  # some services write -1 where they have none
        return math.nan if missing else require(values.number(), value, f"{where}: a time"), per_s
    if parts := MARKS["DURATION"].fullmatch(value):
        return sum(float(part or 0) * unit_s for part, unit_s in zip(parts.groups(), (3600, 60, 1), strict=True)), 1
    match, clock_s = MARKS["DIGITS"].fullmatch(value.strip()), parse_clock(value)
    if match is None and not math.isnan(clock_s):
        return clock_s, 1
    if match is not None:
        value, per_s = match[1].replace(",", "."), {"s": 1, "ms": 1000}.get((match[2] or "").lower(), per_s)
    if value.strip().lower() in ("", "nan", "null", "none", "n/a", "-1", "-1.0"):
        return math.nan, per_s
    return parse_number(value, f"{where}: a time is", "a number of seconds from the start of the recording"), per_s


def _parse_time(value: Any, where: str, per_s: float = 1) -> float:
    """Return a time in seconds. Raises InputError: it is missing, or no number."""
    time, stated_per_s = _parse_number(value, where)
    if math.isnan(time):
        raise InputError(f"{where} has no time")
    if abs(time / (stated_per_s or per_s)) > LATEST_S:
        raise InputError(f"{where}: a time is {time:g}, required seconds, up to {LATEST_S:g}")
    return time / (stated_per_s or per_s)


def _read_row(item: dict[str, Any], place: str, where: str, name: str, owner: Row | None, who: str) -> Row | None:
    """Return an item with its text and the times that it has; None: it has no text."""
    texts = (_find_text(item[name]) for name in NAMES["texts"] if name in item)
    text = next((each for each in texts if each is not None), None)
    is_phone = name in NAMES["phones"] or ({"phone", "phoneme"} & {*item} and "word" not in item)
    role = PHONE_LABELS if is_phone else WORDS if "word" in item or name in NAMES["words"] else ""
    if text is None and any(item.get(name) for name in ("text", "word")):
        stored = shorten(repr(item.get("text") or item.get("word"))[:200])
        raise InputError(f"{where}: {place}: its text is {stored}, required a text")
    if "visemeid" in item or item.get("type") == "viseme":
        viseme, role = str(item.get("visemeid", item.get("value"))), PHONE_LABELS
        text = PHONE_OF_VISEME[require(values.one_of(PHONE_OF_VISEME), viseme, f"{where}: {place}: the viseme")]
    if text is not None and "markname" in item and not MARKS["MARK"].fullmatch(text):
        raise InputError(
            f"{where}: {place} is the mark {shorten(text)!r}, which is no word; name every mark as the word that "
            'follows it, <mark name="hello"/>hello, or give the words as a transcript'
        )
    start, end, times = _find_times(item, f"{where}: {place}")
    if times.kind == "pieces" and name != "tokens":
        times = times._replace(kind="")
    return None if text is None else Row(start, end, text, place, times, who, role, "symbol" in item, owner=owner)


def _find_times(item: dict[str, Any], where: str) -> tuple[float, float, Times]:
    """Return the start and the end of an item, and which names they have."""
    stamp, members = item.get("timestamp"), item
    if isinstance(stamp, list) and len(stamp) == 2:
        members = {**members, "timestampstart": stamp[0], "timestampend": stamp[1]}
    if isinstance(stamp, int | float):
        members = {**members, "stamp": stamp}
    if isinstance(each := item.get("instances"), list) and each and isinstance(each[0], dict):  # Azure's of videos
        members = {**members, **each[0]}
    for name in ("time", "offsets"):  # an object of both
        if isinstance(item.get(name), dict):
            members = {**members, **{f"{name}{edge}": time for edge, time in item[name].items()}, name: None}
    times = next((row for row in KNOWN_TIMES if (row.start or row.end) in members), UNTIMED)
    if item.get("type") in NAMES["polly"] and not {"offsetsfrom", "timestampstart"} & members.keys():
        is_speechify = {"start", "starttime"} <= members.keys()
        times = POLLY if members.get("time") is not None else SPEECHIFY if is_speechify else times
    start, per_s = _parse_number(members.get(times.start), where, times.per_s)
    end, per_s = _parse_number(members.get(times.end), where, per_s)
    if math.isnan(end) and times.duration in members:
        length, length_per_s = _parse_number(members[times.duration], where, per_s)
        share = per_s / length_per_s if length_per_s else 1.0  # that of two units
        end = start + length * share if share else math.nan
    return start, end, times._replace(per_s=per_s)


def _find_text(value: Any) -> str | None:
    """Return the text of a member: of a list its lines, of alternatives the first; None: it is no text."""
    if isinstance(value, list) and value:
        if all(isinstance(line, str) for line in value):
            return " ".join(value)
        if all(isinstance(part, dict) and "utf8" in part for part in value):
            return "".join(str(part["utf8"]) for part in value)
        value = value[0]
    if isinstance(value, dict):
        return next((_find_text(value[name]) for name in NAMES["texts"] if name in value), None)
    return value if isinstance(value, str) else None


def _collect_rows(
    value: Any, lists: Lists, where: str, place: str = "", path: Place = ("",), owner: Row | None = None, who: str = ""
) -> None:
    """Add the items with a text in a value, and in all its members, to those of the same lists; of alternatives one."""
    name = path[-1]
    if isinstance(value, dict) and value and all(map(str.isdecimal, value)):  # a list as an object of numbers
        value = list(value.values())
    if isinstance(value, list):
        for number, each in enumerate(value[:1] if name in NAMES["alternatives"] else value, 1):
            item = _read_stamp(each) or each
            if isinstance(item, dict | list):
                at = f"{place}, {name or 'item'} {number}".strip(", ")
                _collect_rows(item, lists, where, at, path, owner, who)
            elif name in ("segments", "words"):
                require(values.members({}), item, f"{where}: {name!r}, item {number}")
    if not isinstance(value, dict) or len(path) > DEEPEST or not _is_said(value):
        return
    value = _list_items(value, ": ".join(filter(None, (where, f"{place}, {name}".strip(", ")))))
    names = (str(value[name]) for name in NAMES["speakers"] if isinstance(value.get(name), str | int))
    who = next(filter(None, names), who)
    row = _read_row(value, place, where, name, owner, who)
    if name == "words" and row is None:
        raise InputError(f"{where}: {place}: no text; required a member 'word'")
    if row is not None and (row.text or row.role != WORDS):
        rows = lists[path, row.role == PHONE_LABELS]
        _add_row(rows, row, value, where)
        check_count(len(rows), where)
    timed = row is not None and not math.isnan(row.start)
    passed = {"tokens" if timed else "", "alignment" if isinstance(value.get("normalizedalignment"), dict) else ""}
    for member, each in value.items():
        if member not in passed:
            _collect_rows(each, lists, where, place, (*path, member), row if timed else owner, who)


def _list_items(item: dict[str, Any], where: str) -> dict[str, Any]:
    """Return an object with lists of items for parallel ones: ``PARALLEL_LISTS``, words and their times, phones."""
    for name, members in PARALLEL_LISTS:
        lists: list[Any] = [item.get(member) for member in members]
        if not all(isinstance(each, list) for each in lists) or any(isinstance(each, dict) for each in lists[0]):
            continue
        if len({len(each) for each in lists}) > 1:
            raise InputError(f"{where}: required are the lists {', '.join(members)}, all of one length")
        check_count(len(lists[0]), where)
        items = [dict(zip(members.values(), row, strict=True)) for row in zip(*lists, strict=True)]
        item = {**{key: each for key, each in item.items() if key not in members}, name: items}
    stamps: list[Any] = next((item[name] for name in NAMES["stamps"] if isinstance(item.get(name), list)), [])
    if stamps and all(isinstance(stamp, list) and len(stamp) == 2 for stamp in stamps):
        text, words = str(item.get("text") or item.get("textseg")), item.get("words")
        words = words if isinstance(words, list) else MARKS["TOKEN"].findall(text)
        if len(words) != len(stamps):
            raise InputError(f"{where}: {len(stamps)} times of {len(words)} words; required a time of each")
        items = [{"word": word, "start": start, "end": end} for word, (start, end) in zip(words, stamps, strict=True)]
        return {**{name: each for name, each in item.items() if name not in NAMES["stamps"]}, "words": items}
    return _list_voice_phones(item, where)


def _list_voice_phones(item: dict[str, Any], where: str) -> dict[str, Any]:
    """Return an object of Piper or Kokoro with a list of its phones; another one as it is."""
    if isinstance(item.get("phonemealignments"), list):
        rate = require(values.number(1000, 1e6), item.get("samplerate"), f"{where}: the sample rate in hertz")
        phonemes = [each if isinstance(each, dict) else {} for each in item["phonemealignments"]]
        phones = [{"symbol": p.get("phoneme"), "samples": p.get("numsamples"), "rate": rate} for p in phonemes]
        return {"phones": phones}
    if isinstance(item.get("preddur"), list) and "phonemes" in item:
        letters = f"^{require(_TEXT, item['phonemes'], f'{where}: phonemes')}$"
        if len(item["preddur"]) != len(letters):
            what = f"{len(item['preddur'])} durations of {len(letters) - 2} phonemes"
            raise InputError(f"{where}: {what}, required two more than phonemes")
        ends = list(accumulate(_parse_time(each, where, KOKORO_FRAMES_PER_S) for each in item["preddur"]))
        rows = zip(letters, [0.0, *ends], ends, strict=False)
        phones = [{"symbol": KOKORO_LETTERS.get(a, a), "sentencestart": b, "sentenceend": c} for a, b, c in rows]
        return {"tokens": item.get("tokens"), "phones": phones}
    return item


def _join_characters(rows: list[Row]) -> list[Row]:
    """Return the words of characters, of pieces of words, or whole; one without an end lasts to the next one."""
    if any(row.text[1:].isalpha() for row in rows) and not any(MARKS["BLANK"].search(row.text) for row in rows):
        rows = [replace(row, text=f"{row.text} ".replace("@@ ", "")) for row in rows]
    starts = [*(row.start for row in rows[1:]), math.inf]
    lasting = [replace(row, end=after) if math.isnan(row.end) else row for row, after in zip(rows, starts, strict=True)]
    owner_of = [row for row in lasting for _ in row.text]
    spoken = MARKS["SPOKEN_WORD"].finditer("".join(row.text for row in rows).replace("▁", " "))
    edges = ((match[0], owner_of[match.start()], owner_of[match.end() - 1]) for match in spoken)
    return [replace(first, end=last.end, text=text, role=WORDS) for text, first, last in edges]


def _is_said(item: dict[str, Any]) -> bool:
    """Return whether an item may hold speech: it is of such a kind, it is sure, and it is in the sound."""
    kinds = () if {"chunks", "timeline"} & item.keys() else (str(item.get(kind, "")).lower() for kind in NAMES["kinds"])
    assessed = item.get("pronunciationassessment")
    missed = item.get("case") == MISSED or (isinstance(assessed, dict) and assessed.get("errortype") == OMITTED)
    is_sound = bool({"alignment", "normalizedalignment"} & item.keys())  # that is spoken, not heard
    unsure = not is_sound and any(item.get(name) == state for name, state in UNFINISHED.items())
    return not (missed or unsure or any(map(MARKS["NOT_SAID"].search, kinds)))


def _add_row(rows: list[Row], row: Row, item: dict[str, Any], where: str) -> None:
    """Add an item; phones of Gentle and Piper have lengths alone, and a piece of a word goes on with the one before."""
    same = bool(rows) and rows[-1].owner is row.owner
    if row.role == PHONE_LABELS and math.isnan(row.start) and (row.owner or "samples" in item):
        start = rows[-1].end if same else row.owner.start if row.owner else 0.0
        length = _parse_time(item.get("samples", item.get("duration")), f"{where}: {row.place}", item.get("rate", 1))
        phone = row.text if row.is_symbol else row.text.partition("_")[0]
        times = row.owner.times if row.owner else UNTIMED._replace(per_s=1)
        row = replace(row, start=start, end=start + length, text=phone, times=times)
    if same and row.times.kind == "pieces" and not row.text[:1].isspace() and row.speaker == rows[-1].speaker:
        end = rows[-1].end if math.isnan(row.end) or not any(map(str.isalnum, row.text)) else row.end
        before = rows.pop()
        row = replace(before, end=end, text=before.text + row.text)
    rows.append(row)


def _choose_rows(lists: Lists, *, phones: bool) -> list[Row]:
    """Return the words, or else the lines, or the phones, of the lists that are known best; words in their lines."""

    def rank(path: Place) -> tuple[bool, int]:
        has_words = any(row.role == WORDS for row in rows_of[path])
        return not has_words, NAMES["lists"].index(path[-1]) if path[-1] in NAMES["lists"] else len(NAMES["lists"])

    rows_of = {path: rows for (path, kind), rows in lists.items() if kind == phones}
    rows_of |= {path: _join_characters(rows) for path, rows in rows_of.items() if path[-1] in NAMES["characters"]}
    timed = [path for path in rows_of if any(row.times.end or not math.isnan(row.start) for row in rows_of[path])]
    rows = rows_of[min(timed, key=rank)] if timed else []
    parts: dict[int, list[Row]] = defaultdict(list)
    for row in rows:
        parts[id(row.owner)].append(row)
    around = (lines for (_, kind), lines in lists.items() if not (kind or phones))
    lines = next((lines for lines in around if any(id(line) in parts for line in lines)), None)
    if lines is None:
        return rows
    return [*(replace(line, parts=tuple(parts[id(line)])) for line in lines), *parts[id(None)]]


def _read_stamp(item: Any) -> dict[str, Any]:
    """Return a list that is a word with its times (IBM's, Qwen's) as an object; empty: it is no such list."""
    if not isinstance(item, list) or len(item) != 3 or not (isinstance(item[0], str) or isinstance(item[2], str)):
        return {}
    text, start, end = item if isinstance(item[0], str) else (item[2], *item[:2])
    return {"text": text, "start": start, "end": end}


def _collect_lists(objects: Objects, where: str) -> Lists:
    """Return the items of all objects by their lists. Raises InputError: pieces whose times each begin at 0."""
    lists: Lists = defaultdict(list)
    if all("sentence" in str(item.get("type")).lower() for _, item in objects):  # without words beside them
        objects = [(place, {**item, "type": "word"}) for place, item in objects]
    for place, item in objects:
        _collect_rows(item, lists, where, place if len(objects) > 1 else "")
    begun = {row.place.partition(",")[0] for rows in lists.values() for row in rows if row.times.kind == "sentence"}
    if len(objects) > 1 < len(begun):
        what = f"{len(begun)} pieces whose times each begin at 0; save the sound of each apart"
        raise InputError(f"{where}: holds {what}, and give those of one")
    words = [word for _, item in objects if isinstance(item.get("words"), list) for word in item["words"]]
    missed = sum(isinstance(word, dict) and word.get("case") == MISSED for word in words)
    if missed and where:
        LOG.warning("%s: %d words were not found in the sound and are left out", where, missed)
    return lists


def _read_lists(objects: Objects, where: str) -> list[LabelTier] | None:
    """Return lists of items in time: the phones, and what each speaker says; None: there are none."""
    lists = _collect_lists(objects, where)
    spoken, phones = (_choose_rows(lists, phones=kind) for kind in (False, True))
    if not (spoken or phones):
        if not (any(lists.values()) and all(item.keys() <= {*NAMES["text_alone"]} for _, item in objects)):
            known = [item[name] for _, item in objects for name in NAMES["lists"] if name in item]
            return [] if known and not any(known) else None
        spoken = next(filter(None, lists.values()))
    phones = _extend_to_next(phones, [])
    spoken = _extend_to_next(spoken, [row.start for row in phones if row.text == SILENCE])
    if not phones:
        return _build_spoken_tiers(spoken, where, may_be_phones=True)
    labels = _scale_rows(phones, PHONE_LABELS, where)
    labels = split_ipa(labels, where) if any(row.is_symbol for row in phones) else labels
    tier = LabelTier(PHONE_LABELS, tuple(labels), PHONE_LABELS)
    return [tier, *_build_spoken_tiers(spoken, where, may_be_phones=False)]


def _build_spoken_tiers(spoken: list[Row], where: str, *, may_be_phones: bool) -> list[LabelTier]:
    """Return a tier of each speaker: of words if nearly all rows are, else of lines, or of what may be phones."""
    spoken = _leave_out_repetition(spoken)
    if any(len({part.speaker for part in row.parts}) > 1 for row in spoken):
        spoken = [part for row in spoken for part in row.parts or (row,)]
    role, has_parts = _choose_role(spoken, where), any(each.parts for each in spoken)
    by_speaker: dict[str, list[TimedLabel]] = defaultdict(list)
    for each, label in zip(spoken, _scale_rows(spoken, role, where), strict=True):
        by_speaker[each.speaker or (each.parts[0].speaker if each.parts else "")].append(label)
    for labels in by_speaker.values():
        _warn_of_disorder(labels, where)
    if may_be_phones and not has_parts and not any(each.role == WORDS for each in spoken):
        role = PHONE_LABELS if all(holds_phones(LabelTier("", tuple(each))) for each in by_speaker.values()) else role
    return [LabelTier(who or role, tuple(labels), role, who) for who, labels in by_speaker.items()]


def _leave_out_repetition(spoken: list[Row]) -> list[Row]:
    """Return rows without the first half where the other one repeats it with speakers, as Google's last result does."""
    half = len(spoken) // 2
    first, again = ([(row.text, row.start) for row in part] for part in (spoken[:half], spoken[half:]))
    return spoken[half:] if half and first == again and spoken[0].speaker != spoken[-1].speaker else spoken


def _warn_of_disorder(labels: list[TimedLabel], where: str) -> None:
    """Log a warning if a speaker's labels are not in order of time."""
    pairs = pairwise(each for each in labels if not math.isnan(each.start_s))
    back = next((after for before, after in pairs if after.start_s < before.start_s - ROUNDING_S), None)
    if back and where:
        what = "before the one ahead of it; all are put in order of time: correct it if those of pieces begin anew"
        LOG.warning("%s: %s starts at %.2f s, %s", where, back.position, back.start_s, what)


def _choose_role(spoken: list[Row], where: str) -> str:
    """Return whether rows are words or lines. Raises InputError: they hold more words than a recording has."""
    counts = [len(find_words(extract_spoken_text(each.text[:LONGEST_JUDGED]))) for each in spoken]
    check_count(sum(counts) + sum(len(each.parts) for each in spoken), where, "words")
    single = sum(each.role == WORDS or count < 2 for each, count in zip(spoken, counts, strict=True))
    return LINES if single < SINGLE_SHARE * len(spoken) or any(each.parts for each in spoken) else WORDS


def _extend_to_next(rows: list[Row], silences: Iterable[float]) -> list[Row]:
    """Return rows, of which events last to the next one or to a silence, and the last one is open."""
    starts = [row.start for row in rows if row.times.kind == "event"]
    if not starts:
        return rows
    edges = sorted([*starts, *silences])
    later = [*edges, math.inf]
    in_time = sorted(rows, key=lambda row: row.start)
    return [replace(row, end=later[bisect_right(edges, row.start)]) if math.isnan(row.end) else row for row in in_time]


def _scale_rows(rows: list[Row], role: str, where: str) -> list[TimedLabel]:
    """Return rows in seconds, in the unit that their names say, or else in the one that their lengths do."""
    parts = [part for row in rows for part in row.parts or (row,)]
    judged = [part for part in parts if not part.times.per_s and not math.isnan(part.start)]
    if any(row.times.usual == 0 for row in judged):
        frames = "its times are offsets in frames, whose length is not known"
        raise InputError(f"{where}: {frames}; required start and end in seconds")
    spans = [(row.start, row.end, row.text) for row in judged]
    per_s = find_time_unit(spans, role, where, judged[0].times.usual) if judged else 1
    starts_s = [part.start / (part.times.per_s or per_s) for part in parts]

    def label(row: Row) -> TimedLabel:
        start_s, end_s = (time / (row.times.per_s or per_s) for time in (row.start, row.end))
        for time, time_s in ((row.start, start_s), (row.end, end_s)):
            if LATEST_S < abs(time_s) < math.inf:
                raise InputError(f"{where}: {row.place}: a time is {time:g}, required seconds, up to {LATEST_S:g}")
        start_s = math.nan if start_s <= EARLIEST_S else start_s
        if end_s < start_s - ROUNDING_S:
            what = f"{where}: {row.place} ends at {end_s:g} s, before its start at {start_s:g} s"
            if len(parts) <= 2 * sum(part.end < part.start for part in parts):
                raise InputError(f"{what}; correct it")
            LOG.log(logging.WARNING if where else logging.DEBUG, "%s; it is taken to last to the next start", what)
            end_s = min((each for each in starts_s if each > start_s), default=math.inf)
        end_s = start_s if end_s < start_s else end_s
        return TimedLabel(start_s, end_s, row.text, row.place, tuple(map(label, row.parts)))

    return [label(row) for row in rows]


def _read_named_tiers(objects: Objects, where: str) -> list[LabelTier] | None:
    """Return the tiers of the JSON of the Montreal Forced Aligner and of praatIO, by their names."""
    named: Any = objects[0][1].get("tiers") if len(objects) == 1 else None
    if isinstance(named, list) and all(isinstance(tier, dict) and "name" in tier for tier in named):
        named = {str(tier["name"]): tier for tier in named}
    listed = [*named.values()] if isinstance(named, dict) else [None]
    if not all(isinstance(tier, dict) and isinstance(tier.get("entries"), list) for tier in listed):
        return None
    tiers = []
    for name, tier in named.items():
        check_count(len(tier["entries"]), where)
        labels = []
        for number, entry in enumerate(tier["entries"], 1):
            place = f"tier {name!r}, entry {number}"
            if not isinstance(entry, list) or len(entry) not in (2, 3):
                raise InputError(f"{where}: {place} is no list of start, end and label")
            *times_s, text = (*(_parse_time(time, f"{where}: {place}") for time in entry[:-1]), entry[-1])
            labels.append(TimedLabel(times_s[0], times_s[-1], require(_TEXT, text, f"{where}: {place}"), place))
        if len(tier["entries"][0] if tier["entries"] else ()) == 3:
            tiers.append(find_tier(name, labels))
    return tiers
