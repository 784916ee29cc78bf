import json
from itertools import pairwise

import numpy as np
import pytest

from lipmotion.types import TimedTranscript, TimedWord, TranscriptLine
from lipmotion_faces.corpus.long_videos import (
    LEAST_S,
    LONGEST_S,
    MARGIN_S,
    SHORTEST_S,
    SpokenPart,
    find_transcript,
    spoken_lines,
    utterance_spans,
)


def spans(
    stretches: list[SpokenPart], cuts_s: list[float] | None = None, duration_s: float = 100.0
) -> list[SpokenPart]:
    return utterance_spans(stretches, cuts_s or [], duration_s, lambda low_s, high_s: (low_s + high_s) / 2)


def edges(found: list[SpokenPart]) -> list[tuple[float, float]]:
    return [(round(part.start_s, 6), round(part.end_s, 6)) for part in found]


@pytest.mark.parametrize(
    ("said", "cuts_s", "expected"),
    [
        ([(1, 5), (8, 12)], [], [(0.7, 5.3), (7.7, 12.3)]),  # a long pause divides, and is left out
        ([(1, 3), (3.4, 6), (6.5, 9)], [], [(0.7, 9.3)]),  # short pauses do not
        ([(1, 5), (5.3, 9), (9.8, 13), (13.3, 16)], [], [(0.7, 9.3), (9.5, 16.3)]),  # too long: at the longest pause
        ([(0, 30)], [], [(0, 7.5), (7.5, 15), (15, 22.5), (22.5, 30)]),  # or where it is quietest
        ([(1, 9)], [4.0], [(0.7, 4.0), (4.0, 9.3)]),  # a cut divides even in speech
        ([(1, 4), (4.4, 8)], [4.1], [(0.7, 4.1), (4.1, 8.3)]),  # and bounds both sides in a pause
        ([(1, 9)], [4.0, 4.0 + LEAST_S / 2], [(0.7, 4.0), (4.4, 9.3)]),  # what is between two may be too short
        ([(1, 2), (2.9, 6)], [], [(0.7, 6.3)]),  # short ones join a neighbour within a second
        ([(1, 2), (3.5, 6.5)], [], [(0.7, 2.3), (3.2, 6.8)]),
        ([], [], []),
    ],
)
def test_pauses_and_cuts_divide(said, cuts_s, expected):
    duration_s = 30.0 if said == [(0, 30)] else 100.0
    assert edges(spans([SpokenPart(*part) for part in said], cuts_s, duration_s)) == expected


def test_lines_keep_their_words_and_are_never_divided():
    lines = [SpokenPart(1, 7, ("one", "two")), SpokenPart(7, 15, ("three",)), SpokenPart(15.2, 17, ("four",))]
    found = spans(lines, [4.0, 10.0])
    assert [part.words for part in found] == [("one", "two"), ("three", "four")]
    assert edges(found) == [(0.7, 7.0), (7.0, 17.3)]


def test_lines_that_overlap_end_where_the_next_begins():
    found = spans([SpokenPart(1, 8, ("a",)), SpokenPart(6, 16, ("b",))])
    assert [part.words for part in found] == [("a",), ("b",)]
    assert edges(found) == [(0.7, 6.0), (6.0, 16.3)]


def test_a_short_pause_belongs_to_both_neighbours_up_to_where_it_is_quietest():
    parts = [SpokenPart(1, 5), SpokenPart(5.3, 9), SpokenPart(9.5, 13), SpokenPart(13.3, 16)]
    for quietest_s in (9.0, 9.5):
        found = utterance_spans(parts, [], 100.0, lambda *_, at_s=quietest_s: at_s)
        assert edges(found) == [(0.7, quietest_s), (quietest_s, 16.3)]


def test_any_recording():
    for seed in range(20):
        draw = np.random.default_rng(seed)
        times_s = np.cumsum(draw.choice([0.25, 0.6, 1.5, 4.0, 9.0], size=60))
        stretches = [SpokenPart(*pair) for pair in zip(times_s[::2].tolist(), times_s[1::2].tolist(), strict=True)]
        duration_s = float(times_s[-1]) + draw.uniform(0, 1)
        cuts_s = sorted(draw.uniform(0, duration_s, 8).tolist())
        found = spans(stretches, cuts_s, duration_s)
        assert all(0 <= part.start_s < part.end_s <= duration_s for part in found)
        assert all(before.end_s <= after.start_s + 1e-9 for before, after in pairwise(found))
        assert all(part.duration_s <= LONGEST_S + 2 * MARGIN_S for part in found)
        for part in found:
            assert not [t for t in cuts_s if part.start_s + 0.06 < t < part.end_s - 0.06]
        said_s = sum(part.duration_s for part in stretches)
        kept_s = sum(
            max(0.0, min(part.end_s, stretch.end_s) - max(part.start_s, stretch.start_s))
            for part in found
            for stretch in stretches
        )
        assert kept_s > said_s - LEAST_S * (len(stretches) + len(cuts_s))
        assert min(SHORTEST_S, said_s) <= max(part.duration_s for part in found)


SUBTITLES = "1\n00:00:01,000 --> 00:00:02,500\nHello there.\n\n2\n00:00:04,000 --> 00:00:05,000\n- Again!\n"
WHISPER = {
    "segments": [
        {
            "start": 1.0,
            "end": 2.0,
            "text": " Hello you",
            "words": [{"word": " Hello", "start": 1.0, "end": 1.4}, {"word": " you", "start": 1.5, "end": 2.0}],
        }
    ]
}


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("talk.srt", SUBTITLES, [(1.0, 2.5, ("hello", "there")), (4.0, 5.0, ("again",))]),
        ("talk.en.vtt", "WEBVTT\n\n00:01.000 --> 00:02.500\nHello\n", [(1.0, 2.5, ("hello",))]),
        ("talk.json", json.dumps(WHISPER), [(1.0, 1.4, ("hello",)), (1.5, 2.0, ("you",))]),
        ("talk.txt", "0.5\t1.5\tHello there.\n3.0\t4.0\tAgain\n", [(0.5, 1.5, ("hello", "there")), (3, 4, ("again",))]),
        ("talk.txt", "only words, at no time", []),
    ],
)
def test_transcripts_beside_a_video(tmp_path, name, text, expected):
    (tmp_path / name).write_text(text)
    transcript = find_transcript(tmp_path / "talk.mp4")
    assert transcript is not None
    assert [(part.start_s, part.end_s, part.words) for part in spoken_lines(transcript)] == expected


def test_subtitles_come_before_plain_text(tmp_path):
    (tmp_path / "talk.srt").write_text(SUBTITLES)
    (tmp_path / "talk.txt").write_text("hello there again")
    transcript = find_transcript(tmp_path / "talk.mp4")
    assert transcript.has_times


def test_times_that_are_missing():
    hello, you = TimedWord("hello", 1.0, 1.4), TimedWord("you")
    lines = (
        TranscriptLine((hello, you), 1.0, None),  # lasts to the next start
        TranscriptLine((you,)),  # not known when
        TranscriptLine((you,), 3.0, 3.5),
        TranscriptLine((you,), 5.0, None),  # not known how long
    )
    found = spoken_lines(TimedTranscript(lines))
    assert [(part.start_s, part.end_s, part.words) for part in found] == [
        (1.0, 3.0, ("hello", "you")),
        (3.0, 3.5, ("you",)),
    ]
