"""Recordings as engines hear them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from lipmotion.engines import Animator
from lipmotion.errors import AlignmentError
from lipmotion.speech.f0 import log_f0
from lipmotion.speech.recogniser import Recogniser
from lipmotion.types import Audio, Features, Speech, Timeline, Unit


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
