"""Networks from sequences of vectors to sequences of vectors, for motion from sound: convolutional, and BLSTM."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.network_training import Array, Dropout, LinearMap, SequenceNetwork, pad_batch

TAPS = 3  # time steps that each unit sees of the layer below: one before, the same, one after; ``dilation`` steps apart
BLOCK = 4096  # time steps computed at a time, so that the memory does not grow with the sequence


@final
@dataclass(frozen=True, eq=False)
class ConvolutionalNetwork(SequenceNetwork):
    """Convolutions in time with residual connections, and a linear output.

    layers    : convolutions of ``TAPS`` time steps, then max(0, x); all but the first add their input to the output
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

    def forward(  # noqa: D102
        self,
        inputs: Array,
        inside: NDArray[np.bool_],  # noqa: ARG002 - beyond the end there are zeros
        dropout: Dropout | None,
    ) -> tuple[Array, list[tuple[Array, Array]]]:
        states, passes = inputs, []  # of each layer: its stacked inputs, and its derivative times the dropout
        for number, (layer, dilation) in enumerate(zip(self.layers, self.dilations, strict=True)):
            stacked = _stack(states, dilation)
            result = stacked @ layer.weights
            result += layer.biases
            if dropout is None:
                np.maximum(result, 0, out=result)
            else:
                slope = (result > 0) * dropout.draw(result.shape)
                passes.append((stacked, slope))
                result *= slope
            states = result if number == 0 else states + result
        return states, passes

    def backward(self, slope: Array, passed: Any) -> list[Array]:  # noqa: D102
        gradients: list[Array] = []  # from the last to the first
        rows = slope.shape[0] * slope.shape[1]
        for number, (stacked, layer_slope) in reversed([*enumerate(passed)]):
            inner: Array = slope * layer_slope
            spread: Array = inner.reshape(rows, -1)
            gradients += [spread.sum(axis=0), stacked.reshape(rows, -1).T @ spread]
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


GATES = 4  # weighted sums of a cell, in this order: input gate, forget gate, value, output gate
SLOPES, OFFSETS = (np.array(values, np.float32)[:, None] for values in ((0.5, 0.5, 1.0, 0.5), (0.5, 0.5, 0.0, 0.5)))
"""A sigmoid is 0.5 + 0.5 tanh(x / 2), the value is tanh(x) [each shape=(4, 1)]."""
FORGET_BIAS = 1.0  # bias of the forget gates before training: cells remember
PIECE, REACH = 250, 50
"""Long sequences are computed in pieces of PIECE time steps, side by side, each with REACH steps around it for what its
cells remember."""
PIECES = 16  # pieces computed at a time, so that the memory does not grow with the sequence


class RecurrentLayer(NamedTuple):
    """Weights of H cells forward and H cells backward in time.

    weights : of the inputs [shape=(2, I, 4·H)]
    memory  : of the outputs of the time step before, or after [shape=(2, H, 4·H)]
    biases  : [shape=(2·4·H,)]
    """

    weights: Array
    memory: Array
    biases: Array


class _CellPass(NamedTuple):
    """What the backward pass needs of one layer, in the order of time of either direction.

    inputs : [shape=(2, T, B, I)]
    gates  : values of all gates [shape=(2, T, B, 4, H)]
    cells, outputs : of all cells [each shape=(2, T, B, H)]
    inside : 1 before the end of a sequence, 0 after it [shape=(2, T, B, 1)]
    dropped : 0, or the factor of the outputs [shape=(B, T, 2·H)]
    """

    inputs: Array
    gates: Array
    cells: Array
    outputs: Array
    inside: Array
    dropped: Array | None


@final
@dataclass(frozen=True, eq=False)
class RecurrentNetwork(SequenceNetwork):
    """Layers of long short-term memory cells, as many forward as backward in time, and a linear output.

    Source: Graves & Schmidhuber 2005, without connections from cells to gates (peepholes).
    """

    layers: tuple[RecurrentLayer, ...]
    output: LinearMap

    def hidden(self, inputs: Array) -> Array:  # noqa: D102
        result = np.empty((len(inputs), len(self.output.weights)), np.float32)
        starts = list(range(0, len(inputs), PIECE))
        for number in range(0, len(starts), PIECES):
            pieces = [(max(start - REACH, 0), start) for start in starts[number : number + PIECES]]
            rows = [inputs[first : start + PIECE + REACH] for first, start in pieces]
            states, _ = self.forward(*pad_batch(rows), None)
            for (first, start), each, state in zip(pieces, rows, states, strict=True):
                result[start : start + PIECE] = state[start - first : min(start - first + PIECE, len(each))]
        return result

    def forward(  # noqa: D102
        self, inputs: Array, inside: NDArray[np.bool_], dropout: Dropout | None
    ) -> tuple[Array, list[_CellPass]]:
        states, passes, counts = inputs, [], _run_both(inside[:, :, None].astype(np.float32))
        for layer in self.layers:
            passed = _run_layer(layer, _run_both(states), counts)
            forth, back = passed.outputs[0], passed.outputs[1, ::-1]
            states = np.ascontiguousarray(np.concatenate([forth, back], axis=2).transpose(1, 0, 2))
            if dropout is not None:
                dropped = dropout.draw(states.shape)
                states = states * dropped
                passes.append(passed._replace(dropped=dropped))
        return states, passes

    def backward(self, slope: Array, passed: Any) -> list[Array]:  # noqa: D102
        gradients: list[Array] = []
        for layer, each in zip(reversed(self.layers), reversed(passed), strict=True):
            by_layer, slope = _differentiate_layer(layer, each, slope * each.dropped)
            gradients = [*by_layer, *gradients]
        return gradients


def make_recurrent_network(inputs: int, cells: int, outputs: int, layers: int, seed: int) -> RecurrentNetwork:
    """Return an untrained network of layers of cells, with random weights, uniform between ± 1 / √cells."""
    rng, bound = np.random.default_rng(seed), 1 / np.sqrt(cells)

    def uniform(*shape: int) -> Array:
        return rng.uniform(-bound, bound, shape).astype(np.float32)

    made = []
    for number in range(layers):
        biases = np.zeros((2, GATES, cells), np.float32)
        biases[:, 1] = FORGET_BIAS
        size = 2 * cells if number else inputs
        weights, memory = uniform(2, size, GATES * cells), uniform(2, cells, GATES * cells)
        made.append(RecurrentLayer(weights, memory, biases.reshape(-1)))
    return RecurrentNetwork(tuple(made), LinearMap(uniform(2 * cells, outputs), np.zeros(outputs, np.float32)))


def _run_both(values: Array) -> Array:
    """Return the values of a batch [shape=(B, T, C)] forward and backward in time [shape=(2, T, B, C)]."""
    forward = values.transpose(1, 0, 2)
    return np.stack([forward, forward[::-1]])


def _run_layer(layer: RecurrentLayer, inputs: Array, inside: Array) -> _CellPass:
    """Return the cells of one layer at all time steps; inputs [shape=(2, T, B, I)], inside [shape=(2, T, B, 1)]."""
    _, length, batch, size = inputs.shape
    cells = layer.memory.shape[1]
    scale = np.repeat(SLOPES, cells)
    biases = (layer.biases.reshape(2, 1, -1) * scale).astype(np.float32)
    gates = np.matmul(inputs.reshape(2, length * batch, size), layer.weights * scale)
    gates += biases
    gates = gates.reshape(2, length, batch, GATES, cells)
    memory = layer.memory * scale
    states, outputs = (np.empty((2, length, batch, cells), np.float32) for _ in range(2))
    cell, output = np.zeros((2, batch, cells), np.float32), np.zeros((2, batch, cells), np.float32)
    for step in range(length):
        gate = gates[:, step]
        gate += np.matmul(output, memory).reshape(gate.shape)
        np.tanh(gate, out=gate)
        gate *= SLOPES
        gate += OFFSETS
        cell = (gate[:, :, 1] * cell + gate[:, :, 0] * gate[:, :, 2]) * inside[:, step]
        states[:, step] = cell
        output = gate[:, :, 3] * np.tanh(cell)
        outputs[:, step] = output
    return _CellPass(inputs, gates, states, outputs, inside, None)


def _differentiate_layer(layer: RecurrentLayer, passed: _CellPass, slope: Array) -> tuple[list[Array], Array]:
    """Return the gradients of a layer's parameters and inputs [shape=(B, T, I)], from that of its outputs."""
    _, length, batch, cells = passed.cells.shape
    forth, back = _run_both(slope)
    of_outputs = np.stack([forth[:, :, :cells], back[:, :, cells:]])
    gates, bent = passed.gates, np.tanh(passed.cells)
    before = _shift(passed.cells)
    curve = gates * (1 - gates)
    by_cell = np.stack(
        [
            gates[:, :, :, 2] * curve[:, :, :, 0],
            before * curve[:, :, :, 1],
            gates[:, :, :, 0] * (1 - np.square(gates[:, :, :, 2])),
        ],
        axis=3,
    )
    by_output, to_cell = bent * curve[:, :, :, 3], gates[:, :, :, 3] * (1 - np.square(bent))
    inner, memory = np.empty_like(gates), np.ascontiguousarray(layer.memory.transpose(0, 2, 1))
    of_cell, of_output = (np.zeros((2, batch, cells), np.float32) for _ in range(2))
    for step in reversed(range(length)):
        of_output = of_output + of_outputs[:, step]
        of_cell = (of_cell + of_output * to_cell[:, step]) * passed.inside[:, step]
        here = inner[:, step]
        np.multiply(by_cell[:, step], of_cell[:, :, None], out=here[:, :, :3])
        np.multiply(by_output[:, step], of_output, out=here[:, :, 3])
        of_cell = of_cell * gates[:, step, :, 1]
        of_output = np.matmul(here.reshape(2, batch, GATES * cells), memory)
    flat = inner.reshape(2, length * batch, GATES * cells)
    seen = passed.inputs, _shift(passed.outputs)
    inputs, outputs = (values.reshape(2, length * batch, -1).transpose(0, 2, 1) for values in seen)
    of_inputs = np.matmul(flat, layer.weights.transpose(0, 2, 1)).reshape(passed.inputs.shape)
    both = (of_inputs[0] + of_inputs[1, ::-1]).transpose(1, 0, 2)
    return [np.matmul(inputs, flat), np.matmul(outputs, flat), flat.sum(axis=1).reshape(-1)], both


def _shift(values: Array) -> Array:
    """Return values at the time step before [shape=(2, T, B, C)], 0 before the first one."""
    result = np.zeros_like(values)
    result[:, 1:] = values[:, :-1]
    return result
