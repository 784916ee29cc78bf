"""Motion files as people bring them: cases of public bug reports, and others of their kind."""

import csv
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import read_motion
from lipmotion.errors import InputError
from lipmotion.meshes.model.shape_names import ARKIT_52
from lipmotion.pipeline.outputs.motion_files import match_duration, read_generation
from lipmotion.types import Motion

CASES = Path(__file__).parents[1] / "data" / "cases" / "motion"
NAMES = json.loads((Path(__file__).parents[1] / "meshes" / "names.json").read_text(encoding="utf-8"))["arkit"]
JAW = [round(0.3 + 0.3 * np.sin(n / 3), 3) for n in range(60)]


def read(path: Path, content: str | bytes) -> Motion:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_motion(path)[0]


def first_open(motion: Motion) -> int:
    return int(np.argmax(motion["jawOpen"] > 0.01))


def take(rows: list[str], head: str = "Timecode,BlendshapeCount,JawOpen,MouthClose") -> str:
    return "\n".join([head, *rows]) + "\n"


def code(frame: int, rate: int = 60, start_s: int = 36_000, mark: str = ":") -> str:
    seconds, part = divmod((frame + start_s * rate) % (86_400 * rate), rate)
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}{mark}{part:02d}.000"


@pytest.mark.parametrize(
    ("name", "frames", "rate_hz", "largest", "opens"),
    [
        ("llf-late-face.csv", 180, 60.0, 0.5, 60),
        ("llf-excel-semicolon.csv", 60, 60.0, 0.5, 0),
        ("index-timecode-prefixed.csv", 60, 30.0, 0.5967, 1),
        ("eyes-first.glb", 60, 30.0, 0.597, 1),
        ("names-in-accessors.glb", 60, 30.0, 0.597, 1),
    ],
)
def test_cases_with_a_jaw(name: str, frames: int, rate_hz: float, largest: float, opens: int) -> None:
    motion, _ = read_motion(CASES / name)
    assert (len(motion.values), motion.rate_hz) == (frames, pytest.approx(rate_hz))
    assert motion["jawOpen"].max() == pytest.approx(largest, abs=1e-3)
    assert first_open(motion) == opens


@pytest.mark.parametrize("encoding", ["cp932", "gbk", "utf-8", "big5", "euc_jp"])
def test_names_of_morphs_in_any_encoding(tmp_path: Path, encoding: str, caplog: pytest.LogCaptureFixture) -> None:
    keys = [("あ", 0, 0.0), ("あ", 6, 0.8), ("あ", 12, 0.0), ("まばたき", 3, 1.0), ("謎", 3, 1.0), ("空", 3, 0.0)]
    content = b"Vocaloid Motion Data 0002".ljust(50, b"\0") + bytes(4) + struct.pack("<I", len(keys))
    for name, frame, weight in keys:
        content += struct.pack("<15sIf", name.encode(encoding), frame, weight)
    motion = read(tmp_path / "a.vmd", content + bytes(16))
    assert motion["aa"].max() == pytest.approx(0.8)
    assert int(np.argmax(motion["aa"])) == 6
    assert "eyeBlinkLeft" in motion.names
    assert "1 morphs that move are not known: " in caplog.text


def test_the_case_in_gbk() -> None:
    motion, _ = read_motion(CASES / "lips-gbk.vmd")
    assert (motion["aa"].max(), motion["ih"].max()) == (pytest.approx(0.8), pytest.approx(0.6))


def test_motion_of_a_camera_alone_is_named(tmp_path: Path) -> None:
    camera = bytes(8) + struct.pack("<I", 7)
    with pytest.raises(InputError, match=r"none of the morphs .* 7 keys of a camera"):
        read(tmp_path / "a.vmd", b"Vocaloid Motion Data 0002".ljust(50, b"\0") + camera + bytes(7 * 61 + 8))


def spelled(separator: str, quote: bool, decimal: str, above: str = "", end: str = "\n") -> str:
    text = io.StringIO()
    rows = csv.writer(text, delimiter=separator, quoting=csv.QUOTE_ALL if quote else 0, lineterminator=end)
    rows.writerow(["Timecode", "BlendshapeCount", "JawOpen", "MouthClose"])
    for number, jaw in enumerate(JAW):
        rows.writerow([code(number).replace(".", decimal), 2, str(jaw).replace(".", decimal), 0])
    return above + text.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        *(spelled(",", True, "."), spelled(";", False, ","), spelled(";", True, ","), spelled("\t", False, ".")),
        *(spelled(",", True, ","), spelled(";", False, ",", "\ufeffsep=;\r\n", "\r\n")),
        *(spelled(",", False, ".", above) for above in ("\ufeff", "\n\n,,,\r\n", "# FPS: 60\n")),
        spelled(",", False, ".").encode("utf-16"),
        spelled(",", False, ".").encode("utf-16-le"),
        spelled(",", False, ".").replace("\n", "\r"),
    ],
    ids=lambda content: repr(content[:12]),
)
def test_tables_as_spreadsheets_save_them(tmp_path: Path, content: str | bytes) -> None:
    motion = read(tmp_path / ("a.tsv" if "\t" in str(content) else "a.csv"), content)
    assert motion.rate_hz == 60
    assert motion["jawOpen"] == pytest.approx(JAW)


def test_faces_that_come_late_leave_and_are_lost_between(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rows = [f"{code(n)},2,0.5,0" if 30 <= n < 150 and not 80 <= n < 90 else f"{code(n)},0" for n in range(180)]
    motion = read(tmp_path / "a.csv", take(rows))
    assert len(motion.values) == 180
    expected = np.zeros(180)
    expected[30:150] = 0.5
    assert motion["jawOpen"] == pytest.approx(expected)
    assert "70 of 180 rows" in caplog.text
    assert "1.33–1.48 s" in caplog.text


def test_a_take_under_a_second_says_what_rate_is_assumed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    motion = read(tmp_path / "a.csv", take([f"{code(n, 30)},2,0.5,0" for n in range(27)]))
    assert (motion.rate_hz, "60 frames a second are assumed" in caplog.text) == (60, True)


@pytest.mark.parametrize(("rate", "mark"), [(30, ";"), (30, ":"), (60, ";"), (60, ":")])
def test_drop_frame_over_minutes_and_midnight(tmp_path: Path, rate: int, mark: str) -> None:
    """Numbers 0 and 1 (0 to 3 of 60) are left out in every minute but each tenth; a colon does not say so."""
    numbered = (n for n in range(rate * (86_400 - 2), rate * (86_400 + 62)))
    kept = [n for n in numbered if n % rate >= rate // 15 or n // rate % 60 or n // rate % 600 == 0]
    motion = read(tmp_path / "a.csv", take([f"{code(n, rate, 0, mark)},2,{n % 7 / 10},0" for n in kept]))
    assert motion.rate_hz == pytest.approx(rate / 1.001)
    assert motion["jawOpen"] == pytest.approx(np.array([n % 7 / 10 for n in kept]))


def test_frames_behind_a_point_are_no_hundredths(tmp_path: Path) -> None:
    rows = [f"10:00:{n // 30:02d}.{n % 30:02d},2,{n / 200},0" for n in range(17, 137)]
    motion = read(tmp_path / "a.csv", take(rows))
    assert motion.rate_hz == pytest.approx(30)
    assert motion["jawOpen"] == pytest.approx(np.arange(17, 137) / 200)


def test_timecodes_without_frames_are_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    motion = read(tmp_path / "a.csv", take([f"10:00:{n // 30:02d},2,{n / 200},0" for n in range(17, 137)]))
    assert motion.rate_hz == pytest.approx(30)
    assert "120 rows" in caplog.text
    with pytest.raises(InputError, match=r"begins with '00:00\.0', required a timecode"):
        read(tmp_path / "a.csv", take(["00:00.0,2,0,0"] * 3))


@pytest.mark.parametrize(
    ("head", "first"),
    [
        ("timestamp_ms", lambda n: f"{n * 1000 / 30:.0f}"),
        ("frame,timestamp_ms,_neutral", lambda n: f"{n},{n * 1000 / 30:.0f},0.01"),
        ("frame,Time (ms)", lambda n: f"{n},{n * 1000 / 30:.2f}"),
        ("timeCode", lambda n: f"{n / 30:.6f}"),
        ("Timecode", lambda n: f"10:00:{n // 30:02d}:{n % 30 + 1:02d}"),
        (",timestamp", lambda n: f"{n},{1_700_000_000 + n / 30:.6f}"),
        ("timestamp", lambda n: f"{n * 1e6 / 30:.0f}"),
        ("Unnamed: 0,time", lambda n: f"{n},{n / 30:.6f}"),
        ("image,seconds", lambda n: f"take_{n}.png,{n / 30:.6f}"),
        ("timestamp,time_ms,isTracked", lambda n: f"{n * 1e7 / 30:.0f},{n * 1e3 / 30:.2f},True"),
    ],
)
@pytest.mark.parametrize("names", ["jawOpen,mouthClose", "blendShapes.JawOpen,blendShapes.MouthClose", "JAW_OPEN,x_9"])
def test_columns_of_times(tmp_path: Path, head: str, first: Any, names: str) -> None:
    motion = read(tmp_path / "a.csv", take([f"{first(n)},{jaw},0" for n, jaw in enumerate(JAW)], f"{head},{names}"))
    assert len(motion.values) == 60
    assert motion.rate_hz == pytest.approx(30, abs=0.02)
    assert motion["jawOpen"] == pytest.approx(JAW)
    assert len(motion.names) == 2


def test_one_blendshape_a_row(tmp_path: Path) -> None:
    rows = [f"{n},{n * 40},{name},{score}" for n in range(50) for name, score in (("_neutral", 0), ("jawOpen", JAW[n]))]
    motion = read(tmp_path / "a.csv", take(rows, "frame,timestamp_ms,category_name,score"))
    assert (motion.rate_hz, motion.names) == (25, ("jawOpen",))
    assert motion["jawOpen"] == pytest.approx(JAW[:50])


def test_what_cannot_be_trusted_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "a.csv"
    read(path, take([f"{n / 30},{1.3 if n == 7 else 0.2},0,text" for n in range(30)], "time,jawOpen,MouthClose,mood"))
    assert "jawOpen from 0.00 to 1.30" in caplog.text
    assert "left out: mood" in caplog.text
    motion = read(path, take([f"{n / 30},0,{JAW[n]}" for n in range(30)], "time,Eye.jawOpen,Head.jawOpen"))
    assert motion["jawOpen"] == pytest.approx(JAW[:30])
    read(path, take([f"{n / 30},nan,0.1" if n == 3 else f"{n / 30},0,0.1" for n in range(30)], "time,a,b"))
    assert "1 of 30 rows" in caplog.text
    assert "1 columns have no name of a blendshape and count as eye distances, up to 0.1: b" in caplog.text
    read(path, take([f"{0.3 if n == 10 else n / 30},0" for n in range(30)], "time,a"))
    assert "1 of 30 rows are not later than those before, as row 11" in caplog.text
    rows = [f"{n},{face},{n / 30},{n != 9},{JAW[n] * (face == 0)}" for n in range(30) for face in (0, 1)]
    motion = read(path, take(rows, "frame, face_id, timestamp, success, jawOpen"))
    assert "30 rows are of other faces than the first one (0)" in caplog.text
    assert (motion.names, motion["jawOpen"][9]) == (("jawOpen",), pytest.approx((JAW[8] + JAW[10]) / 2))
    for head, row in (("time,jawOpen", "55"), ("Timecode,BlendshapeCount,JawOpen", "55"), ("time,opening", "55")):
        times = [f"{n / 30}" if head.startswith("time,") else f"{code(n)},1" for n in range(30)]
        with pytest.raises(InputError, match=r"goes up to 55, required 0|are 55 apart, required eye"):
            read(path, take([f"{time},{row}" for time in times], head))


def azure(first: int, last: int) -> dict[str, Any]:
    rows = [[jaw if name == "jawOpen" else 0.0 for name in (*ARKIT_52, "a", "b", "c")] for jaw in JAW[first:last]]
    return {"FrameIndex": first, "BlendShapes": rows}


def event(piece: dict[str, Any], start: int, key: str = "AudioOffset") -> dict[str, Any]:
    return {key: round(start / 60 * 1e7), "VisemeId": 2, "Animation": json.dumps(piece)}


def categories(jaw: float) -> dict[str, Any]:
    named = [{"categoryName": name, "score": score} for name, score in (("_neutral", 0.1), ("jawOpen", jaw))]
    return {"faceBlendshapes": [{"categories": named}]}


@pytest.mark.parametrize(
    ("documents", "rate_hz"),
    [
        ([azure(0, 60)], 60),
        ([[azure(0, 20), azure(20, 60)]], 60),
        ([azure(0, 20), azure(20, 60)], 60),  # one a line
        ([[event(azure(20, 60), 20), event(azure(0, 20), 0), {"AudioOffset": 5, "VisemeId": 3, "Animation": ""}]], 60),
        ([{"visemes": [event(azure(0, 20), 0), event(azure(20, 60) | {"FrameIndex": 0}, 20)]}], 60),
        ([[{"timestamp_ms": n * 40, "blendshapes": {"jawOpen": jaw}} for n, jaw in enumerate(JAW)]], 25),
        ([[{"timeCode": n / 30, "blendShapes": {"JawOpen": jaw}} for n, jaw in enumerate(JAW)]], 30),
        ([{"time": n / 30, "jawOpen": jaw, "mouthClose": 0} for n, jaw in enumerate(JAW)], 30),
        ([{"fps": 24, "frames": [categories(jaw) for jaw in JAW]}], 24),
    ],
)
def test_frames_of_weights_in_json(tmp_path: Path, documents: list[Any], rate_hz: float) -> None:
    motion = read(tmp_path / "a.json", "\ufeff" + "\n".join(map(json.dumps, documents)))
    assert (len(motion.values), motion.rate_hz) == (60, pytest.approx(rate_hz))
    assert motion["jawOpen"] == pytest.approx(JAW)
    assert read(tmp_path / "a.jsonl", "\n".join(map(json.dumps, documents)))["jawOpen"] == pytest.approx(JAW)


def test_frames_of_weights_that_contradict_one_another(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    motion = read(tmp_path / "a.json", json.dumps([azure(0, 20), azure(30, 60)]))
    assert (len(motion.values), "10 of 60 rows" in caplog.text) == (60, True)
    faceless = [{"time": n / 30, "blendshapes": {"jawOpen": JAW[n]} if n > 4 else None} for n in range(60)]
    assert read(tmp_path / "a.json", json.dumps(faceless))["jawOpen"] == pytest.approx([0] * 5 + JAW[5:])
    numbered = [{"frame": n, "success": n != 9, "jawOpen": 0.5 * (n != 9)} for n in range(60) if n % 7 != 2]
    motion = read(tmp_path / "a.json", json.dumps({"fps": 30, "frames": numbered}))
    assert (len(motion.values), motion["jawOpen"].min()) == (60, 0.5)
    for documents, message in (
        ([azure(0, 20), azure(20, 40) | {"FrameIndex": 10}], "frames from 10 on are there twice"),
        ({"FrameIndex": 0, "BlendShapes": [[0.0] * 52]}, "52 weights, required 55"),
        ([{"blendshapes": {"jawOpen": 0.5}}] * 3, "3 frames have no time, required one in each, or a member fps"),
        ([{"time": 0, "jawOpen": 0.5}, {"jawOpen": 0.5}], "1 of 2 frames have no 'time'"),
        ({"BlendShapes": "none"}, "no frames of blendshapes"),
    ):
        with pytest.raises(InputError, match=message):
            read(tmp_path / "a.json", json.dumps(documents))


@pytest.mark.parametrize("counted", [24, 30, 60])
def test_timecodes_that_count_whole_frames_of_television(write, tmp_path, counted, caplog):
    duration_s, rate_hz = 120.0, counted / 1.001
    jaw = (np.arange(int(duration_s * rate_hz)) / rate_hz > 118).astype(int)
    generation = read_generation(write(take([f"{code(n, counted)},2,{each},0" for n, each in enumerate(jaw)]), "a.csv"))
    motion = match_duration(generation, duration_s).motion
    assert counted / motion.rate_hz == pytest.approx(1.001, abs=1e-6)
    assert motion.time_s[first_open(motion)] == pytest.approx(118, abs=2 / counted)
    assert " times as long" in caplog.text
    assert match_duration(generation, duration_s, keeps_rate=True).motion.rate_hz == counted
    for other_s in (120.2, 119.87, 119.93, 121.0):
        assert match_duration(generation, other_s).motion.rate_hz == counted
    given = read_generation(tmp_path / "a.csv", rate_hz=rate_hz).motion
    assert given.time_s[first_open(given)] == pytest.approx(118, abs=2 / counted)


@pytest.mark.parametrize("name", [name for name, known in NAMES.items() if known == "jawOpen"])
def test_spellings_in_a_table(tmp_path: Path, name: str) -> None:
    motion = read(tmp_path / "a.csv", take([f"{n / 30:.6f},{jaw}" for n, jaw in enumerate(JAW)], f"time,{name}"))
    assert motion["jawOpen"] == pytest.approx(JAW)
