"""The input of engines: speech, and examples to learn from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.types.audio import FRAME_RATE_HZ, Audio, Features, TokenPosteriors
from lipmotion.types.delivery import MoodTag
from lipmotion.types.motion import Motion
from lipmotion.types.timeline import Span, Timeline, Unit

CachedT = TypeVar("CachedT")


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
    range_db    : decibels between loud and quiet moments of the sound (0: not measured)
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
    range_db: float = 0.0
    times_given: bool = False
    cache: dict[Any, Any] = field(default_factory=dict, repr=False)
    parts: tuple[SpeechPart, ...] | None = None

    def cached(self, of: Any, make: Callable[[], CachedT]) -> CachedT:
        """Return what a function makes of the sound for an object, as a network; speech with other units shares it."""
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
        posteriors = self.posteriors and replace(self.posteriors, values=np.asarray(self.posteriors.values))
        encoding = None if self.encoding is None else np.asarray(self.encoding)
        return replace(self, features=features, spectrum=spectrum, posteriors=posteriors, encoding=encoding)

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
    """The spectrum of a recording in another acoustic condition, and its encoding, for training.

    values   : float16 array [shape=(T', 40)], the normalised log mel spectrum
    encoding : float16 array [shape=(T', 64)], as ``Speech.encoding``
    tempo    : frames of the recording in one of these frames: frame n is that at ``tempo`` · n
    distortion : 0 (as recorded) to 1: by how much noise and room cover the speech
    """

    values: NDArray[np.float16]
    encoding: NDArray[np.float16]
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


@dataclass(frozen=True, slots=True)
class TimedWord:
    """A spoken word in lower case, and its times in seconds where they are known."""

    word: str
    start_s: float | None = None
    end_s: float | None = None


@dataclass(frozen=True, slots=True)
class TranscriptLine:
    """Words that are shown or were recognised together: a subtitle, a segment, a label; times where they are known."""

    words: tuple[TimedWord, ...]
    start_s: float | None = None
    end_s: float | None = None


@dataclass(frozen=True)
class TimedTranscript:
    """What is said, in order. Times are as people and recognisers write them: late, early, rounded, overlapping.

    tags : the moods that tags in the text ask for
    """

    lines: tuple[TranscriptLine, ...]
    tags: tuple[MoodTag, ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """The words of all lines."""
        return tuple(word.word for line in self.lines for word in line.words)

    def with_words(self, words: Callable[[str], Iterable[str]]) -> TimedTranscript:
        """Return the transcript with other words in place of each one; they have its times."""
        lines = []
        for line in self.lines:
            replaced = tuple(replace(word, word=each) for word in line.words for each in words(word.word))
            lines.append(replace(line, words=replaced))
        return replace(self, lines=tuple(lines))

    @property
    def has_times(self) -> bool:
        """Whether any line or word has a time."""
        spans: list[TranscriptLine | TimedWord] = [*self.lines, *(word for line in self.lines for word in line.words)]
        return any(span.start_s is not None or span.end_s is not None for span in spans)


def sort_lines(lines: list[TranscriptLine]) -> TimedTranscript:
    """Return the transcript of lines with words, sorted by start; one without a start stays behind the one before."""
    latest_s, keys = float("-inf"), []
    for line in lines:
        start_s = line.words[0].start_s if line.start_s is None and line.words else line.start_s
        latest_s = latest_s if start_s is None else start_s
        keys.append(latest_s)
    order = sorted(range(len(lines)), key=keys.__getitem__)
    return TimedTranscript(tuple(lines[i] for i in order if lines[i].words))


@dataclass(frozen=True, eq=False)
class Track:
    """Motion of the face in one recording: tracked in a video, or supplied as curves.

    motion : at the frame rate of the recording. Of a video: ``opening``, ``width``, ``outer`` and the lip and jaw
             points (``x_17``, ``y_17``, ``z_17``: face-mesh point 17) without head motion, in eye distances; supplied
             curves may have any channels
    seen   : bool array [shape=(T,)], False in frames where the face was not measured and the motion is interpolated;
             True everywhere for supplied curves, but without a face in a take of Live Link Face
    crops  : uint8 array [shape=(T, 56, 72, 3)], RGB pictures of the mouth, or None
    notes  : remarks on the video for the user, in words (cuts, damage, a covered mouth)
    """

    motion: Motion
    seen: NDArray[np.bool_]
    crops: NDArray[np.uint8] | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Utterance:
    """One recorded sentence: sound, acoustic features, motion, transcript.

    name     : unique in its corpus
    audio    : the sound, at 16 kHz
    features : acoustic features of the sound, at 100 Hz
    track    : motion of the face
    words    : the transcript in lower case, or None if it is not known
    split    : ``train``, ``val`` or ``test``
    source   : file, digest, licence, attribution and software of the recording, by name
    speaker  : name of the speaker; empty if it is not known
    phones   : labelled phones in time, from 0 s to the end of the sound, or None if there are no labels
    """

    name: str
    audio: Audio
    features: Features
    track: Track
    words: tuple[str, ...] | None
    split: str
    source: dict[str, str]
    speaker: str = ""
    phones: Timeline[Unit] | None = None
