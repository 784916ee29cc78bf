import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.formats.steady_rate import even_out_rows, exact_rate
from lipmotion.meshes.model.rig_tables import apply_rig, read_rig_table

SOURCES = {"jawOpen": np.array([0.0, 0.5, 1.0]), "mouthPucker": np.array([0.0, 1.0, 0.0])}


def _table(tmp_path, text):
    (tmp_path / "rig.csv").write_text(text)
    return read_rig_table(tmp_path / "rig.csv")


def test_controls_follow_their_sources_or_are_constant(tmp_path):
    text = (
        "control,source,gain,offset,low,high\nJaw.rz,jawOpen,-25,,-20,0\nLips,mouthPucker,0.5\nLips,jawOpen,-0.25,0.1\n"
    )
    motion = apply_rig(_table(tmp_path, text), SOURCES, 25.0)
    assert motion.names == ("Jaw.rz", "Lips")
    np.testing.assert_allclose(motion["Jaw.rz"], [0, -12.5, -20])
    np.testing.assert_allclose(motion["Lips"], [0.1, 0.475, -0.15])
    motion = apply_rig(_table(tmp_path, "control,source,offset\n# a comment\nBrow,,0.3\n\n"), SOURCES, 25.0)
    np.testing.assert_allclose(motion["Brow"], 0.3)
    with pytest.raises(InputError, match="'Jaw' follows 'jawopen', which is no curve; nearest: jawOpen"):
        apply_rig(_table(tmp_path, "control,source\nJaw,jawopen\n"), SOURCES, 25.0)


WRONG = [
    ("", "required control,source"),
    ("control,from\nJaw,jawOpen\n", "required control,source"),
    ("control,source\n", "0 rows"),
    ("control,source,gain\nJaw,jawOpen,much\n", "line 2"),
    ("control,source,gain\nJaw,jawOpen,nan\n", "line 2: the number is"),
    ("control,source,gain\nJaw,jawOpen,1e9\n", "required at most"),
    ("control,source,low,high\nJaw,jawOpen,2,1\n", "goes from 2 to 1"),
    ("control,source\n,jawOpen\n", "without a control"),
]


def test_damaged_tables_are_refused(tmp_path):
    for text, message in WRONG:
        with pytest.raises(InputError, match=message):
            _table(tmp_path, text)


NTSC = 30_000 / 1001


def test_a_rounded_rate_of_television_is_meant_exactly() -> None:
    assert exact_rate(29.97003) == NTSC
    assert exact_rate(59.94006) == 60_000 / 1001
    for other in (29.97, 30.0, 25.0, 1e-6):
        assert exact_rate(other) == other
    assert np.isnan(exact_rate(float("nan")))


@pytest.mark.parametrize("rate_hz", [24.0, 24_000 / 1001, NTSC, 30.0, 60_000 / 1001, 60.0])
def test_even_rows_have_their_rate(rate_hz: float) -> None:
    time_s = np.round(np.arange(300) / rate_hz, 5)
    rows, found_hz = even_out_rows(time_s, np.arange(300.0)[:, None])
    assert found_hz == rate_hz
    assert rows[:, 0].tolist() == list(range(300))
    for other_hz in (2.0, 72.0, 71.9):  # are measured
        assert even_out_rows(np.arange(100) / other_hz, np.zeros((100, 1)))[1] == pytest.approx(other_hz, abs=1e-6)
