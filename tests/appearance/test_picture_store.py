from __future__ import annotations

import numpy as np
import pytest

from lipmotion.appearance.picture_store import (
    PictureStore,
    compress_pictures,
    picture_store_arrays,
    picture_store_from_arrays,
)
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.storage.archive import read_archive, write_archive


def pictures(count: int = 60, noise: float = 3.0, height: int = 10, width: int = 12) -> np.ndarray:
    """A dark ellipse that opens and closes on a lighter ground, and noise of a camera."""
    draw = np.random.default_rng(0)
    y, x = np.mgrid[:height, :width]
    opening = 2 + np.sin(np.arange(count) / 4) + 0.3 * np.sin(np.arange(count) / 2.3)
    inside = ((x - width / 2) / 4) ** 2 + ((y - height / 2) / opening[:, None, None]) ** 2
    levels = 60 + 120 / (1 + np.exp(-6 * (inside - 1)))[..., None] * [1, 0.6, 0.5]
    return np.clip(levels + draw.normal(0, noise, levels.shape), 0, 255).astype(np.uint8)


def psnr_db(store: PictureStore, values: np.ndarray) -> np.ndarray:
    """The definition: 10·log10(255² / mean square difference) of each picture."""
    frames = np.concatenate([np.arange(first, stop) for first, stop in store.kept])
    difference = store.rows(frames).astype(float) - values[frames]
    return 10 * np.log10(255**2 / np.maximum(np.square(difference).mean(axis=(1, 2, 3)), 1e-9))


@pytest.fixture(scope="module")
def store() -> PictureStore:
    return compress_pictures(pictures(), 36.0, kept=[(0, 20), (25, 60)])


def test_the_promise_is_kept() -> None:
    values = pictures()
    for target in (25.0, 40.0, 50.0):
        store = compress_pictures(values, target, kept=[(0, 20), (25, 60)])
        worst = float(np.percentile(psnr_db(store, values), 1))
        assert worst > target - 1e-3
        assert worst == pytest.approx(store.psnr_db, abs=0.1)


def test_pictures_of_few_directions_take_few_components() -> None:
    store = compress_pictures(pictures(100, noise=0.0), 34.0)
    assert len(store.table.basis) < 12
    assert store.nbytes < pictures(100).nbytes / 3


def test_more_components_are_computed_where_the_first_do_not_suffice() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (80, 12, 16, 3), np.uint8)
    store = compress_pictures(noise, 30.0)
    assert len(store.table.basis) > 64
    assert np.percentile(psnr_db(store, noise), 1) > 30 - 1e-3


def test_any_pictures_are_those_of_the_whole(store: PictureStore) -> None:
    whole = store.rows(slice(25, 60))
    assert whole.dtype == np.uint8
    assert whole.shape == (35, 10, 12, 3)
    assert np.array_equal(store.rows([59, 25, 31, 31]), whole[[34, 0, 6, 6]])
    assert store.rows([]).shape == (0, 10, 12, 3)
    assert len(store) == 60


def test_few_pictures() -> None:
    for count in (0, 1, 2):
        store = compress_pictures(pictures(count), 40.0)
        again = picture_store_from_arrays(picture_store_arrays(store))
        assert again.rows(slice(None)).shape == (count, 10, 12, 3)
        if count:
            assert psnr_db(again, pictures(count)).min() > 40 - 1e-3


def test_equal_pictures_come_back() -> None:
    values = np.repeat(pictures(1), 9, axis=0)
    store = compress_pictures(values, 40.0)
    assert np.array_equal(store.rows(slice(None)), values)
    assert store.psnr_db == pytest.approx(100.0)


def test_the_arrays_survive_a_file(store: PictureStore, tmp_path) -> None:
    write_archive(tmp_path / "p", {}, picture_store_arrays(store))
    again = picture_store_from_arrays(read_archive(tmp_path / "p"))
    assert np.array_equal(again.rows([3, 40]), store.rows([3, 40]))
    assert again.size == (10, 12)
    assert again.psnr_db == pytest.approx(store.psnr_db)
    with pytest.raises(InputError, match="frame 22 was left out"):
        again.rows([3, 22])


def test_bad_input_is_refused() -> None:
    for values, target, says in (
        (pictures()[..., :2], 36.0, "required"),
        (pictures().astype(float), 36.0, "uint8"),
        (np.zeros((4, 0, 5, 3), np.uint8), 36.0, "at least one pixel"),
        (pictures(), 5.0, "required 10 to 50"),
        (pictures(), float("nan"), "required 10 to 50"),
    ):
        with pytest.raises(InputError, match=says):
            compress_pictures(values, target)


def test_damaged_arrays_are_refused(store: PictureStore) -> None:
    arrays = picture_store_arrays(store)
    for changes, says in (
        ({"size": np.array([10, 13])}, "required 10 × 13 × 3"),
        ({"size": np.array([0, 12])}, "required 1"),
        ({"mean": arrays["mean"][1:]}, "shape"),
        ({"used": arrays["used"] + 100}, "required 0"),
    ):
        with pytest.raises(ModelFormatError, match=says):
            picture_store_from_arrays(arrays | changes)
