import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from formats.examples import LABEL_CASES, timed
from lipmotion.errors import InputError
from lipmotion.formats.label_files import find_labels, holds_timings, read_labels, read_phones, read_transcript
from lipmotion.pipeline.analysis.read_request import read_units
from lipmotion.types import TimedTranscript

Lines = list[tuple[float | None, float | None, str]]
Read = Callable[[str | bytes], TimedTranscript]
POLLY, MFA_CSV = (LABEL_CASES[f"{name}, a voice"]["content"] for name in ("Polly", "MFA's table"))


@pytest.fixture
def read(write: Any) -> Read:
    """Return the transcript in time of a file with some content."""
    return lambda content: timed(write(content, "a.txt"))


def lines(transcript: TimedTranscript) -> Lines:
    """Return start, end and text of every line."""
    return [(line.start_s, line.end_s, " ".join(word.word for word in line.words)) for line in transcript.lines]


def words(transcript: TimedTranscript) -> list[tuple[str, float | None, float | None]]:
    return [(word.word, word.start_s, word.end_s) for line in transcript.lines for word in line.words]


SRT, ASS, SCROLLING = (LABEL_CASES[name]["content"] for name in ("SubRip", "SubStation", "captions that scroll"))


def expected(row: list[Any]) -> list[Any]:
    return [each if isinstance(each, str) or each is None else pytest.approx(each, abs=1e-4) for each in row]


@pytest.mark.parametrize("name", [name for name, case in LABEL_CASES.items() if "error" not in case])
def test_every_form_of_labels(write: Any, caplog: pytest.LogCaptureFixture, name: str) -> None:
    case = LABEL_CASES[name]
    path = write(case["content"], case.get("file", "a.json"))
    assert holds_timings(path) or isinstance(case["content"], str)
    if "lines" in case:
        assert [list(line) for line in lines(timed(path))] == list(map(expected, case["lines"]))
    if "words" in case:
        assert [list(word) for word in words(timed(path))] == list(map(expected, case["words"]))
    if "spans" in case:
        spans = [[start, end if math.isfinite(end) else None, phone] for start, end, phone, _ in phones(path)]
        assert spans == list(map(expected, case["spans"]))
    if "phones" in case:
        found = phones(path)
        assert [f"{phone}/{word.lower()}" if word else phone for *_, phone, word in found] == case["phones"].split()
        assert case.get("end", found[0][1]) in [each[1] for each in found]
    assert case.get("warning", "") in caplog.text


def read_both(path: Path) -> None:
    read_labels(path)
    read_transcript(path)


@pytest.mark.parametrize("name", [name for name, case in LABEL_CASES.items() if "error" in case])
def test_what_is_damaged_is_refused_with_its_place(write: Any, name: str) -> None:
    with pytest.raises(InputError, match=LABEL_CASES[name]["error"]):
        read_both(write(LABEL_CASES[name]["content"]))


def test_some_words_have_no_time_some_share_one_and_an_end_just_before_its_start_is_its_start(read: Read) -> None:
    items = [{"word": "In", "start": 0.5, "end": 0.6}, {"word": "1999"}, {"word": "we", "start": 2.0, "end": None}]
    found = words(read(json.dumps({"segments": [{"start": 0.5, "end": 2.5, "text": "", "words": items}]})))
    assert [word for word, *_ in found] == ["in", "1999", "we"]
    assert [time is None for _, time, _ in found] == [False, True, False]
    assert found[-1] == ("we", 2.0, None)
    found = words(read('{"words": [{"word": "20-foot", "start": 1.0, "end": 2.0}]}'))
    assert [word for word, *_ in found] == ["20", "foot"]
    assert [time for row in found for time in row[1:]] == pytest.approx([1.0, 1.6, 1.6, 2.0])


def test_captions_that_scroll_say_each_line_once(read: Read) -> None:
    without_times = SCROLLING.replace("<c>", "").replace("</c>", "").replace("<00:00:", "<").replace("<0", "<i 0")
    assert read(without_times).words == ("let", "us", "look", "look", "again")
    rolling = "00:01.0 --> 00:01.99\nhi\n\n00:01.99 --> 00:02.0\nhi\n\n00:02.0 --> 00:03.0\nhi\nyou\n\n"
    assert read(rolling).words == ("hi", "you")
    twice = "00:00:01,000 --> 00:00:02,000\nno\n\n00:00:02,000 --> 00:00:03,000\nno\nno\n\n"
    assert read(twice).words == ("no", "no", "no")


def test_what_is_spoken(read: Read) -> None:
    for text, said in (
        ("ANNA: hi\nBOB #2: you", "hi you"), ("Speaker 1: hi\n[SPEAKER_02]: you", "hi you"),
        ("It is AT 10:30 now", "it is at 10:30 now"), ("Tom &amp; Jerry&#39;s", "tom & jerry's"),
        ("♪ la la ♪", "la la"), ("(all) hi [laughs\nloudly] you", "hi you"), ("5 < 6 and 7 > 3", "5 < 6 and 7 > 3"),
        ("Note: hi", "note hi"),
    ):  # fmt: skip
        assert " ".join(read(f"00:01,000 --> 00:02,000\n{text}\n").words) == said


def test_names_that_come_again_and_again_are_not_said(read: Read) -> None:
    cues = [f"00:0{i}.000 --> 00:0{i}.900\nAnna Smith: hello {i}\n" for i in range(1, 4)]
    assert read("WEBVTT\n\n" + "\n".join(cues)).words == ("hello", "1", "hello", "2", "hello", "3")


HOSTILE: list[tuple[Callable[[], bytes], str]] = [
    (lambda: b"00:01 --> 00:02\nhi\n" * 900_000, "bytes, required at most 16777216"),
    (lambda: b"0:1-->0:2\n" * 2501, "more than 2500 labels"),
    (lambda: b"[" + b'{"start":0,"text":"a"},' * 2501 + b"{}]", "more than 2500 labels"),
    (lambda: b"0:1-->0:2\n" + b"7" * 1_500_000, "line 1: a line of 1500000 characters"),
    (lambda: b'{"words":[' + b'{"word":"a"},' * 2501 + b'{"word":"a"}]}', "more than 2500 labels"),
    (lambda: b"a 1 0. 1 b\n" * 2501, "more than 2500 labels"),
    (lambda: b'{"segments": ' + b"[" * 100_000, "nested too deeply"),
]


@pytest.mark.long
def test_more_than_a_recording_has_is_refused(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lipmotion.formats.label_tiers.MAX_LABELS", 2500)
    for content, message in HOSTILE:
        with pytest.raises(InputError, match=message):
            read(content())


def test_other_encodings(read: Read, caplog: pytest.LogCaptureFixture) -> None:
    text = SRT.replace("Hello", "Café")
    assert read(text.encode("utf-16")).words[0] == "café"
    assert not caplog.records
    assert read(text.encode("cp1252")).words[0] == "café"
    (record,) = caplog.records
    assert "a.txt: not UTF-8; read as Windows-1252" in record.getMessage()


def test_plain_text_stays_as_it_is(write: Any, tmp_path: Path) -> None:
    for text in (
        "<speak>Hello</speak>",
        "Hello, [you] (all)\n",
        "The 5:30 - 6:00 train",
        "5:30 - 6:00",
        "a -> b",
        "3 - 4 -> 5",
    ):
        assert read_transcript(write(text, "a.txt")) == text
    with pytest.raises(InputError, match=r"b\.txt: no such transcript file"):
        read_transcript(tmp_path / "b.txt")


@pytest.mark.parametrize("name", ["take.srt", "take.en.vtt", "take.mp4.srt", "take.json", "take.ctm", "take.SRT"])
def test_they_are_found_beside_recordings(tmp_path: Path, name: str) -> None:
    other = {"ctm": LABEL_CASES["CTM: words"]["content"], "json": LABEL_CASES["Whisper"]["content"]}
    (tmp_path / name).write_text(other.get(name.rpartition(".")[2], SRT))
    found = find_labels(tmp_path / "take.mp4")
    assert found.words == ("hello", "there", "how", "are", "you")
    assert found.transcript.lines[0].start_s == pytest.approx(1.0)
    (tmp_path / "take.txt").write_text("By hand")
    assert find_labels(tmp_path / "take.mp4").words == ("by", "hand")


def test_json_of_another_kind_beside_a_recording_is_passed_over(tmp_path: Path) -> None:
    for content in ('{"format": "lipmotion-motion", "channels": [], "words": []}', '{"name": "take"}', "7"):
        (tmp_path / "take.json").write_text(content)
        assert find_labels(tmp_path / "take.mp4").words is None
    (tmp_path / "take.json").write_text('{"segments": [')
    with pytest.raises(InputError, match=r"take\.json: line 1: damaged JSON"):
        find_labels(tmp_path / "take.mp4")


def test_times_are_never_spoken(read: Read) -> None:
    for content, message in (
        (SRT.replace("-->", "/"), "two times as in subtitles; required: times as in 00:00:01,000 --> 00:00:02,500, or"),
        (SRT.replace("-->", "", 1), "line 2 is '00:00:01,000  00:00:02,500'; required times as in"),
        (SRT.replace("-->", "->").replace("02,500", "2x"), "line 2 is '00:00:01,000 -> 00:00:2x'; required times as"),
        (ASS.replace("0:00:04.00", "later"), "line 12 is 'Dialogue: 0,0:00:02.75,later"),
        (ASS.replace("0:00:04.00", "0:00:00.10"), "line 12 ends at 0.1 s, before its start at 2.75 s; correct it"),
        (ASS.replace(",0,0,0,,How", ""), "line 12 is 'Dialogue: 0,0:00:02.75"),
        (ASS[: ASS.index("Dialogue")], "the transcript holds no word"),
        ("{25}{63}Hello there\n", "is MicroDVD, whose times are in frames, and says no rate"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            read(content)


def test_an_empty_file_is_no_transcript(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "take1.txt").write_text(" \n")
    assert find_labels(tmp_path / "take1.mp4").words is None
    assert "take1.txt: is empty: it counts as no transcript" in caplog.messages[0]


def phones(path: Path) -> list[tuple[float, float, str, str]]:
    units = read_units(path)
    return [(round(s.start_s, 6), round(s.end_s, 6), s.label.phone or s.label.unit, s.label.word) for s in units]


def test_a_textgrid_in_ipa(write: Any) -> None:
    rows = "".join(f'{start}\n{end}\n"{text}"\n' for start, end, text in ((0, 0.1, "m"), (0.1, 0.4, "ɒ"), (0.4, 1, "")))
    grid = f'"ooTextFile"\n"TextGrid"\n0\n1\n<exists>\n1\n"IntervalTier"\n"phones"\n0\n1\n3\n{rows}'
    assert phones(write(grid, "a.TextGrid")) == [(0, 0.1, "m", ""), (0.1, 0.4, "ao", ""), (0.4, 1, "sil", "")]


def test_beside_a_recording_and_other_suffixes(write: Any, tmp_path: Path) -> None:
    write(POLLY, "take.json")
    assert find_labels(tmp_path / "take.wav").words == ("mama", "bites")
    for name in ("take.marks", "take.jsonl"):
        assert phones(write(POLLY, name)) == phones(tmp_path / "take.json")
    assert phones(write(MFA_CSV, "take.csv")) == phones(write(MFA_CSV, "b.txt"))
    assert read_labels(write(LABEL_CASES["Cartesia, a voice"]["content"])).phones is not None
    assert read_phones(write(MFA_CSV, "b.txt"))[0].label.word == "my"


def test_words_alone_are_no_units_and_visemes_alone_no_transcript(write: Any) -> None:
    with pytest.raises(InputError, match=r"holds words in time, but no phones; give it as a transcript"):
        read_units(write(LABEL_CASES["ElevenLabs, a voice"]["content"]))
    with pytest.raises(InputError, match="phones in time, but no words; give them as units"):
        read_transcript(write(LABEL_CASES["Azure phones, a voice"]["content"]))


def test_words_that_gentle_did_not_find_are_reported(write: Any, caplog: pytest.LogCaptureFixture) -> None:
    read_labels(write(LABEL_CASES["Gentle, a voice"]["content"]))
    assert "1 words were not found in the sound and are left out" in caplog.text
