"""Recorded sentences: the motion of the face in them, and their transcripts, with the times that files give."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.types.audio import Audio, Features
from lipmotion.types.delivery import MoodTag
from lipmotion.types.motion import Motion
from lipmotion.types.timeline import Timeline, Unit


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

    >>> line = TranscriptLine((TimedWord("hello"), TimedWord("you")), 1.5, 2.5)
    >>> TimedTranscript((line,)).words, TimedTranscript((line,)).has_times
    (('hello', 'you'), True)
    """

    lines: tuple[TranscriptLine, ...]
    tags: tuple[MoodTag, ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """The words of all lines."""
        return tuple(word.word for line in self.lines for word in line.words)

    def shifted(self, offset_s: float) -> TimedTranscript:
        """Return the transcript with ``offset_s`` seconds added to all times."""

        def shift(time_s: float | None) -> float | None:
            return None if time_s is None else time_s + offset_s

        lines = []
        for line in self.lines:
            words = tuple(TimedWord(word.word, shift(word.start_s), shift(word.end_s)) for word in line.words)
            lines.append(TranscriptLine(words, shift(line.start_s), shift(line.end_s)))
        return replace(self, lines=tuple(lines))

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
    """Return the transcript of lines in any order, those without words left out.

    Lines are sorted by their start; one without a start stays behind the line before it.
    """
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
