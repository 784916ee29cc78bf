"""Parameter generation with dense matrices."""

import numpy as np


def window_matrix(frames: int) -> np.ndarray:
    """Return W [shape=(3 T, T)]: static rows, then Δ = (-½, 0, ½), then Δ² = (1, -2, 1); 0 at both ends."""
    static, slope, bend = np.eye(frames), np.zeros((frames, frames)), np.zeros((frames, frames))
    for t in range(1, frames - 1):
        slope[t, t - 1], slope[t, t + 1] = -0.5, 0.5
        bend[t, t - 1], bend[t, t], bend[t, t + 1] = 1, -2, 1
    return np.concatenate([static, slope, bend])


def generate(mean, precision, pins=()):
    """Return the trajectory of one channel and its variance, both [shape=(T,)].

    mean, precision : [shape=(T, 3)]
    pins : pairs of frame and value; these frames are taken out of the unknowns
    """
    W = window_matrix(len(mean))
    P = np.diag(precision.T.ravel())
    A, b = W.T @ P @ W, W.T @ P @ mean.T.ravel()
    x, variance = np.zeros(len(mean)), np.zeros(len(mean))
    pinned = dict(pins)
    for frame, value in pinned.items():
        x[frame] = value
    free = [t for t in range(len(mean)) if t not in pinned]
    if free:
        inverse = np.linalg.inv(A[np.ix_(free, free)])
        x[free] = inverse @ (b - A @ x)[free]
        variance[free] = np.diag(inverse)
    return x, variance
