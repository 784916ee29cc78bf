"""A convolutional network in time, from sequences of vectors to sequences of vectors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.network_training import Array, Dropout, LinearMap, SequenceNetwork

TAPS = 3
"""Time steps that each unit sees of the layer below: one before, the same, one after; ``dilation`` steps apart."""
BLOCK = 4096
"""Time steps computed at a time, so that the memory does not grow with the sequence."""


class _Pass(NamedTuple):
    """What the backward pass needs of one layer: its stacked inputs, and its derivative times the dropout mask."""

    stacked: Array
    slope: Array


@final
@dataclass(frozen=True, eq=False)
class ConvolutionalNetwork(SequenceNetwork):
    """Convolutions in time with residual connections, and a linear output.

    layers    : convolutions of ``TAPS`` time steps, each followed by max(0, x); the output of each but the first is
                added to its input
    dilations : distance of the taps of each layer, in time steps
    output    : the linear map from the last hidden layer
    Source: Bai, Kolter & Koltun 2018, without causality and without normalisation.
    """

    layers: tuple[LinearMap, ...]
    dilations: tuple[int, ...]
    output: LinearMap
    SHARDS: ClassVar[int] = 2

    def hidden(self, inputs: Array) -> Array:  # noqa: D102
        result = np.empty((len(inputs), len(self.output.weights)), np.float32)
        reach, everywhere = self.reach, np.ones((1, 0), bool)
        for start in range(0, len(inputs), BLOCK):
            first, stop = max(start - reach, 0), min(start + BLOCK + reach, len(inputs))
            states, _ = self.forward(inputs[None, first:stop], everywhere, None)
            result[start : start + BLOCK] = states[0, start - first : start - first + BLOCK]
        return result

    @property
    def reach(self) -> int:
        """How many time steps before and after a step change its output."""
        return sum(self.dilations)

    @property
    def parameters(self) -> list[Array]:  # noqa: D102
        return [array for layer in (*self.layers, self.output) for array in layer]

    def with_parameters(self, parameters: Sequence[Array]) -> ConvolutionalNetwork:  # noqa: D102
        pairs = [LinearMap(*parameters[i : i + 2]) for i in range(0, len(parameters), 2)]
        return replace(self, layers=tuple(pairs[:-1]), output=pairs[-1])

    def forward(  # noqa: D102
        self,
        inputs: Array,
        inside: NDArray[np.bool_],  # noqa: ARG002 - beyond the end there are zeros
        dropout: Dropout | None,
    ) -> tuple[Array, list[_Pass]]:
        states, passes = inputs, []
        for number, (layer, dilation) in enumerate(zip(self.layers, self.dilations, strict=True)):
            stacked = _stack(states, dilation)
            result = stacked @ layer.weights
            result += layer.biases
            if dropout is None:
                np.maximum(result, 0, out=result)
            else:
                slope = (result > 0) & dropout.mask(result.shape)
                passes.append(_Pass(stacked, slope * dropout.gain))
                result *= passes[-1].slope
            states = result if number == 0 else states + result
        return states, passes

    def backward(self, slope: Array, passed: Any) -> list[Array]:  # noqa: D102
        gradients: list[Array] = []  # from the last to the first
        rows = slope.shape[0] * slope.shape[1]
        for number in reversed(range(len(self.layers))):
            inner: Array = slope * passed[number].slope
            spread: Array = inner.reshape(rows, -1)
            gradients += [spread.sum(axis=0), passed[number].stacked.reshape(rows, -1).T @ spread]
            if number:
                parts = (inner @ self.layers[number].weights.T).reshape(*slope.shape[:2], TAPS, -1)
                dilation, by_states = self.dilations[number], parts[:, :, 1].copy()  # the derivative of ``_stack``
                if dilation < slope.shape[1]:
                    by_states[:, :-dilation] += parts[:, dilation:, 0]
                    by_states[:, dilation:] += parts[:, :-dilation, 2]
                slope = slope + by_states
        return gradients[::-1]


def make_network(inputs: int, hidden: int, outputs: int, dilations: Sequence[int], seed: int) -> ConvolutionalNetwork:
    """Return an untrained network with random weights (He et al. 2015); those of residual layers are halved."""
    rng = np.random.default_rng(seed)

    def layer(size: int, width: int, factor: float) -> LinearMap:
        weights = rng.standard_normal((size, width)) * np.sqrt(2 / size) * factor
        return LinearMap(weights.astype(np.float32), np.zeros(width, np.float32))

    first = layer(TAPS * inputs, hidden, 1.0)
    others = [layer(TAPS * hidden, hidden, 0.5) for _ in dilations[1:]]
    return ConvolutionalNetwork((first, *others), tuple(dilations), layer(hidden, outputs, 0.1))


def _stack(states: Array, dilation: int) -> Array:
    """Return every time step with those before and after it [shape=(B, T, 3·C)]; zeros beyond the ends."""
    batch, length, width = states.shape
    result = np.zeros((batch, length, TAPS, width), np.float32)
    result[:, :, 1] = states
    if dilation < length:
        result[:, dilation:, 0] = states[:, :-dilation]
        result[:, :-dilation, 2] = states[:, dilation:]
    return result.reshape(batch, length, TAPS * width)
