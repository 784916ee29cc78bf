"""Recognisers of words that users install themselves: Whisper (faster-whisper) and Vosk, with a model on the disk."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lipmotion.errors import InputError, MissingDependencyError, shorten
from lipmotion.extensions import install_command
from lipmotion.types import Audio, TimedTranscript, TimedWord, TranscriptLine, sort_lines
from lipmotion.units.spoken_text import extract_spoken_text, time_words

LOG = logging.getLogger("lipmotion")
ENGLISH = "en"
STEP = 8000
"""Samples that Vosk is given at a time."""


class InstalledRecogniser(NamedTuple):
    """A recogniser that users install themselves.

    package : the module to import
    parts   : files or folders of a model, one of each group
    words   : returns the lines of a recording, given the module and the folder; none in other languages than English
    """

    package: str
    parts: tuple[tuple[str, ...], ...]
    words: Callable[[Any, Path, Audio], list[TranscriptLine]]


def recognise_words(audio: Audio, kind: str) -> TimedTranscript | None:
    """Return the words of a recording in time, or None where nothing is said in English.

    audio : at 16 kHz
    kind  : ``whisper`` or ``vosk``, of ``INSTALLED_RECOGNISERS``
    ``LIPMOTION_WHISPER_MODEL`` and ``LIPMOTION_VOSK_MODEL`` name the folders of models. Nothing is ever downloaded.
    Raises MissingDependencyError: the package is not installed. Raises InputError: no model, or one it cannot read.
    """
    recogniser, variable = INSTALLED_RECOGNISERS[kind], f"LIPMOTION_{kind.upper()}_MODEL"
    os.environ.setdefault("HF_HUB_OFFLINE", "1")  # faster-whisper reads it when it is imported
    try:
        module = import_module(recogniser.package)
    except ImportError as error:
        raise MissingDependencyError(
            f"the recogniser {kind!r} needs {recogniser.package}: {install_command(kind)}; then set {variable} to the "
            "folder of its model (docs/transcripts.md)"
        ) from error
    named = os.environ.get(variable, "")
    if not named:
        raise InputError(f"the recogniser {kind!r} needs a model: set {variable} to its folder (docs/transcripts.md)")
    folder = Path(named)
    missing = [group for group in recogniser.parts if not any((folder / name).exists() for name in group)]
    if missing:
        raise InputError(
            f"{shorten(named)} ({variable}): is no model of {kind}, required a folder with "
            f"{' or '.join(missing[0])}; see docs/transcripts.md"
        )
    transcript = sort_lines(recogniser.words(module, folder, audio))
    return transcript if transcript.lines else None


def _transcribe_whisper(module: Any, folder: Path, audio: Audio) -> list[TranscriptLine]:
    segments, about = _load_whisper(module, str(folder)).transcribe(
        audio.samples, word_timestamps=True, vad_filter=True, condition_on_previous_text=False
    )
    if about.language != ENGLISH:
        LOG.warning("whisper recognises the language %r, not English; its words are not used", about.language)
        return []
    lines = []
    for segment in segments:
        words: list[TimedWord] = []
        for word in segment.words or ():
            words += time_words(extract_spoken_text(word.word), float(word.start), float(word.end))
        if not words:  # a segment of which the words have no times
            words = [TimedWord(word.word) for word in time_words(extract_spoken_text(segment.text))]
        lines.append(TranscriptLine(tuple(words), float(segment.start), float(segment.end)))
    return lines


@lru_cache(maxsize=1)
def _load_whisper(module: Any, folder: str) -> Any:
    try:
        return module.WhisperModel(folder, device="cpu", compute_type="int8", local_files_only=True)
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError(f"{folder}: faster-whisper cannot read this model: {shorten(str(error))}") from error


def _transcribe_vosk(module: Any, folder: Path, audio: Audio) -> list[TranscriptLine]:
    recogniser = module.KaldiRecognizer(_load_vosk(module, str(folder)), audio.rate_hz)
    recogniser.SetWords(True)
    results = []
    for start in range(0, len(audio.samples), STEP):
        samples = np.clip(audio.samples[start : start + STEP] * 32_768, -32_768, 32_767).astype("<i2")
        if recogniser.AcceptWaveform(samples.tobytes()):
            results.append(recogniser.Result())
    lines = []
    for result in [*results, recogniser.FinalResult()]:  # the JSON of every stretch of speech
        words: list[TimedWord] = []
        for item in json.loads(result).get("result", ()):
            words += time_words(extract_spoken_text(item["word"]), float(item["start"]), float(item["end"]))
        if words:
            lines.append(TranscriptLine(tuple(words), words[0].start_s, words[-1].end_s))
    return lines


@lru_cache(maxsize=1)
def _load_vosk(module: Any, folder: str) -> Any:
    module.SetLogLevel(-1)
    try:
        return module.Model(folder)
    except Exception as error:  # vosk raises nothing more special
        raise InputError(f"{folder}: vosk cannot read this model: {shorten(str(error))}") from error


INSTALLED_RECOGNISERS = {
    "whisper": InstalledRecogniser(
        "faster_whisper",
        (("model.bin",), ("tokenizer.json",)),  # without a tokenizer in the folder it would be fetched
        _transcribe_whisper,
    ),
    "vosk": InstalledRecogniser("vosk", (("am", "final.mdl"),), _transcribe_vosk),
}
"""By the name that ``--recogniser`` has for each, and the extra of this package that installs it."""
