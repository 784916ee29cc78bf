import numpy as np
import pytest

from lipmotion.faces.portrait.bands import COLUMNS, Bands
from lipmotion.faces.portrait.view import View


def canvas(size: int = 64) -> tuple[Bands, np.ndarray, np.ndarray]:
    window = View(size).window(-1, -1, 1, 1)
    picture = np.zeros((window.y1 - window.y0, window.x1 - window.x0, 3), dtype=np.float32)
    return Bands.of(picture, window), picture, window.columns(COLUMNS).reshape(-1, COLUMNS).T


def naive_cover(bands: Bands, top: np.ndarray, bottom: np.ndarray, fine: int = 200) -> np.ndarray:
    """Return the coverage by counting points: ``fine`` points down each pixel in every column."""
    cover = np.zeros((len(bands.y), len(bands.x)))
    steps = (np.arange(fine) + 0.5) / fine - 0.5
    for row, y in enumerate(bands.y[:, 0]):
        points = y + steps * bands.pixel
        hit = (points[:, None, None] >= top) & (points[:, None, None] < bottom)
        cover[row] = hit.mean(axis=(0, 1))
    return cover


def test_cover_is_that_of_counted_points():
    bands, picture, x = canvas()
    top, bottom = -0.4 + 0.5 * x * x, 0.35 - 0.3 * np.abs(x)
    bands.fill(top, bottom, (100, 100, 100))
    assert picture[..., 0] / 100 == pytest.approx(naive_cover(bands, top, bottom), abs=0.01)


def test_thin_and_empty_bands():
    bands, picture, x = canvas()
    bands.fill(np.zeros_like(x), np.zeros_like(x), (255, 255, 255))
    assert not picture.any()
    bands.fill(np.zeros_like(x), np.full_like(x, bands.pixel / 10), (255, 255, 255))
    assert picture[..., 0].sum(axis=0) == pytest.approx(np.full(len(bands.x), 25.5), abs=0.1)


def test_painting_on_some_rows_paints_the_picture():
    bands, picture, x = canvas()
    whole = np.zeros_like(picture)
    Bands(whole, bands.x, bands.y, bands.pixel).fill(x * 0 - 0.2, x * 0 + 0.2, (9, 99, 200), 0.5)
    bands.between(-0.2, 0.2).fill(x * 0 - 0.2, x * 0 + 0.2, (9, 99, 200), 0.5)
    assert (picture == whole).all()
    assert picture.any()


def test_depth_runs_from_top_to_bottom():
    bands, _, x = canvas()
    depth = bands.depth(np.full_like(x, -0.5), np.full_like(x, 0.5))
    expected = np.broadcast_to(np.clip(bands.y + 0.5, 0, 1), depth.shape)
    assert depth == pytest.approx(expected, abs=1e-5)
