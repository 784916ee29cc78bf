from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.motion.motion_store import (
    MotionStore,
    compress,
    lip_tolerance,
    motion_store_arrays,
    motion_store_from_arrays,
    point_distances,
)
from lipmotion.storage.archive import read_archive, write_archive
from lipmotion.types import Channel

CHANNELS = tuple(map(Channel, ("opening", "width", "x_1", "y_1", "z_1", "x_2", "y_2", "z_2")))
GROUPS = np.array([0, 1, 2, 2, 2, 3, 3, 3])


def motion(frames: int, channels: int = 8, seed: int = 0, noise: float = 0.01) -> np.ndarray:
    """Slow curves of a few sources, and noise."""
    draw = np.random.default_rng(seed)
    sources = np.cumsum(draw.normal(0, 0.1, (frames, 3)), axis=0)
    return sources @ draw.normal(0, 1, (3, channels)) + draw.normal(0, noise, (frames, channels)) + 0.5


def largest_error(store: MotionStore, values: np.ndarray) -> float:
    """The promise, computed from the definition: the largest 99th percentile of a point's distance in tolerances."""
    frames = np.concatenate([np.arange(first, stop) for first, stop in store.kept])
    restored = store.rows(frames)
    worst = 0.0
    for group in range(store.groups.max() + 1):
        columns = np.flatnonzero(store.groups == group)
        distance = np.linalg.norm(restored[:, columns] - values[frames][:, columns], axis=1)
        worst = max(worst, float(np.percentile(distance, 99)) / store.tolerance[columns[0]])
    return worst


def packed(store: MotionStore, path: Path) -> int:
    write_archive(path, {}, motion_store_arrays(store))
    return path.stat().st_size


@settings(max_examples=30)
@given(
    frames=st.integers(1, 150),
    channels=st.integers(1, 12),
    points=st.integers(1, 5),
    exponent=st.floats(-4, 0.5),
    rate_hz=st.sampled_from([25.0, 30.0, 100.0]),
    noise=st.sampled_from([0.0, 0.01, 1.0]),
    cut=st.floats(0, 1),
)
def test_the_promise_is_kept(frames, channels, points, exponent, rate_hz, noise, cut) -> None:
    values, tolerance = motion(frames, channels, frames, noise), 10.0**exponent
    middle = int(cut * frames)
    kept = [span for span in ((0, middle), (middle, frames)) if span[0] < span[1]]
    store = compress(values, rate_hz, tolerance, groups=np.arange(channels) % points, kept=kept)
    error = largest_error(store, values)
    assert error <= 1 + 1e-6
    assert error == pytest.approx(store.error, rel=1e-3, abs=1e-6)


def test_any_frames_are_those_of_the_whole() -> None:
    kept = [(0, 100), (100, 277), (300, 301), (350, 500)]
    for rate_hz in (25.0, 100.0):
        store = compress(motion(500), rate_hz, 0.05, groups=GROUPS, kept=kept)
        frames = np.concatenate([np.arange(*span) for span in kept])
        whole = np.full((500, 8), np.nan)
        whole[frames] = store.rows(frames)
        scattered = np.random.default_rng(1).choice(frames, 200)
        assert store.rows(scattered) == pytest.approx(whole[scattered], abs=1e-12)
        assert store.rows(slice(360, 380, 3)) == pytest.approx(whole[360:380:3], abs=1e-12)
        assert store.rows(list(range(120, 110, -1))) == pytest.approx(whole[120:110:-1], abs=1e-12)
        assert store.rows([]).shape == (0, 8)


def test_only_touched_blocks_are_read() -> None:
    store = compress(motion(2000), 25.0, 0.05)
    code, length = store.table.code, store.table.code.layout.length
    before = store.rows(slice(0, length))
    code.low[:, 2:] = 0
    code.high[:, 2:] = 0
    assert np.array_equal(store.rows(slice(0, length)), before)
    assert not np.allclose(store.rows(slice(2 * length, 3 * length)), motion(2000)[2 * length : 3 * length], atol=0.1)


def test_motion_that_was_interpolated_is_stored_at_the_rate_of_the_camera(tmp_path) -> None:
    slow = motion(200, noise=0.1)
    fast = CubicSpline(np.arange(200) / 25, slow)(np.arange(797) / 100)
    store = compress(fast, 100.0, 0.05, groups=GROUPS)
    assert store.rate_hz / store.table.code.layout.spacing == pytest.approx(25.0)
    assert packed(store, tmp_path / "spline") < 1.3 * packed(
        compress(slow, 25.0, 0.05, groups=GROUPS), tmp_path / "camera"
    )


def test_a_larger_tolerance_takes_less(tmp_path) -> None:
    sizes = [packed(compress(motion(800), 25.0, tolerance), tmp_path / "m") for tolerance in (0.01, 0.03, 0.1, 0.3)]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > 1.5 * sizes[-1]


def test_frames_that_are_left_out_take_no_space_and_keep_their_numbers(tmp_path) -> None:
    values = motion(8000)
    silent = values.copy()
    silent[200:6000] = np.nan
    short = compress(silent, 25.0, 0.05, kept=[(0, 200), (6000, 8000)])
    assert len(short) == 8000
    assert short.rows([5, 7900]) == pytest.approx(values[[5, 7900]], abs=0.2)
    assert packed(short, tmp_path / "short") < 0.6 * packed(compress(values, 25.0, 0.05), tmp_path / "whole")
    with pytest.raises(InputError, match="frame 300 was left out"):
        short.rows([5, 300])
    with pytest.raises(InputError, match="frame 200 was left out"):
        short.rows(slice(190, 201))


def test_all_shapes() -> None:
    for values in (
        np.zeros((0, 3)),
        np.full((1, 3), 0.7),
        np.full((50, 3), 0.7),
        np.full((50, 3), -1e6),
        motion(1, 4),
        motion(2, 1),
        motion(300, 1),
        motion(5, 40),
        motion(20, 400),
        np.concatenate([motion(80, 3), np.full((80, 2), 0.1)], axis=1),
        motion(90, 3).astype(np.float32),
        np.arange(60).reshape(20, 3),
    ):
        for rate_hz in (25.0, 100.0):
            store = compress(values, rate_hz, 0.01)  # type: ignore[arg-type]
            again = motion_store_from_arrays(motion_store_arrays(store))
            assert len(again) == len(values)
            assert again.rows(slice(None)).shape == values.shape
            if len(values):
                assert largest_error(again, values) <= 1
                assert np.array_equal(again.rows(slice(None)), store.rows(slice(None)))


def test_points_are_channels_of_one_number() -> None:
    assert point_distances(np.array([[3.0, 1.0, 4.0]]), np.array([1, 0, 1])).tolist() == [[1.0, 5.0]]


def test_the_tolerance_is_a_share_of_the_width_of_the_lips() -> None:
    values = motion(9)
    assert lip_tolerance(values, CHANNELS) == pytest.approx(0.005 * sorted(values[:, 1])[4])
    with pytest.raises(InputError, match="no width"):
        lip_tolerance(values[:, :1], CHANNELS[:1])


GOOD: dict[str, Any] = {"values": motion(20), "rate_hz": 25.0, "tolerance": 0.1}


def test_bad_input_is_refused() -> None:
    for changes, says in (
        ({"values": np.where(np.arange(8) == 3, np.nan, motion(20))}, "not finite"),
        ({"values": np.where(np.arange(8) == 3, np.inf, motion(20))}, "not finite"),
        ({"values": motion(20)[:, 0]}, r"shape \(20,\)"),
        ({"values": np.zeros((20, 0))}, r"shape \(20, 0\)"),
        ({"rate_hz": 0.0}, "rate is 0"),
        ({"rate_hz": np.inf}, "rate is inf"),
        ({"tolerance": 0.0}, "positive"),
        ({"tolerance": -1.0}, "positive"),
        ({"tolerance": np.nan}, "positive"),
        ({"tolerance": np.ones(3)}, "each of 8"),
        ({"tolerance": np.arange(1.0, 9), "groups": GROUPS}, "different tolerances"),
        ({"tolerance": 1e-14}, "cannot be promised"),
        ({"groups": [0, 1]}, r"required \(8,\)"),
        ({"groups": np.zeros(8)}, "whole numbers"),
        ({"kept": [(0, 10), (5, 20)]}, "overlap"),
        ({"kept": [(0, 21)]}, "leave 0 to 20"),
        ({"kept": [(-1, 5)]}, "leave 0 to 20"),
        ({"kept": [(5, 5)]}, "empty"),
        ({"kept": [(5, 2)]}, "order"),
        ({"kept": [(0.5, 2)]}, "whole numbers"),
        ({"kept": [(0, 2, 3)]}, r"required \(R, 2\)"),
    ):
        with pytest.raises(InputError, match=says):
            compress(**(GOOD | changes))


def test_bad_frames_are_refused() -> None:
    for frames in ([-1], [20], [[1, 2]], [0.5], "abc", 3):
        with pytest.raises(InputError, match="required"):
            compress(**GOOD).rows(frames)  # type: ignore[arg-type]


def test_more_components_than_channels_are_refused() -> None:
    arrays = {name: ARRAYS[name] for name in ARRAYS}
    arrays["basis"], arrays["steps"] = np.zeros((9, 8), np.int8), np.full(9, 0.1)
    with pytest.raises(ModelFormatError, match="9 components of 8 columns"):
        motion_store_from_arrays(arrays)


def test_the_arrays_survive_a_file(tmp_path) -> None:
    values = motion(500)
    store = compress(values, 100.0, 0.02, groups=GROUPS, kept=[(0, 100), (150, 500)])
    write_archive(tmp_path / "m", {}, motion_store_arrays(store))
    again = motion_store_from_arrays(read_archive(tmp_path / "m"))
    assert again.rate_hz == pytest.approx(100.0)
    assert again.table.code.layout.spacing == pytest.approx(store.table.code.layout.spacing)
    assert again.error == pytest.approx(store.error)
    assert np.array_equal(again.kept, [(0, 100), (150, 500)])
    assert np.array_equal(again.rows([3, 499]), store.rows([3, 499]))
    assert again.nbytes == store.nbytes


ARRAYS = motion_store_arrays(compress(motion(500), 100.0, 0.05, groups=GROUPS, kept=[(0, 100), (150, 500)]))


def test_every_array_is_needed() -> None:
    for name in ARRAYS:
        with pytest.raises(ModelFormatError, match=name):
            motion_store_from_arrays({other: array for other, array in ARRAYS.items() if other != name})
    with pytest.raises(ModelFormatError, match="undeclared"):
        motion_store_from_arrays(ARRAYS | {"more": np.zeros(1)})


def test_damaged_arrays_are_refused() -> None:
    for name, array, says in (
        ("rate_hz", np.array(0.0), "more than 0"),
        ("tolerance", np.zeros(8), "more than 0"),
        ("tolerance", np.ones(7), "shape"),
        ("groups", np.array([0, 1, 2, 2, 2, 3, 3, 9]), "gaps"),
        ("groups", np.full(8, -1), "required 0"),
        ("error", np.array(1.5), "required 0 to 1"),
        ("error", np.array(np.nan), "finite"),
        ("mean", np.full(8, np.inf), "finite"),
        ("mean", np.zeros(0), "shape"),
        ("scale", np.zeros(8), "more than 0"),
        ("steps", ARRAYS["steps"][:-1], "shape"),
        ("basis", ARRAYS["basis"].astype(float), "whole numbers"),
        ("basis", ARRAYS["basis"][:, 1:], "shape"),
        ("frames", np.array(400), "leave 0 to 400"),
        ("frames", np.array(2**40), "required 0"),
        ("kept", np.array([[0, 100], [90, 500]]), "overlap"),
        ("kept", np.array([[0, 100], [150, 5000]]), "leave 0 to 500"),
        ("kept", np.zeros((0, 2), int), "blocks"),
        ("spacing", np.array(0.5), "required 1"),
        ("spacing", np.array(7.0), "blocks"),
        ("length", np.array(0), "required 1"),
        ("length", np.array(3), "required"),
        ("length", np.array(257), "required 1 to 256"),
        ("spacing", np.array(101.0), "required 1 to 100"),
        ("step", np.array(0.0), "more than 0"),
        ("step", np.array(np.inf), "finite"),
        ("used", ARRAYS["used"][:-1], "places"),
        ("used", np.full_like(ARRAYS["used"], 1), "different"),
        ("used", ARRAYS["used"] + 1000, "required 0 to"),
        ("low", ARRAYS["low"][:, 1:], "high of shape"),
        ("low", ARRAYS["low"][1:], "places"),
        ("low", ARRAYS["low"].astype(float), "whole numbers"),
        ("low", np.full(ARRAYS["low"].shape, 1000), "required -127"),
        ("high", np.full(ARRAYS["high"].shape, 2**40), "required"),
    ):
        assert name in ARRAYS
        with pytest.raises(ModelFormatError, match=says):
            motion_store_from_arrays(ARRAYS | {name: array})
