"""Text to sound and motion: ``speak(text) → sound, generation``."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import Corpus, quantise
from lipmotion.engines.base import SelectsRecordings, SourcePiece
from lipmotion.errors import InputError
from lipmotion.formats.subtitles import is_subtitles, strip_markup
from lipmotion.kernels.compiler import limit_threads
from lipmotion.pipeline.analysis.read_request import read_lexicon
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.generation import find_speaker_map
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.request import ASKED, Onto, Pauses, Request
from lipmotion.speech.sound.resampling import JoinedPieces, overlap_pieces, resample_speech
from lipmotion.speech.voices.installed import choose_voice, find_voice, speak_sentences
from lipmotion.speech.voices.synthesiser import SyntheticVoice
from lipmotion.types import SPEECH_RATE_HZ, Audio, Constraints, Span, SpokenText, Timeline, Unit
from lipmotion.types.progress import Monitor, silent_monitor, sub_monitor, with_progress
from lipmotion.units import PAUSE, SILENCE, Lexicon, is_silent, split_words
from lipmotion.units.phones import SHORT_PAUSE_S
from lipmotion.units.spoken_text import parse_tagged_text, time_moods
from lipmotion.units.text_normalisation import MAX_CHARACTERS, split_sentences

BETWEEN_S = 0.35  # silence between two sentences that a corpus says
FEATURES = 13  # the static acoustic features, whose differences joins cost


@limit_threads()
def speak_from_corpus(
    text: str, corpus: Corpus, model: Model, request: Request | None = None, constraints: Constraints | None = None
) -> SpokenText:
    """Return a text as the joined sound of recordings, and the motion that was recorded with it.

    text    : one sentence or several, in English words that the dictionary or the request's lexicon pronounces
    corpus  : the corpus that the model was trained on
    model   : of an engine that ``SelectsRecordings`` (``selection``)
    request : the lexicon, and how the motion is made of the sound: speaker, pauses, asymmetry
    The sound is not changed but at the joins, where successive pieces are shifted by up to 8 ms to fit and overlap: how
    fast and how high words are spoken is what was recorded. Phones that were never recorded are replaced by similar
    ones, with a warning.
    Raises InputError: another engine, another corpus, recordings of several people, a text without words, or a word
    that nobody can pronounce.
    Source: Minnis & Breen 2000, §2 and §3.
    """
    engine, request = model.engine, request or Request()
    if not isinstance(engine, SelectsRecordings):
        raise InputError(f"the engine {engine.name!r} has no recordings to speak with; train one: --engine selection")
    names = engine.recordings(model.learned)
    known = set(corpus.names())
    missing = [name for name in names if name not in known]
    if missing:
        lacks = f"lacks {len(missing)} of {len(names)} recordings of the model, as {missing[0]}"
        raise InputError(f"the corpus {corpus.path} {lacks}; give the corpus that it was trained on")
    target = _plan_phones(text, read_lexicon(request), engine, model)
    utterances = {name: corpus.utterance(name) for name in names}
    people = sorted({utterance.speaker for utterance in utterances.values()})
    if len(people) > 1:
        raise InputError(f"the model has recordings of {', '.join(people)}, required one person; train another model")
    recorded_features = {
        name: np.asarray(utterance.features.values)[:, :FEATURES] for name, utterance in utterances.items()
    }
    stand_ins = engine.stand_ins(model.learned)
    replaced = dict.fromkeys(span.label.phone for span in target if span.label.phone in stand_ins)
    if replaced:
        instead = ", ".join(f"{phone} ({stand_ins[phone]})" for phone in replaced)
        LOG.warning("phones without recordings, and what is said instead: %s; see lipmotion corpus coverage", instead)
    pieces, units = engine.source_pieces(model.learned, target, recorded_features)
    sounds = [np.asarray(utterances[piece.recording].audio.samples) for piece in pieces]
    rate_hz = utterances[names[0]].audio.rate_hz
    joined = overlap_pieces(sounds, [(piece.start_s, piece.end_s) for piece in pieces], rate_hz)
    begin_s = _find_starts(len(units), pieces, joined, rate_hz)
    first, last = (round(begin_s[number] * rate_hz) for number in (0, -1))
    audio = Audio(joined.samples[first:last], rate_hz)
    edges_s = np.clip(begin_s - begin_s[0], 0, audio.duration_s).tolist()
    spoken = Timeline(tuple(Span(a, b, s.label) for a, b, s in zip(edges_s, edges_s[1:], units, strict=False)))
    request = replace(request, recording=audio, units=spoken, lexicon=None, spoken_so=True)
    return SpokenText(audio, animate(request, model=model, constraints=constraints))


def _plan_phones(text: str, lexicon: Lexicon, engine: SelectsRecordings, model: Model) -> Timeline[Unit]:
    phones: list[tuple[Unit, float]] = []
    for number, sentence in enumerate(split_sentences(text)):
        phones.append((Unit(SILENCE), BETWEEN_S if number else REST_S))
        for word in split_words(sentence):
            for phone in lexicon.pronunciations(word)[0]:
                phones.append((Unit(phone, word=word), engine.typical_duration_s(model.learned, phone)))
    phones.append((Unit(SILENCE), REST_S))
    edges_s = accumulate((duration_s for _, duration_s in phones), initial=0.0)
    return Timeline(tuple(Span(*times_s, unit) for times_s, (unit, _) in zip(pairwise(edges_s), phones, strict=True)))


def _find_starts(count: int, pieces: Sequence[SourcePiece], joined: JoinedPieces, rate_hz: int) -> NDArray[np.float64]:
    """Return when each of some phones begins in the joined sound, and when the last one ends [shape=(count + 1,)]."""
    duration_s = len(joined.samples) / rate_hz
    begin_s = np.full(count + 1, np.nan)
    begin_s[0], begin_s[-1] = 0.0, duration_s
    for piece, start, shift in zip(pieces, joined.starts, joined.shifts, strict=True):
        for number, time_s in piece.phones_s.items():
            if number:
                begin_s[number] = (start - shift) / rate_hz + (time_s - piece.start_s)
    known = np.isfinite(begin_s)
    begin_s = np.maximum.accumulate(np.interp(np.arange(count + 1), np.flatnonzero(known), begin_s[known]))
    begin_s = np.minimum(begin_s, duration_s)
    begin_s[0] = max(begin_s[1] - REST_S, 0.0)
    begin_s[-1] = min(begin_s[-2] + REST_S, duration_s)
    return begin_s


LOG = logging.getLogger("lipmotion")
CORPUS_VOICE = "corpus"  # the name of the voice that is a corpus
REST_S = 0.25  # silence before the first and after the last sound
FLOOR_DB = 50.0
"""Noise under the speech, in decibels of what lies under 8 kHz, as in training: a synthesiser's silence has no sound at
all, which would shift features that are normalised over the recording. The sound that is returned has it, too: what
the model takes in is what a ``.wav`` of it holds, so that its motion comes again from that file and the phones."""
SENTENCES_PER_RUN = 20  # sentences that one run of a synthesiser speaks; only their files are on the disk at a time
BLOCK = 1 << 20  # samples of noise that are drawn at a time
LARGEST_TEXT_BYTES = 4 * MAX_CHARACTERS  # most bytes of a text file: a character takes up to four


@limit_threads()
def speak(  # noqa: PLR0913
    text: str,
    *,
    voice: str | SyntheticVoice | None = None,
    corpus: Corpus | None = None,
    model: Model | str | Path | None = None,
    constraints: Constraints | None = None,
    lexicon: Lexicon | None = None,
    speaker: str = "",
    onto: Onto | None = None,
    onto_speaker: str = "",
    pauses: Pauses = "rest",
    asymmetry: float = 0.0,
    monitor: Monitor = silent_monitor,
) -> SpokenText:
    """Return a text as sound of a synthetic voice, and the lip motion for it, with 0.25 s of rest at both ends.

    text        : one sentence or many, at most 50,000 characters; the synthesiser reads numbers and abbreviations. Tags
                  in it (``[sad]``, ``<smile>``) are moods, and not spoken (docs/expression.md)
    voice       : ``flite:slt``, ``espeak-ng:de``, or a name alone where only one synthesiser has it; None: the first of
                  ``DEFAULT_VOICES`` that is installed; ``corpus``: the recordings of ``corpus``
    corpus      : the corpus that a model of unit selection was trained on, for the voice ``corpus``
    model       : from ``load_model``, or the path of a model file; None: the shipped model
    constraints : values that the motion must take exactly, in the units of the speaker
    lexicon     : pronunciations of English words; they tell which vowels are reduced, not how the voice says the words
    speaker     : whose motion is generated, of the people whom the model was trained on; empty: the mean person
    onto, onto_speaker, pauses, asymmetry : as of ``Request``;  monitor : as of ``animate``
    The phones and their times are the synthesiser's, so nothing is recognised. The sound is one of 16 bits, at the
    synthesiser's rate or 16 kHz if that is less; ``animate`` of a ``.wav`` or ``.flac`` of it, with the units, returns
    the same motion.
    Raises MissingDependencyError: no synthesiser is installed, or not the one that was asked for.
    Raises InputError: no such voice or speaker, or a text that is too long, has no word, or cannot be spoken.

    >>> import lipmotion
    >>> sound, result = lipmotion.speak("Please speak.")  # doctest: +SKIP
    >>> lipmotion.write(result, ["hello.mp4", "hello.wav"], speech=sound)  # doctest: +SKIP
    """
    if is_subtitles(text):
        LOG.warning("the text is that of subtitles: times, and sounds in brackets, are left out")
        text = strip_markup(text)
    text, tags = parse_tagged_text(text)
    request = Request(
        lexicon=lexicon, speaker=speaker, onto=onto, onto_speaker=onto_speaker, pauses=pauses, asymmetry=asymmetry
    )
    if voice == CORPUS_VOICE or corpus is not None:
        if voice != CORPUS_VOICE or corpus is None:
            raise InputError("a corpus that speaks needs both: the voice 'corpus', and the corpus (--corpus FOLDER)")
        if onto is not None:
            raise InputError("a corpus speaks with the motion that was recorded; it is not mapped onto another person")
        request = replace(request, onto_speaker="")
        sound, generation = speak_from_corpus(text, corpus, load_model(model), request, constraints)
    else:
        sentences = split_sentences(text)
        chosen = find_voice(voice) if isinstance(voice, str) else voice or choose_voice()
        model = load_model(model)
        find_speaker_map(model.speakers, speaker)  # an unknown one is reported before anything is spoken
        sound, units = _speak_sentences(sentences, chosen, lexicon, sub_monitor(monitor, 0, 0.5))
        sound = quantise(sound)
        spoken_so = {"recording": resample_speech(sound), "units": units, "manner": ASKED, "spoken_so": True}
        request = replace(request, lexicon=None, **spoken_so)
        generation = animate(request, model=model, constraints=constraints, monitor=sub_monitor(monitor, 0.5, 1))
    return SpokenText(sound, replace(generation, moods=time_moods(tags, generation.units)))


def _speak_sentences(
    sentences: Sequence[str], voice: SyntheticVoice, lexicon: Lexicon | None, monitor: Monitor
) -> tuple[Audio, Timeline[Unit]]:
    """Return sentences one after the other, at the synthesiser's rate or 16 kHz, and their phones in time."""
    sounds: list[tuple[int, NDArray[np.float32]]] = []
    spans: list[Span[Unit]] = []
    rate_hz, at = SPEECH_RATE_HZ, 0
    for start in with_progress(range(0, len(sentences), SENTENCES_PER_RUN), "speaking", monitor):
        with closing(speak_sentences(sentences[start : start + SENTENCES_PER_RUN], voice, lexicon)) as voiced:
            for sentence in voiced:
                sound = sentence.own_sound()
                sound = sentence.audio if sound.rate_hz < SPEECH_RATE_HZ else sound
                if not spans:
                    rate_hz = sound.rate_hz
                    at = _count_rest(sentence.units[0], rate_hz)
                sounds.append((at, sound.samples))
                spans += sentence.units.shifted(at / rate_hz)
                at += len(sound.samples)
    count = at + _count_rest(spans[-1], rate_hz)
    samples = np.zeros(count, np.float32)
    while sounds:  # each is freed at once
        first, part = sounds.pop()
        samples[first : first + len(part)] = part[: max(count - first, 0)]
    units = Timeline(tuple(_join_silences(spans, count / rate_hz)))
    spoken = [span for span in units if not is_silent(span.label.phone)]
    slices = [samples[round(span.start_s * rate_hz) : round(span.end_s * rate_hz)] for span in spoken]
    power = sum(float(part @ part) for part in slices) / max(sum(map(len, slices)), 1)
    gain = np.float32(np.sqrt(power * rate_hz / SPEECH_RATE_HZ) * 10 ** (-FLOOR_DB / 20))
    rng = np.random.default_rng(0)
    for start in range(0, count, BLOCK):
        part = samples[start : start + BLOCK]
        part += gain * rng.standard_normal(len(part), np.float32)
    return Audio(samples, rate_hz), units


def _count_rest(edge: Span[Unit], rate_hz: int) -> int:
    """Return how many samples a first or last span lacks to ``REST_S`` of silence."""
    rest_s = REST_S - (edge.duration_s if is_silent(edge.label.phone) else 0.0)
    return max(round(rest_s * rate_hz), 0)


def _join_silences(spans: Sequence[Span[Unit]], duration_s: float) -> Iterator[Span[Unit]]:
    """Yield phones from 0 s to the end of the sound, every gap and every row of silences as one silence."""
    now_s, last_s = 0.0, 0.0  # where the silence begins, and where the next phone
    for span in spans:
        if is_silent(span.label.phone):
            continue
        last_s = max(span.start_s, now_s)
        if last_s - now_s > 1e-6:
            inside = now_s > 0 and last_s - now_s < SHORT_PAUSE_S
            yield Span(now_s, last_s, Unit(PAUSE if inside else SILENCE))
        now_s = min(max(span.end_s, last_s), duration_s)
        yield Span(min(last_s, now_s), now_s, span.label)
    if duration_s > now_s:
        yield Span(now_s, duration_s, Unit(SILENCE))
