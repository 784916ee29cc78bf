"""Poisson cloning, pixel by pixel as the equation is printed, by a sparse direct solver."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu


def cloned(mask: np.ndarray, source: np.ndarray, background: np.ndarray) -> np.ndarray:
    """Return the solution before rounding [shape=(h, w, C)]: Pérez et al. 2003, Eq. 7, for every pixel of the mask.

    |N| f(p) − Σ f(q) inside = Σ b(q) on the edge + Σ (s(p) − s(q)), over the four neighbours q of p.
    """
    result = background.astype(float)
    pixels = [tuple(pixel) for pixel in np.argwhere(mask)]
    number = {pixel: n for n, pixel in enumerate(pixels)}
    rows, columns, values = [], [], []
    right = np.zeros((len(pixels), source.shape[2]))
    for n, (y, x) in enumerate(pixels):
        rows.append(n)
        columns.append(n)
        values.append(4.0)
        for q in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
            right[n] += source[y, x].astype(float) - source[q]
            if q in number:
                rows.append(n)
                columns.append(number[q])
                values.append(-1.0)
            else:
                right[n] += background[q]
    system = csr_array((values, (rows, columns)), shape=(len(pixels), len(pixels))).tocsc()
    result[mask] = splu(system).solve(right)
    return result
