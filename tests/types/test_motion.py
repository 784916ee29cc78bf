import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.types import EYE_DISTANCE, Channel, Motion

CHANNELS = (Channel("opening"), Channel("jaw", "degrees"))


def motion(rows: int = 11, rate_hz: float = 10.0) -> Motion:
    """Two straight lines: what lies between frames is known."""
    return Motion(np.arange(rows)[:, None] * np.array([1.0, -2.0]), rate_hz, CHANNELS)


def test_frames_have_times_and_channels_have_names() -> None:
    curves = motion()
    assert curves.time_s == pytest.approx(np.arange(11) / 10)
    assert curves.names == ("opening", "jaw")
    assert curves["jaw"] == pytest.approx(-2 * np.arange(11))
    assert Channel("opening").unit == EYE_DISTANCE
    with pytest.raises(InputError, match="no motion channel 'width' among 2: opening, jaw"):
        _ = curves["width"]


def test_it_says_what_does_not_fit() -> None:
    for changes, message in (
        ({"values": np.zeros((3, 1))}, r"shape \(3, 1\), required \(T, 2\)"),
        ({"values": np.zeros(3)}, r"shape \(3,\), required \(T, 2\)"),
        ({"rate_hz": 0.0}, "rate is 0.0 Hz, required more than 0"),
        ({"rate_hz": -1.0}, "rate is -1.0 Hz"),
        ({"rate_hz": float("nan")}, "rate is nan Hz"),
        ({"channels": (Channel("opening"), Channel("opening", "mm"))}, "names repeat: opening, opening"),
    ):
        good = {"values": np.zeros((3, 2)), "rate_hz": 25.0, "channels": CHANNELS}
        with pytest.raises(InputError, match=message):
            Motion(**(good | changes))


def test_between_frames_it_is_linear_and_beyond_the_ends_constant() -> None:
    values = motion().at(np.array([-1.0, 0.0, 0.25, 0.999, 1.0, 7.0]))
    assert values[:, 0] == pytest.approx([0, 0, 2.5, 9.99, 10, 10])
    assert values[:, 1] == pytest.approx(-2 * values[:, 0])


@settings(max_examples=50)
@given(st.integers(1, 30), st.floats(1, 120), st.lists(st.floats(-1, 5), max_size=20), st.integers(0, 1000))
def test_at_is_what_numpy_interpolates(rows: int, rate_hz: float, time_s: list[float], seed: int) -> None:
    curves = Motion(np.random.default_rng(seed).normal(size=(rows, 2)), rate_hz, CHANNELS)
    found = curves.at(np.array(time_s))
    for column, name in enumerate(curves.names):
        assert found[:, column] == pytest.approx(np.interp(time_s, curves.time_s, curves[name]), abs=1e-9)


@settings(max_examples=50)
@given(st.integers(1, 300), st.sampled_from([24.0, 25.0, 29.97, 30.0, 60.0, 100.0]), st.floats(1, 1000))
def test_resampling_keeps_the_duration_and_the_values(rows: int, rate_hz: float, new_hz: float) -> None:
    curves = motion(rows, rate_hz)
    again = curves.resampled(new_hz)
    last_s = curves.time_s[-1]
    assert again.rate_hz == new_hz
    assert again.channels == curves.channels
    assert again.time_s[-1] <= last_s + 1e-6
    assert again.time_s[-1] + 1 / new_hz > last_s - 1e-6
    assert again["opening"] == pytest.approx(np.minimum(again.time_s * rate_hz, rows - 1), abs=1e-6)


def test_whole_multiples_keep_the_last_frame() -> None:
    for rows in range(1, 200):
        assert len(motion(rows, 100.0).resampled(50.0).values) == (rows - 1) // 2 + 1
        assert len(motion(rows, 25.0).resampled(100.0).values) == 4 * (rows - 1) + 1
    for rate_hz in (0.0, -25.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match=f"motion rate is {rate_hz} Hz"):
            motion().resampled(rate_hz)


def test_a_name_is_no_formula_of_a_spreadsheet() -> None:
    for name in ("=1+1", "+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1", " =1", "＝1", "\u3000＠x", "-x" * 500):
        with pytest.raises(InputError, match="a spreadsheet's formula, required another beginning") as caught:
            Channel(name)
        assert len(str(caught.value)) < 250
    for name in ("opening", "p12.x", "jaw-open", "Mouth Open (L)", "blendShape1.a=b", "öffnen", "", "_x", "|a|b"):
        assert Channel(name).name == name
