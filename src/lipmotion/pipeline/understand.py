"""Recordings as engines hear them."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from lipmotion.engines import Animator
from lipmotion.errors import AlignmentError, InputError
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.transcribe import read_transcript, transcribe
from lipmotion.speech.f0 import log_f0
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.recogniser import Recogniser
from lipmotion.speech.recogniser import recogniser as cached_recogniser
from lipmotion.types import Audio, Features, Speech, Timeline, Unit
from lipmotion.units import Lexicon, check_phones, check_text, words_of

LATE_S = 0.1
"""Units may end this long after the sound: editors round."""
LOG = logging.getLogger("lipmotion")


def understand(
    model: Model,
    audio: Audio,
    *,
    transcript: str | Path | None = None,
    units: Timeline[Unit] | None = None,
    lexicon: Lexicon | None = None,
    recogniser: str = "auto",
) -> Speech:
    """Return a recording as the engine of a model hears it; arguments, and what is raised, as of ``animate``."""
    phones = cached_recogniser(model.phones, recogniser, model.adaptation)
    if units is not None:
        _check_units(units, audio.duration_s)
        return hear(model.engine, audio, mfcc(audio), units)
    words = _words(transcript, audio.duration_s)
    features = mfcc(audio)
    found = partial(transcribe, phones, audio, features, words, lexicon or Lexicon())
    if words is not None:
        return hear(model.engine, audio, features, found())
    return hear_unsaid(model.engine, model.learned, audio, features, phones, found)


def hear(engine: Animator[Any], audio: Audio, features: Features, units: Timeline[Unit]) -> Speech:
    """Return a recording with its phones in time, and with its F0 where the engine wants it."""
    return Speech(features, units, log_f0(audio) if engine.hears_f0 else None)


def hear_unsaid(
    engine: Animator[Any],
    learned: Any,
    audio: Audio,
    features: Features,
    phones: Recogniser,
    recognise: Callable[[], Timeline[Unit]],
) -> Speech:
    """Return a recording whose words are not known, with its phones in time.

    They are those that the engine's own models hear, if they know the voice, placed by the recogniser as it placed
    those of the training; else those that ``recognise`` gives.
    """
    speech = hear(engine, audio, features, Timeline(()))
    found = engine.listen(learned, speech) if phones.kind != "general" else None
    if found is None:
        return replace(speech, units=recognise(), said=False)
    try:
        return replace(speech, units=phones.place(audio, features, found), said=False)
    except AlignmentError:
        return replace(speech, units=recognise(), said=False)


def _words(transcript: str | Path | None, duration_s: float) -> tuple[str, ...] | None:
    """Return what is said. Raises AlignmentError: a text that is too long for the recording."""
    text = read_transcript(transcript) if isinstance(transcript, Path) else transcript
    if text is None:
        return None
    check_text(text, duration_s)
    return words_of(text)


def _check_units(units: Timeline[Unit], duration_s: float) -> None:
    if not len(units):
        raise InputError(
            "the units are an empty list (a .csv has none); give those of a .json or .npz, or leave them out"
        )
    check_phones(len(units), duration_s)
    if units[-1].end_s > duration_s + LATE_S:
        LOG.warning(
            "the units go on to %.2f s, the recording ends at %.2f s: are they those of another?",
            units[-1].end_s,
            duration_s,
        )
