"""Takes of Live Link Face are read as the app writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.formats import read_motion
from lipmotion.formats.tables import SPEECH_CURVES, is_live_link, speech_curves
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS
from lipmotion.types import WEIGHT, Channel, Motion
from meshes.live_link_app import COLUMNS, HEAD, write_take

RATE_HZ = 60.0


@pytest.fixture
def curves() -> Motion:
    """Ten seconds of all curves: slow waves between 0 and 1."""
    time_s = np.arange(601) / RATE_HZ
    phase = np.linspace(0, 3, len(COLUMNS))
    values = 0.5 + 0.5 * np.sin(2 * np.pi * 1.5 * time_s[:, None] + phase)
    return Motion(values, RATE_HZ, tuple(Channel(name, WEIGHT) for name in COLUMNS))


def row(code: str, *values: object, count: int = 61) -> str:
    held = [*values, *[0] * (61 - len(values))]
    return ",".join(map(str, [code, count, *held]))


def read(tmp_path: Path, text: str) -> Motion:
    (tmp_path / "take.csv").write_text(text, encoding="utf-8")
    return read_motion(tmp_path / "take.csv")[0]


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
def test_frames_that_a_spreadsheet_made_seconds_of_are_frames(tmp_path, caplog, form, rate):
    rows = [row(form.format(n // rate, n % rate), n / 1000) for n in range(4 * rate)]
    motion = read(tmp_path, "\n".join([HEAD, *rows]))
    assert (motion.rate_hz, len(motion.values)) == (pytest.approx(rate), 4 * rate)
    assert "frames" in caplog.text


def test_uneven_times_and_lost_frames_are_evened_out(tmp_path, curves):
    rng = np.random.default_rng(3)
    times_s = curves.time_s + rng.uniform(-0.3, 0.3, len(curves.values)) / RATE_HZ
    times_s[0] = 0.0
    kept = np.sort(rng.permutation(len(times_s) - 1)[:570])
    kept = np.concatenate([[0], kept[kept > 0], [600]])
    write_take(tmp_path / "take.csv", curves, np.maximum(times_s[kept], 0))
    motion = read_motion(tmp_path / "take.csv")[0]
    assert motion.rate_hz == 60.0
    assert len(motion.values) == 601
    inner = slice(1, 600)
    assert np.abs(motion.values[inner] - curves.values[inner]).max() < 0.03
    assert np.abs(motion.values[inner] - curves.values[inner]).mean() < 0.002


def test_drop_frame_timecode_is_real_time(tmp_path):
    """At 29.97 frames a second, 00:00:59;29 is followed by 00:01:00;02."""
    codes = [f"00:00:59;{n:02d}" for n in range(30)] + [f"00:01:00;{n:02d}" for n in range(2, 30)]
    motion = read(tmp_path, "\n".join([HEAD, *(row(code, n / 100) for n, code in enumerate(codes))]))
    assert motion.rate_hz == pytest.approx(30 / 1.001, abs=1e-3)
    assert motion["eyeBlinkLeft"] == pytest.approx(np.arange(58) / 100)
    codes = [f"00:09:59;{n:02d}" for n in range(30)] + [f"00:10:00;{n:02d}" for n in range(30)]  # none is left out
    motion = read(tmp_path, "\n".join([HEAD, *(row(code, n / 100) for n, code in enumerate(codes))]))
    assert motion.rate_hz == pytest.approx(30 / 1.001, abs=1e-3)
    assert motion["eyeBlinkLeft"] == pytest.approx(np.arange(60) / 100)


def test_rows_without_a_face_are_bridged(tmp_path):
    lines = [row(f"10:00:0{n // 60}:{n % 60:02d}.000", 0.01 * n) for n in range(90)]
    lines[10:13] = [lines[10].split(",")[0] + ",0", lines[11].split(",")[0] + ",0,,,", lines[12].split(",")[0] + ",0"]
    motion = read(tmp_path, "\n".join([HEAD + ",", *lines]) + "\n")
    np.testing.assert_allclose(motion["eyeBlinkLeft"], 0.01 * np.arange(90), atol=1e-9)


def test_a_short_take_has_the_rate_of_the_app(tmp_path):
    motion = read(tmp_path, "\n".join([HEAD, *(row(f"10:00:00:{n:02d}.000") for n in range(10, 21))]))
    assert motion.rate_hz == 60.0


def test_curves_that_speech_moves(curves, tmp_path):
    write_take(tmp_path / "take.csv", curves)
    kept = speech_curves(read_motion(tmp_path / "take.csv")[0])
    assert set(kept.names) == SPEECH_CURVES
    with pytest.raises(InputError, match="none of its curves is one of mouth or jaw"):
        speech_curves(Motion(np.zeros((3, 1)), 60.0, (Channel("browInnerUp", WEIGHT),)))


def test_what_is_a_table_of_the_app():
    for head in (HEAD, "timecode,BlendshapeCount,x", "Timecode,JawOpen"):
        assert is_live_link(head.split(","))
    for head in ("time_s,jawOpen", "Timecode,text", "timeCode,blendShapes.JawOpen"):
        assert not is_live_link(head.split(","))


GOOD = [row(f"10:00:00:{n:02d}.000") for n in range(10)]


WRONG = [
    ([], "there are no rows"),
    (GOOD[:1], "1 rows with values, required two or more"),
    ([*GOOD, "10:00:00:12.000,61,0.1"], "line 12 has 1 curves, required 61; delete it if it is the last"),
    ([*GOOD, row("soon")], "line 12 begins with 'soon', required a timecode as"),
    ([*GOOD, row("10:61:00:00.000")], "line 12 begins with '10:61:00:00.000', required a timecode"),
    ([*GOOD, row("10:00:00:13.000", "wide")], "could not convert string to float"),
    ([*GOOD, row("09:00:00:00.000")], r"the time of row 11 goes back by 3600"),
    ([*GOOD, row("11:00:00:00.000")], "11 rows in 3600.0 s at 60 rows a second: most of the time there are none"),
    ([row(f"10:00:00:{n:02d}.000", count=0) for n in range(5)], "could not|0 rows with values"),
    ([row(f"10:00:0{n // 200}:{n % 200}.000") for n in range(300)], "has frame 199, required less than 120"),
]


def test_what_is_wrong_is_said(tmp_path):
    for lines, message in WRONG:
        with pytest.raises(InputError, match=message):
            read(tmp_path, "\n".join([HEAD, *lines]))


def test_a_table_that_is_not_text_is_refused(tmp_path):
    (tmp_path / "take.csv").write_bytes(HEAD.encode() + b"\n\xff\xfe\x00")
    with pytest.raises(InputError, match="not a table of"):
        read_motion(tmp_path / "take.csv")
