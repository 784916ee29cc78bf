"""Input and output of engines: speech, examples, constraints, generated motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.types.audio import FRAME_RATE_HZ, Audio, Features, TokenPosteriors, VoiceEvent
from lipmotion.types.delivery import MoodKey
from lipmotion.types.motion import Motion, interpolate_rows
from lipmotion.types.timeline import Span, SpeechKnowledge, Timeline, Unit

CachedT = TypeVar("CachedT")
LARGEST_GAIN, MAX_DRAWN = 3.0, 10_000
"""Largest factor of movements, and largest number of values of a drawn curve."""
RowChange = Callable[[NDArray[np.floating[Any]]], NDArray[np.floating[Any]]]


@dataclass(frozen=True, eq=False)
class PriorOutput:
    """What a model makes of speech, for a model that stands on it; one row every 40 ms, T' = ceil(T / 4).

    articulators : opening, width, and what else of the articulators is known, of its motion [shape=(T', A)]
    hidden       : float32 array [shape=(T', H)], the last hidden layer of its acoustic network; H may be 0
    distortion   : 0 to 1, how much noise and room cover the speech [shape=(T',)]
    """

    articulators: NDArray[np.float64]
    hidden: NDArray[np.float32]
    distortion: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Speech:
    """Speech of one recording: the input of an engine.

    features    : acoustic features [T frames]
    log_f0      : float32 array [shape=(T,)], natural logarithm of F0 in Hz, NaN in unvoiced frames (None: the engine
                  does not use F0)
    units_known : whether the units are given, labelled, or aligned to known words; False: they were recognised
    times_given : whether the times of the units were given with them: no engine moves these
    spectrum    : float32 array [shape=(T, 40)], the normalised log mel spectrum (None: the engine does not use it)
    confidence  : 0 to 1, how well recognised units are confirmed by words; 1 where the units are known. One number, or
                  one of each frame [shape=(T,)] where somebody has corrected some of the recognised units
    prior       : what another model makes of the same speech, on which this engine's model stands (None: on none)
    voice       : 0 to 1, how well the model's training knows the voice
    posteriors  : of a phone recogniser (None: the engine does not use them, or none is installed)
    encoding    : float16 array [shape=(T, 64)], of the speech encoder (None: the engine does not use it)
    cache       : what was computed of the sound alone (``cached``); speech with other units shares it
    parts       : the speech of each passage of the recording, which is animated by itself (None: all is one passage);
                  empty: nothing is said. Beside it, features, spectrum, posteriors and encoding may be ``JoinedRows``
    """

    features: Features
    units: Timeline[Unit]
    log_f0: NDArray[np.float32] | None = None
    units_known: bool = True
    spectrum: NDArray[np.float32] | None = None
    confidence: float | NDArray[np.float64] = 1.0
    prior: PriorOutput | None = None
    voice: float = 1.0
    posteriors: TokenPosteriors | None = None
    encoding: NDArray[np.float16] | None = None
    times_given: bool = False
    cache: dict[Any, Any] = field(default_factory=dict, repr=False)
    parts: tuple[SpeechPart, ...] | None = None

    def cached(self, of: Any, make: Callable[[], CachedT]) -> CachedT:
        """Return what a function makes of the sound; speech of the same sound with other units shares it.

        of : the object that the result belongs to, as a network; the result must depend on it and the sound alone
        """
        sound = (self.features, self.log_f0, self.spectrum, self.posteriors, self.encoding)
        entry = self.cache.get(of)
        if entry is None or any(ours is not theirs for ours, theirs in zip(sound, entry[0], strict=True)):
            entry = self.cache[of] = (sound, make())
        result: CachedT = entry[1]
        return result

    def with_arrays(self) -> Speech:
        """Return the same with an array in place of all ``JoinedRows``, for an engine that takes it as one passage."""
        features = replace(self.features, values=np.asarray(self.features.values))
        spectrum = None if self.spectrum is None else np.asarray(self.spectrum)
        said = self.posteriors and replace(self.posteriors, values=np.asarray(self.posteriors.values))
        encoding = None if self.encoding is None else np.asarray(self.encoding)
        return replace(self, features=features, spectrum=spectrum, posteriors=said, encoding=encoding)

    @property
    def units_decide(self) -> bool:
        """Whether engines that recognise units themselves must take these: all, or some of them, are known."""
        return self.units_known or isinstance(self.confidence, np.ndarray)


class SpeechPart(NamedTuple):
    """The speech of one passage of a recording.

    first  : the frame of the recording in which it begins, with the silence before it; it may be negative
    own    : frames of the recording that are nearer to it than to other passages
    speech : of its sound, with silence before and after it
    """

    first: int
    own: slice
    speech: Speech

    @property
    def frames(self) -> int:
        """The number of its frames."""
        return len(self.speech.features.values)

    @property
    def inside(self) -> slice:
        """Its own frames of the recording, as far as its sound goes."""
        return slice(max(self.own.start, self.first), min(self.own.stop, self.first + self.frames))

    def between(self, units: Timeline[Unit]) -> Timeline[Unit]:
        """Return the recording's phones in time in its own frames, with times from its first frame."""
        inside = self.inside
        within = units.between(inside.start / FRAME_RATE_HZ, inside.stop / FRAME_RATE_HZ)
        lead_s = (inside.start - self.first) / FRAME_RATE_HZ
        return Timeline(  # half a frame must not be more or less by where in the recording the passage is
            tuple(Span(round(each.start_s + lead_s, 9), round(each.end_s + lead_s, 9), each.label) for each in within)
        )


@dataclass(frozen=True, eq=False)
class ConditionSpectrum:
    """The spectrum of a recording in another acoustic condition, for training.

    values   : float16 array [shape=(T', 40)], the normalised log mel spectrum
    tempo    : frames of the recording in one of these frames: frame n is that at ``tempo`` · n
    distortion : 0 (as recorded) to 1: by how much noise and room cover the speech
    """

    values: NDArray[np.float16]
    tempo: float
    distortion: float


@dataclass(frozen=True, eq=False)
class Example:
    """Speech with the motion that was recorded with it.

    name   : of the utterance
    motion : at 100 Hz, on the frames of ``speech.features``
    valid  : bool array [shape=(T,)], False in frames whose motion was not measured
    condition_spectra : the spectrum as recorded, and in other conditions; empty: the engine does not use them
    """

    name: str
    speech: Speech
    motion: Motion
    valid: NDArray[np.bool_]
    condition_spectra: Sequence[ConditionSpectrum] = ()


@dataclass(frozen=True)
class Pin:
    """A value that generated motion must take at a time.

    time_s  : seconds; the value is set in the nearest 10 ms frame
    channel : name of a channel that is modelled as it is: ``opening``, ``width``, ``outer``, blendshapes
    value   : in the unit of the channel

    >>> Pin(1.2, "opening", 0.02)
    Pin(time_s=1.2, channel='opening', value=0.02)
    """

    time_s: float
    channel: str
    value: float

    def __post_init__(self) -> None:
        for name, number in (("time", self.time_s), ("value", self.value)):
            try:
                is_number = isinstance(number, Real) and isinstance(float(number), float)
            except OverflowError:
                is_number = False
            if not is_number:
                raise InputError(f"the {name} of a pin is {shorten(repr(number))}, required a number")


@dataclass(frozen=True)
class Gain:
    """Movements that are made larger or smaller for a time.

    start_s, end_s : seconds; the factor grows and fades within 0.1 s before and after them
    factor  : 1: as generated; 0: the rest pose
    channel : name of a channel or curve; empty: all movements of the mouth
    Raises InputError: a factor that is not 0 to 3, or an end before the start.

    >>> Gain(1.0, 2.0, 1.3)
    Gain(start_s=1.0, end_s=2.0, factor=1.3, channel='')
    """

    start_s: float
    end_s: float
    factor: float
    channel: str = ""

    def __post_init__(self) -> None:
        if not 0 <= self.factor <= LARGEST_GAIN:
            raise InputError(f"the gain is {self.factor:g}, required 0 to {LARGEST_GAIN:g}")
        if not self.start_s <= self.end_s:
            raise InputError(
                f"the gain lasts from {self.start_s:g} to {self.end_s:g} s, required an end after the start"
            )


@dataclass(frozen=True)
class DrawnCurve:
    """Values that a curve takes over a stretch, as somebody has drawn them.

    start_s, end_s : seconds; before and after them the curve goes over into them within 0.1 s
    channel : name of a channel or curve
    values  : at equal distances from the start to the end, in the unit of the channel
    Raises InputError: fewer than 2 values, or more than ``MAX_DRAWN``; no numbers; or an end that is not after the
    start.

    >>> DrawnCurve(1.0, 1.5, "opening", (0.0, 0.1, 0.0)).channel
    'opening'
    """

    start_s: float
    end_s: float
    channel: str
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if not 2 <= len(self.values) <= MAX_DRAWN or not all(map(math.isfinite, self.values)):
            raise InputError(f"{len(self.values)} values are drawn, required 2 to {MAX_DRAWN} finite numbers")
        _check_stretch(self.start_s, self.end_s)


@dataclass(frozen=True)
class Hold:
    """The whole mouth stays for a time as it is at the start; it goes over into that within 0.05 s.

    start_s, end_s : seconds
    Raises InputError: an end that is not after the start.
    """

    start_s: float
    end_s: float
    channel: ClassVar[str] = ""

    def __post_init__(self) -> None:
        _check_stretch(self.start_s, self.end_s)


@dataclass(frozen=True)
class Locked:
    """Curves stay for a time as these edits alone make them, whatever other edits there are."""

    start_s: float
    end_s: float
    edits: tuple[CurveEdit, ...]
    channel: ClassVar[str] = ""


CurveEdit = Pin | Gain | DrawnCurve | Hold | Locked
"""Changes of one curve, or of all curves of the mouth."""


def _check_stretch(start_s: float, end_s: float) -> None:
    if not start_s < end_s:
        raise InputError(f"from {start_s:g} to {end_s:g} s, required an end after the start")


@dataclass(frozen=True)
class Constraints:
    """Values that generated motion must take exactly.

    Raises InputError: something else than pins, or a time or a value that is no number.

    >>> import lipmotion
    >>> closed = lipmotion.Constraints((lipmotion.Pin(0.5, "opening", 0.02),))
    >>> result = lipmotion.animate("examples/welcome.flac", constraints=closed)
    >>> round(float(result.motion["opening"][50]), 6)
    0.02
    """

    pins: tuple[Pin, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.pins, Collection) or not all(isinstance(pin, Pin) for pin in self.pins):
            found = shorten(repr(self.pins))
            raise InputError(f"constraints of {found}, required pins: Constraints((Pin(0.5, 'opening', 0.02),))")


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


BLOCK_FRAMES = 60_000
"""Frames whose variances are in memory at once."""
FULL_FIT_SHARE = 0.995
"""A transcript that fits as large a share of the speech fits all of it, rounded."""
SURE_CONFIDENCE = 0.8
"""Words that were recognised with less confidence deserve an ear, and a transcript."""


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

    >>> Outlook("words", 0.66, 0.0, 31.2, ("the words that are spoken",)).text
    'words recognised, confidence 0.66; voice 0.00; levels 31 dB apart; would help most: the words that are spoken'
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
            parts.append(f"voice {self.voice:.2f}")
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
    moods: tuple[MoodKey, ...] = ()
    events: tuple[VoiceEvent, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)
    knowledge: SpeechKnowledge | None = None

    def __repr__(self) -> str:
        frames, channels = self.motion.values.shape
        return (
            f"Generation({frames} frames at {self.motion.rate_hz:g} Hz, {channels} channels, {len(self.units)} units)"
        )

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
        """Return the generation at another frame rate: interpolated values, and the state of the nearest frame.

        Raises InputError: the rate is not more than 0.
        """
        motion = self.motion.resampled(rate_hz)
        spread = self.change_frames(lambda rows: interpolate_rows(rows, self.motion.rate_hz, motion.time_s))
        nearest = np.minimum(np.round(motion.time_s * self.motion.rate_hz).astype(int), len(self.trace.frames) - 1)
        return replace(
            self, motion=motion, spread=spread, trace=StateTrace(self.trace.states, self.trace.frames[nearest])
        )

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
