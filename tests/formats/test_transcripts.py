import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats import timing_samples as timings
from formats.examples import timed
from lipmotion.errors import InputError
from lipmotion.formats.label_files import find_labels, holds_timings, read_labels, read_phones, read_transcript
from lipmotion.pipeline.analysis.read_request import read_units
from lipmotion.types import TimedTranscript

Lines = list[tuple[float | None, float | None, str]]
Read = Callable[[str | bytes], TimedTranscript]
HELLO = [(1.0, 2.5, "hello there"), (2.75, 4.0, "how are you")]
HELLO_WORDS = [("hello", 1.0, 1.75), ("there", 1.75, 2.5), ("how", 2.75, 3.0), ("are", 3.0, 3.25), ("you", 3.5, 4.0)]


@pytest.fixture
def read(write: Any) -> Read:
    """Return the transcript in time of a file with some content."""
    return lambda content: timed(write(content, "a.txt"))


def lines(transcript: TimedTranscript) -> Lines:
    """Return start, end and text of every line."""
    return [(line.start_s, line.end_s, " ".join(word.word for word in line.words)) for line in transcript.lines]


def words(transcript: TimedTranscript) -> list[tuple[str, float | None, float | None]]:
    return [(word.word, word.start_s, word.end_s) for line in transcript.lines for word in line.words]


def clock(time_s: float, mark: str = ",") -> str:
    ms = round(1000 * time_s)
    return f"{ms // 3_600_000:02}:{ms // 60_000 % 60:02}:{ms // 1000 % 60:02}{mark}{ms % 1000:03}"


SRT = "1\n00:00:01,000 --> 00:00:02,500\nHello there!\n\n2\n00:00:02,750 --> 00:00:04,000\nHow are\nyou?\n"
ASS = """[Script Info]
Title: no words
ScriptType: v4.00+

[V4+ Styles]
Format: Name, Fontname, Fontsize
Style: Default,Arial,20

[Events]
Format: Layer, Start, End, Style, Name, MarginL, MarginR, MarginV, Effect, Text
Comment: 0,0:00:00.00,0:00:09.00,Default,,0,0,0,,not said
Dialogue: 0,0:00:02.75,0:00:04.00,Default,Bob,0,0,0,,How\\Nare, {\\i1}you{\\i0}?
Dialogue: 1,0:00:01.00,0:00:02.50,Default,,0,0,0,,{\\an8\\fad(100,100)}Hello\\hthere!
Dialogue: 1,0:00:01.00,0:00:02.50,Default,,0,0,0,,{\\p1}m 0 0 l 100 0{\\c&HFF&} 100 100{\\p0}
"""
SSA = """[Script Info]
ScriptType: v4.00

[Events]
Format: Marked, Start, End, Style, Name, MarginL, MarginR, MarginV, Effect, Text
Dialogue: Marked=0,0:00:01.00,0:00:02.50,Default,,0,0,0,,Hello there
Dialogue: Marked=0,0:00:02.75,0:00:04.00,Default,,0,0,0,,How are you
"""
OF_LINES = {
    "SubStation": ASS,
    "SubStation of Windows": "\ufeff" + ASS.replace("\n", "\r\n"),
    "SubStation's dialogue alone": "".join(line for line in ASS.splitlines(keepends=True) if line[:8] == "Dialogue"),
    "SubStation 4": SSA,
    **{f"SubRip with {arrow} as arrow": SRT.replace("-->", arrow) for arrow in ("->", "- ->", "–>", "—>", "→", "==>")},
    "SubRip with escaped arrows": SRT.replace("-->", "--&gt;"),
    "SubRip with one damaged arrow": SRT.replace("-->", "->", 1),
    "SubRip": SRT,
    "SubRip of Windows": "\ufeff" + SRT.replace("\n", "\r\n"),
    "SubRip without blank lines": SRT.replace("\n\n", "\n"),
    "SubRip without numbers": SRT.replace("1\n", "").replace("\n2\n", "\n"),
    "SubRip with blank lines in texts": SRT.replace("are\n", "are\n\n"),
    "SubRip with places": SRT.replace("500\n", "500  X1:100 X2:200 Y1:0 Y2:9\n"),
    "SubRip with marks": SRT.replace("Hello", r"{\an8}<i>Hello</i> <font color='#fff'>").replace("you", "[music] you"),
    "SubRip with points": SRT.replace(",", "."),
    "SubRip of speakers": SRT.replace("Hello", "- ANNA: Hello").replace("How", ">> Speaker 2: How"),
    "WebVTT": "WEBVTT\n\n00:01.000 --> 00:02.500\nHello there\n\n00:02.750 --> 00:04.000 line:0\nHow are you\n",
    "WebVTT with everything": "WEBVTT - a title\nKind: captions\n\nSTYLE\n::cue(b) { color: red }\n\n"
    "NOTE two\nlines\n\nintro\n00:00:01.000 --> 00:00:02.500 align:start\n<v.loud Anna>Hello &lrm;<b>there</b></v>\n\n"
    "NOTE one more\n\n00:00:02.750 --> 00:00:04.000\n(door opens) How are&nbsp;you\n\nNOTE the end\n",
    "WebVTT with names of cues": "WEBVTT\n\nfirst part\n00:01.000 --> 00:02.500\nHello there\n\nsecond part\n"
    "00:02.750 --> 00:04.000\nHow are you\n",
    "lyrics": "[ar:Anna]\n[offset:+50]\n[00:02.80] How are\nyou\n[00:01.05] Hello there\n[00:02.55]\n[00:04.05]\n",
    "MicroDVD": "{1}{1}20.000\n{20}{50}Hello|there!\n{55}{80}{y:i}How are you?\n",
    "lines that begin with times": "[0:01] Hello there\n[00:00:02.50]\n[0:00:02.75]How are you\n[0:04]",
    "Whisper's table": "start\tend\ttext\n1000\t2500\tHello there!\n2750\t4000\tHow are you?\n",
    "Whisper": json.dumps({"text": " Hello there! How are you?", "language": "en", "segments": [
        {"id": 0, "start": 1.0, "end": 2.5, "text": " Hello there!", "avg_logprob": math.nan},
        {"id": 1, "start": 2.75, "end": 4, "text": " How are you?", "tokens": [1, 2]}]}),
    "faster-whisper's segments": json.dumps([
        {"start": 1.0, "end": 2.5, "text": " Hello there!", "words": None},
        {"start": 2.75, "end": 4.0, "text": "How are you?", "words": None}], indent=1),
    "whisper.cpp": json.dumps({"systeminfo": "AVX = 1", "transcription": [
        {"timestamps": {"from": "00:00:01,000", "to": "00:00:02,500"}, "offsets": {"from": 1000, "to": 2500},
         "text": " Hello there!", "tokens": [{"text": " Hello"}]},
        {"offsets": {"from": 2750, "to": 4000}, "text": " How are you?"}]}),
    "transformers": json.dumps({"text": "Hello there! How are you?", "chunks": [
        {"timestamp": [1.0, 2.5], "text": " Hello there!"}, {"timestamp": [2.75, 4.0], "text": " How are you?"}]}),
    "Audacity's labels": "1.000000\t2.500000\tHello there!\n2.750000\t4.000000\tHow are you?\n",
    "lines out of order": "00:00:02,750 --> 00:00:04,000\nHow are you\n\n00:00:01,000 --> 00:00:02,500\nHello there\n",
}  # fmt: skip


@pytest.mark.parametrize("kind", OF_LINES)
def test_lines_in_time(read: Read, kind: str) -> None:
    found = lines(read(OF_LINES[kind]))
    assert [text for *_, text in found] == [text for *_, text in HELLO]
    assert [time for line in found for time in line[:2]] == pytest.approx([time for line in HELLO for time in line[:2]])


def segment(first: int, end: int, name: str = "word", space: str = " ") -> dict[str, Any]:
    items = [{name: space + word, "start": start_s, "end": end_s} for word, start_s, end_s in HELLO_WORDS[first:end]]
    return {"start": items[0]["start"], "end": items[-1]["end"], "text": "ignored", "words": items}


VOSK: list[dict[str, Any]] = [{"result": segment(0, 2, space="")["words"], "text": "hello there"}, {"text": ""}]
VOSK += [{"result": segment(2, 5, space="")["words"], "text": "how are you"}]
OF_WORDS = {
    "Whisper": json.dumps({"text": "", "segments": [segment(0, 2), segment(2, 5)]}),
    "OpenAI's API": json.dumps({"segments": [{"start": 1, "end": 4, "text": "-"}], "words": segment(0, 5)["words"]}),
    "Vosk, a list": json.dumps(VOSK),
    "Vosk, one after another": "\n".join(json.dumps(result, indent=2) for result in VOSK),
    "Vosk, one of several": json.dumps({"alternatives": [VOSK[0] | {"confidence": 9}, VOSK[2]]})
    + json.dumps({"alternatives": [VOSK[2]]}),
    "words alone": json.dumps({"words": segment(0, 5, name="text")["words"]}),
    "CTM": ";; made by hand\n"
    + "\n".join(f"a 1 {start_s} {end_s - start_s} {word.upper()} 0.9" for word, start_s, end_s in HELLO_WORDS),
    "CTM without confidence, out of order, with silence": "a A 0.0 1.0 <eps>\n"
    + "\n".join(f"a A {start_s:.2f} {end_s - start_s:.2f} {word}" for word, start_s, end_s in HELLO_WORDS[::-1]),
    "LRS2": "Text:  HELLO\nConf:  4\n\nWORD START END ASDSCORE\n"
    + "\n".join(f"{word.upper()} {start_s} {end_s} 7.5" for word, start_s, end_s in HELLO_WORDS),
    "LRS3": "Text:  HELLO\nConf: 9\nRef: 0Fi83\n\nFRAME X Y W H\n000001 0.4 0.1 0.2 0.4\n\nWORD START END ASDSCORE\n"
    + "\n".join(f"{word.upper()} {start_s} {end_s} 7.5" for word, start_s, end_s in HELLO_WORDS)
    + "\n\nEND",
    "a TextGrid": '"ooTextFile" "TextGrid" 0 4 <exists> 1 "IntervalTier" "words" 0 4 5\n'
    + "\n".join(f'{start_s} {end_s} "{word}"' for word, start_s, end_s in HELLO_WORDS),
    "HTK's labels": "\n".join(f"{round(a * 1e7)} {round(b * 1e7)} {word}" for word, a, b in HELLO_WORDS),
}


@pytest.mark.parametrize("kind", OF_WORDS)
def test_words_in_time(read: Read, kind: str) -> None:
    found = words(read(OF_WORDS[kind]))
    assert [word for word, *_ in found] == [word for word, *_ in HELLO_WORDS]
    for word, wanted in zip(found, HELLO_WORDS, strict=True):
        assert word[1:] == pytest.approx(wanted[1:])


def test_some_words_have_no_time_some_share_one_and_an_end_just_before_its_start_is_its_start(read: Read) -> None:
    items = [{"word": "In", "start": 0.5, "end": 0.6}, {"word": "1999"}, {"word": "we", "start": 2.0, "end": None}]
    found = words(read(json.dumps({"segments": [{"start": 0.5, "end": 2.5, "text": "", "words": items}]})))
    assert [word for word, *_ in found] == ["in", "1999", "we"]
    assert [time is None for _, time, _ in found] == [False, True, False]
    assert found[-1] == ("we", 2.0, None)
    found = words(read('{"words": [{"word": "20-foot", "start": 1.0, "end": 2.0}]}'))
    assert [word for word, *_ in found] == ["20", "foot"]
    assert [time for row in found for time in row[1:]] == pytest.approx([1.0, 1.6, 1.6, 2.0])
    assert words(read('{"words": [{"word": "a", "start": 7.0, "end": 6.98}]}')) == [("a", 7.0, 7.0)]


SCROLLING = """WEBVTT
Kind: captions
Language: en

00:00:00.240 --> 00:00:01.910 align:start position:0%
{blank}
Let<00:00:00.640><c> us</c><00:00:00.800><c> look</c>

00:00:01.910 --> 00:00:01.920 align:start position:0%
Let us look
{blank}

00:00:01.920 --> 00:00:03.750 align:start position:0%
Let us look
look<00:00:02.320><c> again</c>

00:00:03.750 --> 00:00:03.760 align:start position:0%
look again
{blank}

""".replace("{blank}", " ")


def test_captions_that_scroll_say_each_line_once(read: Read) -> None:
    found = words(read(SCROLLING))
    assert [word for word, *_ in found] == ["let", "us", "look", "look", "again"]
    assert [start_s for _, start_s, _ in found] == pytest.approx([0.24, 0.64, 0.8, 1.92, 2.32])
    without_times = SCROLLING.replace("<c>", "").replace("</c>", "").replace("<00:00:", "<").replace("<0", "<i 0")
    assert read(without_times).words == ("let", "us", "look", "look", "again")
    twice = "00:00:01,000 --> 00:00:02,000\nno\n\n00:00:02,000 --> 00:00:03,000\nno\nno\n\n"
    assert read(twice).words == ("no", "no", "no")


def test_what_is_spoken(read: Read) -> None:
    for text, said in (
        ("ANNA: hi\nBOB #2: you", "hi you"), ("Speaker 1: hi\n[SPEAKER_02]: you", "hi you"),
        ("It is AT 10:30 now", "it is at 10:30 now"), ("Tom &amp; Jerry&#39;s", "tom & jerry's"),
        ("♪ la la ♪", "la la"), ("(all) hi [laughs\nloudly] you", "hi you"), ("5 < 6 and 7 > 3", "5 6 and 7 3"),
        ("Note: hi", "note hi"),
    ):  # fmt: skip
        assert " ".join(read(f"00:01,000 --> 00:02,000\n{text}\n").words) == said


def test_names_that_come_again_and_again_are_not_said(read: Read) -> None:
    cues = [f"00:0{i}.000 --> 00:0{i}.900\nAnna Smith: hello {i}\n" for i in range(1, 4)]
    assert read("WEBVTT\n\n" + "\n".join(cues)).words == ("hello", "1", "hello", "2", "hello", "3")


DAMAGED = {
    "times without seconds": ("1\n00:00:01,000 --> 07\nhi\n\n2\n00:04 --> 00:05\nyou", r"a\.txt: line 2 is '00:00:01"),
    "a time with letters": (SRT.replace("00:00:02,750 -->", "00:00:0x,7 -->"), r"a\.txt: line 6 is '00:00:0x,7 -->"),
    "an end before its start": (SRT.replace("02,750", "09,750"),
        r"a\.txt: line 6 ends at 4 s, before its start at 9.75 s"),
    "a table with a broken row": ("start\tend\ttext\n0\t1\ta\n2 3 b\n",
        r"a\.txt: line 3 is '2 3 b'; required, as in line 1: start"),
    "no word": (SRT.replace("Hello there!", "♪").replace("How are\nyou?", "[music]"), "holds no word"),
    "JSON cut off": ('{"segments": [\n{"start": 0,', r"a\.txt: line 2: damaged JSON"),
    "JSON with more after it": ('{"segments": []}\n]', r"a\.txt: line 2: damaged JSON"),
    "JSON nested too deeply": ('{"segments": ' + "[" * 100_000, "nested too deeply"),
    "a number of 5,000 digits": ('{"segments": [{"text": "a", "start": ' + "9" * 5000 + "}]}", "a number too long"),
    "a text as a time": ('{"words": [{"word": "b", "start": "soon"}]}', "a time is 'soon', required a number"),
    "a truth as a time": ('{"words": [{"word": "b", "start": true}]}', "a time is true, required a finite number"),
    "a time of years": ('{"words": [{"word": "b", "start": 1e8}]}', "a time is 1e.08, required seconds"),
    "a segment that is a number": ('{"segments": [{"text": "a"}, 7]}', "'segments', item 2 is 7, required an object"),
    "a word without text": ('{"words": [{"start": 7}]}', "words 1: no text"),
    "a text that is a list": ('{"segments": [{"text": [1], "start": 7}]}', r"its text is \[1\], required a text"),
    "a word that ends long before it starts": ('{"words": [{"word": "a", "start": 7, "end": 2}]}',
        "ends at 2 s, before"),
    "CTM of two recordings": ("a 1 0.0 0.5 hi\nb 1 0.5 0.5 you\n", r"line 2: words of two recordings, 'a' and 'b'"),
    "CTM with a broken line": ("a 1 0.0 0.5 hi\na 1 0.5 you\n", r"line 2 is 'a 1 0\.5 you'; required, as in line 1"),
    "CTM with a time that is none": ("a 1 0.0 0.5 hi\na 1 nan 0.5 you\n", "line 2 has the time 'nan"),
    "CTM with a negative duration": ("a 1 0.0 0.5 hi\na 1 1.0 -0.5 you\n", r"line 2: a duration of -0\.5 s"),
    "LRS with a broken line": ("Text:  HI\n\nWORD START END\nHI 0.1 0.2 9\nYOU 0.2\n",
        r"line 5 is 'YOU.*0\.2'; required"),
    "LRS with a time that is none": ("Text:  HI\n\nWORD START END\nHI 0.1 nan\n", "line 4 has the time 'nan"),
    "phones alone": ("0 1000000 sil\n1000000 2000000 p\n2000000 3500000 aa\n", "phones in time, but no words"),
}  # fmt: skip


@pytest.mark.parametrize("kind", DAMAGED)
def test_what_is_damaged_is_refused_with_its_place(read: Read, kind: str) -> None:
    text, message = DAMAGED[kind]
    with pytest.raises(InputError, match=message):
        read(text)


HOSTILE: list[tuple[Callable[[], bytes], str]] = [
    (lambda: b"00:01 --> 00:02\nhi\n" * 900_000, "bytes, required at most 16777216"),
    (lambda: b"0:1-->0:2\n" * 250_001, "more than 250000 labels"),
    (lambda: b"[" + b'{"start":0,"text":"a"},' * 250_001 + b"{}]", "more than 250000 labels"),
    (lambda: b"0:1-->0:2\n" + b"7" * 15_000_000, "line 1: a line of 15000000 characters"),
    (lambda: b'{"words":[' + b'{"word":"a"},' * 250_001 + b'{"word":"a"}]}', "more than 250000 labels"),
    (lambda: b"a 1 0. 1 b\n" * 250_001, "more than 250000 labels"),
]


@pytest.mark.long
def test_more_than_a_recording_has_is_refused(read: Read) -> None:
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
    for text in ("Hello, [you] (all)\n", "The 5:30 - 6:00 train", "5:30 - 6:00", "a -> b", "3 - 4 -> 5"):
        assert read_transcript(write(text, "a.txt")) == text
    with pytest.raises(InputError, match=r"b\.txt: no such transcript file"):
        read_transcript(tmp_path / "b.txt")


@pytest.mark.parametrize("name", ["take.srt", "take.en.vtt", "take.mp4.srt", "take.json", "take.ctm", "take.ass"])
def test_they_are_found_beside_recordings(tmp_path: Path, name: str) -> None:
    other = {"ctm": OF_WORDS["CTM"], "json": OF_LINES["Whisper"], "ass": ASS}
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


times = st.integers(0, 3_600_000).map(lambda ms: ms / 1000)
word = st.lists(st.sampled_from(ascii_lowercase), min_size=1, max_size=12).map("".join)
many_lines = st.lists(st.tuples(times, times, st.lists(word, min_size=1, max_size=6)), min_size=1, max_size=8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("transcripts")


@given(rows=many_lines, form=st.sampled_from(["srt", "vtt", "json", "tsv"]))
@settings(max_examples=25)
def test_what_is_written_is_read(folder: Path, rows: list[tuple[float, float, list[str]]], form: str) -> None:
    shortest_s = 0.2  # shorter cues that repeat the one before are the bridges of captions that scroll
    longest_s = 10  # words that last longer are in another unit
    spans = sorted((min(a, b), min(a, b) + min(max(abs(a - b), shortest_s), longest_s), said) for a, b, said in rows)
    if form == "json":
        text = json.dumps({"segments": [{"start": a, "end": b, "text": " ".join(said)} for a, b, said in spans]})
    elif form == "tsv":
        rounded = [f"{round(1000 * a)}\t{round(1000 * b)}\t{' '.join(said)}\n" for a, b, said in spans]
        text = "start\tend\ttext\n" + "".join(rounded)
    else:
        mark = "," if form == "srt" else "."
        cues = [f"{clock(a, mark)} --> {clock(b, mark)}\n{' '.join(said)}\n" for a, b, said in spans]
        text = ("WEBVTT\n\n" if form == "vtt" else "") + "\n".join(cues)
    (folder / "a").write_text(text)
    got = [(line.start_s, [each.word for each in line.words]) for line in timed(folder / "a").lines]
    assert [line[0] for line in got] == pytest.approx([a for a, *_ in spans], abs=1e-6)
    assert sorted(line[1] for line in got) == sorted(said for *_, said in spans)


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


def words_of(path: Path) -> list[tuple[str, float | None, float | None]]:
    return [(word, start and round(start, 6), end and round(end, 6)) for word, start, end in words(timed(path))]


def phones(path: Path) -> list[tuple[float, float, str, str]]:
    units = read_units(path)
    return [(round(s.start_s, 6), round(s.end_s, 6), s.label.phone or s.label.unit, s.label.word) for s in units]


WORDS = {
    "Polly": (timings.POLLY, [("mama", 0.06, 0.4), ("bites", 0.7, 1.1)]),
    "Azure's boundaries": (timings.AZURE_WORDS, [("hello", 0.05, 0.3875), ("you", 0.45, 0.75)]),
    "Azure's batch": ([{"Text": "the", "AudioOffset": 38, "Duration": 153}], [("the", 0.038, 0.191)]),
    "ElevenLabs": (timings.ELEVENLABS, [("hi", 0.5, 0.7), ("2", 0.8, 1.2)]),
    "ElevenLabs' pieces": (timings.json_lines(*({"alignment": text and {
        "characters": [text], "character_start_times_seconds": [start], "character_end_times_seconds": [end]}}
        for text, start, end in (("h", 0.5, 0.6), (None, 0, 0), ("i", 0.6, 0.75)))), [("hi", 0.5, 0.75)]),
    "ElevenLabs' socket": ({"audio": "", "isFinal": False, "normalizedAlignment": {
        "chars": [" ", "h", "i"], "charStartTimesMs": [0, 100, 200], "charsDurationsMs": [100, 100, 150]}},
        [("hi", 0.1, 0.35)]),
    "Cartesia": (timings.CARTESIA, [("hi", 0, 0.4), ("you", 0.5, 0.9)]),
    "Google": (timings.GOOGLE, [("hello", 0.25, 0.75), ("you", 0.75, None)]),
    "Kokoro": (timings.KOKORO, [("hi", 0.25, 0.55), ("you", 0.6, 0.9)]),
    "servers of Kokoro": (timings.SAMPLES["servers"], [("hi", 0.1, 0.4)]),
    "Gentle": (timings.GENTLE, [("hi", 0.1, 0.4), ("you", 0.5, 0.8)]),
    "MFA": (timings.MFA, [("my", 0.1, 0.5), ("spot", 0.5, 1.0)]),
    "MFA's table": (timings.MFA_CSV, [("my", 0.1, 0.5)]),
}  # fmt: skip
PHONES = {
    "Polly": (timings.POLLY, "sil p/mama aa/mama p/mama ax/mama sil p/bites aa/bites t/bites s/bites sil", 0.4),
    "Azure": (timings.AZURE_VISEMES, "sil hh eh l ow", 0.2),
    "Cartesia": (timings.CARTESIA, "hh/hi ay/hi sp y/you uw/you", 0.4),
    "Piper": (timings.PIPER, "sil hh ay sp y uw sil sil", 0.4),
    "Kokoro": (timings.KOKORO, "sil hh/hi ay/hi sp y/you uw/you sil sil", 0.55),
    "Gentle": (timings.GENTLE, "hh/hi ay/hi sp spn/you", 0.4),
    "MFA": (timings.MFA, "m/my ay/my s/spot p/spot ao/spot t/spot", 0.5),
    "MFA's table": (timings.MFA_CSV, "m/my ay/my", 0.5),
}
"""Phones with their words, in order, and the end of one of them."""


@pytest.mark.parametrize("name", WORDS)
def test_words_of_every_service_in_time(write: Any, name: str) -> None:
    content, expected = WORDS[name]
    assert words_of(write(content)) == expected
    assert holds_timings(write(content))


@pytest.mark.parametrize("name", PHONES)
def test_phones_in_time(write: Any, name: str) -> None:
    content, expected, end_s = PHONES[name]
    found = phones(write(content))
    assert [f"{phone}/{word.lower()}" if word else phone for *_, phone, word in found] == expected.split()
    assert end_s in [each[1] for each in found]
    starts, ends = [each[0] for each in found[1:]], [each[1] for each in found[:-1]]
    assert ends == pytest.approx(starts, abs=0.11) or name == "Cartesia"


def test_a_textgrid_in_ipa(write: Any) -> None:
    rows = "".join(f'{start}\n{end}\n"{text}"\n' for start, end, text in ((0, 0.1, "m"), (0.1, 0.4, "ɒ"), (0.4, 1, "")))
    grid = f'"ooTextFile"\n"TextGrid"\n0\n1\n<exists>\n1\n"IntervalTier"\n"phones"\n0\n1\n3\n{rows}'
    assert phones(write(grid, "a.TextGrid")) == [(0, 0.1, "m", ""), (0.1, 0.4, "ao", ""), (0.4, 1, "sil", "")]


def test_beside_a_recording_and_other_suffixes(write: Any, tmp_path: Path) -> None:
    write(timings.POLLY, "take.json")
    assert find_labels(tmp_path / "take.wav").words == ("mama", "bites")
    for name in ("take.marks", "take.jsonl"):
        assert phones(write(timings.POLLY, name)) == phones(tmp_path / "take.json")
    assert phones(write(timings.MFA_CSV, "take.csv")) == phones(write(timings.MFA_CSV, "b.txt"))
    assert read_labels(write(timings.CARTESIA)).phones is not None
    assert read_phones(write(timings.MFA_CSV, "b.txt"))[0].label.word == "my"


ERRORS = {
    "a viseme of Polly": (
        timings.POLLY.replace('"@"', '"Q"'), r"a\.json: line 7: the viseme is 'Q', required one of sil, p, t, "),
    "a viseme of Azure": ([{"audio_offset": 0, "viseme_id": 22}], "the viseme is 22, required one of sil, p, t, "),
    "a symbol": (timings.CARTESIA.replace('"aɪ"', '"§"'), "phonemes 2 is '§', which is no phone"),
    "lists": (timings.CARTESIA.replace("[0, 0.5]", "[0]"), "line 2, .*: required are the lists words, start"),
    "a mark": ({"timepoints": [{"markName": "m1"}]}, "timepoints 1 is the mark 'm1', which is no word; name every"),
    "a rate": ({**timings.PIPER, "sample_rate": 0}, "the sample rate in hertz is 0, required"),
    "durations": ({**timings.KOKORO, "pred_dur": [1]}, "1 durations of 7 phonemes, required two more than phonemes"),
    "an event without a time": ([{"Text": "a", "AudioOffset": None}], "no words in time are found"),
    "a time": ({**timings.MFA, "tiers": {"words": {"entries": [["x", 1, "a"]]}}}, "entry 1: a time is 'x', required"),
    "a line": (timings.MFA_CSV + "0.5,x\n", "line 5 is '0.5,x'; required, as in line 1: Begin,End"),
    "pieces of the socket": (
        timings.json_lines(*[{"alignment": {"chars": ["a"], "charStartTimesMs": [0], "charDurationsMs": [1]}}] * 2),
        "holds 2 pieces whose times each begin at 0"),
    "a symbol without end": (timings.CARTESIA.replace('"aɪ"', f'"{"a" * 41}"'),
        "has 41 letters, required a phone: 40 at most"),
}  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_what_is_not_understood_is_named(write: Any, name: str) -> None:
    content, message = ERRORS[name]
    with pytest.raises(InputError, match=message):
        read_labels(write(content))


def test_words_alone_are_no_units_and_visemes_alone_no_transcript(write: Any) -> None:
    with pytest.raises(InputError, match=r"holds words in time, but no phones; give it as a transcript"):
        read_units(write(timings.ELEVENLABS))
    with pytest.raises(InputError, match="phones in time, but no words; give them as units"):
        read_transcript(write(timings.AZURE_VISEMES))


def test_words_that_gentle_did_not_find_are_reported(write: Any, caplog: pytest.LogCaptureFixture) -> None:
    read_labels(write(timings.GENTLE))
    assert "1 words were not found in the sound and are left out" in caplog.text
