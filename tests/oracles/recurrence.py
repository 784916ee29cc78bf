"""A recurrent network, cell by cell (twin of ``stats.recurrence``)."""

import numpy as np

from lipmotion.stats.recurrence import GATES, RecurrentLayer, RecurrentNetwork


def recurrent_outputs(network: RecurrentNetwork, inputs: np.ndarray) -> np.ndarray:
    """Return the outputs of one sequence [shape=(T, O)]."""
    states = np.asarray(inputs, float)
    for layer in network.layers:
        states = np.concatenate([_one_way(layer, 0, states), _one_way(layer, 1, states[::-1])[::-1]], axis=1)
    return states @ network.output.weights + network.output.biases


def _one_way(layer: RecurrentLayer, way: int, inputs: np.ndarray) -> np.ndarray:
    """Return the outputs of the cells of one direction [shape=(T, H)]."""
    cells = layer.memory.shape[1]
    cell, output, outputs = np.zeros(cells), np.zeros(cells), []
    biases = layer.biases.reshape(2, -1)[way]
    for x in inputs:
        gates = x @ layer.weights[way] + output @ layer.memory[way] + biases
        taken, kept, value, shown = gates.reshape(GATES, cells)
        cell = sigmoid(kept) * cell + sigmoid(taken) * np.tanh(value)
        output = sigmoid(shown) * np.tanh(cell)
        outputs.append(output)
    return np.array(outputs)


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x))
