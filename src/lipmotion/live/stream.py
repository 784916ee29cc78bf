"""Motion of speech as it comes: ``Stream``."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import AsyncIterable, AsyncIterator, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.live.face import WEIGHT_NAMES, LiveFrame, ModelFace, between
from lipmotion.live.idling import LARGEST_TURN_RAD, Idling
from lipmotion.live.network import (
    BLOCK,
    HEARD_S,
    LAGS,
    STEP_FRAMES,
    STEP_S,
    LiveNetwork,
    Resampler,
    SoundFeatures,
    hear_silence,
    live_network,
    mono_samples,
)
from lipmotion.live.timings import TimedPhones
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, VISEMES_15
from lipmotion.motion.articulation import ARTICULATORS
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.pipeline.request import Pauses, Request
from lipmotion.types import SPEECH_RATE_HZ, Audio
from lipmotion.types.delivery import Staging
from lipmotion.units.lexicon import Lexicon

Array = NDArray[np.float64]
LONGEST_LOOK_AHEAD_MS = 640.0
SPOKEN, SILENT = 0.8, 0.82  # probability of silence under which the mouth speaks, and from which on it goes to rest
AHEAD_STEPS = 8
"""Lips part before they are heard: as far as so many steps are known, 160 ms, it rests only if all are silent."""
REST_STEPS, START_STEPS = 5, 3  # steps in which it rests, 100 ms, and in which it begins to speak
CLOSED = (0.07, 0.18)  # probabilities of p, b and m from which on the lips begin to close, and are closed
CLOSING_STEPS, OPENING_STEPS = 2, 4
"""Steps in which they close, also where it is seen late, and in which they open again: 40 and 80 ms."""
LARGEST_MOVE = 0.08
"""The opening changes by at most so much in a step, eye distances: GRID's s1 is faster in one of 10,000 steps."""
TIMED_SHARE = 0.3  # weight of phones that are given with their times in the articulators; the rest is what is heard
CORRELATED_STEPS = 0.02  # the network's errors are alike for about so many steps
ANSWER_STEPS, POSE_FRAMES = LAGS[-1] + 3, 500
OPENING_ROW, SILENT_ROW = ARTICULATORS.index("opening"), VISEMES_15.index("sil")
LOWEST_RATE_HZ, HIGHEST_RATE_HZ = 4_000, 384_000


class Stream:
    """Lip motion of sound that is still coming.

    sample_rate   : of the sound that is pushed, Hz
    look_ahead_ms : how long after its time a frame may be known, 0 to 640; more is better. None: frames come with
                    ``flush`` alone, and are those of ``animate``
    model         : whose face moves, a model or its file; None: the one that ships
    pauses        : "rest": the lips close in pauses; "natural": they stay as people's do
    lexicon       : pronounces the words of ``add_words``
    seed          : of blinks, glances and the sway of the head; None: only the mouth moves
    The same sound in any pieces gives the same frames, 50 a second. The state is small: ``copy.deepcopy`` copies it.
    Raises InputError: a rate or a look-ahead out of range.

    >>> import numpy as np, lipmotion
    >>> stream = lipmotion.Stream(sample_rate=24_000, look_ahead_ms=80)
    >>> frames = stream.push(np.zeros(24_000, np.float32)) + stream.flush()
    >>> len(frames), frames[0].time_s, round(frames[0]["opening"], 2)
    (50, 0.0, 0.0)
    """

    def __init__(
        self,
        sample_rate: int = SPEECH_RATE_HZ,
        look_ahead_ms: float | None = 160.0,
        model: Model | str | Path | None = None,
        *,
        pauses: Pauses = "rest",
        lexicon: Lexicon | None = None,
        seed: int | None = 0,
    ) -> None:
        if sample_rate not in range(LOWEST_RATE_HZ, HIGHEST_RATE_HZ + 1):
            raise InputError(f"a stream of {sample_rate!r} Hz, required {LOWEST_RATE_HZ} to {HIGHEST_RATE_HZ}, whole")
        if look_ahead_ms is not None and not 0 <= look_ahead_ms <= LONGEST_LOOK_AHEAD_MS:
            raise InputError(f"a look-ahead of {look_ahead_ms} ms, required 0 to {LONGEST_LOOK_AHEAD_MS:g}, or None")
        if pauses not in get_args(Pauses):
            raise InputError(f"pauses {pauses!r}, required one of {', '.join(get_args(Pauses))}")
        self.sample_rate, self.look_ahead_ms, self._pauses, self._seed = int(sample_rate), look_ahead_ms, pauses, seed
        self._face = ModelFace(load_model(model))
        self._sound: list[NDArray[np.float32]] | None = [] if look_ahead_ms is None else None
        self._lag = max(int(np.floor(((look_ahead_ms or 0.0) / 1000 - HEARD_S) / STEP_S + 1e-9)), -1)
        self._smoother = _Smoother(live_network(), self._lag)
        self._first = 0  # the frame at which the sound that is heard now begins
        self._next = 0
        self._poses: deque[tuple[Array, Array]] = deque([self._face.resting], maxlen=POSE_FRAMES)
        self._features = SoundFeatures(live_network().typical)
        self._idling = None if seed is None else Idling(seed)
        self._timings, self._lexicon = TimedPhones(), lexicon or Lexicon()
        self._listen()

    def push(self, samples: Any) -> list[LiveFrame]:
        """Return the frames that are known now, in order.

        samples : the sound that follows, of any length: floats, full scale 1, or integers of 16 bits [shape=(N,)], or
                  of several channels [shape=(N, C)], which are mixed
        Raises InputError: other numbers, or some that are not finite; the stream stays as it was.
        """
        mono = mono_samples(samples)
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
            self._poses.pop()
        self._next, self._first = wanted, wanted
        self._listen()
        return [replace(frame, known_s=min(frame.known_s, end_s)) for frame in frames if frame.number < wanted]

    def interrupt(self, time_s: float | None = None) -> list[LiveFrame]:
        """Return the frames in which the mouth comes to rest, 100 ms; sound that is not heard yet is forgotten.

        time_s : of the frame after which it rests, for sound that was pushed ahead of what is heard; where that is
                 more than 10 s before the last frame, the mouth rests at once. None: the last frame
        Sound that is pushed now follows these frames; words that were added are forgotten, too.
        Raises InputError: a time that is not finite.
        """
        if time_s is not None and not np.isfinite(time_s):
            raise InputError(f"a rest from {time_s} s on, required a time of the stream")
        last = self._next if time_s is None else min(max(int(time_s / STEP_S) + 1, 0), self._next)
        for _ in range(min(self._next - last, len(self._poses))):
            self._poses.pop()
        if self._idling is not None:
            self._idling.ahead_s += (self._next - last) * STEP_S
        self._next, frames = last, []
        pose = self._poses[-1] if self._poses else self._face.resting
        for number in range(1, REST_STEPS + 1):
            share = (1 - np.cos(np.pi * number / REST_STEPS)) / 2
            frames.append(self._frame(between(pose, self._face.resting, share), self._next * STEP_S))
        self._first, self._timings = self._next, TimedPhones()
        self._sound = None if self._sound is None else []
        self._listen()
        return frames

    @property
    def time_s(self) -> float:
        """The time of the next frame, seconds: sound that is pushed after ``flush`` or ``interrupt`` begins there."""
        return self._next * STEP_S

    @property
    def begins_s(self) -> float:
        """The time of the frame at which the sound began that is heard now, seconds."""
        return self._first * STEP_S

    def add_words(self, words: Iterable[tuple[str, float, float]]) -> None:
        """Take words that are said, each with its start and end in seconds of the stream, in order.

        A speech service sends them with its sound, or before it; frames that were given already stay as they are. The
        mouth then says these words, not what is recognised. Markup and punctuation alone are silence.
        Raises InputError: times that overlap or are no seconds; the stream stays as it was.
        """
        self._timings.add(words, phones=False, lexicon=self._lexicon, now_s=self.time_s)

    def add_phones(self, phones: Iterable[tuple[str, float, float]]) -> None:
        """Take phones (ARPAbet; "" is silence) as ``add_words`` does words. Raises InputError: also an unknown one."""
        self._timings.add(phones, phones=True, lexicon=self._lexicon, now_s=self.time_s)

    def look_at(self, yaw_rad: float, pitch_rad: float = 0.0) -> None:
        """Turn eyes and head to somebody, so far to the face's left and upwards; ``look_at(0)``: to the viewer.

        Raises InputError: further than 1 radian.
        """
        target = np.array([yaw_rad, pitch_rad], float)
        if not (np.abs(target) <= LARGEST_TURN_RAD).all():
            raise InputError(f"somebody at {yaw_rad}, {pitch_rad} radians, required at most {LARGEST_TURN_RAD:g} away")
        if self._idling is not None:
            self._idling.target = target

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
            shared = name in ("_face", "_smoother", "_lexicon")  # these never change
            setattr(result, name, value if shared else copy.deepcopy(value, memo))
        return result

    def _listen(self) -> None:
        """Begin to hear, as after silence; how loud and how coloured the sound is stays known."""
        self._resampler = Resampler(self.sample_rate)
        self._features.restart()
        self._steps = copy.deepcopy(hear_silence()[0])
        self._rows: list[NDArray[np.float32]] = []
        self._answers = deque([self._smoother.silent] * ANSWER_STEPS, ANSWER_STEPS)
        self._heard = 0  # steps
        self._before = [self._smoother.rest] * 2
        self._closing, self._resting, self._opening = 0.0, 1.0, 0.0
        self._timed, self._timed_share = self._smoother.rest, 0.0  # by timings, and how far these count
        self._last, self._leaving = self._poses[-1], 1.0  # the pose from which the mouth goes on

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
        smooth, known = self._smoother.solve(self._answers, self._before)
        visemes, silent = known[0], float(known[: AHEAD_STEPS + 1, SILENT_ROW].min())
        self._before = [smooth, self._before[0]]
        timed, share = self._timings.row(self._next), 0.0
        if timed is not None:
            self._timed, visemes = np.split(timed, [len(ARTICULATORS)])
            silent = float(visemes[SILENT_ROW])
            share = TIMED_SHARE * (1 - silent)
        step = TIMED_SHARE / START_STEPS
        self._timed_share += float(np.clip(share - self._timed_share, -step, step))
        smooth = smooth + self._timed_share * (self._timed - smooth)
        change = 1 / REST_STEPS if silent > SILENT else -1 / START_STEPS if silent < SPOKEN else 0.0
        self._resting = float(np.clip(self._resting + change, 0, 1))
        closing = float(np.interp(visemes[VISEMES_15.index("PP")], CLOSED if timed is None else (0, 1), (0, 1)))
        self._closing += float(np.clip(closing - self._closing, -1 / OPENING_STEPS, 1 / CLOSING_STEPS))
        self._opening = float(smooth[OPENING_ROW])
        spoken = self._face.pose(smooth, np.clip(visemes, 0, 1), self._closing)
        resting = self._resting if self._pauses == "rest" else 0.0
        pose = between(spoken, self._face.resting, (1 - np.cos(np.pi * resting)) / 2)
        self._leaving = max(self._leaving - 1 / REST_STEPS, 0.0)
        pose, before = between(pose, self._last, self._leaving), self._poses[-1]
        move = abs(pose[0][self._face.opening] - before[0][self._face.opening])
        return between(before, pose, LARGEST_MOVE / move) if move > LARGEST_MOVE else pose

    def _frame(self, pose: tuple[Array, Array], known_s: float) -> LiveFrame:
        self._poses.append(pose)
        motion, weights = pose
        named = dict(zip(WEIGHT_NAMES, weights.tolist(), strict=True))
        time_s = self._next * STEP_S
        if self._idling is not None:
            named |= self._idling.step(time_s, self._opening, self._resting < 0.5)
        self._next += 1
        return LiveFrame(time_s, known_s, motion, self._face.names, named)

    def _animate_all(self) -> list[LiveFrame]:
        sound, self._sound = np.concatenate(self._sound or [np.zeros(0, np.float32)]), []
        if not len(sound):
            return []
        result = animate(Request(Audio(sound, self.sample_rate), pauses=self._pauses), model=self._face.model)
        end_s = self._first * STEP_S + len(sound) / self.sample_rate
        curves = (
            make_curves(result.motion, result.units, name, staging=Staging(seed=self._seed or 0))
            for name in ("arkit" if self._seed is None else "face", "visemes")
        )
        motion, face, visemes = (each.resampled(1 / STEP_S) for each in (result.motion, *curves))
        frames = []
        count = int(np.ceil(len(sound) / self.sample_rate / STEP_S - 1e-9))
        for pose, row, viseme_row in zip(motion.values[:count], face.values, visemes.values, strict=False):
            mouth, living = np.split(row, [len(ARKIT_MOUTH)])
            frame = self._frame((pose, np.concatenate([mouth, viseme_row])), end_s)
            named = dict(zip(face.names[len(ARKIT_MOUTH) :], living.tolist(), strict=True))
            frames.append(replace(frame, weights=frame.weights | named))
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
        self.silent = hear_silence()[1]
        self.rest = self.silent[-1, : len(ARTICULATORS)].astype(float)

    def solve(self, answers: deque[NDArray[np.float32]], before: list[Array]) -> tuple[Array, Array]:
        """Return articulators [shape=(8,)] of the frame known now, and visemes from it on [shape=(N, 15)].

        From the answers of the last steps [each shape=(5, 23)], and the articulators of the two frames before.
        """
        places = zip(self._steps.tolist(), self._choice.tolist(), strict=True)
        rows = np.stack([answers[place][choice] for place, choice in places]).astype(float)
        wanted = rows[:, : len(ARTICULATORS)] * self._gains * self._of_answers
        previous = np.stack([before[1], before[0]]) * self._of_before
        return wanted.sum(axis=0) + previous.sum(axis=0), rows[:, len(ARTICULATORS) :]
