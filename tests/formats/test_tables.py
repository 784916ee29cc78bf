"""Takes of Live Link Face: the app's own columns, and times as Unreal's importer reads them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.formats import read_motion
from lipmotion.formats.base import write_motion
from lipmotion.formats.tables import CURVES, timecode
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS
from lipmotion.types import WEIGHT, Channel, Generation, Motion, StateTrace, Timeline


def test_the_table_is_as_specified(tmp_path, generation):
    path = tmp_path / "a.csv"
    write_motion(path, generation, source={}, model={})
    lines = path.read_text(encoding="utf-8").split("\n")
    assert lines[0] == "time_s,opening,x_17"
    assert lines[4] == "0.03,0.00000,0.12346"
    assert lines[-1] == ""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    assert table[:, 0] == pytest.approx(np.arange(101) / 100)
    assert table[:, 1:] == pytest.approx(generation.motion.values, abs=5.1e-6)


def test_a_table_saved_by_a_spreadsheet_is_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("\ufefftime_s,opening\r\n0,0.1\r\n0.04,0.2\r\n".encode())
    motion, units = read_motion(path)
    assert motion.rate_hz == 25
    assert motion["opening"].tolist() == [0.1, 0.2]
    assert len(units) == 0


WRONG = [
    ("time_s\n0\n", "first line is 'time_s'"),
    ("opening\n0\n", "first line is 'opening', required 'time_s,opening"),
    ("time_s,opening\n0,a\n0.1,b\n", "not a table of numbers"),
    ("time_s,opening\n0,1\n0.1\n", "not a table of numbers"),
    ("time_s,opening\n0,1,2\n0.1,1,2\n", "required 2 numbers in each"),
    ("time_s,opening\n0,1\n", "fewer than two rows"),
    ("time_s,opening\n0.1,1\n0.2,1\n", "begin at 0"),
    ("time_s,opening\n0,1\n0.1,1\n0.3,1\n", "even steps"),
    ("time_s,opening\n0,1\n0,1\n", "even steps"),
    ("time_s,opening\n0,1\ninf,1\n", "values that are no times, required seconds up to"),
    ("time_s,opening\n0,1\n1,nan\n", "1 values that are not finite, the first is 'opening' in frame 1"),
    ("time_s,opening,opening\n0,1,1\n0.1,1,1\n", "names repeat"),
    ("time_s,jawOpen\n0,0\n0.1,55\n", "jawOpen goes up to 55, required 0 to 1; divide percent by 100"),
    *(
        (f"time_s,{field}\n0,1\n1,1\n", "begins as a spreadsheet's formula")
        for field in ("=1", "@A", "-1", "+x", "\t=1")
    ),
    ("time,jaw\n0,1\n", "1 rows with values, required two or more"),
    ("time,jaw\n0,1\n0,2\n", "1 rows with values, required two or more"),
    ("time,jaw\n" + "0,1\n" * 5 + "1,1\n", "4 of 6 rows are not later than those before, as row 2"),
    ("time,jaw\n0,inf\n1,nan\n", "0 rows with values"),
    ("frame,jaw\n0,1\n1,1\n", "first line is 'frame,jaw', required .* a column of times"),
    ("time,jaw\nsoon,1\n1,1\n", "line 2: could not convert"),
    ("time,jaw\n0,1\n0.01,1\n0.02,1\n0.03,1\n99,1\n", "most of the time there are none; cut the take"),
]


def test_what_is_wrong_is_said(tmp_path):
    path = tmp_path / "a.csv"
    for text, message in WRONG:
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=message):
            read_motion(path)


def test_names_that_other_separators_would_part_are_refused_and_odd_ones_come_back(tmp_path, generation):
    path = tmp_path / "a.csv"

    def written(name: str) -> None:
        odd = Motion(generation.motion.values[:, :1], 100.0, (Channel(name),))
        write_motion(path, replace(generation, motion=odd), source={}, model={})

    for name in ("a,b", 'a"b', "a\nb", "a;b", "a\tb", "a\u2028b", "a\x1bb"):
        with pytest.raises(ExportError, match=r"does not fit in a table; write .json or .npz"):
            written(name)
        assert not list(tmp_path.iterdir())
    for name in ("jaw open", "Mouth (L)", "a=b", "p1.x", "öffnen", "a|b", "x-y", "'x"):
        written(name)
        assert read_motion(path)[0].names == (name,)


def test_a_line_without_end_is_not_read_whole(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s," + "a," * 600_000 + "b\n0,1\n")
    with pytest.raises(InputError, match="fields, required"):
        read_motion(path)


@pytest.mark.parametrize(
    ("head", "times"),
    [("time", [5.0, 5.5, 6.0]), ("Timestamp", [0, 0.5, 1.0]), ("time_ms", [100, 600, 1100]), (" t ", [0, 0.5, 1])],
)
def test_tables_of_other_programs_begin_with_their_first_row(tmp_path, head, times):
    path = tmp_path / "a.csv"
    path.write_text(f"{head}, jawOpen,chin\n" + "".join(f"{t},{n},{n}\n" for n, t in enumerate(times)))
    motion, _ = read_motion(path)
    assert motion.rate_hz == pytest.approx(2.0)
    assert motion.channels == (Channel("jawOpen", "weight"), Channel("chin"))
    assert motion["chin"].tolist() == [0, 1, 2]


def test_uneven_times_of_other_programs_are_evened_out(tmp_path):
    chance = np.random.default_rng(4)
    times_s = np.sort(np.arange(300) / 60 + chance.uniform(-0.004, 0.004, 300))
    path = tmp_path / "a.csv"
    path.write_text("time,jaw\n" + "".join(f"{t},{t - times_s[0]}\n" for t in times_s))
    motion, _ = read_motion(path)
    assert motion.rate_hz == 60
    np.testing.assert_allclose(motion["jaw"][:-1], motion.time_s[:-1], atol=1e-9)


APP = (
    "Timecode,BlendshapeCount,EyeBlinkLeft,EyeLookDownLeft,EyeLookInLeft,EyeLookOutLeft,EyeLookUpLeft,EyeSquintLeft,"
    "EyeWideLeft,EyeBlinkRight,EyeLookDownRight,EyeLookInRight,EyeLookOutRight,EyeLookUpRight,EyeSquintRight,"
    "EyeWideRight,JawForward,JawRight,JawLeft,JawOpen,MouthClose,MouthFunnel,MouthPucker,MouthRight,MouthLeft,"
    "MouthSmileLeft,MouthSmileRight,MouthFrownLeft,MouthFrownRight,MouthDimpleLeft,MouthDimpleRight,"
    "MouthStretchLeft,MouthStretchRight,MouthRollLower,MouthRollUpper,MouthShrugLower,MouthShrugUpper,"
    "MouthPressLeft,MouthPressRight,MouthLowerDownLeft,MouthLowerDownRight,MouthUpperUpLeft,MouthUpperUpRight,"
    "BrowDownLeft,BrowDownRight,BrowInnerUp,BrowOuterUpLeft,BrowOuterUpRight,CheekPuff,CheekSquintLeft,"
    "CheekSquintRight,NoseSneerLeft,NoseSneerRight,TongueOut,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,"
    "LeftEyeRoll,RightEyeYaw,RightEyePitch,RightEyeRoll"
)
"""The first line of a take as the app records it."""


def generation(rate_hz: float, count: int = 61) -> Generation:
    rng = np.random.default_rng(1)
    names = (*ARKIT_MOUTH, *ARKIT_OTHERS, "headYaw", "opening")
    moved = Motion(rng.random((count, len(names))), rate_hz, tuple(Channel(name, WEIGHT) for name in names))
    return Generation(moved, np.zeros(moved.values.shape), Timeline(()), StateTrace(("a",), np.zeros(count, np.intp)))


def as_unreal_reads(path: Path) -> tuple[list[str], list[float], np.ndarray]:
    """Return names, times and values by the rules of Unreal's importer (LiveLinkFaceImporterFactory, UE 5)."""
    lines = path.read_text().splitlines()
    keys = lines[0].split(",")
    assert keys[0].lower() == "timecode"
    assert keys[1].lower() == "blendshapecount"
    times, rows = [], []
    for line in lines[1:]:
        fields = line.split(",")
        assert len(fields) == len(keys)
        hours, minutes, seconds, frames = fields[0].split(":")
        times.append(int(hours) * 3600 + int(minutes) * 60 + int(seconds) + float(frames) / 60.0)
        rows.append([float(field) for field in fields[2:]])
    return keys[2:], times, np.array(rows)


def test_the_columns_are_those_of_the_app(tmp_path: Path) -> None:
    write_motion(tmp_path / "a.livelink.csv", generation(60.0), source={}, model={})
    lines = (tmp_path / "a.livelink.csv").read_text().splitlines()
    assert lines[0] == APP
    assert len(CURVES) == 61
    assert all(line.split(",")[1] == "61" and line.count(",") == 62 for line in lines[1:])


@pytest.mark.parametrize("rate_hz", [29.97, 100.0])
def test_unreal_reads_the_same_times_and_values(tmp_path: Path, rate_hz: float) -> None:
    written = generation(rate_hz)
    write_motion(tmp_path / "a.livelink.csv", written, source={}, model={})
    names, times, values = as_unreal_reads(tmp_path / "a.livelink.csv")
    assert times == pytest.approx(written.motion.time_s.tolist(), abs=1e-5)
    for column, name in enumerate(names):
        own = name[0].lower() + name[1:]
        wanted = written.motion[own] if own in written.motion.names else np.zeros(len(times))
        assert values[:, column] == pytest.approx(wanted, abs=1e-6)
    assert "opening" not in (tmp_path / "a.livelink.csv").read_text()


def test_times_carry_over() -> None:
    codes = {0.999999999: "00:00:01:00.000", 1 / 60: "00:00:00:01.000", 59.99: "00:00:59:59.400"}
    codes |= {3600 + 59.5: "01:00:59:30.000", 2 * 3600 + 5 * 60: "02:05:00:00.000"}
    assert {time_s: timecode(time_s) for time_s in codes} == codes
