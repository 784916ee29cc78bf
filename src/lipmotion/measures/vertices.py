"""Measures of points of a face, which the literature on talking meshes and talking heads uses.

A set of clips is a list of arrays [shape=(T_i, V, D)]: places of V vertices, landmarks or curves in T_i frames.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Clips = Sequence[Array]


def lip_vertex_error(generated: Clips, original: Clips) -> float:
    """Return the mean over frames of the largest distance of any lip vertex, in the unit of the places.

    generated, original : places of the lip vertices
    Source: Richard et al. 2021 (MeshTalk), Fan et al. 2022 (FaceFormer, on VOCASET).
    """
    return float(np.concatenate([each.max(axis=1) for each in _distances(generated, original)]).mean())


def landmark_distance(generated: Clips, original: Clips) -> float:
    """Return the mean over frames and landmarks of their distance, in the unit of the places.

    Source: Chen et al. 2018 (LMD).
    """
    return float(np.concatenate([each.mean(axis=1) for each in _distances(generated, original)]).mean())


def upper_face_deviation(generated: Clips, original: Clips, rest: Array) -> float:
    """Return by how much more the vertices of the upper face vary in the original, in the unit of the places.

    rest : their places in a face at rest [shape=(V, D)]
    The variation of a vertex is the standard deviation over time of its distance from its place at rest; the result is
    the mean over vertices of the original's less the generated one's: negative where the generated face moves more.
    Source: Xing et al. 2023 (CodeTalker, FDD).
    """
    return float((_variation(original, rest) - _variation(generated, rest)).mean())


def _distances(generated: Clips, original: Clips) -> list[Array]:
    """Return the distances of all vertices [each shape=(T_i, V)]."""
    return [np.linalg.norm(g - o, axis=2) for g, o in zip(generated, original, strict=True)]


def _variation(clips: Clips, rest: Array) -> Array:
    return np.linalg.norm(np.concatenate(clips) - rest, axis=2).std(axis=0)
