"""The slow, readable twin of ``measures.sync_network``: layer after layer as PyTorch's documentation defines them.

Arrays are as in PyTorch: channels first, then time (1 for sounds), rows and columns.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
State = Mapping[str, Array]

FACES = (
    ("conv 0", 2, 0), ("pool", 3, 3, 2, 2, 0),
    ("conv 4", 2, 1), ("pool", 3, 3, 2, 2, 1),
    ("conv 8", 1, 1),
    ("conv 11", 1, 1),
    ("conv 14", 1, 1), ("pool", 3, 3, 2, 2, 0),
    ("conv 18", 1, 0),
)  # fmt: skip
SOUNDS = (
    ("conv 0", 1, 1),
    ("conv 4", 1, 1), ("pool", 3, 3, 1, 2, 0),
    ("conv 8", 1, 1),
    ("conv 11", 1, 1),
    ("conv 14", 1, 1), ("pool", 3, 3, 2, 2, 0),
    ("conv 18", 1, 0),
)  # fmt: skip
"""Convolutions: stride and padding; pooling: rows, columns, strides, padding."""
KERNELS: dict[str, dict[int, tuple[int, ...]]] = {
    "netcnnlip": {0: (5, 7, 7), 4: (1, 5, 5), 8: (1, 3, 3), 11: (1, 3, 3), 14: (1, 3, 3), 18: (1, 6, 6)},
    "netcnnaud": {0: (3, 3), 4: (3, 3), 8: (3, 3), 11: (3, 3), 14: (3, 3), 18: (5, 4)},
}


def random_state(width: int, seed: int = 0) -> dict[str, Any]:
    """Return weights of a network whose layers all have as many channels, by their names in PyTorch."""
    rng = np.random.default_rng(seed)
    state: dict[str, Any] = {}
    for tower, kernels in KERNELS.items():
        channels = 3 if tower == "netcnnlip" else 1
        for number, kernel in kernels.items():
            shape = (width, channels, *kernel)
            state[f"{tower}.{number}.weight"] = rng.normal(size=shape) / np.sqrt(np.prod(shape[1:]))
            state |= _normalisation(f"{tower}.{number}", f"{tower}.{number + 1}", width, rng)
            channels = width
    for maps in ("netfclip", "netfcaud"):
        state[f"{maps}.0.weight"] = rng.normal(size=(width, width))
        state |= _normalisation(f"{maps}.0", f"{maps}.1", width, rng)
        state[f"{maps}.3.weight"], state[f"{maps}.3.bias"] = rng.normal(size=(3, width)), rng.normal(size=3)
    return state


def _normalisation(layer: str, after: str, width: int, rng: np.random.Generator) -> dict[str, Array]:
    return {
        f"{layer}.bias": rng.normal(size=width),
        f"{after}.weight": rng.uniform(0.5, 1.5, width),
        f"{after}.bias": rng.normal(size=width),
        f"{after}.running_mean": rng.normal(size=width),
        f"{after}.running_var": rng.uniform(0.5, 2, width),
        f"{after}.num_batches_tracked": np.array(7.0),
    }


def face_vector(state: State, pictures: Array) -> Array:
    """Return the vector of five pictures [shape=(5, 224, 224, 3)]."""
    return _vector(state, "netcnnlip", "netfclip", FACES, np.moveaxis(pictures, 3, 0).astype(float))


def sound_vector(state: State, cepstra: Array) -> Array:
    """Return the vector of 20 frames of cepstra [shape=(20, 13)]."""
    return _vector(state, "netcnnaud", "netfcaud", SOUNDS, cepstra.T[None, None].astype(float))


def _vector(state: State, tower: str, maps: str, layers: tuple[tuple, ...], values: Array) -> Array:
    for name, *numbers in layers:
        if name == "pool":
            values = _pooled(values, *numbers)
        else:
            number = int(name.split()[1])
            values = _convolved(values, state[f"{tower}.{number}.weight"], state[f"{tower}.{number}.bias"], *numbers)
            values = np.maximum(_normalised(state, f"{tower}.{number + 1}", values), 0)
    hidden = state[f"{maps}.0.weight"] @ values.ravel() + state[f"{maps}.0.bias"]
    return state[f"{maps}.3.weight"] @ np.maximum(_normalised(state, f"{maps}.1", hidden), 0) + state[f"{maps}.3.bias"]


def _normalised(state: State, name: str, values: Array) -> Array:
    shape = (-1, *[1] * (values.ndim - 1))
    mean, variance, weight, bias = (
        state[f"{name}.{part}"].reshape(shape) for part in ("running_mean", "running_var", "weight", "bias")
    )
    return (values - mean) / np.sqrt(variance + 1e-5) * weight + bias


def _convolved(values: Array, weights: Array, bias: Array, stride: int, padding: int) -> Array:
    """Sum of products at every place; the kernel is as long as there is time."""
    kernel = weights if weights.ndim == 5 else weights[:, :, None]
    padded = np.pad(values, ((0, 0), (0, 0), (padding, padding), (padding, padding)))
    rows, columns = ((padded.shape[2 + i] - kernel.shape[3 + i]) // stride + 1 for i in (0, 1))
    result = np.zeros((len(kernel), 1, rows, columns))
    for row in range(rows):
        for column in range(columns):
            top, left = row * stride, column * stride
            part = padded[:, :, top : top + kernel.shape[3], left : left + kernel.shape[4]]
            result[:, 0, row, column] = (kernel * part).sum(axis=(1, 2, 3, 4)) + bias
    return result


def _pooled(values: Array, height: int, width: int, down: int, across: int, padding: int) -> Array:
    edges = ((0, 0), (0, 0), (padding, padding), (padding, padding))
    padded = np.pad(values, edges, constant_values=-np.inf)
    rows, columns = (padded.shape[2] - height) // down + 1, (padded.shape[3] - width) // across + 1
    result = np.zeros((*values.shape[:2], rows, columns))
    for row in range(rows):
        for column in range(columns):
            part = padded[:, :, row * down : row * down + height, column * across : column * across + width]
            result[:, :, row, column] = part.max(axis=(2, 3))
    return result
