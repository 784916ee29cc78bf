"""Requests from files: its sound, words, phones and lexicon are read here.

Formats of labels and of motion are imported where such a file is read: most requests have none.
"""

from __future__ import annotations

import logging
import os
import re
from dataclasses import replace
from pathlib import Path

from lipmotion.errors import InputError, shorten_list
from lipmotion.pipeline.request import Request
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.storage.sources import check_kind, is_folder
from lipmotion.types import Audio, TimedTranscript, Timeline, Unit
from lipmotion.units import Lexicon
from lipmotion.units.text_normalisation import tokenise

LOG = logging.getLogger("lipmotion")

LABEL_SUFFIXES = (".textgrid", ".eaf", ".lab", ".phn", ".txt", ".json", ".jsonl", ".marks", ".csv", ".tsv")
"""Suffixes of label files; content decides which form they have. ``.json`` and ``.csv`` may also be motion."""
LONGEST_NAME, LONGEST_PATH = 255, 1000
"""Most bytes of the name of a file on any usual system; most letters of an argument that may be a path."""
_SUFFIX = re.compile(r"\.[A-Za-z]{1,10}")


def read_request(request: Request, *, words_beside: bool = False, is_typed: bool = True) -> Request:
    """Return a request with its words, phones and lexicon read; what is a value already stays.

    words_beside : use the text, subtitles or labels beside the recording, where no words and no phones are given
    is_typed     : whether a transcript that is a text may be the name of a file, as what a user types
    Raises InputError: no recording is named, or a file cannot be read.
    """
    if request.recording is None:
        raise InputError("the job names no recording; required: [request] recording = 'FILE'")
    transcript, units = request.transcript, request.units
    spoken_by = _find_label_speaker(request, is_typed=is_typed)
    if is_typed and isinstance(transcript, str):
        transcript = read_text_or_file(transcript, request.tier, spoken_by)
    elif isinstance(transcript, Path) or (isinstance(transcript, str) and ":" in transcript):  # perhaps subtitles
        transcript = _read_words(transcript, request.tier, spoken_by)
    if isinstance(units, Path):
        units = read_units(units, request.tier, spoken_by)
    if words_beside and transcript is None and units is None and isinstance(request.recording, Path):
        from lipmotion.formats.label_files import find_labels

        labels = find_labels(request.recording)
        transcript, units = labels.transcript, labels.phones if labels.transcript is None else None
    return replace(
        request,
        transcript=transcript,
        units=units,
        lexicon=None if request.lexicon is None else read_lexicon(request),
        speaker="" if spoken_by else request.speaker,
    )


def read_lexicon(request: Request) -> Lexicon:
    """Return the pronunciations of a request; those of the dictionary alone, where it has none.

    Raises InputError: its file cannot be read.
    """
    lexicon = request.lexicon
    if not isinstance(lexicon, str | Path):
        return lexicon or Lexicon()
    read = Lexicon.from_file(lexicon)
    odd = (word for word in read.user if not word.replace("'", "").isalpha())
    if unused := [word for word in odd if len(tokenise(word)) != 1]:
        what = "are read as several words, and not by this file: give the pronunciation of each word"
        LOG.warning("%s: %s %s", lexicon, shorten_list(unused), what)
    return read


def read_recording(request: Request) -> Audio:
    """Return the samples of a request's recording. Raises InputError: it cannot be read."""
    recording = request.recording
    if isinstance(recording, Audio):
        return recording
    if not isinstance(recording, str | Path):
        kind = type(recording).__name__
        raise InputError(f"the recording is a {kind}, required a path, or samples as lipmotion.Audio(samples, rate_hz)")
    return read_audio(Path(recording))


def _find_label_speaker(request: Request, *, is_typed: bool) -> str:
    """Return the speaker of a request if its labels have one of that name: it then is whose words are read."""
    sources = (request.transcript, request.units) if request.speaker else ()
    kinds = (str, Path) if is_typed else Path
    files = [Path(name) for name in sources if isinstance(name, kinds) and _exists(Path(name))]
    if not files:
        return ""
    from lipmotion.formats.label_files import list_speakers

    speakers = (name.lower() for file in files for name in list_speakers(file))
    return request.speaker if request.speaker.lower() in speakers else ""


def read_text_or_file(argument: str, tier: str = "", speaker: str = "") -> str | TimedTranscript:
    """Return the content of the file that the argument names, else the argument itself.

    tier, speaker : of a file of labels, which tier and whose words
    Raises InputError: the argument looks like a file name but no such file exists, or the file cannot be read.
    """
    path = Path(argument)
    if not _exists(path):
        parts = argument.encode("utf-8", "surrogatepass").split(b"/")
        may_be_name = " " not in argument and "\0" not in argument and len(argument) < LONGEST_PATH
        if not may_be_name or max(map(len, parts)) > LONGEST_NAME:
            return argument
        folder, separator, name = argument.rpartition("/")
        in_folder = bool(separator and name) and not any(map(str.isspace, argument))  # as subtitles/take1
        if not _SUFFIX.fullmatch(path.suffix) and not (in_folder and is_folder(Path(folder or "/"))):
            return argument
    return _read_words(path, tier, speaker)


def _read_words(words: Path | str, tier: str, speaker: str) -> str | TimedTranscript:
    from lipmotion.formats.label_files import read_transcript

    if isinstance(words, Path):
        check_kind(words, "text", "transcript")
    return read_transcript(words, tier, speaker)


def _exists(path: Path) -> bool:
    """Return whether a file, a pipe or a device of that name exists; False also for names that are not valid."""
    return os.path.exists(path) and not is_folder(path)  # noqa: PTH110 (which raises for some)


def read_units(path: str | Path, tier: str = "", speaker: str = "") -> Timeline[Unit]:
    """Return the phones in time of a file.

    path : a motion file (``.json``, ``.npz``); a ``.json`` with the member ``units`` alone; or any file of labels that
           corpora may have (``LABEL_SUFFIXES``): a TextGrid with a tier of phones, Audacity's or HTK's labels, the
           timings of a voice or an aligner
    tier, speaker : of labels, which tier and whose phones (``read_phones``)
    Raises InputError: no such file, not one of these, or without phones.
    """
    from lipmotion.formats.base import find_suffix, read_motion_units
    from lipmotion.formats.label_files import holds_timings, read_phones

    path = Path(path)
    check_kind(path, "motion file", "units file")
    is_label = path.suffix.lower() in LABEL_SUFFIXES
    if find_suffix(path) and not (is_label and holds_timings(path)):
        return read_motion_units(path)
    if is_label:
        return read_phones(path, tier, speaker)
    required = "use one of .json, .npz, .TextGrid, .eaf, .lab, .txt, .jsonl, .marks"
    raise InputError(f"{path}: cannot read phones from {path.suffix!r}; {required}")
