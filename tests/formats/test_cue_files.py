import json
import math
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import programs
from formats.examples import result, spoken
from lipmotion import CueSheet, read_motion
from lipmotion.articulation.cue_sheets import choose_cues
from lipmotion.articulation.mouth import find_mouth
from lipmotion.errors import ExportError, InputError
from lipmotion.formats.cues import CUE_FORMATS, UNKNOWN, convert_cues, find_format, read_cues, write_cue_file
from lipmotion.pipeline.outputs.motion_files import read_generation
from lipmotion.types import Channel, Motion, Span, Timeline, Unit
from lipmotion.units.phones import SHAPES
from testing.toy import ToySentence

NAMES = ["hi.wav", "C:\\av\\hi.wav", 'Größe & <"tea\'s"> 茶 😀.wav', "line\nbreak\ttab.wav", "bell\x07\x00.wav", ""]
OPENTOONZ = {"ai", "e", "o", "u", "fv", "l", "mbp", "wq", "other", "etc", "rest"}
Row = tuple[float, float, str]


@pytest.fixture(params=[1, 23.976, 25, 60])
def sheet(request: pytest.FixtureRequest, toy_sentence: ToySentence) -> CueSheet:
    return choose_cues(result(toy_sentence.units), request.param)


@pytest.fixture
def empty() -> CueSheet:
    return choose_cues(result(Timeline(()), Motion(np.zeros((0, 1)), 100.0, (Channel("opening"),))))


def rows(sheet: CueSheet) -> list[Row]:
    return [(cue.start_s, cue.end_s, cue.label) for cue in sheet.cues]


def read_tsv(text: str) -> list[Row]:
    """Split at tabs; a cue ends where the next begins, the last line only ends."""
    lines = [line.split("\t") for line in text.splitlines()]
    times = [float(time) for time, _ in lines]
    return [(start, end, shape) for start, end, (_, shape) in zip(times, times[1:], lines, strict=False)]


def read_json(text: str) -> list[Row]:
    """Read it as the Blender add-ons do."""
    return [(cue["start"], cue["end"], cue["value"]) for cue in json.loads(text)["mouthCues"]]


def read_xml(text: str) -> list[Row]:
    root = ElementTree.fromstring(text.encode())  # noqa: S314
    assert [child.tag for child in root] == ["metadata", "mouthCues"]
    assert root.tag == "rhubarbResult"
    found = root.findall("mouthCues/mouthCue")
    return [(float(cue.attrib["start"]), float(cue.attrib["end"]), cue.text or "") for cue in found]


def is_integer(token: str) -> bool:
    return re.fullmatch(r"[+-]?\d+", token) is not None


def shown_by_opentoonz(text: str) -> list[str]:
    """Return the drawing of every frame: lines of two tokens parted by one space, a number and no number, count."""
    tokens = [line.split(" ") for line in text.splitlines()]
    lines = [(int(t[0]), t[1].lower()) for t in tokens if len(t) == 2 and is_integer(t[0]) and not is_integer(t[1])]
    frames: list[str] = []
    for (_, name), (until, _) in pairwise(lines):
        assert name in OPENTOONZ
        frames += [name] * (until - 1 - len(frames))
    return frames


def test_what_is_written_is_read(sheet: CueSheet, tmp_path: Path) -> None:
    for form, read in [("tsv", read_tsv), ("json", read_json), ("xml", read_xml)]:
        for name in NAMES:
            text = CUE_FORMATS[form].text(sheet, name)
            assert read(text) == rows(sheet)
            assert text.isascii()
            assert text.endswith("\n")
    lines = CUE_FORMATS["tsv"].text(sheet, "").splitlines()
    assert lines[-1] == f"{sheet.duration_s:.2f}\tX"
    assert all(re.fullmatch(r"\d+\.\d\d\t[A-HX]", line) for line in lines)
    for name in NAMES:
        document = json.loads(CUE_FORMATS["json"].text(sheet, name))
        assert document["metadata"] == {"soundFile": name, "duration": sheet.duration_s}
        assert list(document) == ["metadata", "mouthCues"]
        root = ElementTree.fromstring(CUE_FORMATS["xml"].text(sheet, name))  # noqa: S314
        assert float(root.findtext("metadata/duration") or "") == sheet.duration_s
        assert (root.findtext("metadata/soundFile") or "") == name.replace("\x07", "\\x07").replace("\x00", "\\x00")
    for name, kind in CUE_FORMATS.items():
        path = tmp_path / f"Größe.{name.upper()}"
        write_cue_file(path, sheet, "a.wav", find_format(path))
        assert path.read_bytes().decode() == kind.text(sheet, "a.wav")
    for name in ("a.txt", "a"):
        with pytest.raises(ExportError, match=r"unknown cue format .*; required one of: \.tsv \.xml \.json \.dat"):
            find_format(Path(name))


def test_what_opentoonz_shows_in_every_frame(sheet: CueSheet) -> None:
    text = CUE_FORMATS["dat"].text(sheet, "hi.wav")
    assert text.startswith("MohoSwitch1\n")
    frames = [int(line.split(" ")[0]) for line in text.splitlines()[1:]]
    assert frames[0] == 1
    assert all(before < after for before, after in pairwise(frames))
    shown = shown_by_opentoonz(text)
    assert len(shown) == pytest.approx(sheet.duration_s * sheet.fps, abs=1.01)
    for frame, name in enumerate(shown):
        (label,) = [c.label for c in sheet.cues if int(c.start_s * sheet.fps) <= frame < _end(sheet, c.end_s)]
        assert name == SHAPES[label].blair.lower()


def _end(sheet: CueSheet, end_s: float) -> float:
    return np.inf if end_s == sheet.duration_s else int(end_s * sheet.fps)


def test_nothing_is_one_cue_of_no_length_and_rest_may_have_no_shape_of_its_own(empty: CueSheet) -> None:
    assert CUE_FORMATS["tsv"].text(empty, "") == "0.00\tX\n0.00\tX\n"
    assert CUE_FORMATS["dat"].text(empty, "") == "MohoSwitch1\n1 rest\n2 rest\n"
    assert read_json(CUE_FORMATS["json"].text(empty, "")) == [(0.0, 0.0, "X")]
    assert read_xml(CUE_FORMATS["xml"].text(empty, "")) == [(0.0, 0.0, "X")]
    sheet = choose_cues(spoken("b aa b"), optional="")
    assert CUE_FORMATS["tsv"].text(sheet, "").splitlines()[-1] == "0.90\tA"
    assert CUE_FORMATS["dat"].text(sheet, "").splitlines()[-1].endswith(" MBP")
    _, phrases = read_project(CUE_FORMATS["pgo"].text(sheet, ""))
    assert {shown(phrases, frame) for frame in range(20)} <= {shape.blair for shape in SHAPES.values()} - {"rest"}


Word = tuple[str, int, int, list[tuple[int, str]]]


def read_project(text: str) -> tuple[dict[str, str], list[tuple[str, int, int, list[Word]]]]:
    """Read line by line, and parts of lines at spaces; what is indented is stripped, as Papagayo does."""
    lines = iter(text.splitlines())
    assert next(lines) == "lipsync version 1"
    about = {name: next(lines).strip() for name in ("sound", "fps", "frames", "voices", "voice", "text")}
    phrases = []
    for _ in range(int(next(lines))):
        said, first, last = next(lines).strip(), int(next(lines)), int(next(lines))
        words: list[Word] = []
        for _ in range(int(next(lines))):
            word, start, end, count = next(lines).split()
            shapes = [next(lines).split() for _ in range(int(count))]
            words.append((word, int(start), int(end), [(int(frame), name) for frame, name in shapes]))
        phrases.append((said, first, last, words))
    assert next(lines, None) is None
    return about, phrases


def shown(phrases: list[tuple[str, int, int, list[Word]]], frame: int) -> str:
    """Return what Papagayo shows in a frame: the last shape of the word that the frame is in, else rest."""
    for _, first, last, words in phrases:
        if first <= frame <= last:
            for _, start, end, shapes in words:
                if start <= frame <= end:
                    return next((name for at, name in reversed(shapes) if frame >= at), "rest")
    return "rest"


def said(sentence: ToySentence) -> Timeline[Unit]:
    """Return the units with a word for every three phones that are no silence."""
    spans, count = [], 0
    for span in sentence.units:
        count += span.label.phone != "sil"
        word = "" if span.label.phone == "sil" else f"word{count // 3}"
        spans.append(replace(span, label=replace(span.label, word=word)))
    return Timeline(tuple(spans))


@pytest.mark.parametrize("fps", [12.0, 25.0])
def test_every_frame_shows_the_cue_and_words_follow_each_other(toy_sentence: ToySentence, fps: float) -> None:
    sheet = choose_cues(result(said(toy_sentence)), fps)
    about, phrases = read_project(CUE_FORMATS["pgo"].text(sheet, "a b.wav"))
    assert (about["sound"], about["fps"], about["voices"]) == ("a b.wav", f"{fps:.0f}", "1")
    frames = shown_by_opentoonz(CUE_FORMATS["dat"].text(sheet, ""))
    assert int(about["frames"]) == pytest.approx(len(frames), abs=1)
    assert [shown(phrases, frame).lower() for frame in range(len(frames))] == frames
    words = [word for *_, words in phrases for word, *_ in words]
    assert {part for word in words for part in word.split("-")} <= {f"word{n}" for n in range(99)} | {UNKNOWN}
    assert len(words) > 1
    for text, first, last, said_in in phrases:
        assert text == " ".join(word for word, *_ in said_in)
        assert (said_in[0][1], said_in[-1][2]) == (first, last)
        assert all(after[1] == before[2] + 1 for before, after in pairwise(said_in))
        assert all(start <= end and shapes[0][0] == start for _, start, end, shapes in said_in)


def test_words_of_less_than_a_frame_are_joined() -> None:
    base = spoken("b aa b aa b")
    words = Timeline(tuple(Span(0.3 + 0.01 * n, 0.31 + 0.01 * n, f"w{n}") for n in range(4)))
    _, phrases = read_project(CUE_FORMATS["pgo"].text(replace(choose_cues(base), words=words), ""))
    found = [word for *_, words in phrases for word, *_ in words]
    assert len(found) < 4
    assert "-".join(found) == "w0-w1-w2-w3"


def test_speech_without_words_and_nothing_at_all() -> None:
    _, phrases = read_project(CUE_FORMATS["pgo"].text(choose_cues(spoken("b aa b")), ""))
    assert [word for *_, words in phrases for word, *_ in words] == [UNKNOWN]
    nothing = CueSheet(Timeline((Span(0.0, 0.0, "X"),)), 24.0, "ABCDEFX")
    about, phrases = read_project(CUE_FORMATS["pgo"].text(nothing, "line\nbreak"))
    assert (phrases, about["sound"]) == ([], "line break")


@pytest.mark.parametrize(("fps", "whole"), [(29.97, 30), (12.5, 13)])
def test_times_stay_at_a_rate_that_is_not_whole(fps: float, whole: int) -> None:
    """After ten minutes, 29.97 frames a second would be 18 frames behind 30."""
    times_s = [frame / fps for frame in (0, 1, *range(int(600 * fps), int(600 * fps) + 6))]
    starts = [math.ceil(time_s * 100) / 100 for time_s in times_s]
    spans = [Span(start, end, "XADAXADA"[n]) for n, (start, end) in enumerate(pairwise([*starts, 601.0]))]
    about, phrases = read_project(CUE_FORMATS["pgo"].text(CueSheet(Timeline(tuple(spans)), fps, "ABCDEFX"), "a.wav"))
    assert about["fps"] == str(whole)
    for span in spans:
        assert shown(phrases, int(span.start_s * whole)) == SHAPES[span.label].blair


@pytest.fixture
def puppet() -> CueSheet:
    return choose_cues(spoken("m aa m uw"), optional="GX")


def test_every_cue_is_a_key_of_an_attachment_that_there_is(puppet: CueSheet, tmp_path: Path) -> None:
    path = tmp_path / "a.spine.json"
    write_cue_file(path, puppet, "talk.wav", find_format(path))
    document = json.loads(path.read_text(encoding="ascii"))
    keys = document["animations"]["speech"]["slots"]["mouth"]["attachment"]
    expected = [(cue.start_s, cue.label) for cue in puppet.cues] + [(puppet.duration_s, "X")]
    assert [(key["time"], key["name"]) for key in keys] == expected
    assert "A" in {key["name"] for key in keys} <= {*document["skins"][0]["attachments"]["mouth"]} == {*"ABCDEFGX"}
    assert document["slots"] == [{"name": "mouth", "bone": "root", "attachment": "X"}]
    assert document["events"] == {"speech": {"audio": "talk.wav"}}
    write_cue_file(path, puppet, "", "spine.json")
    assert "events" not in json.loads(path.read_text(encoding="ascii"))


@pytest.mark.long
@pytest.mark.skipif(not programs.node_package("@esotericsoftware/spine-core"), reason="no spine-core")
def test_spine_reads_it(puppet: CueSheet, tmp_path: Path) -> None:
    write_cue_file(tmp_path / "a.spine.json", puppet, "talk.wav", "spine.json")
    found = programs.run_node("spine_keys.mjs", "@esotericsoftware/spine-core", tmp_path / "a.spine.json")
    assert (found["slot"], found["attachments"], found["audio"]) == ("mouth", [*"ABCDEFGX"], ["talk.wav"])
    assert found["names"] == [*(cue.label for cue in puppet.cues), "X"]
    assert found["times"] == pytest.approx([*(cue.start_s for cue in puppet.cues), puppet.duration_s], abs=1e-5)


SHOWN = [("X", 0.5), ("A", 0.625), ("D", 0.875), ("G", 1.0), ("C", 1.25), ("F", 1.5), ("H", 1.625), ("B", 1.75),
         ("E", 2.0), ("X", 2.5)]  # fmt: skip
"""Shapes and their ends, whole frames at 24 a second."""


@pytest.fixture
def motion_sheet() -> CueSheet:
    starts = [0.0, *(end_s for _, end_s in SHOWN)]
    cues = [Span(start_s, end_s, name) for start_s, (name, end_s) in zip(starts, SHOWN, strict=False)]
    words = Timeline((Span(0.5, 1.0, "map"), Span(1.0, 2.0, "well")))
    return CueSheet(Timeline(tuple(cues)), 24.0, "".join(SHAPES), words)


@pytest.mark.parametrize("form", [name for name, form in CUE_FORMATS.items() if form.parse])
def test_motion_of_cues_that_are_written(form: str, motion_sheet: CueSheet, tmp_path: Path) -> None:
    write_cue_file(tmp_path / f"a.{form}", motion_sheet, "a.wav", form)
    again = read_cues(tmp_path / f"a.{form}")
    assert [cue.label for cue in again.cues] == [name for name, _ in SHOWN]
    ends_s = [end_s for _, end_s in SHOWN]
    assert [cue.end_s for cue in again.cues] == pytest.approx(ends_s, abs=1 / 24 if form == "pgo" else 0.011)
    motion, units = read_motion(tmp_path / f"a.{form}")
    assert [span.label.phone for span in units] == "sil p aa f eh uw l s ao sil".split()
    assert {span.label.word for span in units} == ({"", "map", "well"} if form == "pgo" else {""})
    assert motion.time_s[-1] == pytest.approx(2.5, abs=1 / 24)


@pytest.mark.parametrize(
    ("times", "scale"), [("0 1000 2000", 1000.0), ("0 80 160", 1000.0), ("0 2 4", 1.0), ("0 99.5 199", 1.0)]
)
def test_milliseconds_are_read(write: Any, times: str, scale: float, caplog: pytest.LogCaptureFixture) -> None:
    starts = times.split()
    found = read_cues(write("".join(map("{}\t{}\n".format, starts, "XDX")), "a.tsv")).cues
    assert [cue.end_s for cue in found] == pytest.approx([float(time) / scale for time in starts[1:]])
    assert ("milliseconds" in caplog.text) == (scale > 1)


TABLES = json.loads(Path(__file__).with_name("cue_tables.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", TABLES)
def test_cues_of_tables_and_events_of_visemes(write: Any, name: str) -> None:
    motion, units = read_motion(write(TABLES[name], name))
    closes = "A" in TABLES[name] or "PP" in TABLES[name]
    closed = [("sil", 0.0, 0.5), ("p", 0.5, 1.0)] if closes else [("sil", 0.0, 1.0)]
    found = [(span.label.phone, span.start_s, span.end_s) for span in units]
    assert found == [(phone, *map(pytest.approx, times)) for phone, *times in (*closed, ("aa", 1.0, 2.0))]
    assert motion.time_s[-1] == pytest.approx(2.0)


def test_the_mouth_rests_where_a_cue_ends_before_the_next(write: Any) -> None:
    sheet = read_cues(write("start,end,value\n0,0.5,D\n0.9,1.2,A\n1.21,2,D\n", "a.csv"))
    assert [(cue.start_s, cue.label) for cue in sheet.cues] == [(0, "D"), (0.5, "X"), (0.9, "A"), (1.21, "D")]


def test_a_table_of_motion_is_none_of_cues(write: Any) -> None:
    motion, _ = read_motion(write("time_s,opening\n0.00,0.5\n0.01,0.6\n0.02,0.7\n", "a.csv"))
    assert motion.names == ("opening",)


def test_lips_close_in_a_and_are_as_open_as_the_drawings(motion_sheet: CueSheet) -> None:
    mouth = find_mouth(*convert_cues(motion_sheet))
    middle = {name: round(100 * (end_s - 0.0625)) for name, end_s in SHOWN}
    assert mouth.contact[middle["A"]]
    assert mouth.contact[:45].all()
    gaps = [mouth.gap[middle[name]] for name in "FCD"]
    assert gaps == sorted(gaps)
    assert 0.03 < gaps[0] < 0.1 < gaps[2] < 0.3
    assert mouth.tuck[middle["G"]] > 0.8
    assert mouth.protrusion[middle["F"]] > 0.8
    assert np.abs(np.diff(mouth.gap)).max() < 0.05


def test_switch_data_of_rhubarb_has_letters(write: Any, tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_text("MohoSwitch1\n1 X\n13 E\n25 A\n49 X\n")
    assert [cue.label for cue in read_cues(tmp_path / "a.dat").cues] == ["X", "E", "A"]
    found = read_cues(write("MohoSwitch1\n1 rest\n13 E\n25 WQ\n49 rest\n", "a.dat")).cues
    assert [(cue.start_s, cue.label) for cue in found] == [(0, "X"), (0.5, "C"), (1, "F")]


@pytest.mark.parametrize("fps", [12.0, 25.0, 29.97, 60.0])
def test_switch_data_at_any_rate(fps: float, motion_sheet: CueSheet, tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    write_cue_file(path, replace(motion_sheet, fps=fps), "a.wav", "dat")
    again = read_generation(path, rate_hz=fps)
    assert again.motion.time_s[-1] == pytest.approx(2.5, abs=1 / fps + 0.011)
    (closed,) = [span for span in again.units if span.label.phone == "p"]
    assert (closed.start_s, closed.end_s) == pytest.approx((0.5, 0.625), abs=1 / fps)


def test_cues_with_times_need_no_rate(motion_sheet: CueSheet, tmp_path: Path) -> None:
    write_cue_file(tmp_path / "a.tsv", motion_sheet, "a.wav", "tsv")
    with pytest.raises(InputError, match="need no rate"):
        read_generation(tmp_path / "a.tsv", rate_hz=25.0)
    write_cue_file(tmp_path / "a.dat", motion_sheet, "a.wav", "dat")
    with pytest.raises(InputError, match="required 1 to"):
        read_generation(tmp_path / "a.dat", rate_hz=0.0)


@pytest.mark.parametrize(
    ("names", "shapes"),
    [
        ("rest M AA1 F UW2 rest", "XADGFX"),  # the phones of CMU's dictionary, as Papagayo's set of that name
        ("rest MBP AA FV O rest", "XADGEX"),  # Fleming and Dobbs'
        ("rest MBP AI FV WQ rest", "XADGFX"),
        ("x a d g f x", "XADGFX"),
    ],
)
def test_switch_data_with_names_of_other_sets(write: Any, names: str, shapes: str) -> None:
    rows = "".join(f"{1 + 12 * place} {name}\n" for place, name in enumerate(names.split()))
    assert "".join(cue.label for cue in read_cues(write(f"MohoSwitch1\n{rows}", "a.dat")).cues) == shapes[:-1]
