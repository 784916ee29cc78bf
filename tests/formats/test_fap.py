from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.examples import of_motion
from lipmotion.articulation.contact import opening_to_gap
from lipmotion.errors import ExportError, InputError
from lipmotion.formats import read_motion, write_motion
from lipmotion.formats.fap import FAP, MOUTH_TO_NOSE, PARAMETERS, STEPS, move_faps
from lipmotion.types import Channel, Generation, Motion
from meshes.speech import motion, units

NONE = ["0"] * 68


def generation(frames: int = 50, rate_hz: float = 25.0) -> Generation:
    values = np.rint(np.random.default_rng(5).normal(0, 200, (frames, len(PARAMETERS))))
    channels = tuple(Channel(f"fap{number}_{name}", FAP) for number, name, *_ in PARAMETERS)
    return of_motion(Motion(values, rate_hz, channels))


@pytest.mark.parametrize("rate_hz", [25.0, 29.97, 100.0])
def test_parameters_come_back(tmp_path, rate_hz):
    written = generation(rate_hz=rate_hz)
    write_motion(tmp_path / "a.fap", written, source={"file": "my talk.wav"}, model={})
    motion, units = read_motion(tmp_path / "a.fap")
    assert (motion.channels, motion.rate_hz, len(units)) == (written.motion.channels, rate_hz, 0)
    np.testing.assert_array_equal(motion.values, written.motion.values)
    first = (tmp_path / "a.fap").read_text().splitlines()[0]
    assert first == f"2.1 my_talk {rate_hz:g} 50"


def marks(*numbers: int) -> str:
    return " ".join("1" if number in numbers else "0" for number in range(1, 69))


def read(tmp_path: Path, *lines: str) -> Motion:
    (tmp_path / "a.fap").write_text("\n".join(lines))
    return read_motion(tmp_path / "a.fap")[0]


def test_files_of_others(tmp_path):
    """Visemes and expressions are passed over, other parameters named by their number; what is not given stays."""
    motion = read(
        tmp_path,
        *("# a comment", "2.1 face.fap 25 3"),
        *(marks(1, 2, 3, 19), "0 7 0 0 0 1 0 0 0 0 0 11 22"),
        *(marks(3), "1 33"),
        *(marks(), "2"),
    )
    assert motion.names == ("fap3_open_jaw", "fap19")
    assert motion.values.tolist() == [[11, 22], [33, 22], [33, 22]]


WRONG = [
    ([], "begins with ''"),
    (["1.0 a 25 1"], "begins with '1.0 a 25 1', required 2.1 NAME FPS FRAMES"),
    (["2.1 a 25"], "begins with '2.1 a 25', required 2.1 NAME FPS FRAMES"),
    (["2.1 a 25 0"], "0 frames, required 1 to"),
    (["2.1 a 25 999999999999"], "999999999999 frames, required"),
    (["2.1 a 25 2", marks(3), "0 5"], "frame 1 of 2 has 0 marks, required 68"),
    (["2.1 a 25 1", marks(3) + " 1", "0 5"], "has 69 marks"),
    (["2.1 a 25 1", marks(3), "0 5 6"], "frame 0 of 1 has 2 values, required 1"),
    (["2.1 a 25 1", marks(3), "0 wide"], "invalid literal"),
    (["2.1 a 25 1", marks(3), "0 99999999999999999999"], "has a value over 1000000"),
    (["2.1 a nan 1", marks(3), "0 5"], "rate is nan Hz"),
]


def test_what_is_wrong_is_said(tmp_path):
    for lines, message in WRONG:
        with pytest.raises(InputError, match=message):
            read(tmp_path, *lines)
    other = replace(generation(), motion=Motion(np.zeros((2, 1)), 25.0, (Channel("opening"),)))
    with pytest.raises(ExportError, match="no parameters of MPEG-4 but opening"):
        write_motion(tmp_path / "a.fap", other, source={}, model={})


def test_lips_rest_at_0_meet_in_p_and_m_and_go_as_the_standard_says():
    """Values are whole; a gap is its share of the unit."""
    parameters = move_faps(motion(), units())
    np.testing.assert_allclose(parameters.values, np.rint(parameters.values), atol=1e-12)
    assert np.abs(parameters.values[5:30]).max() <= 1
    apart = -(parameters["fap4_lower_t_midlip"] + parameters["fap5_raise_b_midlip"])
    assert np.abs(apart[[55, 95]]).max() <= 1
    gap = opening_to_gap(motion()["opening"][75:76].astype(np.float64))
    assert apart[75] / STEPS * MOUTH_TO_NOSE == pytest.approx(float(gap[0]), abs=0.002)
    assert parameters["fap3_open_jaw"][75] > 0
    assert parameters["fap5_raise_b_midlip"][75] < 0
    assert parameters["fap4_lower_t_midlip"][75] < 0
    assert parameters["fap6_stretch_l_cornerlip"][115] < 0  # oo is narrow
    assert parameters["fap7_stretch_r_cornerlip"][115] < 0
