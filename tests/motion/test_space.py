import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.motion.space import fit_space, resample_to_model
from lipmotion.types import Channel

CHANNELS = tuple(map(Channel, ("x_1", "opening", "y_1", "jaw_open", "z_1")))


def motion(frames: int = 50) -> np.ndarray:
    return np.random.default_rng(1).normal(0.2, 1, (frames, 5)) * [1, 2, 0.5, 3, 0.1]


def test_distances_are_modelled_as_they_are_and_points_in_components():
    space = fit_space(CHANNELS, motion(), components=2)
    assert space.direct_names == ("opening", "jaw_open")
    assert space.reduce(motion()).shape == (50, 4)
    assert np.array_equal(space.reduce(motion())[:, :2], motion()[:, [1, 3]])
    values, _ = space.restore(space.reduce(motion()), np.ones((50, 4)))
    least = np.linalg.eigvalsh(np.cov(motion()[:, [0, 2, 4]].T, bias=True))[0]  # that any two components lose
    assert np.square(motion() - values).sum(axis=1).mean() == pytest.approx(least)


def test_variance_is_carried_through_the_basis():
    space = fit_space(CHANNELS, motion(), components=2)
    variance = np.random.default_rng(2).uniform(0.1, 1, (1, 4))
    _, spread = space.restore(np.zeros((1, 4)), variance)
    assert spread[0, [1, 3]] == pytest.approx(variance[0, :2])
    assert spread[0, [0, 2, 4]] == pytest.approx(
        np.diag(space.points.basis.T @ np.diag(variance[0, 2:]) @ space.points.basis)
    )


def seen(count: int) -> np.ndarray:
    return np.ones(count, bool)


@given(
    seed=st.integers(0, 2**32 - 1),
    rate_hz=st.sampled_from([24.0, 25.0, 29.97, 30.0, 50.0, 60.0]),
    count=st.integers(4, 40),
)
@settings(max_examples=30)
def test_a_cubic_comes_back_exactly(seed, rate_hz, count):
    cubic = np.polynomial.Polynomial(np.random.default_rng(seed).normal(0, 1, 4))
    camera_s = np.arange(count) / rate_hz
    frames = int(camera_s[-1] * 100) + 1
    values, valid = resample_to_model(cubic(camera_s)[:, None], seen(count), rate_hz, frames, 100.0)
    assert values[:, 0] == pytest.approx(cubic(np.arange(frames) / 100), abs=1e-9)
    assert valid.all()


def test_camera_frames_keep_their_values():
    values = np.random.default_rng(1).normal(0, 1, (10, 3))
    curves, _ = resample_to_model(values, seen(10), 25.0, 37, 100.0)
    assert curves[::4] == pytest.approx(values, abs=1e-12)


def test_frames_beyond_the_end_or_nearest_to_an_unseen_camera_frame_are_not_valid():
    values = np.arange(5.0)[:, None]
    curves, valid = resample_to_model(values, seen(5), 25.0, 30, 100.0)
    assert curves[17:, 0] == pytest.approx(np.full(13, 4.0))  # the last value holds
    assert np.nonzero(~valid)[0].tolist() == [*range(18, 30)]  # the last camera frame is at 16; 18 is half a frame on
    mask = np.array([True, True, False, True, True])
    _, valid = resample_to_model(values, mask, 25.0, 17, 100.0)
    assert np.nonzero(~valid)[0].tolist() == [6, 7, 8, 9]


def test_one_and_two_camera_frames():
    for count, wanted in ((1, [7.0] * 9), (2, [7.0, 7.25, 7.5, 7.75, 8.0, 8.0, 8.0, 8.0, 8.0])):
        curves, valid = resample_to_model(np.array([[7.0], [8.0]])[:count], seen(count), 25.0, 9, 100.0)
        assert curves[:, 0] == pytest.approx(wanted)
        assert valid.sum() == 4 * count - 2


def test_curvature_does_not_jump():
    """Linear interpolation would make the second difference 0 nearly everywhere, and large at camera frames."""
    curves, _ = resample_to_model(np.sin(9 * np.arange(30) / 25)[:, None], seen(30), 25.0, 110, 100.0)
    bend, wanted = (np.diff(curve, 2)[8:-8] for curve in (curves[:, 0], np.sin(9 * np.arange(110) / 100)))
    assert bend == pytest.approx(wanted, abs=0.05 * np.abs(wanted).max())
