"""The output of engines: generated motion, and what to expect of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.types.audio import Audio, VoiceEvent
from lipmotion.types.delivery import MoodKey
from lipmotion.types.edits import CurveEdit
from lipmotion.types.motion import Motion, compute_frame_times, interpolate_rows
from lipmotion.types.timeline import Span, SpeechKnowledge, Timeline, Unit

RowChange = Callable[[NDArray[np.floating[Any]]], NDArray[np.floating[Any]]]


@dataclass(frozen=True, eq=False)
class StateTrace:
    """The state of the model in every frame.

    states : names of the states, for people to read
    frames : int array [shape=(T,)], index into ``states`` of every frame
    """

    states: tuple[str, ...]
    frames: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ReducedVariance:
    """Variances of P channels, stored as those of Q dimensions to save memory: recordings last for hours.

    reduced : float array [shape=(T, Q)], variances of the dimensions
    mixing  : float array [shape=(Q, P)]; ``reduced @ mixing`` are the variances of the channels
    """

    reduced: NDArray[np.floating[Any]]
    mixing: NDArray[np.floating[Any]]


BLOCK_FRAMES = 60_000  # frames whose variances are in memory at once
FULL_FIT_SHARE = 0.995  # a transcript that fits as large a share of the speech fits all of it, rounded
SURE_CONFIDENCE = 0.8  # words that were recognised with less confidence deserve an ear, and a transcript


@dataclass(frozen=True)
class Outlook:
    """What to expect of generated motion: how well the model knew the words and the voice.

    words      : where the phones come from: ``transcript``, ``mapped transcript`` (in another language, by the nearest
                 English phones), ``given units``, ``own model`` (the engine's own
                 recognition of a speaker that it was trained on), ``words`` or ``phones`` (recognised, for the most
                 part), ``no speech`` (none was found)
    confidence : 0 to 1, of recognised words, by their share of the speech; of a transcript and of given units, the
                 share of the speech that they fit (1 where that is not known), of a mapped one at most 0.8
    voice      : 0 (unknown) to 1 (as in the training); None where it was not needed
    range_db   : decibels between loud and quiet moments; under 20 the recording is noisy
    advice     : what would help, the most helpful first
    """

    words: str
    confidence: float
    voice: float | None
    range_db: float
    advice: tuple[str, ...]

    @property
    def text(self) -> str:
        """The outlook in one line."""
        recognised = self.words in ("words", "phones")
        parts = [f"{self.words} recognised, confidence {self.confidence:.2f}" if recognised else f"words: {self.words}"]
        if self.words == "mapped transcript":
            parts = [f"words: transcript, mapped to English phones, confidence {self.confidence:.2f}"]
        if self.words == "no speech":
            parts = ["no speech found"]
        elif self.words in ("transcript", "given units") and self.confidence < FULL_FIT_SHARE:
            parts[0] += f", which fits {self.confidence:.0%} of the speech"
        if self.voice is not None:
            parts.append(f"voice {self.voice:.2f} (1: as in training)")
        parts.append(f"levels {self.range_db:.0f} dB apart")
        if self.advice:
            parts.append(f"would help most: {self.advice[0]}")
        return "; ".join(parts)


@dataclass(frozen=True, eq=False, repr=False)
class Generation:
    """Generated motion, with its variance, its phones in time and its states; returned by ``animate``.

    motion : values of all P channels in T frames at 100 Hz
    spread : posterior variance of the model, in squared units of the channels: float array [shape=(T, P)], or a
             ``ReducedVariance``; ``variance`` returns an array for both
    units  : the phones in time from which the motion was generated; edit them and generate again
    trace  : the state of the model in every frame
    outlook : how well the model knew words and voice (None: not from ``animate``)
    stepped : channels of held poses, which change at once: formats that can say so do
    curve_edits : edits of curves that follow from the motion, as ``jawOpen``, wherever these are made; and what is held
    pinned_s : times of pins in seconds; at other rates, the frame nearest to one shows it
    moods  : what the words say of the mood, over time, in the order of their times
    events : what is detected in the voice beside words; manners and moods of them are shown where none is asked for
    about  : corpus, licence and attribution of the model, by name, as ``Model.about``; empty: not from ``animate``
    knowledge : of voice and phones, from which ``confidence`` follows (None: not from ``animate``)

    >>> import lipmotion
    >>> result = lipmotion.animate("examples/welcome.flac")
    >>> result.variance.shape == result.motion.values.shape
    True
    >>> result.selected(["opening"]).resampled(30).motion.names
    ('opening',)
    """

    motion: Motion
    spread: NDArray[np.floating[Any]] | ReducedVariance
    units: Timeline[Unit]
    trace: StateTrace
    outlook: Outlook | None = None
    stepped: tuple[str, ...] = ()
    curve_edits: tuple[CurveEdit, ...] = ()
    pinned_s: tuple[float, ...] = ()
    moods: tuple[MoodKey, ...] = ()
    events: tuple[VoiceEvent, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)
    knowledge: SpeechKnowledge | None = None

    def __repr__(self) -> str:
        frames, channels = self.motion.values.shape
        shape = f"{frames} frames at {self.motion.rate_hz:g} Hz, {channels} channels"
        return f"Generation({shape}, {len(self.units)} units)"

    @property
    def variance(self) -> NDArray[np.floating[Any]]:
        """Variance of every channel in every frame [shape=(T, P)], computed at every access where it is reduced."""
        return self.variance_of(slice(None))

    @property
    def confidence(self) -> NDArray[np.float64] | None:
        """How sure the motion of the mouth is in every frame, 0 to 1 [shape=(T,)]: that of its opening.

        0.5 means that an error as large as the movement is to be expected (``SpeechKnowledge.confidence``).
        None: not from ``animate``, or neither a channel ``opening`` nor ``jawOpen``.
        """
        names = [name for name in ("opening", "jawOpen") if name in self.motion.names]
        if self.knowledge is None or not names or not len(self.motion.values):
            return None
        opening = self.selected(names[:1])
        blocks = range(0, len(opening.motion.values), BLOCK_FRAMES)
        variance = [opening.variance_of(slice(first, first + BLOCK_FRAMES))[:, 0] for first in blocks]
        return self.knowledge.confidence(opening.motion.values[:, 0], np.concatenate(variance))

    def variance_of(self, frames: slice) -> NDArray[np.floating[Any]]:
        """Return the variance of every channel in a range of N frames [shape=(N, P)]."""
        if isinstance(self.spread, ReducedVariance):
            return self.spread.reduced[frames] @ self.spread.mixing
        return self.spread[frames]

    def selected(self, names: Sequence[str]) -> Generation:
        """Return the generation with some channels only, in the given order. Raises InputError: no such channel."""
        columns = [self.motion.column(name) for name in names]
        spread = self._change_channels(lambda rows: rows[:, columns])
        return replace(self, motion=self.motion.selected(names), spread=spread)

    def with_motion(self, motion: Motion) -> Generation:
        """Return the generation with other motion; channels after its own have the variance 0."""
        added = len(motion.channels) - len(self.motion.channels)
        spread = self._change_channels(lambda rows: np.pad(rows, ((0, 0), (0, added))))
        return replace(self, motion=motion, spread=spread)

    def _change_channels(self, change: RowChange) -> NDArray[np.floating[Any]] | ReducedVariance:
        if isinstance(self.spread, ReducedVariance):
            return replace(self.spread, mixing=change(self.spread.mixing))
        return change(self.spread)

    def resampled(self, rate_hz: float) -> Generation:
        """Return the generation at another rate, with the nearest states. Raises InputError: a rate not more than 0."""
        time_s = self.sample_times(rate_hz)
        spread = self.change_frames(lambda rows: interpolate_rows(rows, self.motion.rate_hz, time_s))
        nearest = np.minimum(np.round(time_s * self.motion.rate_hz).astype(int), len(self.trace.frames) - 1)
        trace = StateTrace(self.trace.states, self.trace.frames[nearest])
        motion = Motion(self.motion.at(time_s), rate_hz, self.motion.channels)
        return replace(self, motion=motion, spread=spread, trace=trace)

    def sample_times(self, rate_hz: float) -> NDArray[np.float64]:
        """Return when frames at another rate are taken, in seconds [shape=(N,)]: at pins, those nearest to them."""
        time_s = compute_frame_times(len(self.motion.values), self.motion.rate_hz, rate_hz)
        own_hz = self.motion.rate_hz
        for pinned_s in self.pinned_s:
            time_s[min(round(pinned_s * rate_hz), len(time_s) - 1)] = np.floor(pinned_s * own_hz + 0.5) / own_hz
        return time_s

    def change_frames(self, change: RowChange) -> NDArray[np.floating[Any]] | ReducedVariance:
        """Return the variances with other rows, which a function makes of those of all frames."""
        if isinstance(self.spread, ReducedVariance):
            return replace(self.spread, reduced=change(self.spread.reduced))
        return change(self.spread)


class SpokenText(NamedTuple):
    """A text that a synthetic voice has said, with the motion of its lips.

    sound      : at the synthesiser's own rate
    generation : as of ``animate``; its units are the synthesiser's phones in time

    >>> import lipmotion, numpy
    >>> silence = lipmotion.Audio(numpy.zeros(22_050, numpy.float32), 22_050)
    >>> sound, result = SpokenText(silence, lipmotion.animate("examples/welcome.flac"))
    >>> sound.duration_s, result.units[0].label.phone
    (1.0, 'sil')
    """

    sound: Audio
    generation: Generation


@dataclass(frozen=True)
class NamedProbability:
    """A name and a probability, 0 to 1: of a state, or of a regression."""

    name: str
    probability: float


@dataclass(frozen=True)
class ChannelValue:
    """A value of a channel and its standard deviation, both in the unit of the channel."""

    value: float
    deviation: float


@dataclass(frozen=True)
class ChainStates:
    """Posterior probabilities of the states of one chain in a frame.

    name   : the unit set of the chain
    states : the most probable states, best first; the name is the unit and the number of the state, from 1 (``b.1``)
    lead   : asynchrony: probability of each number of states by which the chain is ahead of the first chain (negative:
             behind it); empty for the first chain, and where the asynchrony is not limited
    """

    name: str
    states: tuple[NamedProbability, ...]
    lead: Mapping[int, float] = field(default_factory=dict)

    @property
    def expected_lead(self) -> float:
        """Expected number of states by which the chain is ahead of the first chain."""
        return sum(states * probability for states, probability in self.lead.items())


@dataclass(frozen=True)
class DominantGaussian:
    """The mixture component with the largest posterior probability in a frame, in one stream.

    stream     : name of the stream
    density    : name of the mixture
    component, components : number of the Gaussian in the mixture, from 1, and how many Gaussians the mixture has
    responsibility : posterior probability of the component, among all components of the stream
    distance   : distance of the observation from the mean: root mean square over its dimensions, in standard
                 deviations (None: the stream was not observed)
    channels   : mean and standard deviation of each motion channel (empty: a stream of speech)
    """

    stream: str
    density: str
    component: int
    components: int
    responsibility: float
    distance: float | None
    channels: Mapping[str, ChannelValue]


@dataclass(frozen=True)
class Explanation:
    """What determined one frame of generated motion; returned by ``explain``.

    time_s      : time of the frame in seconds
    frame       : number of the frame, at 100 Hz
    span        : phone, unit and word that contain the frame (None: no span contains it)
    state       : state of the model, as in ``Generation.trace``
    motion      : value of every channel, and the standard deviation that the model gives it
    confidence  : 0 to 1, how sure the frame is, as in ``Generation.confidence`` (None: not from ``explain``)
    chains      : posterior probabilities of the states of each chain (empty: the engine has no chains)
    joint       : the most probable joint state of all chains (None: the engine does not list joint states)
    gaussians   : the dominant Gaussian of each stream

    >>> import lipmotion
    >>> (explanation,) = lipmotion.explain("examples/welcome.flac", at=1.0)
    >>> explanation.frame, explanation.time_s, sorted(explanation.motion)[:2]
    (100, 1.0, ['opening', 'outer'])
    """

    time_s: float
    frame: int
    span: Span[Unit] | None
    state: str
    motion: Mapping[str, ChannelValue]
    confidence: float | None = None
    chains: tuple[ChainStates, ...] = ()
    joint: NamedProbability | None = None
    gaussians: tuple[DominantGaussian, ...] = ()


@dataclass(frozen=True, eq=False)
class ChainPosteriors:
    """Posterior probabilities of one chain over time, at 100 Hz.

    name        : name of its unit set
    units       : names of its U units
    probability : float32 array [shape=(T, U)], of each unit
    leads       : asynchronies: numbers of states by which it may be ahead of the first chain; empty for the first chain
    lead        : float32 array [shape=(T, len(leads))], probability of each asynchrony
    """

    name: str
    units: tuple[str, ...]
    probability: NDArray[np.float32]
    leads: tuple[int, ...]
    lead: NDArray[np.float32]
