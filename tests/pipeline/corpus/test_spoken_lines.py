import json

import pytest

from lipmotion.types import TimedTranscript, TimedWord, TranscriptLine
from lipmotion_faces.corpus.long_videos import find_transcript, spoken_lines

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
