"""Motion of speech as it comes: ``Stream``."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import AsyncIterable, AsyncIterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import gcd
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.live.network import (
    HEARD_S,
    LAGS,
    STEP_FRAMES,
    STEP_S,
    CausalSteps,
    LiveNetwork,
    SoundFeatures,
    answer_silence,
    live_network,
    silent_step,
)
from lipmotion.meshes.fitting.shape_weights import VISEME_CHANNELS
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, VISEMES_15
from lipmotion.motion.articulation import ARTICULATORS
from lipmotion.motion.closure import OPENING, clip_at_zero
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.types import Audio, Motion

Array = NDArray[np.float64]
LONGEST_LOOK_AHEAD_MS = 640.0
SPOKEN, SILENT = 0.4, 0.6
"""Probability of silence under which the mouth speaks, and from which on it goes to rest."""
REST_STEPS, START_STEPS = 5, 3
"""Steps in which it rests, 100 ms, and in which it begins to speak."""
CLOSED = (0.07, 0.18)
"""Probabilities of p, b and m from which on the lips begin to close, and are closed."""
CLOSING_STEPS, OPENING_STEPS = 2, 4
"""Steps in which they close, also where it is seen late, and in which they open again: 40 and 80 ms."""
TAPS, BLOCK = 16, 160
"""Zero crossings of the resampling filter on either side; and samples that are resampled at a time, 10 ms."""
CORRELATED_STEPS = 0.02
"""The network's errors are alike for about so many steps."""
KEPT_STEPS, SHOWN_FRAMES = LAGS[-1] + 3, 500
LOWEST_RATE_HZ, HIGHEST_RATE_HZ = 4_000, 384_000


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """One frame of live motion.

    time_s  : its time in the sound
    known_s : when it was known, in the sound's own time
    motion  : values of all channels of the model [shape=(P,)], by ``names``
    weights : ARKit's weights of the mouth, and visemes of Oculus, by name

    >>> import numpy as np, lipmotion
    >>> frame = lipmotion.Stream(look_ahead_ms=80).push(np.zeros(16_000, np.float32))[-1]
    >>> frame.number, round(frame.time_s, 2), round(frame["viseme_sil"])
    (46, 0.92, 1)
    """

    time_s: float
    known_s: float
    motion: Array
    names: tuple[str, ...]
    weights: dict[str, float]

    def __getitem__(self, name: str) -> float:
        """Return one channel, weight or viseme. Raises KeyError: there is none of that name."""
        if name in self.weights:
            return self.weights[name]
        if name not in self.names:
            raise KeyError(name)
        return float(self.motion[self.names.index(name)])

    @property
    def number(self) -> int:
        """The number of the frame, from 0."""
        return round(self.time_s / STEP_S)


class Stream:
    """Lip motion of sound that is still coming.

    sample_rate   : of the sound that is pushed, Hz
    look_ahead_ms : how long after its time a frame may be known, 0 to 640; more is better. None: frames come with
                    ``flush`` alone, and are those of ``animate``
    model         : whose face moves; None: the one that ships
    The same sound in any pieces gives the same frames, 50 a second. The state is small: ``copy.deepcopy`` copies it.
    Raises InputError: a rate or a look-ahead out of range.

    >>> import numpy as np, lipmotion
    >>> stream = lipmotion.Stream(sample_rate=24_000, look_ahead_ms=80)
    >>> frames = stream.push(np.zeros(24_000, np.float32)) + stream.flush()
    >>> len(frames), frames[0].time_s, round(frames[0]["opening"], 2)
    (50, 0.0, 0.0)
    """

    def __init__(
        self, sample_rate: int = SPEECH_RATE_HZ, look_ahead_ms: float | None = 160.0, model: Model | None = None
    ) -> None:
        if not LOWEST_RATE_HZ <= sample_rate <= HIGHEST_RATE_HZ or sample_rate != int(sample_rate):
            raise InputError(
                f"a stream of {sample_rate} Hz, required a whole number from {LOWEST_RATE_HZ} to {HIGHEST_RATE_HZ}"
            )
        if look_ahead_ms is not None and not 0 <= look_ahead_ms <= LONGEST_LOOK_AHEAD_MS:
            raise InputError(f"a look-ahead of {look_ahead_ms} ms, required 0 to {LONGEST_LOOK_AHEAD_MS:g}, or None")
        self.sample_rate, self.look_ahead_ms = int(sample_rate), look_ahead_ms
        self._face = _Face(model if model is not None else load_model())
        self._sound: list[NDArray[np.float32]] | None = [] if look_ahead_ms is None else None
        self._lag = max(int(np.floor(((look_ahead_ms or 0.0) / 1000 - HEARD_S) / STEP_S + 1e-9)), -1)
        self._smoother = _Smoother(live_network(), self._lag)
        self._first = 0  # the frame at which the sound that is heard now begins
        self._next = 0
        self._shown: deque[tuple[Array, Array]] = deque([self._face.resting], maxlen=SHOWN_FRAMES)
        self._features = SoundFeatures(live_network().typical)
        self._listen()

    def push(self, samples: Any) -> list[LiveFrame]:
        """Return the frames that are known now, in order.

        samples : the sound that follows, of any length: floats, full scale 1, or integers of 16 bits [shape=(N,)], or
                  of several channels [shape=(N, C)], which are mixed
        Raises InputError: other numbers, or some that are not finite; the stream stays as it was.
        """
        mono = _mono_samples(samples)
        if self._sound is not None:
            self._sound.append(mono)
            return []
        return self._hear(self._resampler.push(mono))

    def flush(self) -> list[LiveFrame]:
        """Return the frames of all sound that was pushed; the next sound follows it."""
        if self._sound is not None:
            return self._animate_all()
        seconds, frames = self._resampler.seconds, self._hear(self._resampler.finish())
        wanted, end_s = self._first + int(np.ceil(seconds / STEP_S - 1e-9)), self._first * STEP_S + seconds
        while self._next < wanted:
            frames += self._hear(np.zeros(BLOCK, np.float32))
        for _ in range(self._next - wanted):
            self._shown.pop()
        self._next, self._first = wanted, wanted
        self._listen()
        return [replace(frame, known_s=min(frame.known_s, end_s)) for frame in frames if frame.number < wanted]

    def interrupt(self, time_s: float | None = None) -> list[LiveFrame]:
        """Return the frames in which the mouth comes to rest, 100 ms; sound that is not heard yet is forgotten.

        time_s : of the frame after which it rests, for sound that was pushed ahead of what is heard; at most 10 s
                 before the last frame. None: the last frame
        Sound that is pushed now follows these frames.
        """
        last = self._next if time_s is None else min(max(int(time_s / STEP_S) + 1, 0), self._next)
        for _ in range(min(self._next - last, len(self._shown) - 1)):
            self._shown.pop()
            self._next -= 1
        shown, frames = self._shown[-1], []
        for number in range(1, REST_STEPS + 1):
            share = (1 - np.cos(np.pi * number / REST_STEPS)) / 2
            frames.append(self._frame(_between(shown, self._face.resting, share), self._next * STEP_S))
        self._first = self._next
        if self._sound is not None:
            self._sound = []
        self._listen()
        return frames

    async def frames(self, sound: AsyncIterable[Any]) -> AsyncIterator[LiveFrame]:
        """Yield the frames of pieces of sound as they come, those of ``flush`` at their end. Raises as ``push``."""
        async for samples in sound:
            for frame in self.push(samples):
                yield frame
        for frame in self.flush():
            yield frame

    def __deepcopy__(self, memo: dict[int, Any]) -> Stream:
        result = copy.copy(self)
        for name, value in vars(self).items():
            shared = name in ("_face", "_smoother")  # these never change
            setattr(result, name, value if shared else copy.deepcopy(value, memo))
        return result

    def _listen(self) -> None:
        """Begin to hear, as after silence; how loud and how coloured the sound is stays known."""
        self._resampler = _Resampler(self.sample_rate)
        self._features.restart()
        self._steps = CausalSteps(live_network().network, silent_step(live_network().typical))
        self._rows: list[NDArray[np.float32]] = []
        self._answers = deque([self._smoother.silent] * KEPT_STEPS, KEPT_STEPS)
        self._heard = 0  # steps
        self._before = [self._smoother.rest] * 2
        self._closing, self._resting = 0.0, 1.0
        self._last, self._leaving = self._shown[-1], 1.0  # the pose from which the mouth goes on

    def _hear(self, samples: NDArray[np.float32]) -> list[LiveFrame]:
        frames = []
        self._rows += self._features.push(samples)
        while len(self._rows) >= STEP_FRAMES:
            inputs, self._rows = np.concatenate(self._rows[:STEP_FRAMES]), self._rows[STEP_FRAMES:]
            self._answers.append(self._steps.push(inputs).reshape(len(LAGS), -1))
            if self._lag == -1 and not self._heard:  # what the first step says is about the frame after it
                frames.append(self._frame(self._face.resting, self._first * STEP_S))
            self._heard += 1
            if self._heard > self._lag:
                known_s = self._first * STEP_S + (self._heard - 1) * STEP_S + HEARD_S
                frames.append(self._frame(self._speak(), known_s))
        return frames

    def _speak(self) -> tuple[Array, Array]:
        """Return pose and weights of the frame that is known now."""
        smooth, said = self._smoother.solve(self._answers, self._before)
        self._before = [smooth, self._before[0]]
        silent = float(said[VISEMES_15.index("sil")])
        change = 1 / REST_STEPS if silent > SILENT else -1 / START_STEPS if silent < SPOKEN else 0.0
        self._resting = float(np.clip(self._resting + change, 0, 1))
        wanted = float(np.interp(said[VISEMES_15.index("PP")], CLOSED, (0, 1)))
        self._closing += float(np.clip(wanted - self._closing, -1 / OPENING_STEPS, 1 / CLOSING_STEPS))
        spoken = self._face.pose(smooth, np.clip(said, 0, 1), self._closing)
        shown = _between(spoken, self._face.resting, (1 - np.cos(np.pi * self._resting)) / 2)
        self._leaving = max(self._leaving - 1 / REST_STEPS, 0.0)
        return _between(shown, self._last, self._leaving)

    def _frame(self, shown: tuple[Array, Array], known_s: float) -> LiveFrame:
        self._shown.append(shown)
        pose, weights = shown
        frame = LiveFrame(
            self._next * STEP_S, known_s, pose, self._face.names, dict(zip(WEIGHT_NAMES, weights.tolist(), strict=True))
        )
        self._next += 1
        return frame

    def _animate_all(self) -> list[LiveFrame]:
        """Return the frames of ``animate`` of all sound."""
        sound, self._sound = np.concatenate(self._sound or [np.zeros(0, np.float32)]), []
        if not len(sound):
            return []
        result = animate(Audio(sound, self.sample_rate), model=self._face.model)
        end_s = self._first * STEP_S + len(sound) / self.sample_rate
        motion = result.motion.resampled(1 / STEP_S)
        arkit, visemes = (
            make_curves(result.motion, result.units, name).resampled(1 / STEP_S).values for name in ("arkit", "visemes")
        )
        count = min(len(motion.values), len(arkit), len(visemes))
        weights = np.concatenate([arkit[:count], visemes[:count]], axis=1)
        frames = [self._frame((motion.values[n], weights[n]), end_s) for n in range(count)]
        self._first = self._next
        return frames


class _Smoother:
    """Fixed-lag parameter generation: the frame that a step makes known, from answers about it and what follows.

    Least squares of what the network says, by its variance, and of accelerations, by people's, given the two frames
    before. As nothing of it depends on the sound, the solution is a recursive filter, whose weights are found once.
    Source: Koishida et al. 2001 (low-delay parameter generation), Muramatsu et al. 2008.
    """

    def __init__(self, network: LiveNetwork, lag: int) -> None:
        count = lag + 2  # frames from the one that becomes known to the newest
        ages = lag - np.arange(count)
        self._choice = np.array([max(n for n, each in enumerate(LAGS) if each <= age) for age in ages])
        self._steps = -1 - (ages - np.array(LAGS)[self._choice])  # places in the answers, the newest at -1
        self._gains = network.gains[self._choice]
        trust = 1 / (CORRELATED_STEPS * network.variances[self._choice])
        second = np.eye(count + 2)[2:] - 2 * np.eye(count + 2)[1:-1] + np.eye(count + 2)[:-2]
        known, unknown = second[:, :2], second[:, 2:]
        self._of_answers, self._of_before = np.empty((count, len(ARTICULATORS))), np.empty((2, len(ARTICULATORS)))
        for column, variance in enumerate(network.acceleration):
            normal = np.diag(trust[:, column]) + unknown.T @ unknown / variance
            first = np.linalg.solve(normal, np.eye(count)[0])
            self._of_answers[:, column] = first * trust[:, column]
            self._of_before[:, column] = -first @ (unknown.T @ known) / variance
        self.silent = answer_silence().reshape(len(LAGS), -1)
        self.rest = self.silent[-1, : len(ARTICULATORS)].astype(float)

    def solve(self, answers: deque[NDArray[np.float32]], before: list[Array]) -> tuple[Array, Array]:
        """Return articulators [shape=(8,)] and visemes [shape=(15,)] of the frame that is known now.

        answers : of the last steps [each shape=(5, 23)]
        before  : articulators of the frame before, and of the one before that
        """
        rows = np.stack(
            [answers[place][choice] for place, choice in zip(self._steps.tolist(), self._choice.tolist(), strict=True)]
        ).astype(float)
        wanted = rows[:, : len(ARTICULATORS)] * self._gains * self._of_answers
        previous = np.stack([before[1], before[0]]) * self._of_before
        return wanted.sum(axis=0) + previous.sum(axis=0), rows[0, len(ARTICULATORS) :]


class _Face:
    """The face of a model, which follows articulators in standard deviations."""

    def __init__(self, model: Model) -> None:
        learned = model.learned
        if getattr(learned, "prior", None) is None or learned.closure is None:
            raise InputError("the model has no table of articulation, which live motion needs; train it again")
        self.model, self._space, self._prior, self._closure = model, learned.space, learned.prior, learned.closure
        self.names = tuple(channel.name for channel in self._space.channels)
        row = ARTICULATORS.index(OPENING)
        column = self._closure.column
        self._closed = (self._closure.closed - self._prior.centre[column]) / self._prior.matrix[row, column]
        self._opening = row

    @cached_property
    def resting(self) -> tuple[Array, Array]:
        """Pose and weights of the mouth at rest."""
        articulators = answer_silence().reshape(len(LAGS), -1)[-1, : len(ARTICULATORS)].astype(float)
        said = np.eye(len(VISEMES_15))[VISEMES_15.index("sil")]
        return self.pose(articulators, said, 1.0)

    def pose(self, articulators: Array, said: Array, closing: float) -> tuple[Array, Array]:
        """Return the values of all channels, and the weights, with the lips closed so far, 0 to 1."""
        moved = articulators.copy()
        moved[self._opening] += closing * min(self._closed - moved[self._opening], 0.0)
        reduced = self._prior.centre + articulators @ self._prior.matrix
        opening = self._prior.centre[self._closure.column] + (
            moved[self._opening] * self._prior.matrix[self._opening, self._closure.column]
        )
        reduced += (opening - reduced[self._closure.column]) * self._closure.follow
        values, _ = self._space.restore(reduced[None], np.zeros((1, len(reduced))))
        motion = Motion(values, 1 / STEP_S, self._space.channels)
        clip_at_zero(motion)
        arkit = np.clip(np.concatenate([[1.0], moved, said]) @ live_network().curves, 0, 1)
        return motion.values[0], np.concatenate([arkit, said / max(float(said.sum()), 1.0)])


def _between(shown: tuple[Array, Array], goal: tuple[Array, Array], share: float) -> tuple[Array, Array]:
    """Return a pose and weights that are a share of the way to others, 0 to 1."""
    (pose, weights), (last, others) = shown, goal
    return pose + share * (last - pose), weights + share * (others - weights)


class _Resampler:
    """Sound at 16 kHz, block by block, with a windowed sinc (Kaiser); how it is cut into pieces changes no bit."""

    def __init__(self, rate_hz: int) -> None:
        shared = gcd(rate_hz, SPEECH_RATE_HZ)
        self._up, self._down, self._rate_hz = SPEECH_RATE_HZ // shared, rate_hz // shared, rate_hz
        slower = max(1.0, rate_hz / SPEECH_RATE_HZ)
        self._reach = int(np.ceil(TAPS * slower))
        x = np.arange(1 - self._reach, self._reach + 1) - np.arange(self._up)[:, None] / self._up
        window = np.i0(8.0 * np.sqrt(np.maximum(1 - np.square(x / self._reach), 0))) / np.i0(8.0)
        self._filters = (np.sinc(0.95 * x / slower) * 0.95 / slower * window).astype(np.float32)
        self._pending = np.zeros(self._reach - 1, np.float32)  # beginning at the sample ``_reach`` - 1 before the next
        self._made, self._taken, self.pushed = 0, 0, 0

    @property
    def seconds(self) -> float:
        """Seconds of sound that were pushed."""
        return self.pushed / self._rate_hz

    def push(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return what is known of the sound at 16 kHz now."""
        self.pushed += len(samples)
        if self._up == self._down:
            return samples
        self._pending = np.concatenate([self._pending, samples])
        blocks = []
        while True:
            numbers = np.arange(self._made, self._made + BLOCK)
            first, phase = np.divmod(numbers * self._down, self._up)
            if first[-1] - self._taken + 2 * self._reach > len(self._pending):
                break
            rows = self._pending[(first - self._taken)[:, None] + np.arange(2 * self._reach)]
            blocks.append(np.einsum("nt,nt->n", rows, self._filters[phase]))
            self._made += BLOCK
            drop = int(first[-1]) - self._taken
            self._pending, self._taken = self._pending[drop:], self._taken + drop
        return np.concatenate([*blocks, np.zeros(0, np.float32)])

    def finish(self) -> NDArray[np.float32]:
        """Return the rest, with silence after it."""
        seconds = self.seconds
        pushed, rest = self.pushed, self.push(np.zeros(2 * self._reach + self._rate_hz // 50, np.float32))
        self.pushed = pushed
        return rest[: max(int(np.ceil(seconds * SPEECH_RATE_HZ)) - (self._made - len(rest)), 0)]


def _mono_samples(samples: Any) -> NDArray[np.float32]:
    """Return samples as floats of one channel, full scale 1. Raises InputError: as ``Stream.push``."""
    if isinstance(samples, bytes | bytearray | memoryview):
        if len(samples) % 2:
            raise InputError(f"{len(samples)} bytes of sound, required whole samples of 16 bits")
        samples = np.frombuffer(samples, "<i2")
    values = np.asarray(samples)
    if (
        values.ndim not in (1, 2)
        or values.dtype.kind not in "if"
        or (values.dtype.kind == "i" and values.itemsize != 2)
    ):
        raise InputError(
            f"samples of shape {values.shape} and type {values.dtype}, required (N,) or (N, C), floats or int16"
        )
    floats = values.astype(np.float32) / np.float32(32768) if values.dtype.kind == "i" else values.astype(np.float32)
    if not np.isfinite(floats).all():
        raise InputError("samples that are not finite; leave them out, or put 0 there")
    return floats.mean(axis=1, dtype=np.float32) if floats.ndim == 2 else floats


WEIGHT_NAMES = (*ARKIT_MOUTH, *VISEME_CHANNELS)
