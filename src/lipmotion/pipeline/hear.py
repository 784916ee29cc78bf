"""Recordings as engines hear them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lipmotion.engines import Engine
from lipmotion.speech.f0 import log_f0
from lipmotion.types import Audio, Features, Speech, Timeline, Unit

NOTHING: Timeline[Unit] = Timeline(())


def hear(engine: Engine[Any], audio: Audio, features: Features, units: Timeline[Unit]) -> Speech:
    """Return a recording with its phones in time, and with its F0 where the engine wants it."""
    return Speech(features, units, log_f0(audio) if engine.hears_f0 else None)


def hear_out(
    engine: Engine[Any],
    learned: Any,
    audio: Audio,
    features: Features,
    *,
    said: Timeline[Unit] | None,
    recognise: Callable[[], Timeline[Unit]],
) -> Speech:
    """Return a recording with the phones that the engine's own models hear, where they know the voice.

    said      : the phones of its transcript, in time, or None
    recognise : gives its phones where there is no transcript and the engine does not know the voice
    """
    speech = hear(engine, audio, features, NOTHING if said is None else said)
    units = engine.listen(learned, speech, said is not None)
    if units is None:
        units = recognise() if said is None else said
    return Speech(features, units, speech.log_f0)
