"""Linear blend skinning, one vertex and one control point at a time (Hofer 2008, Eq. 12)."""

import numpy as np


def skinned_vertex_by_vertex(weights, matrices, vertices):
    """The weighted sum of each vertex under each transformation; what the weights leave of 1 stays in place."""
    result = np.zeros_like(vertices)
    for number, vertex in enumerate(vertices):
        for weight, matrix in zip(weights[number], matrices, strict=True):
            result[number] += weight * (matrix[:, :3] @ vertex + matrix[:, 3])
        result[number] += (1 - weights[number].sum()) * vertex
    return result
