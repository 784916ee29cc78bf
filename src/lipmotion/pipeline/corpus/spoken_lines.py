"""What is said when in a long video: the lines or words in time of a transcript, as parts that are not divided."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.labels import labels_beside
from lipmotion.pipeline.corpus.utterance_spans import SpokenPart
from lipmotion.types import TimedTranscript, TranscriptLine
from lipmotion.units.written_forms import readings


def transcript_beside(video: Path) -> TimedTranscript | None:
    """Return the transcript beside a video, one with times if there is any; None if there is none.

    Raises InputError: a file of labels cannot be read.
    """
    transcript = labels_beside(video).transcript
    if transcript is None or transcript.has_times:
        return transcript
    other = labels_beside(video, ignored=frozenset({video.with_suffix(".txt")})).transcript
    return other if other is not None and other.has_times else transcript


def spoken_lines(transcript: TimedTranscript) -> list[SpokenPart]:
    """Return the lines of a transcript as parts, in order; of a line whose words all have times, the words.

    A line without an end lasts to the next one that has a start; lines without a start are left out. Numbers
    are read as they usually are.
    """
    starts_s = [line.start_s for line in transcript.lines]
    parts: list[SpokenPart] = []
    for n, line in enumerate(transcript.lines):
        words = [
            SpokenPart(word.start_s, word.end_s, readings(word.word)[0])
            for word in line.words
            if word.start_s is not None and word.end_s is not None and word.end_s > word.start_s
        ]
        if len(words) == len(line.words):
            parts += words
        else:
            following = next((start_s for start_s in starts_s[n + 1 :] if start_s is not None), None)
            parts += _whole_line(line, following)
    return parts


def _whole_line(line: TranscriptLine, following_s: float | None) -> list[SpokenPart]:
    end_s = following_s if line.end_s is None else line.end_s
    if line.start_s is None or end_s is None or end_s <= line.start_s or not line.words:
        return []
    return [SpokenPart(line.start_s, end_s, tuple(said for word in line.words for said in readings(word.word)[0]))]
