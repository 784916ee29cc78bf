"""The face of a stream: its frames, the pose of a model's face for articulators, and a character's own curves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import MIN_GAP, opening_to_gap
from lipmotion.errors import InputError
from lipmotion.extensions import load_provided
from lipmotion.live.network import STEP_S, hear_silence, live_network
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth
from lipmotion.meshes.fitting.shape_weights import (
    NEAREST_VOWEL,
    PRESS_WEIGHT,
    VISEME_CHANNELS,
    blend_visemes,
    cancel_opposed,
    with_gap,
)
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.meshes.model.rig_tables import apply_rig, read_rig_table
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS, VISEMES_15
from lipmotion.motion.articulation import ARTICULATORS
from lipmotion.motion.closure import OPENING, is_never_negative
from lipmotion.pipeline.model import Model

Array = NDArray[np.float64]
PARTING = np.array([name.startswith(("mouthLowerDown", "mouthUpperUp")) for name in ARKIT_MOUTH])
"""Which weights of the mouth part the lips: where these are closed, they are 0."""
PRESSING = np.array([name.startswith("mouthPress") for name in ARKIT_MOUTH])
"""Those of lips that are pressed together, as far as they close in speech."""
CLOSING_GAIN = 1.2
"""Openings under the table's pose lie so much further from it: what a network expects hardly ever closes."""
WEIGHT_NAMES = (*ARKIT_MOUTH, *VISEME_CHANNELS)


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """One frame of live motion.

    time_s  : its time in the sound
    known_s : when it was known, in the sound's own time
    motion  : values of all channels of the model [shape=(P,)], by ``names``
    weights : by name: ARKit's weights of mouth, eyes and brows, visemes of Oculus, and the angles of the head, radians
              (``headYaw`` to its left, ``headPitch`` up, ``headRoll`` to its left shoulder)

    >>> import numpy as np, lipmotion
    >>> frame = lipmotion.Stream(look_ahead_ms=80).push(np.zeros(16_000, np.float32))[-1]
    >>> frame.number, round(frame.time_s, 2), round(frame["viseme_sil"])
    (46, 0.92, 1)
    """

    time_s: float
    known_s: float
    motion: Array
    names: tuple[str, ...]
    weights: dict[str, float]

    def __getitem__(self, name: str) -> float:
        """Return one channel, weight or viseme. Raises KeyError: there is none of that name."""
        if name in self.weights:
            return self.weights[name]
        if name not in self.names:
            raise KeyError(name)
        return float(self.motion[self.names.index(name)])

    @property
    def number(self) -> int:
        """The number of the frame, from 0."""
        return round(self.time_s / STEP_S)


class ModelFace:
    """The face of a model, which follows articulators in standard deviations.

    names, opening : its channels, and the place of the lips' opening among them
    """

    def __init__(self, model: Model) -> None:
        learned = model.learned
        if getattr(learned, "prior", None) is None or learned.closure is None:
            raise InputError("the model has no table of articulation, which live motion needs; train it again")
        self.model, self._space, self._prior, self._closure = model, learned.space, learned.prior, learned.closure
        self.names = tuple(channel.name for channel in self._space.channels)
        self._bounded = np.array([is_never_negative(channel) for channel in self._space.channels])
        poses = np.concatenate([np.zeros((1, self._space.dimensions)), np.eye(self._space.dimensions)])
        rows = self._space.restore(poses)
        self._base, self._basis = rows[0], rows[1:] - rows[0]
        row, column = ARTICULATORS.index(OPENING), self._closure.column
        self._closed = (self._closure.closed - self._prior.centre[column]) / self._prior.matrix[row, column]
        self._opening, self.opening = row, self.names.index(OPENING)

    @cached_property
    def resting(self) -> tuple[Array, Array]:
        """Pose and weights of the mouth at rest."""
        articulators = hear_silence()[1][-1, : len(ARTICULATORS)].astype(float)
        visemes = np.eye(len(VISEMES_15))[VISEMES_15.index("sil")]
        return self.pose(articulators, visemes, 1.0)

    def pose(self, articulators: Array, shares: Array, closing: float) -> tuple[Array, Array]:
        """Return the values of all channels, and the weights, with the lips closed so far, 0 to 1."""
        posed, column = articulators.copy(), self._closure.column
        posed[self._opening] *= CLOSING_GAIN if posed[self._opening] < 0 else 1
        posed[self._opening] += closing * min(self._closed - posed[self._opening], 0.0)
        reduced = self._prior.centre + articulators @ self._prior.matrix
        opening = self._prior.centre[column] + posed[self._opening] * self._prior.matrix[self._opening, column]
        reduced += (opening - reduced[column]) * self._closure.follow
        values = self._base + reduced @ self._basis
        values[self._bounded] = np.maximum(values[self._bounded], 0)
        arkit = np.clip(np.concatenate([[1.0], posed, shares]) @ live_network().curves, 0, 1)
        arkit[PARTING] *= 1 - closing
        arkit[PRESSING] = PRESS_WEIGHT * closing * (1 - min(float(shares[VISEMES_15.index("sil")]), 1.0))
        arkit = cancel_opposed(arkit, ARKIT_MOUTH)
        held = shares[None] / max(float(shares.sum()), 1.0)
        visemes = blend_visemes(held, opening_to_gap(values[[self.opening]]), np.zeros(1))[0]
        return values, np.concatenate([arkit, visemes])


def between(shown: tuple[Array, Array], goal: tuple[Array, Array], share: float) -> tuple[Array, Array]:
    """Return a pose and weights that are a share of the way to others, 0 to 1."""
    (pose, weights), (last, others) = shown, goal
    return pose + share * (last - pose), weights + share * (others - weights)


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
    if np.array([frame[name] for name in ARKIT_MOUTH]) @ arkit_mouth().gap < MIN_GAP / 2:
        weights = with_gap(weights, shapes, np.minimum(weights @ shapes.gap, 0.0))
    return {known.removeprefix("vowel_"): value for known, value in zip(shapes.known, weights[0].tolist(), strict=True)}
