"""The noise of a camera: estimated from recorded pictures in which nothing moves, and added to generated ones."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared

Pictures = NDArray[np.uint8]
Array = NDArray[np.float64]

STILL_SHARE = 0.1  # share of the frames of a clip, those in which least moves, from which noise is estimated
DIFFERENCE_GAIN = 6.0  # variance of the second difference 1, −2, 1 of independent values of variance 1
ROUNDING_VARIANCE = 1 / 12  # variance of rounding to whole grey levels
FIELD_SCALE = 2  # height and width of the field of noise, in heights and widths of a picture
WHITE = 255
LARGEST_SPREAD_PX = 3.0  # noise is taken to be spread over no more: what is smoother is movement
MIN_CORRELATION = 0.02  # neighbouring pixels that are correlated less are taken as independent


@dataclass(frozen=True, eq=False)
class CameraNoise:
    """Gaussian noise of a camera, the same everywhere in the picture.

    covariance : of red, green and blue in one pixel [shape=(3, 3)], grey²
    spread_px  : standard deviation of the Gaussian window that makes white noise as smooth as this noise, down and
                 across [shape=(2,)]; 0: pixels are independent
    Source: Xie & Liu 2007, §6.1: "the noise is estimated from the original facial images". How is not said.
    """

    covariance: Array
    spread_px: Array


def estimate_noise(clips: Iterable[Pictures]) -> CameraNoise:
    """Return the noise of recorded mouth pictures.

    clips : pictures of consecutive frames, clip by clip [each shape=(T, H, W, 3)], uint8
    In the stillest ``STILL_SHARE`` of the frames of every clip, the second difference over time leaves out what is
    constant and what moves evenly; √6 times the noise remains. What else moves still counts as noise, so this is an
    upper limit; noise that stays the same from frame to frame, as in compressed video, is not seen at all.
    Raises InputError: not pictures, or no clip of three frames.
    """
    products, down, across, pixels = np.zeros((3, 3)), np.zeros(2), np.zeros(2), 0
    for pictures in clips:
        if pictures.ndim != 4 or pictures.shape[3] != 3 or pictures.dtype != np.uint8:
            received = f"pictures of shape {pictures.shape} and type {pictures.dtype}"
            raise InputError(f"{received}, required (T, H, W, 3), uint8")
        if len(pictures) < 3 or not pictures.size:
            continue
        steps = np.diff(pictures.astype(np.float32), axis=0)
        change = np.abs(steps).mean(axis=(1, 2, 3))
        change = np.maximum(change[1:], change[:-1])
        stillest = np.argsort(change, kind="stable")[: max(1, round(STILL_SHARE * len(change)))]
        still = steps[stillest + 1] - steps[stillest]  # second differences over time
        products += np.einsum("thwc,thwd->cd", still, still)
        down += _sum_neighbours(still, 1)
        across += _sum_neighbours(still, 2)
        pixels += still[..., 0].size
    if not pixels:
        raise InputError("no clip of at least three pictures; required at least one, to estimate the noise of a camera")
    covariance = products / (DIFFERENCE_GAIN * pixels) - ROUNDING_VARIANCE * np.eye(3)
    values, vectors = np.linalg.eigh(covariance)
    return CameraNoise((vectors * np.maximum(values, 0)) @ vectors.T, np.array([_spread(down), _spread(across)]))


@dataclass(frozen=True, eq=False)
class NoiseSource:
    """Adds noise to the pictures of one video.

    Noise is drawn once, for a field of twice the height and width that has no edges, and each frame is given
    another part of it: that is many times as fast as new noise for every frame.
    """

    noise: CameraNoise
    size: tuple[int, int]
    seed: int

    def add(self, pictures: Pictures, first_frame: int = 0) -> Pictures:
        """Return pictures [shape=(T, H, W, 3)] with noise.

        first_frame : number of the first of these pictures in the video: the noise of a frame depends on the seed and
                      its number alone, so a video can be made in parts of any length
        Raises InputError: not pictures, or of another size.
        """
        height, width = self.size
        if pictures.ndim != 4 or pictures.shape[1:] != (height, width, 3) or pictures.dtype != np.uint8:
            received = f"pictures of shape {pictures.shape} and type {pictures.dtype}"
            raise InputError(f"{received}, required (T, {height}, {width}, 3), uint8")
        result = np.empty_like(pictures)
        for number, picture in enumerate(pictures):
            draw = np.random.default_rng([self.seed, first_frame + number])
            top, left = draw.integers(FIELD_SCALE * height), draw.integers(FIELD_SCALE * width)
            levels = self._field[top : top + height, left : left + width] + picture
            result[number] = np.clip(np.rint(levels, out=levels), 0, WHITE, out=levels)
        return result

    @cached_property
    def _field(self) -> NDArray[np.float32]:
        """The field of noise, followed by its own start, so that a part may begin anywhere."""
        from scipy.ndimage import convolve1d

        values, vectors = np.linalg.eigh(self.noise.covariance)
        mixing = (vectors * np.sqrt(np.maximum(values, 0))).T.astype(np.float32)
        height, width = self.size
        size = FIELD_SCALE * height, FIELD_SCALE * width, 3
        field = np.random.default_rng(self.seed).standard_normal(size, np.float32)
        for axis, spread in enumerate(self.noise.spread_px.tolist()):
            if spread > 0:
                reach = int(np.ceil(4 * spread))
                window = np.exp(-(np.arange(-reach, reach + 1) ** 2) / (2 * spread**2))
                window = (window / np.linalg.norm(window)).astype(np.float32)  # white noise keeps its variance
                field = convolve1d(field, window, axis=axis, mode="wrap")
        return np.pad(field @ mixing, ((0, height), (0, width), (0, 0)), mode="wrap")


def camera_noise_to_arrays(noise: CameraNoise) -> dict[str, NDArray[Any]]:
    """Return the noise of a camera serialised as arrays (``NOISE_ARRAYS``)."""
    return {"noise_covariance": noise.covariance, "noise_spread_px": noise.spread_px}


def camera_noise_from_arrays(arrays: Arrays) -> CameraNoise:
    """Deserialise noise. Raises ModelFormatError: an array is missing, unknown, out of range, or no covariance."""
    with format_errors("the noise of the camera", "build it again from the corpus"):
        refuse_undeclared(arrays, NOISE_ARRAYS)
        stored = check_arrays(arrays, NOISE_ARRAYS)
        covariance = stored["noise_covariance"]
        if not np.allclose(covariance, covariance.T) or np.linalg.eigvalsh(covariance)[0] < -EIGENVALUE_TOLERANCE:
            required = "required a symmetric one without negative eigenvalues"
            raise ValueError(f"noise_covariance is no covariance matrix, {required}")
        return CameraNoise(covariance, stored["noise_spread_px"])


EIGENVALUE_TOLERANCE = 1e-6  # an eigenvalue may be so far below 0 by rounding, grey²
NOISE_ARRAYS = {
    "noise_covariance": ArraySpec(np.float64, "3 3", -(255.0**2), 255.0**2),
    "noise_spread_px": ArraySpec(np.float64, "2", 0, LARGEST_SPREAD_PX),
}


def _sum_neighbours(values: NDArray[np.float32], axis: int) -> Array:
    """Return the sum of products of neighbouring pixels along an axis, and that of squares of as many pixels."""
    count = values.shape[axis]
    before, after = (np.take(values, range(first, count - 1 + first), axis=axis) for first in (0, 1))
    return np.array([np.vdot(before, after), (np.vdot(before, before) + np.vdot(after, after)) / 2], float)


def _spread(sums: Array) -> float:
    """Return the deviation of the Gaussian window after which neighbours are correlated so: ρ = exp(−1 / 4s²)."""
    correlation = sums[0] / sums[1] if sums[1] > 0 else 0.0
    if correlation < MIN_CORRELATION:
        return 0.0
    return float(min(np.sqrt(-1 / (4 * np.log(min(correlation, 1 - MIN_CORRELATION)))), LARGEST_SPREAD_PX))
