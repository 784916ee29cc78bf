"""Words of a recording: ``recognise_words(speech) → recognition``, and their files: ``write_words``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lipmotion.errors import ExportError, InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.analysis.read_request import read_recording
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.request import SpeechInput, as_request
from lipmotion.pipeline.workers import map_in_processes
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.recognised_speech import RecognisedWord, Recognition
from lipmotion.speech.recognition.recogniser import RECOGNISER_KINDS, USING_WORDS, cached_recogniser
from lipmotion.storage.files import atomic_file, check_distinct, check_target
from lipmotion.storage.json_text import as_json
from lipmotion.types import Span, Timeline

TEXT, JSON = ".txt", ".json"
WITHOUT_WORDS = tuple(kind for kind in RECOGNISER_KINDS if kind not in USING_WORDS)
LINE_PAUSE_S = 0.5
"""A longer pause between words ends a line of text."""


@one_thread()
def recognise_words(speech: SpeechInput, *, model: Model | str | Path | None = None, workers: int = 1) -> Recognition:
    """Return the English words of a recording in time, with the phones that they or free recognition decided.

    speech  : an audio or video file, samples at 16 kHz, or a ``Request``, of which the transcript is not used
    model   : whose phone models align the words: from ``load_model``, or a path; None: the shipped one
    workers : as of ``animate``
    Raises InputError: the recording is not usable, or the recogniser does not recognise words.
    Raises MissingDependencyError: pocketsphinx is not installed.

    >>> from lipmotion.pipeline.analysis.words import recognise_words
    >>> found = recognise_words("examples/welcome.flac")
    >>> found.words[0].label.text, found.word_s > found.phone_s
    ('please', True)
    """
    request = as_request(speech)
    chosen = model if isinstance(model, Model) else load_model(model or request.model)
    if request.recogniser in WITHOUT_WORDS:
        raise InputError(
            f"the recogniser {request.recogniser!r} recognises phones, not words; required one of: "
            f"{', '.join(USING_WORDS)}"
        )
    audio = analysed(read_recording(request))
    recogniser = cached_recogniser(chosen.phones, request.recogniser, chosen.adaptation)
    return recogniser.recognition(audio, audio.mfcc(), map_in_processes(workers))


def format_words(words: Timeline[RecognisedWord]) -> str:
    """Return words as a transcript, a line for what is said without a long pause."""
    lines: list[list[str]] = []
    end_s = float("-inf")
    for span in words:
        if span.start_s - end_s > LINE_PAUSE_S:
            lines.append([])
        lines[-1].append(span.label.text)
        end_s = span.end_s
    return "".join(" ".join(line) + "\n" for line in lines)


def describe_word(span: Span[RecognisedWord]) -> dict[str, Any]:
    """Return a word for JSON: ``word``, ``start`` and ``end`` in seconds, and its confidence ``conf``, as Vosk's."""
    return {
        "word": span.label.text,
        "start": round(span.start_s, 3),
        "end": round(span.end_s, 3),
        "conf": round(span.label.confidence, 3),
    }


def write_words(
    words: Timeline[RecognisedWord], outputs: Sequence[str | Path], speech: str | Path | None = None
) -> None:
    """Write words to files that can be edited and given back as transcripts: ``.txt``, or ``.json`` with their times.

    speech : the recording, which must not be overwritten
    Raises ExportError: another suffix, no such folder, or a file that cannot be written; nothing is written then.
    """
    paths = check_word_outputs(outputs, speech)
    for path in paths:
        text = format_words(words)
        if path.suffix.lower() == JSON:
            document = {"result": [describe_word(span) for span in words], "text": " ".join(text.split())}
            text = as_json(document, indent=1) + "\n"
        with atomic_file(path) as unfinished:
            unfinished.write_text(text, encoding="utf-8")


def check_word_outputs(outputs: Sequence[str | Path], speech: str | Path | None = None) -> list[Path]:
    """Return the paths of files of words. Raises ExportError: as ``write_words``."""
    paths = [Path(output) for output in outputs]
    check_distinct(paths)
    for path in paths:
        if path.suffix.lower() not in (TEXT, JSON):
            raise ExportError(f"{path}: unknown format {path.suffix!r}; required one of: {TEXT} {JSON}")
        check_target(path, speech)
    return paths
