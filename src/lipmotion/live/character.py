"""A character's own curves for the frames of a stream."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import LEAST_GAP
from lipmotion.errors import InputError
from lipmotion.extensions import load_provided
from lipmotion.live.face import LiveFrame
from lipmotion.live.network import STEP_S
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth
from lipmotion.meshes.fitting.shape_weights import NEAREST_VOWEL, with_gap
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.meshes.model.rig_tables import apply_rig, read_rig_table
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS, VISEMES_15


class LiveCharacter:
    """Gives frames the curves of a character, beside their own weights.

    path : its file, or a table of a rig's controls (``.csv``)
    Raises InputError: the file cannot be read, or its mouth has no blendshapes that are called as ARKit's or visemes.
    """

    def __init__(self, path: Path) -> None:
        self._shapes: FaceShapes | None = None
        if path.suffix.lower() == ".csv":
            self._rows = read_rig_table(path)
            return
        character = load_provided("load_character")(path)
        if character.shapes is None or not any(character.shapes.known):
            raise InputError(f"{path}: live motion needs a mouth with blendshapes of ARKit, visemes or VRM's vowels")
        self._shapes, self._rows = character.shapes, character.table_rows()

    def __call__(self, frame: LiveFrame) -> LiveFrame:
        """Return a frame with these curves; its lips touch on the character where they touch.

        Raises InputError: a control follows what no frame has.
        """
        sources = dict.fromkeys(ARKIT_OTHERS, 0.0)
        if self._shapes is not None:
            sources = dict.fromkeys((row.source for row in self._rows), 0.0) | _solve(frame, self._shapes)
        sources = dict(zip(frame.names, frame.motion.tolist(), strict=True)) | frame.weights | sources
        curves = apply_rig(self._rows, {name: np.array([value]) for name, value in sources.items()}, 1 / STEP_S)
        return replace(frame, weights=frame.weights | dict(zip(curves.names, curves.values[0].tolist(), strict=True)))


def _solve(frame: LiveFrame, shapes: FaceShapes) -> dict[str, float]:
    """Return the weights of a character's mouth by the names of the curves that its table knows."""
    weights: NDArray[np.float64] = np.zeros((1, len(shapes.known)))
    for name in VISEMES_15 if shapes.style == "visemes" else ():
        row = shapes.row(f"viseme_{name}")
        row = shapes.row(f"vowel_{NEAREST_VOWEL.get(name)}") if row is None else row
        if row is not None:
            weights[0, row] += frame[f"viseme_{name}"]
    for row, name in enumerate(() if shapes.style == "visemes" else shapes.known):
        weights[0, row] = frame.weights.get(name, 0.0)
    if np.array([frame[name] for name in ARKIT_MOUTH]) @ arkit_mouth().gap < LEAST_GAP / 2:
        weights = with_gap(weights, shapes, np.minimum(weights @ shapes.gap, 0.0))
    return {known.removeprefix("vowel_"): value for known, value in zip(shapes.known, weights[0].tolist(), strict=True)}
