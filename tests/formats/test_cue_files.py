"""Each format is read by a small parser that reads it as its consumers do."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from formats.cue_examples import result, spoken
from lipmotion import CueSheet
from lipmotion.articulation.cue_sheets import choose_cues
from lipmotion.errors import ExportError
from lipmotion.formats.cues import CUE_FORMATS, format_of, write_cue_file
from lipmotion.testing.toy import ToySentence
from lipmotion.types import Channel, Motion, Timeline
from lipmotion.units.visemes import SHAPES

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


def test_what_is_written_is_read(sheet: CueSheet) -> None:
    for form, read in [("tsv", read_tsv), ("json", read_json), ("xml", read_xml)]:
        for name in NAMES:
            text = CUE_FORMATS[form].text(sheet, name)
            assert read(text) == rows(sheet)
            assert text.isascii()
            assert text.endswith("\n")


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


def test_the_last_line_of_tsv_is_the_end_at_rest(sheet: CueSheet) -> None:
    lines = CUE_FORMATS["tsv"].text(sheet, "").splitlines()
    assert lines[-1] == f"{sheet.duration_s:.2f}\tX"
    assert all(re.fullmatch(r"\d+\.\d\d\t[A-HX]", line) for line in lines)


def test_rest_without_x() -> None:
    sheet = choose_cues(spoken("b aa b"), optional="")
    assert CUE_FORMATS["tsv"].text(sheet, "").splitlines()[-1] == "0.90\tA"
    assert CUE_FORMATS["dat"].text(sheet, "").splitlines()[-1].endswith(" MBP")


def test_nothing_is_one_cue_of_no_length(empty: CueSheet) -> None:
    assert CUE_FORMATS["tsv"].text(empty, "") == "0.00\tX\n0.00\tX\n"
    assert CUE_FORMATS["dat"].text(empty, "") == "MohoSwitch1\n1 rest\n2 rest\n"
    assert read_json(CUE_FORMATS["json"].text(empty, "")) == [(0.0, 0.0, "X")]
    assert read_xml(CUE_FORMATS["xml"].text(empty, "")) == [(0.0, 0.0, "X")]


def test_metadata(sheet: CueSheet) -> None:
    for name in NAMES:
        document = json.loads(CUE_FORMATS["json"].text(sheet, name))
        assert document["metadata"] == {"soundFile": name, "duration": sheet.duration_s}
        assert list(document) == ["metadata", "mouthCues"]
        root = ElementTree.fromstring(CUE_FORMATS["xml"].text(sheet, name))  # noqa: S314
        assert float(root.findtext("metadata/duration") or "") == sheet.duration_s
        said = root.findtext("metadata/soundFile") or ""
        assert said == name.replace("\x07", "\\x07").replace("\x00", "\\x00")


def test_files(sheet: CueSheet, tmp_path: Path) -> None:
    for name, form in CUE_FORMATS.items():
        path = tmp_path / f"Größe.{name.upper()}"
        write_cue_file(path, sheet, "a.wav", format_of(path))
        assert path.read_bytes().decode() == form.text(sheet, "a.wav")


def test_a_suffix_that_is_no_format() -> None:
    for name in ("a.txt", "a"):
        with pytest.raises(ExportError, match=r"unknown cue format .*; required one of: \.tsv \.xml \.json \.dat"):
            format_of(Path(name))
