"""Recordings to the input of engines: acoustic features, phones in time, F0."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from lipmotion.engines import Animator
from lipmotion.errors import AlignmentError, InputError, MissingDependencyError
from lipmotion.hmm.model import UnitHmm
from lipmotion.pipeline.analysis.language import report_seconds, warn_of_another_language
from lipmotion.pipeline.analysis.read_request import read_lexicon, read_recording, read_request
from lipmotion.pipeline.model import Model, with_prior
from lipmotion.pipeline.request import DETECTED, Request
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import HOP
from lipmotion.speech.recognition.network.beam_search import load_english
from lipmotion.speech.recognition.network.posteriors import infer_posteriors
from lipmotion.speech.recognition.recognised_speech import (
    WORD_POSTERIORS,
    Recognition,
    join_units,
    measure_level_range,
    place_units,
    select_reliable,
)
from lipmotion.speech.recognition.recogniser import Recogniser, open_recogniser, uses_network
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.sound.speaker_similarity import rate_knowledge
from lipmotion.speech.sound.voice_events import find_voice_events, silence_units
from lipmotion.storage.sources import is_file
from lipmotion.types import (
    FRAME_RATE_HZ,
    Audio,
    Features,
    Monitor,
    ParallelMap,
    Progress,
    Span,
    Speech,
    SpeechPart,
    TimedTranscript,
    TimedWord,
    Timeline,
    TranscriptLine,
    Unit,
    VoiceEvent,
    frames_of,
    silent_monitor,
    sub_monitor,
)
from lipmotion.types.audio import LAUGHTER
from lipmotion.types.delivery import MoodTag
from lipmotion.types.languages import ENGLISH
from lipmotion.units import SILENCE, UNKNOWN_PHONES, check_phones, check_text, close_gaps, is_silent, require_phone
from lipmotion.units.spoken_text import parse_tagged_text
from lipmotion.units.text_normalisation import require_tokens

if TYPE_CHECKING:
    from lipmotion.speech.recognition.agreement import TranscriptFit


UNHEARD_S = 0.05  # phones may last so long outside of all passages, and half of their time: alignment is no surer
LATE_S = 0.1  # seconds by which given units may end after the sound; editing programs round times
TIME_UNITS = {"milliseconds": 1e3, "samples": 16e3, "samples of 48 kHz": 48e3, "ticks of 100 ns": 1e7}
"""How many of them a second has: given times that end near so many times the recording are in this unit."""
SHORTEST_PHONE_S, MIN_TIMED = 0.02, 5
"""Given phones, of which half are shorter, are faster than speech; so many are needed to tell."""
REACH_S = 0.1  # phones are recognised so far around the first and the last one that is heard
LATEST_S = 1e15  # later units are refused: frames of such times cannot be counted
MIN_SPEECH_S = 0.2  # a shorter time of recognised speech is none: the edge of a tone or of noise, taken as a consonant
WORDS = (0.2, 0.9)  # shares of the work at which the recognition of words begins and ends, in reports
LOG = logging.getLogger("lipmotion")


@dataclass(frozen=True, eq=False)
class SpeechAnalysis:
    """The speech of a recording as input of an engine, and what was recognised in it.

    recognition : None where words or phones were given, or the engine's own model recognised the speaker
    fit         : of the transcript; None where there was none, or it was not compared with the sound
    tags        : the moods that tags in the transcript ask for
    events      : what is detected in the voice beside words; empty: nothing, or it was not asked for
    """

    speech: Speech
    recognition: Recognition | None
    fit: TranscriptFit | None = None
    tags: tuple[MoodTag, ...] = ()
    events: tuple[VoiceEvent, ...] = ()

    @property
    def is_without_speech(self) -> bool:
        """Whether no speech was recognised."""
        spoken_s = sum(span.duration_s for span in self.speech.units if not is_silent(span.label.phone))
        return not self.speech.units_known and spoken_s < MIN_SPEECH_S


def analyse(model: Model, request: Request) -> Speech:
    """Return the speech of a request as input of a model's engine: features, phones in time, and what else it needs.

    Raises InputError: the recording, the transcript or the units are not usable, or there is no such recogniser.
    Raises AlignmentError: the transcript cannot be aligned with the recording.
    """
    return analyse_speech(model, request).speech.with_arrays()


def analyse_speech(
    model: Model, request: Request, each: ParallelMap = map, monitor: Monitor = silent_monitor
) -> SpeechAnalysis:
    """Return the speech of a request as ``analyse`` does, with what was recognised.

    monitor : receives reports of the progress; the share is that of recognition, up to ``WORDS[1]``
    """
    request = read_request(request, is_typed=False)
    monitor(Progress("reading the sound", 0, 1, 0.0))
    audio = analysed(read_recording(request))
    monitor(Progress("recognising phones", 0, 1, 0.02))
    analysis = _find_phones(model, request, audio, report_seconds(each, audio.duration_s, sub_monitor(monitor, *WORDS)))
    speech, recognition = analysis.speech, analysis.recognition
    tones = [(first / FRAME_RATE_HZ, end / FRAME_RATE_HZ) for first, end in audio.tones]
    events = find_voice_events(audio, speech.units) if request.manner == DETECTED else ()
    units = silence_units(speech.units, [*tones, *((e.start_s, e.end_s) for e in events if e.kind == LAUGHTER)])
    speech = with_units(speech, units) if units != speech.units else speech
    analysis = replace(analysis, speech=speech, events=events)
    if analysis.is_without_speech and not analysis.events:
        LOG.warning("no speech found in the recording: the mouth rests; give a recording in which something is said")
    elif tones:
        from lipmotion.pipeline.analysis.transcribe import format_places

        LOG.warning("a steady tone covers what is said at %s: the mouth rests there", format_places(tones))
    if recognition is not None and request.language == ENGLISH:
        warn_of_another_language(recognition)
    is_given = request.units is not None or analysis.fit is not None
    speech = with_voice(model.phones, audio, speech, recognition, phones_given=is_given)
    if speech.parts is not None and (is_given or speech.units_known):  # else the engine said so when it recognised them
        speech = replace(speech, parts=tuple(_ask_engine(model, part) for part in speech.parts))
    return replace(analysis, speech=with_prior(model.prior, speech))


def _ask_engine(model: Model, part: SpeechPart) -> SpeechPart:
    """Return a passage whose phones were given; its voice is known where the engine recognises the speaker."""
    unlabelled, rated = replace(part.speech, units=Timeline(())), part.speech.voice
    is_own = 0 < rated < 1 and model.engine.recognise(model.learned, unlabelled) is not None
    return part._replace(speech=replace(part.speech, voice=1.0)) if is_own else part


def with_voice(
    phones: UnitHmm, audio: Audio, speech: Speech, recognition: Recognition | None, *, phones_given: bool = False
) -> Speech:
    """Return speech that says how well a model knows its voice, 0 to 1, that of the recording and of each passage.

    phones       : the model's own phone models
    recognition  : of the speech; None: words or phones were given, or the engine recognised the speaker
    phones_given : whether the phones in time were given
    It is 1 where the engine recognised the speaker, and for silence.
    """
    is_recognised, parts = not phones_given and not speech.units_known, speech.parts
    by_engine = recognition is None and is_recognised
    voice = 1.0 if by_engine or not speech.features.values.any() else rate_knowledge(phones, analysed(audio))
    if parts is not None:
        sounds = {passage.first: analysed(passage.audio) for passage in analysed(audio).passages}
        parts = tuple(
            part
            if is_recognised and part.speech.voice == 1
            else part._replace(speech=replace(part.speech, voice=rate_knowledge(phones, sounds[part.first])))
            for part in parts
        )
    return replace(speech, voice=voice, parts=parts)


def prepare_search(request: Request) -> None:
    """Load the words that are searched where a phone recogniser decides; they are then there when it is done."""
    is_searched = request.transcript is None and request.units is None and request.language == ENGLISH
    if is_searched and uses_network(request.recogniser):
        with suppress(MissingDependencyError):  # whoever needs them says so
            load_english()


def align_between(
    model: Model,
    request: Request,
    audio: AnalysedAudio,
    text: str,
    start_s: float,
    end_s: float,
    *,
    pauses: bool = False,
) -> list[Span[Unit]]:
    """Return the phones in time of words that are said from ``start_s`` to ``end_s``, by forced alignment there.

    pauses : whether silence before and after the words stays; else the first and the last phone take its time
    Raises AlignmentError: the words do not fit in there.
    """
    from lipmotion.pipeline.analysis.transcribe import warn_of_guesses

    first, stop = (round(time_s * FRAME_RATE_HZ) for time_s in (start_s, end_s))
    lexicon, words = read_lexicon(request), require_tokens(text)
    warn_of_guesses(words, lexicon)
    if stop > len(audio.samples) // HOP:
        raise AlignmentError(f"the recording ends at {audio.duration_s:.2f} s")
    segment = audio.stretch(first, stop)
    spans = list(_open_recogniser(model, request).align(segment, words, lexicon).shifted(start_s))
    for place in () if pauses else (0, -1):
        while len(spans) > 1 and is_silent(spans[place].label.phone):
            del spans[place]
    spans[0], spans[-1] = replace(spans[0], start_s=start_s), replace(spans[-1], end_s=end_s)
    return spans


def _open_recogniser(model: Model, request: Request) -> Recogniser:
    return open_recogniser(model.phones, request.recogniser, model.adaptation)


def _find_phones(model: Model, request: Request, audio: AnalysedAudio, each: ParallelMap) -> SpeechAnalysis:
    phones, features, fit = _open_recogniser(model, request), audio.joined_mfcc(), None
    results: list[Recognition] = []

    def recognise() -> Recognition:
        results.append(phones.recognise(audio, each, english=request.language == ENGLISH))
        return results[-1]

    @cache
    def recognised() -> Speech:
        return recognise_speech(model.engine, model.learned, audio, features, phones, recognise, each)

    if request.units is not None:
        if request.transcript is not None:
            LOG.warning("the transcript is not used: the units already say what is spoken; leave one of them out")
        units, fit = _follow_units(model, request, audio, phones.kind, lambda: recognised().units)
        speech = build_speech(model.engine, audio, features, units, phones.kind, each)
        return SpeechAnalysis(replace(speech, times_given=True), None, fit)
    words = _read_words(cast("str | TimedTranscript | None", request.transcript), audio.duration_s)
    if words is not None:
        from lipmotion.pipeline.analysis.transcribe import transcribe

        lexicon = read_lexicon(request)
        aligned, fit = transcribe(phones, audio, words, lexicon, lambda: recognised().units)
        if aligned is not None:
            speech = build_speech(model.engine, audio, features, aligned, phones.kind, each)
            tags = words.tags if isinstance(words, TimedTranscript) else ()
            return SpeechAnalysis(speech, None, fit, tags)
    return SpeechAnalysis(recognised(), results[0] if results else None, fit)


def build_speech(
    engine: Animator[Any],
    audio: Audio,
    features: Features,
    units: Timeline[Unit],
    kind: str = "auto",
    each: ParallelMap = map,
) -> Speech:
    """Return speech of features and phones in time, and what else of the recording the engine needs.

    kind : of the recognition; of all but ``auto``, a phone recogniser has no part in it
    """
    inputs, audio = engine.inputs(), analysed(audio, features)

    def rows(of: Callable[[AnalysedAudio], Any]) -> Any:
        return of(audio) if audio.is_passage else audio.joined_rows(of)

    f0 = audio.joined(log_f0, np.nan) if inputs.f0 else None
    spectrum = rows(lambda sound: sound.spectrum) if inputs.conditions else None
    encoding = rows(lambda sound: sound.encoding) if inputs.encoding else None
    is_heard = inputs.posteriors and uses_network(kind)
    posteriors = infer_posteriors(audio, each, dense=audio.is_passage) if is_heard else None
    parts = None
    if not audio.is_passage:
        parts = tuple(
            SpeechPart(first, own, build_speech(engine, sound, sound.mfcc(), Timeline(()), kind, each))
            for first, own, sound in audio.passages
        )
    none = Timeline[Unit](())
    speech = Speech(features, none, f0, spectrum=spectrum, posteriors=posteriors, encoding=encoding, parts=parts)
    speech = replace(speech, range_db=measure_level_range(audio.log_energy))
    return with_units(speech, units) if len(units) else speech


def with_units(speech: Speech, units: Timeline[Unit]) -> Speech:
    """Return speech with other phones in time, which are known or recognised as their labels say.

    Where only some of them are known, those of a user who corrected the others, ``confidence`` is one of each frame.
    Every passage has those in its time; where phones are said outside of all, the recording is one passage.
    """
    if speech.parts is not None:
        speech = replace(speech, parts=_place_in_parts(speech.parts, units))
        speech = speech.with_arrays() if speech.parts is None else speech
    confidences = [span.label.confidence for span in units]
    first = confidences[0] if confidences else None
    if confidences.count(first) == len(confidences):
        return replace(speech, units=units, units_known=first is None, confidence=1.0 if first is None else first)
    by_frame = np.ones(len(speech.features.values))
    for span, confidence in zip(units, confidences, strict=True):
        by_frame[slice(*frames_of(span, len(by_frame)))] = 1.0 if confidence is None else confidence
    return replace(speech, units=units, units_known=False, confidence=by_frame)


def _place_in_parts(parts: tuple[SpeechPart, ...], units: Timeline[Unit]) -> tuple[SpeechPart, ...] | None:
    """Return the passages with the phones in their time; None where phones are said outside of them."""
    covered = np.zeros(max((part.first + part.frames for part in parts), default=0), bool)
    for part in parts:
        covered[max(part.first, 0) : part.first + part.frames] = True
    for span in units:
        first, end = (min(round(time_s * FRAME_RATE_HZ), len(covered)) for time_s in (span.start_s, span.end_s))
        unheard_s = span.duration_s - int(covered[first:end].sum()) / FRAME_RATE_HZ
        if not is_silent(span.label.phone) and unheard_s > max(UNHEARD_S, span.duration_s / 2):
            return None
    spoken = []
    for part in parts:
        within = list(part.between(units))
        labels = [span.label for span in within if not is_silent(span.label.phone)] or [span.label for span in within]
        for place in (0, -1) if within else ():  # silence between passages is as sure as the phones beside it
            if is_silent(within[place].label.phone):
                label = replace(within[place].label, confidence=labels[place].confidence)
                within[place] = replace(within[place], label=label)
        silent = Unit(SILENCE, confidence=labels[0].confidence if labels else None)
        joined = join_units([Timeline(tuple(within))], silent, part.speech.features.duration_s)
        spoken.append(part._replace(speech=with_units(part.speech, joined)))
    return tuple(spoken)


def recognise_speech(
    engine: Animator[Any],
    learned: Any,
    audio: Audio,
    features: Features,
    phones: Recogniser,
    recognise: Callable[[], Recognition],
    each: ParallelMap = map,
) -> Speech:
    """Return the speech of a recording whose words are not known, with recognised phones in time.

    recognise : recognises phones in time, for speakers that the engine does not recognise itself
    If the model knows the voice at all, and its engine recognises phones, these are aligned by ``phones``, as those of
    the training were; else the result of ``recognise`` is used.
    """
    audio = analysed(audio, features)
    speech = build_speech(engine, audio, features, Timeline(()), phones.kind, each)
    passages = (SpeechPart(0, slice(0, len(features.values)), speech),) if speech.parts is None else speech.parts
    units, spoken, recognition = list[Timeline[Unit]](), list[SpeechPart](), None
    for part, (_, _, sound) in zip(passages, audio.passages, strict=True):
        within = None
        if phones.kind != "general" and rate_knowledge(phones.own, sound):
            within = engine.recognise(learned, part.speech)
        if within is not None:
            try:
                within = select_reliable(phones.align_phones(sound, within), 0.0)
            except AlignmentError:
                within = None
        knows_voice = within is not None
        if within is None:
            recognition = recognition or recognise()
            within = part.between(select_reliable(recognition.units, recognition.reliability))
        if sum(span.duration_s for span in within if not is_silent(span.label.phone)) < MIN_SPEECH_S:
            continue  # a click, a knock
        spoken.append(part._replace(speech=replace(part.speech, voice=float(knows_voice))))  # else ``with_voice`` says
        units.append(place_units(within, part.first, part.own))
    if speech.parts is not None:
        speech = replace(speech, parts=tuple(spoken))
    confidence = recognition.reliability if recognition is not None else 0.0
    return with_units(speech, join_units(units, Unit(SILENCE, confidence=confidence), features.duration_s))


def _read_words(text: str | TimedTranscript | None, duration_s: float) -> tuple[str, ...] | TimedTranscript | None:
    """Return the words of a transcript. Raises AlignmentError: a text that is too long for the recording."""
    if text is None or isinstance(text, TimedTranscript):
        return text
    if "." in text and not any(map(str.isspace, text)) and is_file(Path(text)):
        raise InputError(f"the transcript {text!r} is the name of a file; give Path({text!r}), or the words themselves")
    check_text(text, duration_s)
    plain, tags = parse_tagged_text(text)
    words = require_tokens(plain)
    return TimedTranscript((TranscriptLine(tuple(map(TimedWord, words))),), tags) if tags else words


def _follow_units(
    model: Model, request: Request, audio: AnalysedAudio, kind: str, recognised: Callable[[], Timeline[Unit]]
) -> tuple[Timeline[Unit], TranscriptFit | None]:
    """Return the given phones of a request, completed, and how well they fit; None: they were not compared.

    Unknown phones are those of their word, aligned, or recognised; so are stretches left open in which speech is heard.
    """
    from lipmotion.pipeline.analysis.transcribe import compute_phone_posteriors, warn_of_label_misfit
    from lipmotion.speech.recognition.agreement import label_fit

    spans, guessed = _complete_units(model, request, audio, recognised)
    units = close_gaps(Timeline(tuple(spans)), audio.duration_s)
    if kind == "own" or request.spoken_so or not all(span.label.phone for span in units):
        return units, None
    is_heard = request.language == ENGLISH and uses_network(kind)
    posteriors, sure = compute_phone_posteriors(audio) if is_heard else (None, 0.0)
    is_sure = sure >= WORD_POSTERIORS[0]
    fit = label_fit(audio, units, posteriors if is_sure else None)
    filling = _fill_open(spans, fit.missing if is_sure else (), audio.duration_s, recognised)
    warn_of_label_misfit(fit, filled=bool(filling))
    spans = sorted([*spans, *filling], key=lambda span: span.start_s)
    units = close_gaps(Timeline(tuple(spans)), audio.duration_s) if filling else units
    return units, replace(fit, missing=(*fit.missing, *guessed))


def _complete_units(
    model: Model, request: Request, audio: AnalysedAudio, recognised: Callable[[], Timeline[Unit]]
) -> tuple[list[Span[Unit]], list[tuple[float, float]]]:
    """Return the given phones, unknown ones aligned with their word or recognised, and where they are recognised."""
    from lipmotion.pipeline.analysis.transcribe import format_places

    requested = cast("Timeline[Unit]", request.units)  # of ``read_request``
    _check_units(requested, audio.duration_s)
    spans, aligned, guessed = list[Span[Unit]](), list[str](), list[tuple[float, float]]()
    for given in (span for span in requested if span.start_s < audio.duration_s):
        phone = given.label.phone and require_phone(given.label.phone, f" in the units at {given.start_s:.2f} s")
        span, end_s = replace(given, label=replace(given.label, phone=phone)), min(given.end_s, audio.duration_s)
        if span.label.phone or span.label.unit != UNKNOWN_PHONES:
            spans.append(replace(span, end_s=end_s) if span.end_s > audio.duration_s + LATE_S else span)
            continue
        try:
            word = span.label.word
            inside = align_between(model, request, audio, word, span.start_s, end_s) if word else []
            if inside:
                aligned.append(f"{word!r} at {span.start_s:.1f} s")
        except (AlignmentError, InputError):
            inside = []
        if not inside:
            guessed.append((span.start_s, end_s))
        spans += inside or _cut_phones(recognised(), span.start_s, end_s)
    if aligned:
        LOG.warning("the units do not say the phones of %s: they are those of the dictionary", ", ".join(aligned))
    if guessed:
        LOG.warning("the units do not say which phones are said at %s: they are recognised", format_places(guessed))
    return spans, guessed


def _fill_open(
    spans: list[Span[Unit]],
    missing: Sequence[tuple[float, float]],
    duration_s: float,
    recognised: Callable[[], Timeline[Unit]],
) -> list[Span[Unit]]:
    """Return the recognised phones of stretches that the spans leave open and in which speech was heard."""
    from lipmotion.speech.recognition.transcript_evidence import MIN_GAP_S

    edges_s = [0.0, *(time_s for span in spans for time_s in (span.start_s, span.end_s)), duration_s]
    return [
        phone
        for open_s, close_s in zip(edges_s[::2], edges_s[1::2], strict=True)
        for start_s, end_s in missing
        if min(close_s, end_s) - max(open_s, start_s) >= MIN_GAP_S
        for phone in _cut_phones(recognised(), max(open_s, start_s - REACH_S), min(close_s, end_s + REACH_S))
    ]


def _cut_phones(units: Timeline[Unit], start_s: float, end_s: float) -> list[Span[Unit]]:
    """Return the phones, without silence, whose middle is within some time, cut to it."""
    return [
        replace(span, start_s=max(span.start_s, start_s), end_s=min(span.end_s, end_s))
        for span in units
        if start_s <= (span.start_s + span.end_s) / 2 < end_s and not is_silent(span.label.phone)
    ]


def _check_units(units: Timeline[Unit], duration_s: float) -> None:
    """Raise InputError if given units are empty or too many; log a warning if they end after the recording."""
    if not len(units):
        raise InputError("the units are an empty list, as of a .csv; give those of another file, or leave them out")
    check_phones(len(units), duration_s)
    first_s, last_s, end_s = units[0].start_s, units[-1].start_s, units[-1].end_s
    if duration_s <= first_s <= LATEST_S:
        raise InputError(f"the units begin at {first_s:.2f} s, the recording ends at {duration_s:.2f} s; give its own")
    if not -LATEST_S <= first_s <= last_s <= LATEST_S or LATEST_S < end_s < np.inf:
        raise InputError(f"the units last from {first_s} to {end_s} s, required times of this recording")
    spoken_s = sorted(span.duration_s for span in units if not is_silent(span.label.phone))
    if duration_s + LATE_S < end_s < np.inf:
        unit = next((name for name, ratio in TIME_UNITS.items() if 0.3 < end_s / duration_s / ratio < 1.3), "")
        guess = f"their times in {unit}, where seconds are required" if unit else "they those of another recording"
        LOG.warning("the units go on to %.2f s, the recording ends at %.2f s: are %s?", end_s, duration_s, guess)
    elif len(spoken_s) >= MIN_TIMED and spoken_s[len(spoken_s) // 2] < SHORTEST_PHONE_S:
        pace = f"the units last {1000 * spoken_s[len(spoken_s) // 2]:.1f} ms each, {end_s:.2f} of {duration_s:.2f} s"
        LOG.warning("%s, faster than anybody speaks: are their times in seconds?", pace)
