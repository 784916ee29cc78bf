"""Curves over time: their Δ (slope) and Δ² (curvature), their modulation spectrum, whether they vary at all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WINDOW_S = 1.28  # length of a window; the windows overlap by half
ROUNDING_SHARE = 1e-6
"""Values that differ by less than this share of the largest are equal: single precision keeps seven digits. Curves
that are modelled vary by 1e-3 of their magnitude and more."""


def with_dynamics(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each value with its Δ = (-½, 0, ½) and Δ² = (1, -2, 1) [shape=(T, 3, P)].

    values : [shape=(T, P)]
    Δ and Δ² of the first and last frame, which need frames outside, are 0; parameter generation gives them no weight.
    Source: Hofer 2008, Eqs. 6–8 (the print's Δ² lost its minus sign).
    """
    dynamics = np.zeros((len(values), 3, values.shape[1]))
    dynamics[:, 0] = values
    dynamics[1:-1, 1] = (values[2:] - values[:-2]) / 2
    dynamics[1:-1, 2] = values[2:] - 2 * values[1:-1] + values[:-2]
    return dynamics


def mark_known_dynamics(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return in which frames Δ and Δ² are known [shape=(T,)]: those that are known with both neighbours."""
    inner = np.zeros_like(mask)
    inner[1:-1] = mask[:-2] & mask[1:-1] & mask[2:]
    return inner


def measure_modulation_spectrum(clips: Sequence[Array], rate_hz: float) -> tuple[Array, Array]:
    """Return frequencies in Hz [shape=(F,)] and the mean power of curves at each of them [shape=(F, P)].

    clips : curves [each shape=(T_i, P)]
    Hann windows, each freed of its mean; a clip shorter than one has one of its length. The frequency 0 is left out.
    Source: Takamichi, Toda, Black, Neubig, Sakti & Nakamura 2016, who compute it over whole utterances.  Deviation: the
    mean over windows, so that clips of different lengths have one spectrum.
    """
    size = max(2 * round(WINDOW_S * rate_hz / 2), 4)
    powers: list[Array] = []
    for clip in clips:
        length = min(size, len(clip))
        window = np.hanning(length + 2)[1:-1, None]
        window /= np.sqrt(np.square(window).sum())
        for start in range(0, len(clip) - length + 1, size // 2):
            piece = clip[start : start + length]
            centred = (piece - (piece * window).sum(axis=0) / window.sum()) * window
            powers.append(np.square(np.abs(np.fft.rfft(centred, size, axis=0))))
    frequencies: Array = np.arange(1.0, size // 2 + 1) * (rate_hz / size)
    mean: Array = np.mean(powers, axis=0)
    return frequencies, mean[1:]


def varies(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which columns of finite values [shape=(T, D)] are not constant but for rounding [shape=(D,)]."""
    return np.asarray(np.ptp(values, axis=0) > ROUNDING_SHARE * np.abs(values).max(axis=0))
