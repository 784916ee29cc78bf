"""SyncNet: mouths and sounds to vectors that lie near one another where both are in step; its forward pass."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.network_training import LinearMap
from lipmotion.storage.archive import UNREADABLE, read_archive
from lipmotion.storage.files import check_source

Array = NDArray[np.float32]

PICTURES = 5
"""Pictures that a vector of faces is computed from; the sound's is of the same 0.2 s."""
PICTURE_RATE_HZ, PICTURE_PX = 25.0, 224
FRAMES, FRAMES_A_PICTURE = 20, 4
"""Cepstra of a vector of sounds, 100 a second, and how many belong to each picture."""
SMALLEST_VARIANCE = 1e-5
"""It is added to variances in normalisations."""
CONVERSION = "how to convert PyTorch's weights: docs/compare.md"


class MaxPooling(NamedTuple):
    """The largest value of each window: size, stride and zeros at the edges, in rows and columns."""

    size: tuple[int, int]
    stride: tuple[int, int]
    edge: int = 0


class ConvolutionStage(NamedTuple):
    """A convolution with its normalisation, max(0, x), and what is pooled after it.

    number : of the convolution in the names of the weights; its normalisation has the next one
    kernel : size in rows and columns
    """

    number: int
    kernel: tuple[int, int]
    stride: int = 1
    edge: int = 1
    pool: MaxPooling | None = None


HALVED = MaxPooling((3, 3), (2, 2))
FACE_STAGES = (
    ConvolutionStage(0, (7, 7), stride=2, edge=0, pool=HALVED),
    ConvolutionStage(4, (5, 5), stride=2, pool=MaxPooling((3, 3), (2, 2), 1)),
    ConvolutionStage(8, (3, 3)),
    ConvolutionStage(11, (3, 3)),
    ConvolutionStage(14, (3, 3), pool=HALVED),
    ConvolutionStage(18, (6, 6), edge=0),
)
"""The first is over all ``PICTURES``, so that from there on there is no time."""
SOUND_STAGES = (
    ConvolutionStage(0, (3, 3)),
    ConvolutionStage(4, (3, 3), pool=MaxPooling((3, 3), (1, 2))),
    ConvolutionStage(8, (3, 3)),
    ConvolutionStage(11, (3, 3)),
    ConvolutionStage(14, (3, 3), pool=HALVED),
    ConvolutionStage(18, (5, 4), edge=0),
)
"""Over cepstra in rows and time in columns."""


@dataclass(frozen=True, eq=False)
class Tower:
    """One half of the network: convolutions by their stages, then two maps with max(0, x) between them.

    Normalisations are part of the maps that they follow.
    """

    stages: tuple[ConvolutionStage, ...]
    convolutions: tuple[LinearMap, ...]
    hidden: LinearMap
    output: LinearMap

    def __call__(self, image: Array) -> Array:
        """Return the vector of an image [shape=(D,)]; image [shape=(H, W, channels)]."""
        for stage, layer in zip(self.stages, self.convolutions, strict=True):
            image = pooled(np.maximum(convolved(image, layer, stage), 0), stage.pool)
        hidden = np.maximum(image.reshape(-1) @ self.hidden.weights + self.hidden.biases, 0)
        return hidden @ self.output.weights + self.output.biases


@dataclass(frozen=True, eq=False)
class SyncNetwork:
    """The network of Chung & Zisserman 2016, as published with 3-D convolutions over pictures in colour.

    Source: Chung & Zisserman 2016, Out of time: automated lip sync in the wild; layers as in its second version
    (docs/compare.md). The widths are those of the weights.
    """

    faces: Tower
    sounds: Tower

    def face_vectors(self, pictures: Iterable[NDArray[np.uint8]]) -> Array:
        """Return a vector for each five pictures in a row [shape=(T - 4, D)].

        pictures : 25 a second, uint8 arrays [shape=(224, 224, 3)], blue, green and red from 0 to 255; five are kept
        """
        last: deque[NDArray[np.uint8]] = deque(maxlen=PICTURES)
        vectors = []
        for picture in pictures:
            last.append(picture)
            if len(last) == PICTURES:
                vectors.append(self.faces(np.concatenate(last, axis=2).astype(np.float32)))
        return _stacked(vectors, self.faces)

    def sound_vectors(self, cepstra: Array) -> Array:
        """Return a vector of the sound of each five pictures [shape=((N - 20) // 4 + 1, D)].

        cepstra : of ``speech.features.framed_cepstra`` [shape=(N, 13)]
        """
        starts = range(0, len(cepstra) - FRAMES + 1, FRAMES_A_PICTURE)
        return _stacked([self.sounds(cepstra[start : start + FRAMES].T[:, :, None]) for start in starts], self.sounds)


def _stacked(vectors: list[Array], tower: Tower) -> Array:
    return np.stack(vectors) if vectors else np.zeros((0, len(tower.output.biases)), np.float32)


def convolved(image: Array, layer: LinearMap, stage: ConvolutionStage) -> Array:
    """Return a convolution [shape=(rows, columns, outputs)], zeros beyond the edges.

    image : [shape=(H, W, channels)]
    layer : weights of rows, columns and channels of the kernel, in this order
    """
    edge, stride = stage.edge, stage.stride
    padded = np.pad(image, ((edge, edge), (edge, edge), (0, 0)))
    windows = sliding_window_view(padded, stage.kernel, axis=(0, 1))[::stride, ::stride]
    rows, columns = windows.shape[:2]
    patches = windows.transpose(0, 1, 3, 4, 2).reshape(rows * columns, -1)
    return (patches @ layer.weights + layer.biases).reshape(rows, columns, -1)


def pooled(image: Array, pool: MaxPooling | None) -> Array:
    """Return the largest value of each window [shape=(rows, columns, channels)]; no value of the image is negative."""
    if pool is None:
        return image
    padded = np.pad(image, ((pool.edge, pool.edge), (pool.edge, pool.edge), (0, 0)))
    (height, width), (down, across) = pool.size, pool.stride
    rows, columns = ((padded.shape[axis] - pool.size[axis]) // pool.stride[axis] + 1 for axis in (0, 1))
    result = np.zeros((rows, columns, image.shape[2]), np.float32)
    for row in range(height):
        for column in range(width):
            part = padded[row : row + down * rows : down, column : column + across * columns : across]
            np.maximum(result, part[:rows, :columns], out=result)
    return result


def read_sync_network(path: Path) -> SyncNetwork:
    """Return the network whose weights are in an ``.npz`` file, by their names in PyTorch's state.

    Nothing is unpickled. Arrays of other names are not used.
    Raises InputError: no such file, no ``.npz``, or an array is missing, has another shape or is not finite.
    """
    check_source(path, "file of weights (.npz)")
    try:
        arrays = read_archive(path)
    except UNREADABLE as error:
        raise InputError(f"{path}: not weights in an .npz file ({error}); {CONVERSION}") from error
    try:
        return sync_network(arrays)
    except ValueError as error:
        raise InputError(f"{path}: {error}; {CONVERSION}") from error


def sync_network(arrays: Mapping[str, NDArray[Any]]) -> SyncNetwork:
    """Return the network of some weights. Raises ValueError: as ``read_sync_network`` says."""
    faces = _tower(arrays, "netcnnlip", "netfclip", FACE_STAGES, (3, PICTURES))
    sounds = _tower(arrays, "netcnnaud", "netfcaud", SOUND_STAGES, (1,))
    if len(faces.output.biases) != len(sounds.output.biases):
        raise ValueError(
            f"vectors of {len(faces.output.biases)} and {len(sounds.output.biases)} values, required as many of both"
        )
    return SyncNetwork(faces, sounds)


def _tower(
    arrays: Mapping[str, NDArray[Any]],
    convolutions: str,
    maps: str,
    stages: tuple[ConvolutionStage, ...],
    first: tuple[int, ...],
) -> Tower:
    """Return half of the network. ``first``: channels of its input, and pictures in time if it has any."""
    channels, time = first[0], first[1:]
    layers: list[LinearMap] = []
    for stage in stages:
        is_image = convolutions == "netcnnaud"
        depth = () if is_image else time if not layers else (1,)
        shape = (channels, *depth, *stage.kernel)
        weights = _array(arrays, f"{convolutions}.{stage.number}.weight", shape)
        kernel = weights if is_image else np.moveaxis(weights, 2, 1).reshape(len(weights), -1, *stage.kernel)
        flat = kernel.transpose(2, 3, 1, 0).reshape(-1, len(kernel))
        layers.append(_normalised(arrays, flat, f"{convolutions}.{stage.number}", f"{convolutions}.{stage.number + 1}"))
        channels = len(weights)
    hidden = _array(arrays, f"{maps}.0.weight", (channels,))
    output = _array(arrays, f"{maps}.3.weight", (len(hidden),))
    biases = _array(arrays, f"{maps}.3.bias", (), len(output))
    return Tower(
        stages, tuple(layers), _normalised(arrays, hidden.T, f"{maps}.0", f"{maps}.1"), LinearMap(output.T, biases)
    )


def _normalised(arrays: Mapping[str, NDArray[Any]], weights: Array, layer: str, normalisation: str) -> LinearMap:
    """Return a layer followed by its normalisation, as one map; weights [shape=(inputs, outputs)]."""
    count = weights.shape[1]
    bias = _array(arrays, f"{layer}.bias", (), count)
    scale, shift, mean, variance = (
        _array(arrays, f"{normalisation}.{name}", (), count)
        for name in ("weight", "bias", "running_mean", "running_var")
    )
    if (variance < 0).any():
        raise ValueError(f"{normalisation}.running_var has negative values")
    factor = scale / np.sqrt(variance + np.float32(SMALLEST_VARIANCE))
    return LinearMap(np.ascontiguousarray(weights * factor), (bias - mean) * factor + shift)


def _array(arrays: Mapping[str, NDArray[Any]], name: str, shape: tuple[int, ...], count: int | None = None) -> Array:
    """Return weights in single precision: any number of outputs, or ``count`` of them, and the shape of each."""
    if name not in arrays:
        raise ValueError(f"no array {name!r}")
    array = arrays[name]
    fits = array.ndim == 1 + len(shape) and array.shape[1:] == shape and len(array) == (count or len(array)) > 0
    if not (fits and array.dtype.kind == "f" and np.isfinite(array).all()):
        required = ", ".join(map(str, (count or "outputs", *shape)))
        raise ValueError(
            f"{name} is an array of {array.dtype} of shape {array.shape}, required finite floats of shape ({required})"
        )
    return array.astype(np.float32)
