import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import CueSheet, read_motion
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.errors import InputError
from lipmotion.formats.cues import CUE_FORMATS, cue_motion, read_cues, write_cue_file
from lipmotion.pipeline.outputs.motion_files import read_generation
from lipmotion.types import Span, Timeline
from lipmotion.units.phones import SHAPES

SHOWN = [("X", 0.5), ("A", 0.625), ("D", 0.875), ("G", 1.0), ("C", 1.25), ("F", 1.5), ("H", 1.625), ("B", 1.75),
         ("E", 2.0), ("X", 2.5)]  # fmt: skip
"""Shapes and their ends, whole frames at 24 a second."""


@pytest.fixture
def sheet() -> CueSheet:
    starts = [0.0, *(end_s for _, end_s in SHOWN)]
    cues = [Span(start_s, end_s, name) for start_s, (name, end_s) in zip(starts, SHOWN, strict=False)]
    words = Timeline((Span(0.5, 1.0, "map"), Span(1.0, 2.0, "well")))
    return CueSheet(Timeline(tuple(cues)), 24.0, "".join(SHAPES), words)


@pytest.mark.parametrize("form", [name for name, form in CUE_FORMATS.items() if form.parse])
def test_what_is_written_is_read(form: str, sheet: CueSheet, tmp_path: Path) -> None:
    write_cue_file(tmp_path / f"a.{form}", sheet, "a.wav", form)
    again = read_cues(tmp_path / f"a.{form}")
    assert [cue.label for cue in again.cues] == [name for name, _ in SHOWN]
    ends_s = [end_s for _, end_s in SHOWN]
    assert [cue.end_s for cue in again.cues] == pytest.approx(ends_s, abs=1 / 24 if form == "pgo" else 0.011)
    motion, units = read_motion(tmp_path / f"a.{form}")
    assert [span.label.phone for span in units] == "sil p aa f eh uw l s ao sil".split()
    spoken = {span.label.word for span in units}
    assert spoken == ({"", "map", "well"} if form == "pgo" else {""})
    assert motion.time_s[-1] == pytest.approx(2.5, abs=1 / 24)


@pytest.mark.parametrize(
    ("times", "scale"), [("0 1000 2000", 1000.0), ("0 80 160", 1000.0), ("0 2 4", 1.0), ("0 99.5 199", 1.0)]
)
def test_milliseconds_are_read_as_such(
    times: str, scale: float, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    starts = times.split()
    (tmp_path / "a.tsv").write_text("".join(map("{}\t{}\n".format, starts, "XDX")))
    found = read_cues(tmp_path / "a.tsv").cues
    assert [cue.end_s for cue in found] == pytest.approx([float(time) / scale for time in starts[1:]])
    assert ("milliseconds" in caplog.text) == (scale > 1)


TABLES = {
    "clock.csv": "time,mouth\n0:00.00,X\n0:00.50,A\n0:00:01.00,D\n0:02.00,X\n",
    "comma.tsv": "0,00\tX\n0,50\tA\n1,00\tD\n2,00\tX\n",
    "semicolon.csv": "0,0;X\n0,5;A\n1,0;D\n2,0;X\n",
    "commas.csv": "0,00,X\n0,50,A\n1,00,D\n2,00,X\n",
    "quoted.csv": '"0,0","X"\n"0,5","A"\n"1,0","D"\n"2,0","X"\n',
    "spans.csv": "start,end,value\n0,0.5,X\n0.5,1,A\n1,2,D\n",
    "ms.csv": "start,end,value\n0,500,X\n500,1000,A\n1000,2000,D\n",
    "events.json": json.dumps([{"time": t, "viseme": v} for t, v in ((0, "sil"), (0.5, "PP"), (1, "aa"), (2, "sil"))]),
    "visemes.json": json.dumps({"visemes": [
        {"start": f"{t},0", "end": t + 1, "name": f"viseme_{v}"} for t, v in enumerate(("sil", "aa"))]}),
    "comma.json": json.dumps({"mouthCues": [
        {"start": f"{t},0", "end": f"{t + 1},0", "value": v} for t, v in enumerate("XD")]}),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_cues_of_tables_and_events_of_visemes(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(TABLES[name])
    motion, units = read_motion(tmp_path / name)
    closes = "A" in TABLES[name] or "PP" in TABLES[name]
    closed = [("sil", 0.0, 0.5), ("p", 0.5, 1.0)] if closes else [("sil", 0.0, 1.0)]
    found = [(span.label.phone, span.start_s, span.end_s) for span in units]
    assert found == [(phone, *map(pytest.approx, times)) for phone, *times in (*closed, ("aa", 1.0, 2.0))]
    assert motion.time_s[-1] == pytest.approx(2.0)


def test_a_table_of_motion_is_none_of_cues(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time_s,opening\n0.00,0.5\n0.01,0.6\n0.02,0.7\n")
    motion, _ = read_motion(tmp_path / "a.csv")
    assert motion.names == ("opening",)


def test_lips_close_in_a_and_are_as_open_as_the_drawings(sheet: CueSheet) -> None:
    mouth = spoken_mouth(*cue_motion(sheet))
    middle = {name: round(100 * (end_s - 0.0625)) for name, end_s in SHOWN}
    assert mouth.contact[middle["A"]]
    assert mouth.contact[:45].all()
    gaps = [mouth.gap[middle[name]] for name in "FCD"]
    assert gaps == sorted(gaps)
    assert 0.03 < gaps[0] < 0.1 < gaps[2] < 0.3
    assert mouth.tuck[middle["G"]] > 0.8
    assert mouth.protrusion[middle["F"]] > 0.8
    assert np.abs(np.diff(mouth.gap)).max() < 0.05


def test_switch_data_of_rhubarb_has_letters(tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_text("MohoSwitch1\n1 X\n13 E\n25 A\n49 X\n")
    assert [cue.label for cue in read_cues(tmp_path / "a.dat").cues] == ["X", "E", "A"]
    (tmp_path / "a.dat").write_text("MohoSwitch1\n1 rest\n13 E\n25 WQ\n49 rest\n")
    found = read_cues(tmp_path / "a.dat").cues
    assert [(cue.start_s, cue.label) for cue in found] == [(0, "X"), (0.5, "C"), (1, "F")]


ERRORS = {
    "a.tsv": ("0.00\tX\n0.50\tQ\n", "line 2: no mouth shape is 'Q'; the shapes are: a b c d e f g h x"),
    "b.tsv": ("0.00 X\n", "line 1: required a time, a tab and a mouth shape"),
    "c.tsv": ("0.00\tX\nnan\tA\n", "line 2: the time is 'nan', required a number from 0 on"),
    "d.tsv": ("1\tX\n0.5\tA\n2\tX\n", "mouth shape 2 begins at 0.5 s, before the one ahead of it at 1 s"),
    "e.tsv": ("\n", "there is no mouth shape in it"),
    "a.xml": ("<rhubarbResult/>", "there is no mouth shape in it"),
    "b.xml": ('<mouthCue start="0" end="x">A</mouthCue>', "cue 1: the time is 'x'"),
    "a.json": ('{"mouthCues": [{"start": 0}]}', "cue 1: no mouth shape is 'None'"),
    "b.json": ('{"mouthCues": ', "not a file of Rhubarb"),
    "a.dat": ("1 rest\n", "the first line is no MohoSwitch1"),
    "b.dat": ("MohoSwitch1\n1 rest now\n", "line 2: required a frame and a mouth shape"),
    "a.pgo": ("lipsync version 2\n", "the first line is no 'lipsync version 1'"),
    "b.pgo": ("lipsync version 1\na.wav\n24\n", "the project ends after line 3; save it again"),
    "c.pgo": ("lipsync version 1\na.wav\n0\n1\n1\n", "1 voices at 0 frames a second, required one"),
    "d.pgo": ("lipsync version 1\na\n24\n9\n1\nv\nt\n1\np\n0\n8\n1\nhi 0 8\n", "line 13 is 'hi 0 8', required a word"),
}  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_damaged_files_are_refused(name: str, tmp_path: Path) -> None:
    content, message = ERRORS[name]
    (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(message)):
        read_motion(tmp_path / name)
    assert CUE_FORMATS[Path(name).suffix.removeprefix(".")].parse


@pytest.mark.parametrize("fps", [12.0, 25.0, 29.97, 60.0])
def test_switch_data_at_any_rate(fps: float, sheet: CueSheet, tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    write_cue_file(path, replace(sheet, fps=fps), "a.wav", "dat")
    again = read_generation(path, rate_hz=fps)
    assert again.motion.time_s[-1] == pytest.approx(2.5, abs=1 / fps + 0.011)
    (closed,) = [span for span in again.units if span.label.phone == "p"]
    assert (closed.start_s, closed.end_s) == pytest.approx((0.5, 0.625), abs=1 / fps)


def test_cues_with_times_need_no_rate(sheet: CueSheet, tmp_path: Path) -> None:
    write_cue_file(tmp_path / "a.tsv", sheet, "a.wav", "tsv")
    with pytest.raises(InputError, match="need no rate"):
        read_generation(tmp_path / "a.tsv", rate_hz=25.0)
    write_cue_file(tmp_path / "a.dat", sheet, "a.wav", "dat")
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
def test_switch_data_with_names_of_other_sets(names: str, shapes: str, tmp_path: Path) -> None:
    rows = "".join(f"{1 + 12 * place} {name}\n" for place, name in enumerate(names.split()))
    (tmp_path / "a.dat").write_text(f"MohoSwitch1\n{rows}")
    assert "".join(cue.label for cue in read_cues(tmp_path / "a.dat").cues) == shapes[:-1]
