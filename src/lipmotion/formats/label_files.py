"""Files of labels in time, by the suffix or by their content, and those of one recording, which lie beside it."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass, replace
from functools import lru_cache
from io import StringIO
from itertools import islice
from pathlib import Path

from lipmotion.errors import ExportError, InputError, shorten, shorten_list
from lipmotion.formats.annotations import MARKS as DOCUMENTS
from lipmotion.formats.annotations import parse_interval_tiers, read_xml_tiers, write_textgrid
from lipmotion.formats.label_services import DamagedJsonError, describe_json, is_json, parse_service_tiers
from lipmotion.formats.label_tiers import (
    LINES,
    OTHER,
    PHONE_LABELS,
    RECOGNISED_LABEL,
    RECOGNISED_PHONES,
    WORDS,
    LabelTier,
    TimedLabel,
    attach_words,
    holds_phones,
    map_to_inventory,
    merge_timelines,
    parse_seconds,
    read_phone_tier,
    read_transcript_tier,
    split_speakers,
)
from lipmotion.formats.subtitles import MARKS as SUBTITLES
from lipmotion.formats.subtitles import convert_timecodes, is_subtitles, parse_subtitles, write_subtitles
from lipmotion.formats.timed_lines import parse_line_tiers
from lipmotion.printable import is_line
from lipmotion.storage.sources import read_text_file
from lipmotion.types import TimedTranscript, TimedWord, Timeline, TranscriptLine, Unit
from lipmotion.units import UNKNOWN_PHONES, RecognisedPhone, find_phone, restore_confidences
from lipmotion.units.spelling import read_patterns
from lipmotion.units.spoken_text import parse_tagged_text, remove_known_tags
from lipmotion.units.text_normalisation import LARGEST_TRANSCRIPT_BYTES, require_tokens
from lipmotion.units.written_forms import list_readings

LOG = logging.getLogger("lipmotion")
RECOGNISED = tuple(".srt .vtt .ass .ssa .sbv .lrc .ttml .dfxp .json .jsonl .ctm .stm .tsv".split())
"""Suffixes of subtitles and of what recognisers write."""
FOR_WORDS = (".txt", ".TextGrid", ".textgrid", ".eaf", ".lab", ".wrd", *RECOGNISED)
"""Suffixes in whose files words are searched, in order: plain text first, as labels in time may not be words, and what
may be recognised last."""
FOR_PHONES = (".TextGrid", ".textgrid", ".eaf", ".lab", ".phn", ".txt")  # the same for phones
LARGEST_LABELS = 1 << 24  # most bytes of a label file: labels of a day
MARKS = read_patterns(Path(__file__).with_name("label_files.tsv"))
"""Patterns of the forms that are read, by their names in the table."""
CHAPTER = ".trans.txt"
"""Ends the name of the transcripts of a chapter in LibriSpeech: in each line the name of a recording, and its words."""
METADATA = "metadata.csv"
"""The transcripts of LJSpeech, beside its recordings or a folder above: ``name|…|words``, a line for each."""
JUDGED_LINES = 1000  # lines of a text that are judged for whether they hold times
NAMED_TIERS = 12  # most names in a message
_WRITERS = {".TextGrid": write_textgrid, ".vtt": write_subtitles, ".srt": write_subtitles}
LABEL_SUFFIXES = tuple(_WRITERS)
"""Suffixes of label files that are written, as programs write them; capitals do not matter."""


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
        tokens = self.transcript.words if self.transcript else ()
        return tuple(word for token in tokens for word in list_readings(token)[0]) or None


def find_labels(recording: Path, *, ignored: frozenset[Path] = frozenset()) -> RecordingLabels:
    """Return the labels from the files beside a recording that have its name, with a suffix of ``FOR_WORDS``.

    Those of ``RECOGNISED`` may have a language as well (``take.en.vtt``), or the whole name (``take.mp4.srt``); JSON
    that is no transcript, as motion, is passed over. Without any, its line among those of its chapter, as in
    LibriSpeech (of ``19-198-0004.flac`` in ``19-198.trans.txt``), or of all, as in LJSpeech (``METADATA``).
    ignored : files that are no labels (the lists of the splits)
    Raises InputError: one of them cannot be read, or the recording is not in its chapter.
    """
    seen: list[Path] = []
    read: list[tuple[Path, RecordingLabels]] = []
    for path in find_label_files(recording):
        if path not in ignored and not any(path.samefile(other) for other in seen):
            labels = _read(path, unknown_json=path.suffix == ".json")
            read += [(path, labels)] if labels is not None else []
            seen.append(path)
    for path in [] if seen else find_tables(recording):
        words = _parse_table(_read_text(path), is_bars=path.name == METADATA).get(recording.stem)
        if words is not None and not read:
            read.append((path, _read_plain(words, path)))
        elif path.name != METADATA:
            raise InputError(f"{path}: has no line of {recording.stem}; required this name, a blank and its words")
    in_order = sorted(read, key=lambda item: (*FOR_PHONES, item[0].suffix).index(item[0].suffix))
    transcripts = (labels.transcript for _, labels in read if labels.transcript)
    return RecordingLabels(next(transcripts, None), next((each.phones for _, each in in_order if each.phones), None))


def find_label_files(recording: Path) -> list[Path]:
    """Return the files beside a recording that ``find_labels`` reads, in the order of ``FOR_WORDS``."""
    names: list[Path] = []
    for suffix in dict.fromkeys((*FOR_WORDS, *FOR_PHONES)):
        names.append(recording.with_suffix(suffix))
        if suffix in RECOGNISED:
            names += [recording.with_suffix(f".en{suffix}"), recording.with_name(recording.name + suffix)]
    shouted = (path.with_suffix(path.suffix.upper()) for path in names)
    either = (path if path.is_file() else other for path, other in zip(names, shouted, strict=True))
    return [path for path in either if path.is_file()]


def find_tables(recording: Path) -> list[Path]:
    """Return the files of many recordings' words that ``find_labels`` reads where a recording has no other file."""
    chapter = recording.with_name(recording.stem.rpartition("-")[0] + CHAPTER)
    tables = (folder / METADATA for folder in recording.absolute().parents[:2])
    return [path for path in (chapter, *tables) if path.is_file()]


@lru_cache(maxsize=2)  # many recordings have one table
def _parse_table(text: str, *, is_bars: bool) -> dict[str, str]:
    """Return the words of recordings by their names; ``is_bars``: fields are divided as in ``METADATA``."""
    words: dict[str, str] = {}
    for line in StringIO(text):
        name, *rest = re.split(r"\|" if is_bars else " +", line.strip(), maxsplit=1)
        if rest or not is_bars:
            for key in {Path(name).name, Path(name).stem if is_bars else name}:
                words.setdefault(key, rest[0].rpartition("|")[2] if rest else "")
    return words


def read_labels(path: Path) -> RecordingLabels:
    """Return the words and phones of one file.

    Read are TextGrids, ELAN's ``.eaf``, labels with times (HTK, Audacity, TIMIT), tables, subtitles, the JSON of
    recognisers, voices and aligners, CTM, the texts of LRS, and plain text; the content decides, not the name.
    Phones of which some are unknown are left out, with a warning.
    Raises InputError: not text, damaged, overlapping phones, or labels among phones that are no phones.
    """
    return _read(path, unknown_json=False) or RecordingLabels()


def read_transcript(path: Path | str, tier: str = "", speaker: str = "") -> str | TimedTranscript:
    """Return the text of a file of plain text, or the words in time of one of another kind that ``read_labels`` reads.

    path : or a text itself, of which subtitles alone are read
    tier, speaker : which tier and whose words; empty: all that hold words are read, and a warning names the speakers
    Raises InputError: as ``read_labels``, no such file, phones without words, or no such tier or speaker.
    """
    if isinstance(path, str) and not is_subtitles(path):
        return path
    text, path = (path, Path("the transcript")) if isinstance(path, str) else (_read_text(path, "transcript"), path)
    tiers = _read_tiers(text, str(path))
    if tiers is None:
        _check_plain(text, path)
        return text
    transcript = _choose_transcript(tiers, str(path), tier, speaker)
    if transcript is None:
        what = "phones in time, but no words; give them as units" if any(map(holds_phones, tiers)) else "no word"
        raise InputError(f"{path}: the transcript holds {what}")
    return transcript


def read_phones(path: Path, tier: str = "", speaker: str = "") -> Timeline[Unit]:
    """Return the phones in time of a TextGrid or of another file of labels with times; they may have gaps.

    They have the words of the tier of words, and are recognised, not known, where the tier of recognised phones has the
    same. Vowels stay as they are labelled, whatever words another tier has; the end of the last phone may be infinite.
    Speech of which the phones are not known (``spn``, ``<unk>``) has the unit ``units.UNKNOWN_PHONES``, and its word
    where that is known.
    tier, speaker : which tier and whose phones; empty: those of all speakers, whom a warning names
    Raises InputError: no such file or tier or speaker, as ``read_labels``, or no phones in time.
    """
    text, where = _read_text(path, "units"), str(path)
    tiers = _choose_tiers(_read_tiers(text, where) or [], where, tier, speaker)
    phones = _choose_phones(tiers, where)
    if not phones and any(each.role in (WORDS, LINES, "") for each in tiers):
        raise InputError(f"{where}: holds words in time, but no phones; give it as a transcript (--transcript)")
    if not phones:
        held = f"{describe_json(text, where)}; " if is_json(text) else "holds no phones in time, "
        wanted = "a motion file (.json, .npz), a TextGrid with a tier of phones, or labels with times, one phone a line"
        raise InputError(f"{where}: {held}required {wanted}")
    _name_speakers(phones, where)
    spoken = [(read_phone_tier(each, (), where, with_gaps=True), _choose_words(each, tiers)) for each in phones]
    units = merge_timelines([attach_words(*each) for each in spoken])
    recognised = next((each.labels for each in tiers if each.role == RECOGNISED_PHONES), None)
    pairs = [(each, RECOGNISED_LABEL.fullmatch(each.text)) for each in recognised or ()]
    rows = (RecognisedPhone(each.start_s, each.end_s, match[1], float(match[2])) for each, match in pairs if match)
    return units if recognised is None else restore_confidences(units, rows)


def list_speakers(path: Path) -> tuple[str, ...]:
    """Return the speakers whom a file of labels names, none of another or a damaged file."""
    if not path.is_file() or path.stat().st_size > LARGEST_LABELS:
        return ()
    try:
        tiers = _read_tiers(_read_text(path), "") or []
    except InputError:  # said by the reader
        return ()
    return tuple(dict.fromkeys(tier.speaker for tier in split_speakers(tiers) if tier.speaker))


def holds_timings(path: Path) -> bool:
    """Return whether a file has the timings of a voice or an aligner; False: it is another file, or no file at all."""
    if not path.is_file() or not 0 < path.stat().st_size <= LARGEST_LABELS:
        return False
    text = _read_text(path)
    try:
        if MARKS["MOTION"].search(text[:64]):
            return False
        return bool(parse_service_tiers(text, "")) if is_json(text) else parse_line_tiers(text, "") is not None
    except InputError as error:  # said by the reader, if it is damaged by that of motion
        return not isinstance(error, DamagedJsonError)


def _read(path: Path, *, unknown_json: bool) -> RecordingLabels | None:
    """Return the labels of a file; None for JSON of another kind, if expected. Raises InputError: none is of speech."""
    text = "" if unknown_json and path.stat().st_size > LARGEST_LABELS else _read_text(path)
    where = str(path)
    tiers = _read_tiers(text, where) if is_json(text) or not unknown_json else None
    if tiers is None:
        return None if unknown_json else _read_plain(text, path)
    chosen = _choose_tiers(tiers, where)
    phones = _choose_phones(chosen, where)
    transcript = _choose_transcript(tiers, where)
    if not phones:
        if transcript is None and any(tier.role != LINES and tier.labels for tier in chosen):
            raise InputError(f"{where}: {chosen[0].name} holds no word; remove the file if the words are not known")
        return RecordingLabels(transcript)
    several = len(phones) > 1
    timeline = merge_timelines([read_phone_tier(t, _choose_words(t, chosen), where, with_gaps=several) for t in phones])
    unknown_s = [span.start_s for span in timeline if span.label.unit == UNKNOWN_PHONES]
    if unknown_s:
        what = f"the phones of {len(unknown_s)} stretches of speech are not known, the first at {unknown_s[0]:.2f} s"
        LOG.warning("%s: %s; its phones are left out, and its words are aligned", where, what)
    return RecordingLabels(transcript, None if unknown_s else timeline)


def _read_plain(text: str, path: Path) -> RecordingLabels:
    """Return the words of a plain text. Raises InputError: it is another one."""
    _check_plain(text, path)
    text, tags = parse_tagged_text(text)
    tokens = text.split()
    one_a_line = len(tokens) == sum(bool(line.strip()) for line in text.splitlines())
    if len(tokens) > 1 and one_a_line and all(map(find_phone, tokens)):
        raise InputError(f"{path}: a list of phones without times; add their times, or give the words instead")
    if not tokens:
        LOG.warning("%s: is empty: it counts as no transcript; write the words that are said, or remove it", path)
        return RecordingLabels()
    return RecordingLabels(TimedTranscript((TranscriptLine(tuple(map(TimedWord, require_tokens(text)))),), tags))


def _read_tiers(text: str, where: str) -> list[LabelTier] | None:
    """Return the tiers of a text whose form has times, in the phones of the inventory; None of any other text."""
    try:
        if DOCUMENTS["TEXTGRID"].match(text):
            tiers: list[LabelTier] | None = parse_seconds(parse_interval_tiers(text, where), where)
        elif DOCUMENTS["ROOT"].match(text):
            tiers = read_xml_tiers(text, where)
        elif is_subtitles(text := convert_timecodes(text, where)):
            tiers = [parse_subtitles(text, where)]
        else:
            tiers = parse_service_tiers(text, where) if is_json(text) else parse_line_tiers(text, where)
    except RecursionError as error:
        raise InputError(f"{where}: is nested too deeply; give the words in time alone") from error
    return None if tiers is None else [map_to_inventory(tier, where) for tier in tiers]


def _choose_tiers(tiers: list[LabelTier], where: str, tier: str = "", speaker: str = "") -> list[LabelTier]:
    """Return the tiers that are said or seen, of those the ones that are asked for."""
    tiers = split_speakers(tiers)
    if speaker:
        tiers = [each for each in tiers if each.speaker.lower() == speaker.lower()] or _refuse(
            "speaker", speaker, [each.speaker for each in tiers], where
        )
    if tier:
        named = next((each for each in tiers if each.name.lower() == tier.lower()), None)
        if named is None and any(each.speaker.lower() == tier.lower() for each in tiers):
            return _choose_tiers(tiers, where, speaker=tier)
        named = named or _refuse("tier", tier, [each.name for each in tiers], where)[0]
        if not named.role or named.role == OTHER:
            named = replace(named, role=PHONE_LABELS if holds_phones(replace(named, role="")) else LINES)
        same = (WORDS, LINES, "", OTHER) if named.role in (WORDS, LINES) else (PHONE_LABELS,)
        others = [each for each in tiers if each.role not in same and each.speaker == named.speaker]
        return [map_to_inventory(named, where), *(each for each in others if each.role and each.name != named.name)]
    return [each for each in tiers if each.role != OTHER and each.is_said]


def _refuse(kind: str, name: str, known: list[str], where: str) -> list[LabelTier]:
    names = shorten_list([repr(each) for each in dict.fromkeys(filter(None, known))], NAMED_TIERS) or "none with a name"
    raise InputError(f"{where}: has no {kind} {shorten(name)!r}; it has: {names}")


def _choose_phones(tiers: list[LabelTier], where: str) -> list[LabelTier]:
    """Return the tiers of phones, one of each speaker. Raises InputError: a speaker has several."""
    phones: dict[str, LabelTier] = {}
    for tier in filter(holds_phones, tiers):
        if tier.speaker in phones:
            first = phones[tier.speaker].name
            raise InputError(f"{where}: tier {first!r} and tier {tier.name!r} both hold phones; choose one with --tier")
        phones[tier.speaker] = tier
    return list(phones.values())


def _choose_transcript(tiers: list[LabelTier], where: str, tier: str = "", speaker: str = "") -> TimedTranscript | None:
    """Return the words of the best tier of each speaker: one of words, of lines, or else the first of another kind."""
    chosen = [each for each in _choose_tiers(tiers, where, tier, speaker) if not holds_phones(each)]
    best: dict[str, LabelTier] = {}
    for role in (WORDS, LINES, ""):
        for each in chosen:
            if each.role == role and any(label.text or label.parts for label in each.labels):
                best.setdefault(each.speaker, each)
    if any(best):
        best.pop("", None)
    first = best.get("")
    others = [each.name for each in chosen if first and not first.role and each is not first and each.labels]
    if first and others:
        names = shorten_list(list(map(repr, others)), NAMED_TIERS)
        LOG.warning("%s: the words of tier %r are read; others are %s; --tier chooses", where, first.name, names)
    _name_speakers(list(best.values()), where)
    transcript = read_transcript_tier(list(best.values()), where)
    return transcript if transcript.lines else None


def _name_speakers(tiers: list[LabelTier], where: str) -> None:
    speakers = [tier.speaker for tier in tiers if tier.speaker]
    if len(speakers) > 1:
        names = shorten_list(speakers, NAMED_TIERS)
        LOG.warning("%s: %d people speak: %s; all are read; --tier NAME chooses one", where, len(speakers), names)


def _choose_words(phones: LabelTier, tiers: list[LabelTier]) -> tuple[TimedLabel, ...]:
    """Return the words in time of the speaker of some phones; none where labels hold several."""
    spoken = [tier for tier in tiers if tier.speaker == phones.speaker and not holds_phones(tier)]
    words = next((tier.labels for role in (WORDS, "") for tier in spoken if tier.role == role), ())
    return words if all(len(label.text.split()) < 2 for label in words) else ()


def read_plain_text(path: Path) -> str:
    """Return the text of a file of words alone: times and marks of labels and subtitles would be read as words.

    Raises InputError: no such file, larger than ``LARGEST_TRANSCRIPT_BYTES``, not UTF-8 text, or labels in time.
    """
    text = read_text_file(path, "transcript", LARGEST_TRANSCRIPT_BYTES)
    if DOCUMENTS["TEXTGRID"].match(text) or parse_line_tiers(text, str(path)) is not None:
        raise InputError(f"{path}: holds labels in time, required the words alone; write them into a text file")
    _check_no_labels(text, str(path))
    return text


def _check_no_labels(text: str, where: str) -> None:
    """Raise InputError for labels, subtitles and documents in forms that are not read."""
    start, match = text[:200].lstrip(), SUBTITLES["NO_ARROW"].search(text)
    line = shorten(match[0].strip()) if match else ""
    header = re.search(r"^#$", text[:2000], re.MULTILINE)  # of ESPS
    body = (each.strip() for each in StringIO(text[header.end() if header else 0 :]))
    lines = list(islice(filter(None, body), JUDGED_LINES))
    numbered, timed_lines = (sum(bool(MARKS[name].match(each)) for each in lines) for name in ("NUMBERED", "TIME"))
    with_two = sum(len(list(islice(MARKS["TIME"].finditer(each), 2))) > 1 for each in lines)
    seems_timed = len(lines) > 1 and ((2 * numbered > len(lines) and timed_lines > 0) or 2 * with_two >= len(lines))
    clock = "00:00:01,000 --> 00:00:02,500"
    timed = "its lines hold times, but not as in a TextGrid, HTK's or Audacity's labels"
    forms = {
        "holds NUL characters: is it UTF-16 without its mark? save it as UTF-8 text": "\0" in text,
        "is closed captions in Scenarist's code (SCC); save them as .srt": start.startswith("Scenarist_SCC"),
        "is a file of mouth cues, which are motion and no words; render it": MARKS["CUES"].match(start),
        "is a master label file, required the words alone": start.startswith("#!MLF!#"),
        f"begins with {shorten(start[:20])!r}, required the words alone; save it as text": MARKS["MARKUP"].match(start),
        "is a file of subtitles, required the words alone; write them into a text file": is_subtitles(text),
        f"has the line {line!r}, two times as in subtitles; required: times as in {clock}, or the words alone": match,
        f"{timed}; save it in one of these forms, or give the words alone": seems_timed,
    }
    wrong = next((message for message, is_so in forms.items() if is_so), None)
    if wrong is not None:
        raise InputError(f"{where}: {wrong}")


def _check_plain(text: str, path: Path) -> None:
    """Raise InputError for a text that is no plain text, or more than a transcript has."""
    if len(text) > LARGEST_TRANSCRIPT_BYTES:
        limit = f"required at most {LARGEST_TRANSCRIPT_BYTES}"
        raise InputError(f"{path}: {len(text)} characters, {limit}: is it a transcript?")
    if is_json(text):
        raise InputError(f"{path}: {describe_json(text, str(path))}")
    _check_no_labels(remove_known_tags(text), str(path))


def _read_text(path: Path, kind: str = "label") -> str:
    text = read_text_file(path, kind, LARGEST_LABELS, western=True)
    text = text if "\n" in text else text.replace("\r", "\n")
    if not text.startswith("#!MLF!#"):
        return text
    names = MARKS["MASTER"].findall(text)
    if len(names) != 1:
        held = f"is a master label file of {len(names)} recordings: {shorten_list(names, NAMED_TIERS)}"
        raise InputError(f"{path}: {held}; required the labels of one; write a .lab beside each recording")
    return re.sub(r"^\.[ \t\r]*$", "", MARKS["MASTER"].sub("\n", text), flags=re.MULTILINE)


def write_labels(path: Path, units: Timeline[Unit]) -> None:
    """Write phones and words in time in the format of the suffix. Raises ExportError: a label that is no line."""
    for label in [span.label for span in units]:
        if not is_line(label.phone + label.unit + label.word):
            what = "a line end, a control character or half a character"
            raise ExportError(f"{path}: {shorten(repr(label))} has {what}")
    write = next(write for suffix, write in _WRITERS.items() if suffix.lower() == path.suffix.lower())
    write(path, units)
