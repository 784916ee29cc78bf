"""Requests from files: of a job's request, the ``SpeechRequest``; a transcript is a text, or the path of a file."""

from __future__ import annotations

import re
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.formats.label_files import labels_beside, read_transcript, read_units, speakers_in
from lipmotion.pipeline.job import Request
from lipmotion.pipeline.understand.request import SpeechRequest
from lipmotion.storage.sources import check_kind
from lipmotion.types import TimedTranscript
from lipmotion.units import Lexicon

LONGEST_NAME, LONGEST_PATH = 255, 1000
"""Most bytes of the name of a file on any usual system; most letters of an argument that may be a path."""
_SUFFIX = re.compile(r"\.[A-Za-z]{1,10}")


def read_request(request: Request, *, words_beside: bool = False) -> SpeechRequest:
    """Return what is animated, with the content of its files.

    words_beside : use the text, subtitles or labels beside the recording, where no words and no phones are given
    Raises InputError: no recording is named, or a file cannot be read.
    """
    if request.recording is None:
        raise InputError("the job names no recording; required: [request] recording = 'FILE'")
    spoken_by = _speaker_of_labels(request)
    given = request.transcript
    transcript = text_or_file_content(given, request.tier, spoken_by) if given is not None else None
    units = read_units(request.units, request.tier, spoken_by) if request.units else None
    labels = labels_beside(request.recording) if words_beside and transcript is None and units is None else None
    if labels is not None:
        transcript, units = labels.transcript, labels.phones if labels.transcript is None else None
    return SpeechRequest(
        request.recording,
        transcript=transcript,
        units=units,
        lexicon=read_lexicon(request),
        language=request.language,
        recogniser=request.recogniser,
        speaker="" if spoken_by else request.speaker,
        onto=request.onto,
        onto_speaker=request.onto_speaker,
        pauses=request.pauses,
        manner=request.manner,
        asymmetry=request.asymmetry,
    )


def read_lexicon(request: Request) -> Lexicon | None:
    """Return the pronunciations that a request names; None: it names none. Raises InputError: they cannot be read."""
    return Lexicon.from_file(request.lexicon) if request.lexicon else None


def _speaker_of_labels(request: Request) -> str:
    """Return the speaker of a request if its labels have one of that name: it then is whose words are read."""
    files = (Path(name) for name in (request.transcript, request.units) if name is not None and request.speaker)
    named = (name.lower() for file in files if _file_exists(file) for name in speakers_in(file))
    return request.speaker if request.speaker.lower() in named else ""


def text_or_file_content(argument: str, tier: str = "", speaker: str = "") -> str | TimedTranscript:
    """Return the content of the file that the argument names, else the argument itself.

    tier, speaker : of a file of labels, which tier and whose words

    Raises InputError: the argument looks like a file name but no such file exists, or the file cannot be read.
    """
    path = Path(argument)
    looks_like_path = _may_be_name(argument) and (_SUFFIX.fullmatch(path.suffix) or _is_in_a_folder(argument))
    if not looks_like_path and not _file_exists(path):
        return argument
    check_kind(path, "text", "transcript")
    return read_transcript(path, tier, speaker)


def _may_be_name(argument: str) -> bool:
    """Return whether the system may have a file of that name: no blank in it, and no part too long."""
    parts = argument.encode("utf-8", "surrogatepass").split(b"/")
    return (
        " " not in argument
        and "\0" not in argument
        and max(map(len, parts)) <= LONGEST_NAME
        and len(argument) < LONGEST_PATH
    )


def _is_in_a_folder(argument: str) -> bool:
    """Return whether an argument without blanks names a place in a folder that exists, as ``subtitles/take1``."""
    folder, separator, name = argument.rpartition("/")
    try:
        return bool(separator and name) and not any(map(str.isspace, argument)) and Path(folder or "/").is_dir()
    except (OSError, ValueError):  # too long for a path, or with a character that no path has
        return False


def _file_exists(path: Path) -> bool:
    """Return whether a file, a pipe or a device of that name exists; a folder does not count."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):  # too long for a file name, or with a character that no file name has
        return False
