"""Transcripts with the times that their files give: of words, of lines, or none."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from lipmotion.types.moods import MoodTag


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

        def moved(time_s: float | None) -> float | None:
            return None if time_s is None else time_s + offset_s

        return TimedTranscript(
            tuple(
                TranscriptLine(
                    tuple(TimedWord(word.word, moved(word.start_s), moved(word.end_s)) for word in line.words),
                    moved(line.start_s),
                    moved(line.end_s),
                )
                for line in self.lines
            ),
            self.tags,
        )

    def with_words(self, words: Callable[[str], Iterable[str]]) -> TimedTranscript:
        """Return the transcript with other words in place of each one; they have its times."""
        return replace(
            self,
            lines=tuple(
                replace(line, words=tuple(replace(word, word=each) for word in line.words for each in words(word.word)))
                for line in self.lines
            ),
        )

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
