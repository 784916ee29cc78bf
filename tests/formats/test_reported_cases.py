"""Labels that users of other tools have reported, and their siblings: words and phones as they are said."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from formats.examples import LABEL_CASES, timed
from lipmotion import Request
from lipmotion.errors import InputError
from lipmotion.formats.label_files import list_speakers, read_labels, read_phones, read_transcript
from lipmotion.pipeline.analysis.read_request import read_request
from lipmotion.units import UNKNOWN_PHONES

CASES = Path(__file__).parents[1] / "data" / "cases" / "labels"
SAID = json.loads(Path(__file__).with_name("said_labels.json").read_text(encoding="utf-8"))
MOTHER = "my mother moved the baby boat"
W = [("hello", 0.4, 0.8), ("big", 0.85, 1.1), ("moon", 1.2, 1.6)]


def words(path: Path, **choice: str) -> str:
    return " ".join(timed(path, **choice).words)


def phones(path: Path, **choice: str) -> list[str]:
    return [span.label.phone or span.label.unit for span in read_phones(path, **choice)]


def times(path: Path) -> list[tuple[float | None, float | None]]:
    return [(word.start_s, word.end_s) for line in timed(path).lines for word in line.words]


def grid(end: float = 2, /, **tiers: Sequence[tuple[float, float, str]]) -> str:
    rows = ""
    for name, labels in tiers.items():
        rows += f'"IntervalTier"\n"{name.replace("__", " - ").replace("_", "-")}"\n0\n{end}\n{len(labels)}\n'
        rows += "".join(f'{start}\n{stop}\n"{text}"\n' for start, stop, text in labels)
    return f'File type = "ooTextFile"\n"TextGrid"\n0\n{end}\n<exists>\n{len(tiers)}\n{rows}'


@pytest.mark.parametrize(("name", "said", "sounds"), SAID)
def test_the_words_and_phones_that_are_said(name: str, said: str, sounds: str) -> None:
    assert not said or words(CASES / name) == said
    assert not sounds or phones(CASES / name) == sounds.split()


def test_tiers_of_webmaus_have_their_roles(write: Any) -> None:
    for name in ("two-tiers-mau.TextGrid", "three-tiers-mau.TextGrid"):
        units = read_phones(CASES / name)
        assert [span.label.phone for span in units][1:3] == ["m", "ay"]
        assert {span.label.word for span in units} == {"", *MOTHER.split()}
    rows = {"KAN": [(0, 0.5, "m a")], "KAS": [(0, 0.5, "m.a")], "MAS": [(0, 0.5, "m a")], "TRN": [(0, 2.0, "ma")]}
    mau = [(0, 0.2, "<p:>"), (0.2, 0.3, "m"), (0.3, 0.5, "a:"), (0.5, 0.6, "?"), (0.6, 0.8, "<usb>"), (0.8, 2, "<p:>")]
    path = write(grid(ORT=[(0.2, 0.6, "ma")], **rows, MAU=mau), "a.TextGrid")
    assert (words(path), phones(path)) == ("ma", ["sil", "m", "aa", UNKNOWN_PHONES, "sil"])
    assert phones(write(grid(MAU=mau), "b.TextGrid")) == ["sil", "m", "aa", UNKNOWN_PHONES, "sil"]


def test_speech_of_unknown_phones_keeps_its_word_and_its_time(caplog: pytest.LogCaptureFixture) -> None:
    (span,) = [s for s in read_phones(CASES / "spoken-noise-phone.TextGrid") if s.label.unit == UNKNOWN_PHONES]
    assert (span.label.phone, span.label.word) == ("", "boat")
    assert (span.start_s, span.end_s) == pytest.approx((1.445, 1.855))
    (span,) = [s for s in read_phones(CASES / "unknown-word-label.TextGrid") if s.label.unit == UNKNOWN_PHONES]
    assert span.label.word == ""
    found = read_labels(CASES / "spoken-noise-phone.TextGrid")
    assert (found.phones, found.words) == (None, tuple(MOTHER.split()))
    assert "1.4" in caplog.text


def test_a_part_of_a_word_that_is_unknown_has_no_word(write: Any) -> None:
    path = write(grid(words=[(0, 1, "boat")], phones=[(0, 0.5, "b"), (0.5, 1, "spn"), (1, 2, "")]), "a.TextGrid")
    assert [span.label.word for span in read_phones(path)] == ["boat", "", ""]


@pytest.mark.parametrize("per_s", [1000, 10_000_000])
def test_units_of_time_follow_from_how_long_words_last(write: Any, per_s: int) -> None:
    edges = ((0, 0), (25, 21), (85, 11), (135, 0), (185, 21))
    for events in (
        [{"audioOffset": ms * per_s // 1000, "visemeId": number} for ms, number in edges],
        [{"audioOffset": ms / 1000, "visemeId": number} for ms, number in edges],
    ):
        assert [span.start_s for span in read_phones(write(events))] == pytest.approx([0, 0.025, 0.085, 0.135, 0.185])
    labels = [(round(a * per_s), round(b * per_s), w) for w, a, b in W]
    for path in (
        write({"words": [{"text": w, "start": a, "end": b} for a, b, w in labels]}),
        write(grid(2 * per_s, words=labels), "a.TextGrid"),
        write("".join(f"{a}\t{b}\t{w}\n" for a, b, w in labels), "a.txt"),
    ):
        assert times(path)[2] == pytest.approx((1.2, 1.6))


def test_the_first_word_of_protocol_buffers_begins_at_0(write: Any) -> None:
    word = {"word": "hi", "startTime": {}, "endTime": {"nanos": 500_000_000}}
    assert times(write({"results": [{"alternatives": [{"words": [word]}]}]})) == [(0, 0.5)]


def test_a_word_of_minutes_is_one_in_milliseconds(write: Any) -> None:
    assert times(write({"words": [{"text": "hi", "start": 400, "end": 800}]})) == [(0.4, 0.8)]


def test_samples_are_read_where_their_rate_is_known(write: Any) -> None:
    rows = "0 3050 h#\n3050 4559 sh\n4559 5723 ix\n5723 6642 hv\n6642 8772 eh\n8772 9190 dcl\n9190 10337 jh\n"
    rows += "10337 11517 dx\n11517 12500 ax-h\n12500 13000 q\n13000 14000 pcl\n14000 15000 p\n15000 16000 nx\n"
    path = write(rows, "a.phn")
    assert phones(path) == "sil sh ix hh eh jh d ax hh p n".split()
    assert read_phones(path)[1].start_s == pytest.approx(3050 / 16_000)
    with pytest.raises(InputError, match=r"samples .*required seconds"):
        read_labels(write("3000 8140 my\n8180 15520 mother\n15520 29920 moved\n", "a.txt"))


SPEAKERS = {case["file"]: case["content"] for case in LABEL_CASES.values() if "speakers" in case}


def test_textgrids_as_people_spell_them(write: Any) -> None:
    plain = grid(words=[(0.5, 1.5, "mama"), (1.5, 2, "")])
    for text in (f'! of "Anna", 5\n\n{plain}', plain.replace(".5", ",5"), plain.replace("\n", " ! 1\n")):
        assert times(write(text, "a.TextGrid")) == [(0.5, 1.5)]
    with pytest.raises(InputError, match="in order of time"):
        read_transcript(write('"Praat chronological TextGrid text file"\n0 2\n', "a.TextGrid"))


def test_times_of_elan_are_those_of_its_recording(write: Any, caplog: pytest.LogCaptureFixture) -> None:
    for unit in ("milliseconds", "PAL-frames"):
        media = (
            f'<HEADER TIME_UNITS="{unit}"><MEDIA_DESCRIPTOR MEDIA_URL="a.wav" TIME_ORIGIN="1000"/></HEADER><TIME_ORDER>'
        )
        path = write(SPEAKERS["a.eaf"].replace("<TIME_ORDER>", media).encode("utf-16"), "a.eaf")
        if unit == "milliseconds":
            assert timed(path, speaker="bob").lines[0].start_s == pytest.approx(2)
            assert "1.00 s after the start of a.wav" in caplog.text
        else:
            with pytest.raises(InputError, match="PAL-frames, required milliseconds"):
                read_transcript(path)


@pytest.mark.parametrize("name", SPEAKERS)
def test_a_speaker_is_chosen_and_several_are_named(write: Any, caplog: pytest.LogCaptureFixture, name: str) -> None:
    path = write(SPEAKERS[name], name)
    assert words(path, speaker="ann") == words(path, tier="ANN") == "mama"
    assert not caplog.messages
    assert words(path) == "mama papa"
    assert "ann, bob" in caplog.text
    with pytest.raises(InputError, match=r"no speaker 'eve'; it has: 'ann', 'bob'"):
        read_transcript(path, speaker="eve")


def test_phones_of_a_speaker_are_chosen_by_the_request_too(write: Any, tmp_path: Path) -> None:
    for path in (write(SPEAKERS[name], name) for name in ("a.TextGrid", "mfa.json")):
        assert phones(path, speaker="bob") == phones(path, tier="bob - phones") == ["p", "aa"]
        assert phones(path) == ["m", "aa", "p", "aa"]  # who began goes on
        assert list_speakers(path) == ("ann", "bob")
        request = Request(tmp_path / "a.wav", units=path, speaker="bob")
        units = read_request(request).units
        assert units is not None
        assert [span.label.word for span in units] == ["papa", "papa"]
        assert read_request(request).speaker == ""
    assert read_request(Request(tmp_path / "a.wav", units=path, tier="ann", speaker="s1")).speaker == "s1"


def test_of_versions_of_a_text_the_first_is_read(write: Any, caplog: pytest.LogCaptureFixture) -> None:
    path = write(grid(w=[(0, 1, "mama")], deutsch=[(0, 1, "mutter")]), "a.TextGrid")
    assert words(path) == "mama"
    assert "deutsch" in caplog.text
    assert words(path, tier="deutsch") == "mutter"
    assert words(write(grid(Mots=[(0, 1, " mama ")], syllables=[(0, 1, "ma")]), "b.TextGrid")) == "mama"


NOISE = ["<breath>", "[laughs]", "(coughs)", "{sl}", "<eps>", "sil", "***", "=", "♪", "<SIL>", "&=laughs", "xxx", "spn"]
NOISE += ["<unk>", "[unintelligible]", "+NOISE+", "*coughs*", "<|noise|>"]


def test_no_form_of_words_speaks_what_is_no_word(write: Any) -> None:
    rows = [(i / 4, (i + 1) / 4, text) for i, text in enumerate([*NOISE, "mama", "%uh"])]
    whisper = [{"word": text, "start": a, "end": b} for a, b, text in rows]
    mfa = {"words": {"entries": [list(row) for row in rows]}}
    clock = "00:00:{:06.3f} --> 00:00:{:06.3f}\n{}\n\n"
    for name, content in {
        "a.TextGrid": grid(9, words=rows),
        "b.json": {"segments": [{"start": 0, "end": 9, "text": "", "words": whisper}]},
        "c.json": {"tiers": mfa},
        "d.csv": "Begin,End,Label,Type\n" + "".join(f'{a},{b},"{text}",words\n' for a, b, text in rows),
        "e.txt": "".join(f"{a:.2f}\t{b:.2f}\t{text}\n" for a, b, text in rows),
        "f.ctm": "".join(f"take 1 {a:.2f} {b - a:.2f} {text}\n" for a, b, text in rows),
        "g.vtt": "WEBVTT\n\n" + "".join(clock.format(*row) for row in rows if row[2] not in ("sil", "spn")),
    }.items():
        assert words(write(content, name)) == "mama uh", name


def test_times_that_are_none_are_missing(write: Any) -> None:
    for start, end in ((math.nan, math.nan), (None, None), (math.inf, -math.inf), ("NaN", ""), (-5, None)):
        word = {"word": "big", "start": start, "end": end}
        assert times(write({"segments": [{"start": 0, "end": 2, "text": "", "words": [word]}]})) == [(None, None)]
    assert times(CASES / "word-time-nan.json")[1] == (None, None)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16", "utf-32", "utf-8-sig"])
def test_every_form_may_be_wide_text(write: Any, encoding: str) -> None:
    for content in (
        grid(words=[(0, 1, "mama")]),
        "00:01,000 --> 00:02,000\r\nmama\r\n",
        '[{"word": "mama", "start": 1}]',
    ):
        assert words(write(content.encode(encoding), "a.txt")) == "mama"
    assert read_transcript(write("mama went home".encode(encoding), "a.txt")) == "mama went home"


XSAMPA = {"4": "d", "{": "ae", "3`": "er", "@U": "ow", "t_h": "t", '"i:': "iy", "r\\": "r", "n=": "en", "tS": "ch"}


def test_xsampa_is_read_where_it_makes_sense(write: Any) -> None:
    rows = [(i / 10, (i + 1) / 10, label.replace('"', '""')) for i, label in enumerate(XSAMPA)]
    assert phones(write(grid(phones=rows), "a.TextGrid")) == list(XSAMPA.values())


@pytest.mark.parametrize(("start", "end"), [("start_offset", "end_offset"), ("start", "end")])
def test_frames_are_refused(write: Any, start: str, end: str) -> None:
    with pytest.raises(InputError, match="frames"):
        read_transcript(write([{"word": w, start: round(25 * a), end: round(25 * b)} for w, a, b in W]))


def test_minus_one_is_no_time_and_marked_sounds_are_not_said(write: Any) -> None:
    rows = [{"word": w, "start": a, "end": b} for w, a, b in (*W, ("mama", -1, -1), ("~SIL", 2, 3), ("%noise", 3, 4))]
    path = write(rows)
    assert words(path) == "hello big moon mama"
    assert times(path)[-1] == (None, None)
