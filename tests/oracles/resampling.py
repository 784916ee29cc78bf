"""Resampling and blending computed pixel by pixel, from the definitions."""

import math

import numpy as np

A = -0.5
"""Parameter of cubic convolution (Keys 1981)."""


def kernel(distance: float, kind: str) -> float:
    """Return the weight of a pixel at a distance along one side."""
    distance = abs(distance)
    if kind == "linear":
        return max(0.0, 1 - distance)
    if distance <= 1:
        return (A + 2) * distance**3 - (A + 3) * distance**2 + 1
    if distance < 2:
        return A * distance**3 - 5 * A * distance**2 + 8 * A * distance - 4 * A
    return 0.0


def value(picture: np.ndarray, x: float, y: float, kind: str) -> np.ndarray:
    """Return the colours at a position; outside the picture its outermost pixels repeat."""
    height, width = picture.shape[:2]
    total = np.zeros(picture.shape[2:])
    for row in range(math.floor(y) - 2, math.floor(y) + 4):
        for column in range(math.floor(x) - 2, math.floor(x) + 4):
            pixel = picture[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            total = total + kernel(x - column, kind) * kernel(y - row, kind) * pixel.astype(float)
    return total


def resample(picture: np.ndarray, to_source: np.ndarray, size: tuple[int, int], kind: str) -> np.ndarray:
    """Return the new picture [shape=(h, w, C)]."""
    new = np.empty((*size, picture.shape[2]))
    for row in range(size[0]):
        for column in range(size[1]):
            x, y = to_source @ [column, row, 1]
            new[row, column] = value(picture, x, y, kind)
    return new


def blended(part: np.ndarray, patch: np.ndarray, weight: np.ndarray, to_patch: np.ndarray, kind: str) -> np.ndarray:
    """Return a part of a frame with the patch blended in, before rounding."""
    new = resample(patch, to_patch, part.shape[:2], kind)
    share = resample(weight[..., None], to_patch, part.shape[:2], "linear")
    return np.clip(part + share * (new - part), 0, 255)
