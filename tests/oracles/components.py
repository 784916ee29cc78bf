"""Principal components by singular value decomposition of all values."""

import numpy as np


def components(values: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean, and the first components [shape=(count, D)], the entry furthest from 0 positive."""
    mean = values.mean(axis=0)
    _, _, rows = np.linalg.svd(values - mean, full_matrices=False)
    kept = [row if row[np.abs(row).argmax()] > 0 else -row for row in rows[:count]]
    return mean, np.array(kept)


def share(values: np.ndarray, basis: np.ndarray) -> float:
    """Return the share of the variance that a basis explains."""
    centred = values - values.mean(axis=0)
    return sum(float(np.square(centred @ row).sum()) for row in basis) / float(np.square(centred).sum())
