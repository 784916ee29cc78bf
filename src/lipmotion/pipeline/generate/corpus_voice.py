"""One database, two voices: a text said by the recordings of a corpus, with the motion that was recorded with them."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.store import Corpus
from lipmotion.engines.base import SelectsRecordings, SourcePiece
from lipmotion.errors import InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Pauses, Request
from lipmotion.speech.sound.overlap_add import JoinedPieces, overlapped
from lipmotion.types import Audio, Constraints, Span, SpokenText, Timeline, Unit
from lipmotion.units import SILENCE, Lexicon, split_words
from lipmotion.units.text_normalisation import split_sentences

REST_S = 0.25
"""Silence before the first and after the last word,"""
BETWEEN_S = 0.35
"""and between two sentences."""
LOG = logging.getLogger("lipmotion")
FEATURES = 13
"""The static acoustic features, whose differences joins cost."""


@one_thread()
def speak_from_corpus(  # noqa: PLR0913
    text: str,
    corpus: Corpus,
    model: Model,
    *,
    constraints: Constraints | None = None,
    lexicon: Lexicon | None = None,
    speaker: str = "",
    pauses: Pauses = "rest",
    asymmetry: float = 0.0,
) -> SpokenText:
    """Return a text as the joined sound of recordings, and the motion that was recorded with it.

    text    : one sentence or several, in English words that the dictionary or ``lexicon`` pronounces
    corpus  : the corpus that the model was trained on
    model   : of an engine that ``SelectsRecordings`` (``selection``)
    constraints, speaker, pauses, asymmetry : as of ``speak``
    lexicon : pronunciations of words, ahead of those of the dictionary
    The sound is not changed but at the joins, where successive pieces are shifted by up to 8 ms to fit and overlap: how
    fast and how high words are spoken is what was recorded. Phones that were never recorded are replaced by similar
    ones, with a warning.
    Raises InputError: another engine, another corpus, recordings of several people, a text without words, or a word
    that nobody can pronounce.
    Source: Minnis & Breen 2000, §2 and §3.
    """
    engine = model.engine
    if not isinstance(engine, SelectsRecordings):
        raise InputError(
            f"a model of the engine {engine.name!r} has no recordings to speak with; train one: --engine selection"
        )
    names = engine.recordings(model.learned)
    known = set(corpus.names())
    missing = [name for name in names if name not in known]
    if missing:
        raise InputError(
            f"the corpus {corpus.path} lacks {len(missing)} of {len(names)} recordings of the model, {missing[0]} "
            "among them; give the corpus that it was trained on"
        )
    target = _plan_phones(text, lexicon or Lexicon(), engine, model)
    utterances = {name: corpus.utterance(name) for name in names}
    people = sorted({utterance.speaker for utterance in utterances.values()})
    if len(people) > 1:
        raise InputError(
            f"the model has recordings of {len(people)} people ({', '.join(people)}), whose voices cannot be joined; "
            "train one on the recordings of a single person"
        )
    recorded_features = {
        name: np.asarray(utterance.features.values)[:, :FEATURES] for name, utterance in utterances.items()
    }
    stand_ins = engine.stand_ins(model.learned)
    absent = dict.fromkeys(span.label.phone for span in target if span.label.phone in stand_ins)
    if absent:
        LOG.warning(
            "phones that the recordings do not have, and what is said instead: %s; see lipmotion corpus coverage",
            ", ".join(f"{phone} ({stand_ins[phone]})" for phone in absent),
        )
    pieces, units = engine.source_pieces(model.learned, target, recorded_features)
    sounds = [np.asarray(utterances[piece.recording].audio.samples) for piece in pieces]
    rate_hz = utterances[names[0]].audio.rate_hz
    joined = overlapped(sounds, [(piece.start_s, piece.end_s) for piece in pieces], rate_hz)
    begin_s = _find_starts(len(units), pieces, joined, rate_hz)
    first, last = (round(begin_s[number] * rate_hz) for number in (0, -1))
    audio = Audio(joined.samples[first:last], rate_hz)
    edges_s = np.clip(begin_s - begin_s[0], 0, audio.duration_s).tolist()
    spoken = Timeline(tuple(Span(a, b, s.label) for a, b, s in zip(edges_s, edges_s[1:], units, strict=False)))
    request = Request(audio, units=spoken, speaker=speaker, pauses=pauses, asymmetry=asymmetry, spoken_so=True)
    return SpokenText(audio, animate(request, model=model, constraints=constraints))


def _plan_phones(text: str, lexicon: Lexicon, engine: SelectsRecordings, model: Model) -> Timeline[Unit]:
    """Return the phones of a text, each as long as it typically is."""
    spans: list[Span[Unit]] = []
    now_s = 0.0

    def add(phone: str, word: str, duration_s: float) -> None:
        nonlocal now_s
        spans.append(Span(now_s, now_s + duration_s, Unit(phone, word=word)))
        now_s += duration_s

    for number, sentence in enumerate(split_sentences(text)):
        add(SILENCE, "", BETWEEN_S if number else REST_S)
        for word in split_words(sentence):
            for phone in lexicon.pronunciations(word)[0]:
                add(phone, word, engine.typical_duration_s(model.learned, phone))
    add(SILENCE, "", REST_S)
    return Timeline(tuple(spans))


def _find_starts(count: int, pieces: Sequence[SourcePiece], joined: JoinedPieces, rate_hz: int) -> NDArray[np.float64]:
    """Return when each of some phones begins in the joined sound, and when the last one ends [shape=(count + 1,)].

    Of the silences at both ends, ``REST_S`` are kept.
    """
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
