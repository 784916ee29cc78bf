"""Measures of pictures of a video: likeness to other pictures, sharpness, flicker, seams, and changes of colour.

Pictures are arrays [shape=(T, H, W, 3)] of grey levels from 0 to 255, one picture a frame, of any type. "Made" pictures
are synthetic ones; "true" pictures are the recorded ones at the same times.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from lipmotion.errors import InputError

Pictures = NDArray[np.uint8] | NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]
Curve = NDArray[np.float64]

WHITE = 255  # the largest level of a colour
EQUAL_DB = 100.0  # stated for equal pictures
WINDOW_PX = 1.5  # standard deviation of the window of ``structural_similarity``. Source: Wang et al. 2004
STABLE = (0.01, 0.03)
"""Constants of ``structural_similarity`` that keep its fractions stable, as shares of the largest grey level."""
NEAR_PX = 1.0  # the outline of a region is where its edge is at most this far away: interpolation spreads a step so far
APART_PX, BESIDE_PX = 2.0, 6.0
"""The skin beside an outline is from the first to the second of these distances from it, on either side."""


@dataclass(frozen=True, eq=False)
class OutlineSlopes:
    """How steep pictures are across the outline of a region: mean size of the derivative, grey levels a pixel.

    at      : on the outline itself [shape=(T,)]
    inside  : beside the outline, in the region [shape=(T,)]
    outside : beside the outline, out of the region [shape=(T,)]
    """

    at: Curve
    inside: Curve
    outside: Curve

    @property
    def seam(self) -> float:
        """The slope on the outline over that beside it: about 1 without a seam; NaN where pictures have no slope."""
        return _ratio(self.at, (self.inside + self.outside) / 2)


@dataclass(frozen=True)
class ColourChange:
    """How the colour of a region differs from that around it, beside the same difference in true pictures.

    offset : mean over time of the change, mean of the sizes of the three colours, grey levels
    drift  : standard deviation over time of the change, root mean square of the three colours, grey levels
    """

    offset: float
    drift: float


def picture_figures(made: Pictures, true: Pictures) -> dict[str, float]:
    """Return the measures of made pictures beside true ones, by name.

    ``psnr_db`` and ``ssim`` are means over frames. ``sharpness``, ``contrast``, ``colour_edges`` and ``flicker`` are
    ratios to the true pictures, where 1 is right; NaN where these have none.
    Raises InputError: pictures of different shapes, or fewer than three.
    """
    return {
        "psnr_db": float(psnr_db(made, true).mean()),
        "ssim": float(structural_similarity(made, true).mean()),
        "sharpness": _ratio(sharpness(made), sharpness(true)),
        "contrast": _ratio(contrast(made), contrast(true)),
        "colour_edges": _ratio(colour_edges(made), colour_edges(true)),
        "flicker": _ratio(flicker(made), flicker(true)),
    }


def outline_figures(made: Pictures, true: Pictures, region: Mask) -> dict[str, float]:
    """Return the measures of the edge of what was put into made pictures, beside true ones, by name.

    region : bool array [shape=(H, W)], what was put in
    ``seam`` is that of ``OutlineSlopes``; ``seam_ratio`` is the slope on the outline over that of the true pictures at
    the same place, NaN where these have none. ``colour_offset`` and ``colour_drift`` compare the skin inside the
    outline with that outside (``ColourChange``).
    Raises InputError: pictures of different shapes, or a region without an inside or an outside.
    """
    _check(made, true)
    slopes, true_slopes = outline_slopes(made, region), outline_slopes(true, region)
    change = colour_change(made, true, *skin_beside(region))
    return {
        "seam": slopes.seam,
        "seam_ratio": _ratio(slopes.at, true_slopes.at),
        "colour_offset": change.offset,
        "colour_drift": change.drift,
    }


def psnr_db(made: Pictures, true: Pictures) -> Curve:
    """Return the peak signal-to-noise ratio of every frame, of all its pixels and colours, dB [shape=(T,)].

    It is 20·log10(255 / root mean square of the differences), at most ``EQUAL_DB``, which stands for equal pictures.
    Raises InputError: pictures of different shapes.
    """
    _check(made, true)
    error = np.square(_levels(made) - _levels(true)).mean(axis=(1, 2, 3), dtype=float)
    least = WHITE**2 / 10 ** (EQUAL_DB / 10)
    ratio: Curve = 10 * np.log10(WHITE**2 / np.maximum(error, least))
    return ratio


def structural_similarity(made: Pictures, true: Pictures) -> Curve:
    """Return the structural similarity (SSIM) of every frame, mean of its pixels and colours [shape=(T,)].

    Raises InputError: pictures of different shapes.
    Source: Wang et al. 2004, Eq. 13, with their Gaussian window of 11 × 11 px. Deviation: pixels near the edge count,
    with a window that is continued by reflection; scikit-image leaves out 5 px on each side.
    """
    _check(made, true)
    some, others = _levels(made), _levels(true)
    local = partial(gaussian_filter, sigma=(0, WINDOW_PX, WINDOW_PX, 0), truncate=3.5)
    mean, true_mean = local(some), local(others)
    variance, true_variance = local(some * some) - mean**2, local(others * others) - true_mean**2
    shared = local(some * others) - mean * true_mean
    light, contrast = ((share * WHITE) ** 2 for share in STABLE)
    above = (2 * mean * true_mean + light) * (2 * shared + contrast)
    below = (mean**2 + true_mean**2 + light) * (variance + true_variance + contrast)
    similarity: Curve = (above / below).mean(axis=(1, 2, 3), dtype=float)
    return similarity


def sharpness(pictures: Pictures) -> Curve:
    """Return the mean energy of the gradient of every frame, grey² per px² [shape=(T,)].

    It is the mean square of the difference of neighbours down, plus that of neighbours across, over all colours.
    Raises InputError: not pictures.
    """
    _check(pictures)
    return _energy(_levels(pictures))


def contrast(pictures: Pictures) -> Curve:
    """Return the standard deviation of the brightness over the pixels of every frame, grey levels [shape=(T,)].

    Brightness is the mean of the three colours. A mouth whose dark inside and bright teeth are averaged has too little.
    Raises InputError: not pictures.
    """
    _check(pictures)
    deviation: Curve = _levels(pictures).mean(axis=3).std(axis=(1, 2), dtype=float)
    return deviation


def colour_edges(pictures: Pictures) -> Curve:
    """Return the ``sharpness`` of red less green and of blue less green [shape=(T,)]: coloured fringes have much of it.

    Raises InputError: not pictures.
    """
    _check(pictures)
    levels = _levels(pictures)
    return _energy(levels[..., [0, 2]] - levels[..., [1]])


def flicker(pictures: Pictures) -> Curve:
    """Return the mean size of the second difference over time, grey levels [shape=(T − 2,)], T ≥ 3.

    Even movement has little of it, a change that is taken back in the next frame has twice its size.
    Raises InputError: not pictures, or fewer than three.
    """
    _check(pictures)
    if len(pictures) < 3:
        raise InputError(f"{len(pictures)} pictures, required at least 3 in a row to measure flicker")
    second = np.diff(_levels(pictures), 2, axis=0)
    sizes: Curve = np.abs(second).mean(axis=(1, 2, 3), dtype=float)
    return sizes


def outline_slopes(pictures: Pictures, region: Mask) -> OutlineSlopes:
    """Return how steep pictures are across the outline of a region, and beside it.

    region : bool array [shape=(H, W)]
    The derivative is that of central differences along the normal of the outline, mean size over the three colours.
    Raises InputError: not pictures, or a region of another size, without an inside, or without an outside.
    """
    _check(pictures)
    distance = _signed_distance(pictures, region)
    normal = np.stack(np.gradient(gaussian_filter(distance, 1.0)))
    normal /= np.maximum(np.linalg.norm(normal, axis=0), 1e-9)
    levels = _levels(pictures)
    down, across = np.gradient(levels, axis=1), np.gradient(levels, axis=2)
    slope = np.abs(down * normal[0][..., None] + across * normal[1][..., None]).mean(axis=3, dtype=float)
    inside, outside = skin_beside(region)
    return OutlineSlopes(*(_means(slope[..., None], part)[:, 0] for part in (_near(distance), inside, outside)))


def skin_beside(region: Mask) -> tuple[Mask, Mask]:
    """Return the skin beside the outline of a region: the part inside it, and the part outside [each shape=(H, W)].

    Raises InputError: a region without such parts.
    """
    distance = _signed_distance(None, region)
    parts = tuple((side * distance > APART_PX) & (side * distance <= BESIDE_PX) for side in (1, -1))
    if not all(part.any() for part in parts):
        raise InputError(
            f"a region of {int(region.sum())} of {region.shape[0]} × {region.shape[1]} px, required pixels more than "
            f"{APART_PX:g} px from its outline on either side; measure it in a larger picture"
        )
    return parts[0], parts[1]


def colour_change(made: Pictures, true: Pictures, patch: Mask, around: Mask) -> ColourChange:
    """Return how the colour of a patch changed against that around it, beside true pictures.

    patch, around : bool arrays [shape=(H, W)], pixels that show skin, as of ``skin_beside``
    Of every frame and colour it takes the mean of the patch less the mean around it, made less true.
    Raises InputError: pictures of different shapes, or masks of another size or without a pixel.
    """
    _check(made, true)
    for mask in (patch, around):
        if mask.shape != made.shape[1:3] or mask.dtype != np.bool_ or not mask.any():
            raise InputError(
                f"a mask of shape {mask.shape} and type {mask.dtype} with {int(mask.sum())} pixels, required bool, of "
                f"shape {made.shape[1:3]} with at least one pixel"
            )
    steps = [_means(_levels(pictures), patch) - _means(_levels(pictures), around) for pictures in (made, true)]
    change = steps[0] - steps[1]
    return ColourChange(float(np.abs(change.mean(axis=0)).mean()), float(np.sqrt(change.var(axis=0).mean())))


def _energy(levels: NDArray[np.float32]) -> Curve:
    """Return the mean square of differences of neighbours, those down plus those across [shape=(T,)]."""
    down, across = (np.square(np.diff(levels, axis=axis)).mean(axis=(1, 2, 3), dtype=float) for axis in (1, 2))
    energy: Curve = down + across
    return energy


def _means(values: NDArray[np.floating[Any]], part: Mask) -> Curve:
    """Return the mean over some pixels of every frame and colour [shape=(T, C)]."""
    means: Curve = values[:, part].mean(axis=1, dtype=float)
    return means


def _near(distance: NDArray[np.float64]) -> Mask:
    near: Mask = np.abs(distance) <= NEAR_PX
    return near


def _signed_distance(pictures: Pictures | None, region: Mask) -> NDArray[np.float64]:
    """Return the distance of every pixel to the outline of a region, px, positive inside.

    Raises InputError: a region of another size than the pictures, without an inside, or without an outside.
    """
    size = region.shape if pictures is None else pictures.shape[1:3]
    if region.dtype != np.bool_ or region.ndim != 2 or region.shape != size or region.all() or not region.any():
        raise InputError(
            f"a region of shape {region.shape} and type {region.dtype} with {int(region.sum())} pixels, required bool, "
            f"of shape {size}, with pixels inside and outside; measure it in a larger picture"
        )
    distance: NDArray[np.float64] = np.where(
        region, distance_transform_edt(region) - 0.5, 0.5 - distance_transform_edt(~region)
    )
    return distance


def _ratio(made: Curve, true: Curve) -> float:
    """Return the ratio of two means; NaN where the second is 0."""
    below = float(true.mean())
    return float(made.mean()) / below if below > 0 else float("nan")


def _levels(pictures: Pictures) -> NDArray[np.float32]:
    return pictures.astype(np.float32)


def _check(made: Pictures, true: Pictures | None = None) -> None:
    """Raise InputError unless these are pictures, all of one shape."""
    required = f"{true.shape}" if true is not None else "(T, H, W, 3)"
    shape = made.shape
    if made.ndim != 4 or shape[3] != 3 or not made.size or (true is not None and true.shape != shape):
        raise InputError(f"pictures of shape {shape}, required {required}, at least one of them, and three colours")
