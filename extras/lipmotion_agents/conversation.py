"""Motion of what an agent says, one utterance after another, on the time of all its sound; and how much was heard."""

from __future__ import annotations

import asyncio
import copy
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from lipmotion.errors import InputError
from lipmotion.live.face import LiveFrame
from lipmotion.live.network import STEP_S
from lipmotion.live.stream import REST_STEPS, Stream
from lipmotion.live.timings import LONGEST_S
from lipmotion.pipeline.model import Model, load_model

OnFrames = Callable[[list[LiveFrame], bool], Awaitable[None] | None]
"""Takes frames, and whether the first one is to be shown now; perhaps a coroutine function."""
LOOK_AHEAD_MS = 320.0
"""Synthesised sound comes faster than it is spoken: so much look-ahead costs it little."""
PIECE_S = 0.04
"""Between pieces of so many seconds of sound, each some milliseconds of work, other tasks of the event loop run."""
REST_S = REST_STEPS * STEP_S
FRAMES_IN_MESSAGE = 3
"""Keeps messages under 4 kB, which the data channels of all transports carry."""
MIN_WEIGHT = 0.002
WORD_S, LETTER_S = 0.2, 0.1
"""A word whose end is not known lasts at most so long, and so much longer with each letter."""


class Conversation:
    """The motion of utterances, each a stream of sound, on one time: seconds of sound since the first one.

    look_ahead_ms, model, seed : of ``Stream``
    sound_s                    : where the sound that was pushed ends
    known_s                    : the motion of the sound before this time is known
    A pause between utterances takes no time here, and an interruption the 100 ms in which the mouth comes to rest.
    """

    def __init__(self, look_ahead_ms: float = LOOK_AHEAD_MS, model: Model | None = None, seed: int | None = 0) -> None:
        self._model, self._seed, self.look_ahead_s = model or load_model(), seed, look_ahead_ms / 1000
        self._stream = Stream(look_ahead_ms=look_ahead_ms, model=self._model, seed=seed)
        self._words: deque[tuple[str, float, float | None]] = deque()  # that the stream was not given yet
        self._said_s = 0.0  # where the last one ends that it was given
        self._shift = 0.0  # from our time to the stream's
        self._began_s, self._samples = 0.0, 0  # of the utterance
        self._number = 0  # of the utterance
        self.sound_s = self.known_s = 0.0
        self.speaking = False
        self._goal = self._stream.interrupt()[-1]
        self._stream_s = self._goal.time_s + STEP_S

    async def push(self, sound: bytes, rate_hz: int, channels: int, *, at_rest: bool) -> list[LiveFrame]:
        """Return the frames that are known now; none if the utterance is interrupted meanwhile.

        sound   : of 16 bits, channels interleaved
        at_rest : an utterance that begins now follows silence, in which the mouth came to rest
        """
        frames = []
        if self.speaking and rate_hz != self._stream.sample_rate:
            frames += self._flush()
        if not self.speaking:
            self._begin(rate_hz, at_rest)
        number, samples = self._number, np.frombuffer(sound, "<i2", len(sound) // (2 * channels) * channels)
        samples = samples.reshape(-1, channels)
        for piece in np.split(samples, range(round(PIECE_S * rate_hz), len(samples), round(PIECE_S * rate_hz))):
            frames += self._place(self._stream.push(piece))
            self._samples += len(piece)
            self.sound_s = self._began_s + self._samples / rate_hz
            await asyncio.sleep(0)
            if self._number != number:
                return []
        return frames

    def add_words(self, words: Iterable[tuple[str, float, float | None]]) -> None:
        """Take words with their start and end, in order, on the time of ``sound_s``, perhaps before their sound.

        The mouth then says them. An end of None: where the next word begins, but soon. As services send odd times, a
        start moves up to the end of the word before; what is empty then, too long or no single word is left out.
        """
        self._words.extend(words)
        if self.speaking:
            self._give_words()

    def finish(self) -> list[LiveFrame]:
        """Return the last frames of the utterance, and those in which the mouth rests where nothing follows."""
        if not self.speaking:
            return []
        return self._flush() + [_move(frame, -self._shift) for frame in copy.deepcopy(self._stream).interrupt()]

    def interrupt(self, time_s: float, shown: LiveFrame | None) -> list[LiveFrame]:
        """Return the frames of ``rest``; all sound after them is void, and the next sound follows them."""
        self._goal = self._stream.interrupt()[-1]
        self._stream_s, self.speaking = self._goal.time_s + STEP_S, False
        self._number += 1
        self._words.clear()
        self._said_s = 0.0
        self.sound_s = self.known_s = time_s + REST_S
        return self.rest(time_s, shown)

    def rest(self, time_s: float, shown: LiveFrame | None) -> list[LiveFrame]:
        """Return the frames in which the mouth comes to rest after a time, 100 ms.

        shown : the frame from which it goes to rest; None: it rests already
        """
        goal = [replace(self._goal, time_s=time_s + number * STEP_S, known_s=time_s) for number in range(REST_STEPS)]
        return blend(goal, shown or self._goal)

    def _give_words(self, *, last: bool = False) -> None:
        """Give the stream the words; one without an end waits for the next one, unless there is none any more."""
        given: list[tuple[str, float, float]] = []
        while self._words and (last or len(self._words) > 1 or self._words[0][2] is not None):
            text, start_s, end_s = self._words.popleft()
            if end_s is None:
                longest_s = start_s + WORD_S + LETTER_S * len(text)
                end_s = min(self._words[0][1], longest_s) if self._words else longest_s
            start_s = max(start_s, self._said_s)
            if len(text.split()) == 1 and start_s < end_s < start_s + LONGEST_S:
                given.append((text, start_s + self._shift, end_s + self._shift))
                self._said_s = end_s
        try:
            self._stream.add_words(given)
        except InputError:  # nobody can pronounce one of them: in its place, what is heard is shown
            for word in given:
                with suppress(InputError):
                    self._stream.add_words([word])

    def _flush(self) -> list[LiveFrame]:
        self._give_words(last=True)
        frames, self.speaking = self._place(self._stream.flush()), False
        self.known_s = self.sound_s
        return frames

    def _begin(self, rate_hz: int, at_rest: bool) -> None:
        if rate_hz != self._stream.sample_rate:
            self._stream = Stream(rate_hz, self.look_ahead_s * 1000, self._model, seed=self._seed)
            self._stream_s = 0.0
        elif at_rest:
            self._stream_s = self._stream.interrupt()[-1].time_s + STEP_S
        self._shift = self._stream_s - self.sound_s
        self._began_s, self._samples, self.speaking = self.sound_s, 0, True
        self._number += 1
        self._give_words()

    def _place(self, frames: list[LiveFrame]) -> list[LiveFrame]:
        """Return frames of the stream at our times."""
        if frames:
            self._stream_s = frames[-1].time_s + STEP_S
            self.known_s = self._stream_s - self._shift
        return [_move(frame, -self._shift) for frame in frames]


class Playout:
    """How much of the sound that was passed on is heard by now: it is heard in real time, one piece after another.

    Of its motion the frames that are not past yet are remembered. All times ``now_s`` are those of one clock.
    until_s : when the last of it is heard
    """

    def __init__(self) -> None:
        self.until_s = -np.inf
        self._end_s = 0.0
        self._frames: deque[LiveFrame] = deque()

    def pass_on(self, end_s: float, duration_s: float, now_s: float) -> bool:
        """Note a piece of sound, and where it ends; return whether silence was heard before it."""
        self.shown(now_s)
        begins = now_s >= self.until_s
        self.until_s, self._end_s = max(self.until_s, now_s) + duration_s, end_s
        return begins

    def add(self, frames: Iterable[LiveFrame]) -> None:
        """Note motion, which takes the place of all that was to be shown from then on."""
        for frame in frames:
            while self._frames and self._frames[-1].time_s >= frame.time_s:
                self._frames.pop()
            self._frames.append(frame)

    def heard_s(self, now_s: float) -> float:
        """Return up to which time sound was heard."""
        return self._end_s - max(self.until_s - now_s, 0.0)

    def is_silent(self, now_s: float) -> bool:
        """Return whether all sound was heard, and the mouth had the time to come to rest."""
        return now_s >= self.until_s + REST_S

    def shown(self, now_s: float) -> LiveFrame | None:
        """Return the frame that is shown now; those before it are forgotten. None: none was."""
        shown_s = self._end_s + now_s - self.until_s  # the mouth goes on to rest after the sound
        while len(self._frames) > 1 and self._frames[1].time_s <= shown_s:
            self._frames.popleft()
        return self._frames[0] if self._frames and self._frames[0].time_s <= shown_s else None


def blend(frames: list[LiveFrame], start: LiveFrame) -> list[LiveFrame]:
    """Return frames that lead from one that is shown to the last of them."""
    shares = (1 - np.cos(np.pi * np.arange(1, len(frames) + 1) / len(frames))) / 2
    return [
        replace(
            frame,
            motion=start.motion + share * (frame.motion - start.motion),
            weights={name: (1 - share) * start.weights[name] + share * frame.weights[name] for name in frame.weights},
        )
        for frame, share in zip(frames, shares.tolist(), strict=True)
    ]


def list_messages(frames: list[LiveFrame], now: bool, **more: Any) -> Iterator[dict[str, Any]]:
    """Yield messages for whoever shows the frames, as objects of JSON, each under 4 kB.

    ``frames``: a time in seconds, and the weights that are not 0. They take the place of all frames from the time of
    the first one on. ``now``: the first frame is to be shown when the message comes; later ones count from there.
    """
    for first in range(0, len(frames), FRAMES_IN_MESSAGE):
        shown = [
            {
                "time_s": round(frame.time_s, 4),
                "weights": {n: round(value, 3) for n, value in frame.weights.items() if abs(value) >= MIN_WEIGHT},
            }
            for frame in frames[first : first + FRAMES_IN_MESSAGE]
        ]
        yield {"type": "lipmotion", **more, "now": now and not first, "frames": shown}


def _move(frame: LiveFrame, by_s: float) -> LiveFrame:
    return replace(frame, time_s=frame.time_s + by_s, known_s=frame.known_s + by_s)
