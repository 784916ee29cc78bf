"""The language of a request, found by its transcript and its sound; the words of a recording."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any, cast

from lipmotion.errors import ExportError, InputError
from lipmotion.kernels.compiler import limit_threads
from lipmotion.pipeline.analysis.read_request import read_lexicon, read_recording
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.request import Request, SpeechInput, as_request
from lipmotion.speech.recognition.network.posteriors import WORD_BOUNDARY, find_installed_recogniser, find_stretches
from lipmotion.speech.recognition.recognised_speech import RecognisedWord, Recognition
from lipmotion.speech.recognition.recogniser import open_recogniser
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.storage.files import atomic_file, check_distinct, check_target
from lipmotion.storage.json_text import as_json
from lipmotion.types import SPEECH_RATE_HZ, Audio, TimedTranscript, TimedWord, Timeline, TranscriptLine
from lipmotion.types.languages import AUTO, ENGLISH, LANGUAGES
from lipmotion.types.progress import ItemT, Monitor, ParallelMap, Progress, ResultT, silent_monitor
from lipmotion.units.ipa_phones import read_tokens
from lipmotion.units.lexicon import detect_language, is_english
from lipmotion.units.spoken_text import parse_tagged_text
from lipmotion.units.text_normalisation import split_written_words

LOG = logging.getLogger("lipmotion")
MIN_CONFIDENCE = 0.4
"""English words are recognised with at least this confidence in clear English (0.8 to 0.9 there), and with less in
other languages and in English played backwards (0.18 to 0.25), and in noise."""
MIN_TOLD_S = 1.0  # speech that lasts less says nothing of its language
PART_S = 28.0  # so many seconds from the beginning of a recording tell its language


def resolve_language(request: Request) -> Request:
    """Return a request, of ``read_request``, whose words are those of its language, with the lexicon that has them.

    A request in English stays as it is. ``AUTO`` stays where the speech is known not to be English, and no more.
    Raises InputError: the transcript cannot be read, or has words that nobody pronounces. Raises
    MissingDependencyError: there is neither espeak-ng nor a lexicon with the words.
    """
    if request.language == ENGLISH:
        return request
    transcript = cast("str | TimedTranscript | None", request.transcript)
    if isinstance(transcript, str):
        plain, tags = parse_tagged_text(transcript, lambda part: split_written_words(part) if part.strip() else ())
        transcript = TimedTranscript((TranscriptLine(tuple(map(TimedWord, split_written_words(plain)))),), tags)
    language = request.language if request.language != AUTO else _detect_language(request, transcript)
    if language in (ENGLISH, AUTO):
        return replace(request, language=language)
    from lipmotion.speech.voices.espeak import LanguageLexicon

    lexicon = LanguageLexicon(read_lexicon(request).user, language)
    if transcript is not None and request.units is None:
        transcript = transcript.with_words(
            lambda word: split_written_words(word) if any(map(str.isalnum, word)) else ()
        )
        lexicon = lexicon.with_words(transcript.words)
    return replace(request, language=language, transcript=transcript, lexicon=lexicon)


def _detect_language(request: Request, transcript: TimedTranscript | None) -> str:
    """Return the language of a request that names none, which a warning tells; ``AUTO``: it is not English."""
    if transcript is not None and request.units is None:
        language = detect_language(transcript.words)
        if not language:
            raise InputError(f"the language of the transcript is not known; give it, one of: {', '.join(LANGUAGES)}")
        LOG.warning("the transcript is taken for %s; --language says otherwise", LANGUAGES[language].name)
        return language
    english = detect_english(read_recording(request))
    found = "language of the speech is not known, English is assumed"
    if english is not None:
        found = f"speech is {'taken for' if english else 'not'} English"
    LOG.warning("the %s; --language says which it is", found)
    return AUTO if english is False else ENGLISH


def detect_english(audio: Audio) -> bool | None:
    """Return whether a recording is in English; None: not known, or no phone recogniser is installed.

    audio : at 16 kHz
    The network writes every language with the phones of English: it cannot say which other one it is.
    """
    if find_installed_recogniser() is None:
        return None
    part = analysed(Audio(audio.samples[: int(PART_S * audio.rate_hz)], audio.rate_hz))
    tokens = [
        token
        for _, posteriors in find_stretches(part)
        for token in (*(each.token for each in posteriors.best_tokens), WORD_BOUNDARY)
    ]
    words = (list(group) for ends, group in groupby(tokens, WORD_BOUNDARY.__eq__) if not ends)
    return is_english(tuple(phone for phone, _ in read_tokens(word)) for word in words)


def weigh_words(recognition: Recognition) -> float:
    """Return the confidence of recognised words times their share of the speech, 0 to 1."""
    return (recognition.confidence or 0.0) * recognition.word_s / max(recognition.word_s + recognition.phone_s, 1e-9)


def warn_of_another_language(recognition: Recognition) -> None:
    """Log a warning where English words were recognised in what is hardly English."""
    confidence = weigh_words(recognition)
    if recognition.word_s >= MIN_TOLD_S and confidence < MIN_CONFIDENCE:
        unsure = f"the words are hardly recognised (confidence {confidence:.2f}, required {MIN_CONFIDENCE:.1f})"
        LOG.warning("%s: give their --language, if it is not English, or the words (--transcript)", unsure)


TEXT, JSON = ".txt", ".json"
LINE_PAUSE_S = 0.5  # a longer pause between words ends a line of text


@limit_threads()
def recognise_words(
    speech: SpeechInput, *, model: Model | str | Path | None = None, workers: int = 1, monitor: Monitor = silent_monitor
) -> Recognition:
    """Return the English words of a recording in time, with the phones that they or free recognition decided.

    speech  : an audio or video file, samples at 16 kHz, or a ``Request``, of which the transcript is not used
    model   : whose phone models align the words: from ``load_model``, or a path; None: the shipped one
    workers, monitor : as of ``animate``
    Raises InputError: the recording is not usable, or the recogniser does not recognise words.
    Raises MissingDependencyError: pocketsphinx is not installed.
    """
    request = as_request(speech)
    chosen = model if isinstance(model, Model) else load_model(model or request.model)
    if request.recogniser != "auto":
        raise InputError(f"the recogniser {request.recogniser!r} recognises phones, not words; required 'auto'")
    monitor(Progress("recognising words", 0, 1, 0.0))
    audio = analysed(read_recording(request))
    recogniser = open_recogniser(chosen.phones, request.recogniser, chosen.adaptation)
    from lipmotion.pipeline.workers import map_in_processes

    each: ParallelMap = map if workers == 1 else map_in_processes(workers)
    return recogniser.recognise(audio, report_seconds(each, audio.duration_s, monitor))


def report_seconds(each: ParallelMap, duration_s: float, monitor: Monitor) -> ParallelMap:
    """Return a map over stretches of samples (16 bit, 16 kHz) that reports how far into the sound it is."""

    def map_with_reports(function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        lengths_s: deque[float] = deque()

        def measured() -> Iterator[ItemT]:
            for item in items:
                lengths_s.append(len(item) / 2 / SPEECH_RATE_HZ if isinstance(item, bytes) else 0.0)
                yield item

        done_s = 0.0
        for result in each(function, measured()):
            done_s += lengths_s.popleft()
            monitor(Progress("recognising words, seconds", int(done_s), int(duration_s), min(done_s / duration_s, 1.0)))
            yield result

    return map_with_reports


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


def describe_words(words: Timeline[RecognisedWord]) -> list[dict[str, Any]]:
    """Return words for JSON: ``word``, ``start`` and ``end`` in seconds, and the confidence ``conf``, as Vosk's."""
    times = [{"start": round(span.start_s, 3), "end": round(span.end_s, 3)} for span in words]
    labels = [span.label for span in words]
    return [{"word": w.text, **t, "conf": round(w.confidence, 3)} for w, t in zip(labels, times, strict=True)]


def write_words(words: Timeline[RecognisedWord], paths: Sequence[Path]) -> None:
    """Write words to files that can be edited and given back as transcripts, of ``check_word_outputs``."""
    text = format_words(words)
    document = {"result": describe_words(words), "text": " ".join(text.split())}
    for path in paths:
        with atomic_file(path) as unfinished:
            unfinished.write_text(as_json(document, indent=1) + "\n" if path.suffix.lower() == JSON else text, "utf-8")


def check_word_outputs(outputs: Sequence[str | Path], speech: str | Path | None = None) -> list[Path]:
    """Return the paths of files of words: ``.txt``, or ``.json`` with their times.

    speech : the recording, which must not be overwritten
    Raises ExportError: another suffix, no such folder, one file twice, or the recording.
    """
    paths = [Path(output) for output in outputs]
    check_distinct(paths)
    for path in paths:
        if path.suffix.lower() not in (TEXT, JSON):
            raise ExportError(f"{path}: unknown format {path.suffix!r}; required one of: {TEXT} {JSON}")
        check_target(path, speech)
    return paths
