"""Plug-ins for voice agents, with the real frameworks; without them these tests are skipped (``make test-agents``)."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.made import read_welcome

STEP_S = 0.02
MAMA_S, CLOSED_S = (0.5, 1.1), (0.56, 0.86)  # when the tests say "mama", and when the lips are closed in it
WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"


def read_speech(rate_hz: int = 16_000, channels: int = 1) -> np.ndarray:
    """Return speech of 16 bits, here at 16 kHz whatever the rate is called [shape=(N, channels)]."""
    samples = np.round(read_welcome().samples * 32_767).astype("<i2")
    places = np.arange(0, len(samples) - 1, 16_000 / rate_hz).astype(int)
    return np.repeat(samples[places, None], channels, axis=1)


def make_vowel(duration_s: float) -> np.ndarray:
    """Return a sound at 16 kHz in which the lips never close [shape=(N, 1)]."""
    time_s = np.arange(round(16_000 * duration_s)) / 16_000
    waves = sum(np.sin(2 * np.pi * 120 * number * time_s) / number for number in range(1, 20))
    return np.round(4_000 * np.asarray(waves)).astype("<i2")[:, None]


class _Hurry(selectors.DefaultSelector):  # type: ignore[misc, valid-type]
    """Waits in no time: the clock of its loop goes on instead."""

    ahead_s = 0.0

    def select(self, timeout: float | None = None) -> list[Any]:
        ready = super().select(0 if timeout else timeout)
        if not ready and timeout:
            self.ahead_s += timeout
        return ready


class _Loop(asyncio.SelectorEventLoop):
    def __init__(self) -> None:
        self.hurry = _Hurry()
        super().__init__(self.hurry)

    def time(self) -> float:
        return self.hurry.ahead_s


def run(work: Coroutine[Any, Any, None], *, real_time: bool = False) -> None:
    """Run a coroutine to its end, in a clock in which computing takes no time and waiting neither; no task is left."""

    async def check() -> None:
        await work
        for _ in range(10):  # tasks that were cancelled end
            await asyncio.sleep(0)
        assert asyncio.all_tasks() == {asyncio.current_task()}

    loop = asyncio.new_event_loop() if real_time else _Loop()
    try:
        loop.run_until_complete(check())
    finally:
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.close()


def in_no_time(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Let ``run`` run a test."""

    @wraps(test)
    def run_test(**arguments: Any) -> None:
        run(test(**arguments))

    return run_test


class Client:
    """What a page does with messages: it keeps the frames that it will show, by the rule of the documentation."""

    def __init__(self) -> None:
        self.frames: list[dict[str, Any]] = []

    def receive(self, frames: list[dict[str, Any]]) -> None:
        times = [frame["time_s"] for frame in frames]
        assert np.allclose(np.diff(times), STEP_S, atol=2e-4)
        self.frames = [frame for frame in self.frames if frame["time_s"] < times[0] - 1e-6] + frames

    def covers(self, start_s: float, end_s: float) -> bool:
        """Return whether it has every frame of some sound, and none twice."""
        times = [frame["time_s"] for frame in self.frames if start_s - 2e-4 <= frame["time_s"] < end_s - 2e-4]
        if not times:
            return end_s - start_s < STEP_S
        whole = times[0] < start_s + STEP_S and times[-1] > end_s - STEP_S - 2e-4
        return whole and np.allclose(np.diff(times), STEP_S, atol=2e-4)
