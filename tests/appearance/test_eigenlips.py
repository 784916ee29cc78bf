from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.motion.eigenlips import Eigenlips, eigenlips_from_arrays, eigenlips_to_arrays, fit_eigenlips
from oracles.components import components, share


def pictures(seed: int = 0, count: int = 40, height: int = 9, width: int = 12) -> np.ndarray:
    """Coloured blobs that come and go, and a little noise."""
    draw = np.random.default_rng(seed)
    blobs = draw.normal(0, 1, (6, height, width, 3)) * 0.6 ** np.arange(6)[:, None, None, None]
    values = 120 + 25 * np.einsum("tk,khwc->thwc", draw.normal(0, 1, (count, 6)), blobs)
    return np.clip(values + draw.normal(0, 1, values.shape), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def space() -> Eigenlips:
    return fit_eigenlips(pictures(), 5)


def test_each_colour_has_the_components_of_its_own(space: Eigenlips) -> None:
    assert (space.mean.shape, space.basis.shape, space.size) == ((3, 108), (3, 5, 108), (9, 12))
    for colour in range(3):
        values = pictures()[..., colour].reshape(40, -1).astype(float)
        mean, basis = components(values, 5)
        assert space.mean[colour] == pytest.approx(mean, rel=1e-6)
        assert space.basis[colour] == pytest.approx(basis, abs=1e-4)
        assert space.explained[colour] == pytest.approx(share(values, basis), rel=1e-5)


def test_coefficients_are_what_the_paper_says(space: Eigenlips) -> None:
    """Eq. 13, one picture and one component at a time; red first, then green, then blue."""
    images = pictures(1, 3)
    coefficients = space.project(images)
    assert (coefficients.shape, coefficients.dtype) == ((3, 15), np.float32)
    for t, colour, k in np.ndindex(3, 3, 5):
        left = images[t, :, :, colour].astype(float).ravel() - space.mean[colour]
        assert coefficients[t, 5 * colour + k] == pytest.approx(space.basis[colour, k] @ left, abs=1e-2)


def test_all_components_restore_the_pictures() -> None:
    images = pictures(count=12)
    space = fit_eigenlips(images, 30)
    assert space.basis.shape[1] == 11  # twelve pictures span no more
    assert np.abs(space.restore(space.project(images)).astype(int) - images).max() <= 1
    assert space.explained == pytest.approx([1, 1, 1], abs=1e-6)


def test_more_components_restore_better() -> None:
    images = pictures(2)
    spaces = [fit_eigenlips(images, count) for count in (1, 3, 6)]
    errors = [np.square(space.restore(space.project(images)).astype(float) - images).mean() for space in spaces]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert (np.diff([space.explained for space in spaces], axis=0) > 0).all()


def test_restored_pictures_stay_within_black_and_white(space: Eigenlips) -> None:
    extreme = np.zeros((2, 15), np.float32)
    extreme[:, 0] = -1e6, 1e6
    restored = space.restore(extreme)
    assert (restored.dtype, restored.shape) == (np.uint8, (2, 9, 12, 3))
    assert set(np.unique(restored[..., 0])) == {0, 255}
    assert np.array_equal(space.restore(np.zeros((1, 15)))[0, :, :, 1].ravel(), np.rint(space.mean[1]))


def test_channels_say_colour_and_number(space: Eigenlips) -> None:
    names = [channel.name for channel in space.channels]
    assert (names[0], names[4], names[5], names[-1]) == ("lips_r_01", "lips_r_05", "lips_g_01", "lips_b_05")
    assert {channel.unit for channel in space.channels} == {"grey"}
    assert space.summary.startswith("15 of 12 × 9 px, 9")


def test_as_arrays_and_back_and_damaged_arrays(space: Eigenlips) -> None:
    whole, images = eigenlips_to_arrays(space), pictures(3)
    again = eigenlips_from_arrays(whole)
    assert np.array_equal(again.project(images), space.project(images))
    assert (again.size, again.explained.tolist()) == (space.size, space.explained.tolist())
    for what, array in whole.items():
        number = np.full_like(array, -1 if what == "size" else np.nan)
        for damaged in ({}, {what: array[:-1]}, {what: number}):
            others = {name: each for name, each in whole.items() if name != what}
            with pytest.raises(ModelFormatError, match=r"the eigenlips are damaged .*; train the model again"):
                eigenlips_from_arrays(others | damaged)


def test_what_cannot_be_learned_from() -> None:
    for images, count, message in (
        (pictures()[..., 0], 5, r"shape \(40, 9, 12\) and type uint8, required \(N, H, W, 3\)"),
        (pictures().astype(float), 5, "type float64"),
        (pictures()[:0], 5, r"shape \(0, 9, 12, 3\)"),
        (pictures()[:1], 5, "1 mouth pictures, all the same; required at least two that differ"),
        (pictures(), 0, "0 components asked for, required at least 1"),
    ):
        with pytest.raises(InputError, match=message):
            fit_eigenlips(images, count)


def test_other_pictures_than_those_learned(space: Eigenlips) -> None:
    with pytest.raises(InputError, match=r"shape \(40, 8, 12, 3\) .*required \(T, 9, 12, 3\), uint8; prepare"):
        space.project(pictures(height=8))
    with pytest.raises(InputError, match=r"coefficients of shape \(2, 14\), required \(T, 15\)"):
        space.restore(np.zeros((2, 14)))
    with pytest.raises(InputError, match="required"):
        replace(space, size=(12, 9)).project(pictures())
