import numpy as np
import pytest

from lipmotion.stats.rounding import varies


def rounded(value: float, seed: int = 0) -> np.ndarray:
    """Return a constant with the rounding errors of another processor."""
    return value * (1 + 1e-7 * np.random.default_rng(seed).uniform(-1, 1, size=(500, 1)))


def test_rounding_of_a_constant_is_no_movement() -> None:
    for value in (0.0, 1e-30, 0.3, -7.0, 1e6):
        assert not varies(rounded(value)).any()


@pytest.mark.parametrize("value", [0.0, 0.3, -7.0, 1e6])
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_a_thousandth_of_the_magnitude_is_movement_in_any_unit(value: float, scale: float) -> None:
    moving = scale * (value + max(abs(value), 1.0) * 1e-3 * np.sin(np.arange(500)))[:, None]
    assert varies(moving).all()


def test_columns_are_judged_apart() -> None:
    values = np.concatenate([rounded(1e6), np.linspace(0, 1e-3, 500)[:, None], rounded(0.0)], axis=1)
    assert varies(values).tolist() == [False, True, False]
