import numpy as np
import pytest

from lipmotion.motion.space import fit_space
from lipmotion.types import Channel

CHANNELS = tuple(map(Channel, ("x_1", "opening", "y_1", "jaw_open", "z_1")))


def motion(frames: int = 50) -> np.ndarray:
    return np.random.default_rng(1).normal(0.2, 1, (frames, 5)) * [1, 2, 0.5, 3, 0.1]


def test_distances_are_modelled_as_they_are_and_points_in_components():
    space = fit_space(CHANNELS, motion(), components=2)
    assert space.direct_names == ("opening", "jaw_open")
    assert space.reduce(motion()).shape == (50, 4)
    assert np.array_equal(space.reduce(motion())[:, :2], motion()[:, [1, 3]])


def test_fewer_components_lose_least():
    space = fit_space(CHANNELS, motion(), components=2)
    values, _ = space.restore(space.reduce(motion()), np.ones((50, 4)))
    lost = motion() - values
    smallest = np.linalg.eigvalsh(np.cov(motion()[:, [0, 2, 4]].T, bias=True))[0]
    assert np.square(lost).sum(axis=1).mean() == pytest.approx(smallest)


def test_variance_is_carried_through_the_basis():
    space = fit_space(CHANNELS, motion(), components=2)
    variance = np.random.default_rng(2).uniform(0.1, 1, (1, 4))
    _, spread = space.restore(np.zeros((1, 4)), variance)
    assert spread[0, [1, 3]] == pytest.approx(variance[0, :2])
    assert spread[0, [0, 2, 4]] == pytest.approx(
        np.diag(space.points.basis.T @ np.diag(variance[0, 2:]) @ space.points.basis)
    )
