"""Recordings as engines hear them."""

from __future__ import annotations

from typing import Any

from lipmotion.engines import Engine
from lipmotion.speech.f0 import log_f0
from lipmotion.types import Audio, Features, Speech, Timeline, Unit


def hear(engine: Engine[Any], audio: Audio, features: Features, units: Timeline[Unit]) -> Speech:
    """Return a recording with its phones in time, and with its F0 where the engine wants it."""
    return Speech(features, units, log_f0(audio) if engine.hears_f0 else None)
