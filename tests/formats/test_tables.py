import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.examples import of_motion, written
from lipmotion import read_motion
from lipmotion.errors import ExportError, InputError
from lipmotion.formats.tables import CURVES, format_timecode, is_live_link_file
from lipmotion.meshes.fitting.blendshape_motion import arkit_weights, with_mouth
from lipmotion.meshes.model.shape_names import ARKIT_52, ARKIT_MOUTH, ARKIT_OTHERS
from lipmotion.types import WEIGHT, Channel, Generation, Motion
from lipmotion_faces.corpus.supplied import SPEECH_CURVES, read_speech_curves
from meshes.live_link_app import COLUMNS, HEAD, write_take


def test_the_table_is_as_specified(tmp_path, generation):
    path = written(tmp_path / "a.csv", generation)
    lines = path.read_text(encoding="utf-8").split("\n")
    assert lines[0] == "time_s,opening,x_17"
    assert lines[4] == "0.03,0.00000,0.12346"
    assert lines[-1] == ""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    assert table[:, 0] == pytest.approx(np.arange(101) / 100)
    assert table[:, 1:] == pytest.approx(generation.motion.values, abs=5.1e-6)


def test_a_first_line_without_end_is_not_read_whole(write):
    with pytest.raises(InputError, match="fields, required"):
        read_motion(write("time_s," + "a," * 600_000 + "b\n0,1\n", "a.csv"))


def test_names_that_other_separators_would_part_are_refused_and_odd_ones_come_back(tmp_path, generation):
    path = tmp_path / "a.csv"

    def write_channel(name: str) -> None:
        written(path, of_motion(Motion(generation.motion.values[:, :1], 100.0, (Channel(name),))))

    for name in ("a,b", 'a"b', "a\nb", "a;b", "a\tb", "a\u2028b", "a\x1bb", " a"):
        with pytest.raises(ExportError, match=r"does not fit in a table; write .json or .npz"):
            write_channel(name)
        assert not list(tmp_path.iterdir())
    for name in ("jaw open", "Mouth (L)", "a=b", "p1.x", "öffnen", "a|b", "x-y", "'x"):
        write_channel(name)
        path.write_text(path.read_text().replace("\n", ",\n"))  # as spreadsheets write it
        assert read_motion(path)[0].names == (name,)


def test_uneven_times_of_other_programs_are_evened_out(write):
    times_s = np.sort(np.arange(300) / 60 + np.random.default_rng(4).uniform(-0.004, 0.004, 300))
    motion, _ = read_motion(write("time,jaw\n" + "".join(f"{t},{t - times_s[0]}\n" for t in times_s), "a.csv"))
    assert motion.rate_hz == 60
    np.testing.assert_allclose(motion["jaw"][:-1], motion.time_s[:-1], atol=1e-9)


def test_rows_that_begin_late_stay_there_and_degrees_are_angles(write, caplog):
    rows = "".join(f"{n},{round(n * 1000 / 60)},{(n == 60) / 2},{20 - n / 60}\n" for n in range(31, 180))
    motion, _ = read_motion(write("frame,timestamp_ms,jawOpen,headyaw\n" + rows, "a.csv"))
    assert (len(motion.values), motion.rate_hz, int(motion["jawOpen"].argmax())) == (180, 60, 60)
    assert motion["headYaw"][60] == pytest.approx(np.deg2rad(19), abs=1e-3)
    assert "31 of 180 rows have no face or lack numbers, at 0.00" in caplog.text
    assert "they are read as degrees" in caplog.text


def all_curves(rate_hz: float, count: int = 61) -> Generation:
    names = (*ARKIT_MOUTH, *ARKIT_OTHERS, "headYaw", "opening")
    values = np.random.default_rng(1).random((count, len(names)))
    return of_motion(Motion(values, rate_hz, tuple(Channel(name, WEIGHT) for name in names)))


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
    lines = written(tmp_path / "a.livelink.csv", all_curves(60.0)).read_text().splitlines()
    assert lines[0] == HEAD.replace("BlendShape", "Blendshape")
    assert len(CURVES) == 61
    assert all(line.split(",")[1] == "61" and line.count(",") == 62 for line in lines[1:])


@pytest.mark.parametrize("rate_hz", [29.97, 100.0])
def test_unreal_reads_the_same_times_and_values(tmp_path: Path, rate_hz: float) -> None:
    given = all_curves(rate_hz)
    names, times, values = as_unreal_reads(written(tmp_path / "a.livelink.csv", given))
    assert times == pytest.approx(given.motion.time_s.tolist(), abs=1e-5)
    for column, name in enumerate(names):
        own = name[0].lower() + name[1:]
        wanted = given.motion[own] if own in given.motion.names else np.zeros(len(times))
        assert values[:, column] == pytest.approx(wanted, abs=1e-6)
    assert "opening" not in (tmp_path / "a.livelink.csv").read_text()


def test_times_carry_over() -> None:
    codes = {0.999999999: "00:00:01:00.000", 1 / 60: "00:00:00:01.000", 59.99: "00:00:59:59.400"}
    codes |= {3600 + 59.5: "01:00:59:30.000", 2 * 3600 + 5 * 60: "02:05:00:00.000"}
    assert {time_s: format_timecode(time_s) for time_s in codes} == codes


RATE_HZ = 60.0


@pytest.fixture
def curves() -> Motion:
    time_s = np.arange(601) / RATE_HZ
    phase = np.linspace(0, 3, len(COLUMNS))
    values = 0.5 + 0.5 * np.sin(2 * np.pi * 1.5 * time_s[:, None] + phase)
    return Motion(values, RATE_HZ, tuple(Channel(name, WEIGHT) for name in COLUMNS))


def row(code: str, *values: object, count: int = 61) -> str:
    held = [*values, *[0] * (61 - len(values))]
    return ",".join(map(str, [code, count, *held]))


def test_a_take_comes_back(tmp_path, curves):
    write_take(tmp_path / "take.csv", curves)
    motion, units = read_motion(tmp_path / "take.csv")
    assert (motion.rate_hz, len(units)) == (60.0, 0)
    assert set(motion.names) == {*ARKIT_MOUTH, *ARKIT_OTHERS} | {name[0].lower() + name[1:] for name in COLUMNS[52:]}
    assert {c.unit for c in motion.channels if not c.name.endswith(("Yaw", "Pitch", "Roll"))} == {WEIGHT}
    assert {c.unit for c in motion.channels if c.name.endswith(("Yaw", "Pitch", "Roll"))} == {"radian"}
    np.testing.assert_allclose(motion.values, curves.values, atol=6e-11)


@pytest.mark.parametrize("rate", [24.0, 25.0, 30.0, 60.0])
@pytest.mark.parametrize("start_s", [0.0, 3_599.5, 86_395.0])
def test_the_rate_of_the_timecode_is_found_and_midnight_passed(tmp_path, curves, rate, start_s):
    write_take(tmp_path / "take.csv", curves, rate=rate, start_s=start_s)
    motion = read_motion(tmp_path / "take.csv")[0]
    assert motion.rate_hz == 60.0
    np.testing.assert_allclose(motion.values, curves.values, atol=6e-11)


@pytest.mark.parametrize("form", ["00:{0:02d}:{1:02d}.0", "00:{0:02d}:{1:02d}", "00:00:{0:02d}.0", "00:00:{0:02d}"])
@pytest.mark.parametrize("rate", [24, 60])
def test_frames_that_a_spreadsheet_made_seconds_of_are_frames(write, caplog, form, rate):
    rows = [row(form.format(n // rate, n % rate), n / 1000) for n in range(4 * rate)]
    motion, _ = read_motion(write("\n".join([HEAD, *rows]), "take.csv"))
    assert (motion.rate_hz, len(motion.values)) == (pytest.approx(rate), 4 * rate)
    assert "frames" in caplog.text


def test_uneven_times_and_lost_frames_are_evened_out(tmp_path, curves, caplog):
    rng = np.random.default_rng(3)
    times_s = curves.time_s + rng.uniform(-0.3, 0.3, len(curves.values)) / RATE_HZ
    times_s[0] = 0.0
    kept = np.sort(rng.permutation(len(times_s) - 1)[:570])
    kept = np.concatenate([[0], kept[kept > 0], [600]])
    write_take(tmp_path / "take.csv", curves, np.maximum(times_s[kept], 0))
    motion = read_motion(tmp_path / "take.csv")[0]
    assert (motion.rate_hz, len(motion.values)) == (60.0, 601)
    assert re.search(r"\d+ rows are missing, of 60 a second, at \d\.\d\d–", caplog.text)
    inner = slice(1, 600)
    assert np.abs(motion.values[inner] - curves.values[inner]).max() < 0.03
    assert np.abs(motion.values[inner] - curves.values[inner]).mean() < 0.002


def test_curves_that_speech_moves(curves, tmp_path):
    write_take(tmp_path / "take.csv", curves)
    assert set(read_speech_curves(read_motion(tmp_path / "take.csv")[0]).names) == SPEECH_CURVES
    with pytest.raises(InputError, match="none of its curves is one of mouth or jaw"):
        read_speech_curves(Motion(np.zeros((3, 1)), 60.0, (Channel("browInnerUp", WEIGHT),)))


def test_what_is_a_table_of_the_app(write):
    for head in (HEAD, "timecode,BlendshapeCount,x", "Timecode,JawOpen"):
        assert is_live_link_file(write(f"{head}\n", "a.csv"))
    for head in ("time_s,jawOpen", "Timecode,text", "timeCode,blendShapes.JawOpen"):
        assert not is_live_link_file(write(f"{head}\n", "a.csv"))


OWN = {"exportFps": 30, "trackPath": "talk.wav", "numPoses": 4, "numFrames": 2}
OWN |= {"facsNames": ["jawDrop", "jawDropLipTowards", "lipCornerPullerL", "eyesCloseR"], "joints": ["jaw"]}
OWN |= {"weightMat": [[0.0, 0.0, 0.25, 0.0], [0.5, 0.25, 0.0, 1.0]], "rotations": [[[0, 0, 0, 1]], [[0, 0, 0, 1]]]}


def test_its_members_are_those_of_the_program(tmp_path: Path, write: Any) -> None:
    draw = np.random.default_rng(3)
    moved = Motion(draw.random((61, 2)), 60.0, (Channel("jawOpen", WEIGHT), Channel("eyeBlinkLeft", WEIGHT)))
    path = written(tmp_path / "a.a2f.json", of_motion(moved), path="b/talk.wav")
    document = json.loads(path.read_text(encoding="utf-8"))
    assert {name: document[name] for name in ("exportFps", "trackPath", "numPoses", "numFrames")} == {
        "exportFps": 60, "trackPath": "b/talk.wav", "numPoses": 52, "numFrames": 61,
    }  # fmt: skip
    assert document["facsNames"] == list(ARKIT_52)
    assert (document["facsNames"][0], document["facsNames"][17], len(set(ARKIT_52))) == ("eyeBlinkLeft", "jawOpen", 52)
    assert np.array(document["weightMat"])[:, 17] == pytest.approx(moved["jawOpen"], abs=1e-5)
    for name in ("a.a2f.json", "talk_bsweight.json"):
        again, units = read_motion(write(document, name))
        assert (again.rate_hz, len(units), again.names) == (60.0, 0, ARKIT_52)
        assert again["eyeBlinkLeft"] == pytest.approx(moved["eyeBlinkLeft"], abs=1e-5)


def test_the_names_of_its_own_solver_are_understood(write: Any) -> None:
    motion, _ = read_motion(write(OWN))
    known = arkit_weights(motion)
    assert {name: curve.tolist() for name, curve in known.items() if curve.any()} == {
        "jawOpen": [0.0, 0.75], "mouthClose": [0.0, 0.25], "mouthSmileLeft": [0.25, 0.0], "eyeBlinkRight": [0.0, 1.0],
    }  # fmt: skip
    assert with_mouth(motion)["lip_gap"][0] == 0 < with_mouth(motion)["lip_gap"][1]
