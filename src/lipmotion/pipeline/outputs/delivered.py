"""Motion as it is delivered: one place from which files, curves, cues and videos get it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lipmotion.articulation.delivery import (
    Delivery,
    closed_on_grid,
    closed_times,
    held,
    intensified,
    moved_in_time,
)
from lipmotion.articulation.phone_targets import with_gestures
from lipmotion.errors import ExportError, InputError
from lipmotion.faces.base import Face, Staging
from lipmotion.faces.filmed.face import FilmedFace
from lipmotion.meshes.fitting.blendshape_motion import is_of_blendshapes, with_mouth
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.meshes.model.scene import Scene
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, arkit_name
from lipmotion.pipeline.outputs.curve_sets import with_curves
from lipmotion.pipeline.outputs.drawn_video import is_picture_sequence, shows_face
from lipmotion.pipeline.outputs.living_curves import RADIAN
from lipmotion.pipeline.outputs.scenes import scene_of
from lipmotion.types import Generation, Motion, Prosody, StateTrace


def check_delivery(delivery: Delivery, outputs: Iterable[Path], face: Face | FilmedFace) -> None:
    """Raise ExportError or InputError if an output cannot be delivered so."""
    videos = [path for path in outputs if shows_face(path)]
    for path in videos:
        if delivery.offset_ms and not is_picture_sequence(path):
            raise ExportError(
                f"{path}: a video has its own sound, which begins with it; an offset is for files that are put beside "
                "a sound: write the video without it"
            )
    if videos and delivery.hold_ms and isinstance(face, FilmedFace):
        raise InputError("the poses of a filmed face cannot be held; hold those of a drawn face, or of motion files")


def delivered(generation: Generation, delivery: Delivery) -> Generation:
    """Return generated motion with its intensity, anticipation and offset; held poses are made of it last (``held``).

    Raises InputError: the offset leaves nothing.
    """
    return moved_in_time(_larger(generation, delivery.intensity), delivery)


def shown(
    generation: Generation,
    delivery: Delivery,
    fps: float,
    character: DrivenCharacter | None = None,
) -> Generation:
    """Return generated motion as a face shows it: with the channels that faces draw, and held poses at the frame rate.

    character : whose weights are shown, if the face is a character with blendshapes
    """
    moved = delivered(generation, delivery)
    if is_of_blendshapes(moved.motion):
        moved = _with(moved, with_mouth(moved.motion))
    frames = delivery.hold_frames(fps)
    if not frames:
        return moved
    moved = _with(moved, with_gestures(moved.motion, moved.units))
    closed_s, moved = closed_times(moved), closed_on_grid(moved, fps)
    if character is not None and character.shapes is not None:
        moved = with_curves(moved, character)[0]
    return held_mouth(moved.resampled(fps), frames, closed_s)


def delivered_scene(
    generation: Generation,
    delivery: Delivery,
    face: Face | FilmedFace,
    rate_hz: float | None,
    *,
    staging: Staging,
    prosody: Prosody | None,
) -> Scene:
    """Return the scene of a face (``scene_of``) as it is delivered; held poses are those of the mouth."""
    moved = delivered(generation, delivery)
    if is_of_blendshapes(moved.motion):
        moved = _with(moved, with_mouth(moved.motion))
    scene = scene_of(moved, face, rate_hz, staging=staging, prosody=prosody)
    scene = replace(scene, sound_s=delivery.offset_ms / 1000)
    weights = scene.weights
    if weights is None or not delivery.hold_ms:
        return scene
    states = StateTrace(("",), np.zeros(len(weights.values), np.intp))
    whole = Generation(weights, np.zeros(weights.values.shape), moved.units, states)
    steps = held_mouth(whole, delivery.hold_frames(weights.rate_hz), closed_times(moved))
    return replace(scene, weights=steps.motion, stepped=steps.stepped)


def held_mouth(generation: Generation, frames: int, closed_s: Sequence[float]) -> Generation:
    """Return a generation whose mouth is held (``held``); eyes, brows, cheeks and head move as before.

    frames : 0: everything moves as before; 1: every frame is a pose, which formats that can say so hold
    """
    motion = generation.motion
    names = tuple(
        channel.name
        for channel in motion.channels
        if channel.unit != RADIAN and arkit_name(channel.name) not in ARKIT_OTHERS
    )
    if not frames or not names:
        return generation
    mouth = replace(held(generation.selected(names), frames, closed_s), stepped=names)
    if names == motion.names:
        return mouth
    columns = [motion.column(name) for name in names]
    values, variance = motion.values.astype(np.float64), np.array(generation.variance)
    values[:, columns], variance[:, columns] = mouth.motion.values, mouth.variance
    return replace(mouth, motion=replace(motion, values=values), spread=variance)


def moved_prosody(prosody: Prosody, delivery: Delivery) -> Prosody:
    """Return loudness and pitch on the timeline of files: later by the offset."""
    frames = round(delivery.offset_ms / 10)
    if frames <= 0:
        return Prosody(prosody.level_db[-frames:], prosody.log_f0[-frames:])
    quiet = np.full(frames, prosody.level_db.min(initial=0.0))
    return Prosody(np.concatenate([quiet, prosody.level_db]), np.concatenate([quiet * np.nan, prosody.log_f0]))


def _with(generation: Generation, motion: Motion) -> Generation:
    """Return a generation with more channels after its own, of variance 0."""
    added = len(motion.channels) - len(generation.motion.channels)
    variance = np.pad(generation.variance, ((0, 0), (0, added))) if added else generation.spread
    return replace(generation, motion=motion, spread=variance)


def _larger(generation: Generation, intensity: float) -> Generation:
    if intensity == 1:
        return generation
    motion = generation.motion
    opening = with_mouth(motion)["opening"].astype(np.float64) if is_of_blendshapes(motion) else None
    return intensified(generation, intensity, opening)
