"""Files for 3D programs: a character with its animation, as ``.glb``, ``.usda`` or ``.fbx``."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from lipmotion.articulation.contact import sample_pictures
from lipmotion.articulation.delivery import find_closed_times
from lipmotion.articulation.expression import is_mood
from lipmotion.articulation.liveliness import CALM
from lipmotion.articulation.mouth import find_mouth
from lipmotion.articulation.rest import find_rest_frames
from lipmotion.formats.base import Thinning
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.meshes.fitting.eyes_and_brows import compute_living_curves, eye_and_brow_weights
from lipmotion.meshes.model.mesh import Blendshape, turn_head
from lipmotion.pipeline.outputs.curve_sets import apply_weight_edits
from lipmotion.pipeline.outputs.deliver import deliver, hold_mouth_poses
from lipmotion.pipeline.outputs.output import Output, OutputSettings, Performance, measure_recorded_prosody
from lipmotion.storage.files import sound_reference
from lipmotion.types import Channel, Generation, Motion, Prosody, Span, StateTrace, Timeline, Unit
from lipmotion.types.motion import WEIGHT, compute_frame_times
from lipmotion.units import SILENCE
from lipmotion_faces.base import Staging, stage_liveliness
from lipmotion_faces.characters.binding import PosedCharacter
from lipmotion_faces.characters.fbx import convert_to_fbx, find_blender
from lipmotion_faces.characters.gltf_writer import write_animated_gltf, write_gltf_scene
from lipmotion_faces.characters.scene import HeadTurn, Scene
from lipmotion_faces.characters.usd_writer import format_asset, write_usda
from lipmotion_faces.outputs.drawn_video import check_drawable, with_drawn_channels

GLTF, USD, FBX = ".glb", ".usda", ".fbx"
SCENE_SUFFIXES = (GLTF, USD, FBX)
FBX_RATE_HZ = 60  # frames a second of ``.fbx``, which are whole numbers; fewer where fewer keys are asked for
ANIMATED_SUFFIXES = (GLTF, ".vrm")  # suffixes of files of characters that are kept as they are, with an animation more
MARGIN, MOUTH_MARGIN = 10, 50
"""Frames before and after those that are wanted alone, within which weights settle, and the mouth."""
METRES = 0.09  # the distance between the outer eye corners of the 3D head, in metres


class SceneOutput(Output):
    """``.glb``, ``.usda``, ``.fbx``: a character with its animation, for 3D programs."""

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102, ARG003
        return SCENE_SUFFIXES

    def check(self) -> None:  # noqa: D102
        sound = self.settings.recording
        if self.path.suffix.lower() == FBX:
            find_blender()
        if sound is not None and self.path.suffix.lower() == USD:
            format_asset(sound_reference(sound, self.path))  # refuses names that such a file cannot hold

    def prepare(self, performance: Performance) -> Callable[[], None]:  # noqa: D102
        check_drawable(self.path, performance.generation.motion)
        return lambda: write_scene(self.path, performance.cached(build_scene), sound=performance.sound_file)


def build_scene(performance: Performance, frames: slice | None = None) -> Scene:
    """Return the scene of a face as it is delivered; held poses are those of the mouth.

    frames : of the motion, at its rate: the only ones that it is to have, which differ by less than 0.01 from those of
             the whole; None: all
    """
    settings, delivery = performance.settings, performance.settings.delivery
    moved = with_drawn_channels(deliver(performance.generation, delivery))
    part = None if delivery.hold_ms else frames
    scene = settings.face.build_scene(moved, settings, performance.cached(measure_recorded_prosody), part)
    thinning = Thinning(delivery.key_tolerance, tuple(find_closed_times(moved)) if delivery.key_tolerance else ())
    scene = replace(scene, sound_s=delivery.offset_ms / 1000, thinning=thinning)
    weights = scene.weights
    if weights is None or not delivery.hold_ms:
        return scene
    states = StateTrace(("",), np.zeros(len(weights.values), np.intp))
    held = Generation(weights, np.zeros(weights.values.shape), moved.units, states)
    steps = hold_mouth_poses(held, delivery.hold_frames(weights.rate_hz), find_closed_times(moved))
    return replace(scene, weights=steps.motion, stepped=steps.stepped)


def write_scene(path: Path, scene: Scene, sound: Path | None = None) -> None:
    """Write a character with its animation as ``.glb``, ``.usda`` or ``.fbx``, by the suffix.

    A ``.glb`` of a character from a ``.glb`` or ``.vrm`` is that file with one animation more, where that is possible.
    Raises ExportError: the file cannot be written. Raises MissingDependencyError: an ``.fbx``, and no Blender.
    """
    suffix, original, weights = path.suffix.lower(), scene.original, scene.weights
    if suffix == FBX:
        rate_hz = FBX_RATE_HZ if weights is None else min(round(weights.rate_hz), FBX_RATE_HZ)
        with tempfile.TemporaryDirectory() as folder:
            write_scene(Path(folder) / "scene.glb", scene)
            convert_to_fbx(Path(folder) / "scene.glb", path, rate_hz)
        return
    with_sound = replace(scene, sound="" if sound is None else sound_reference(sound, path))
    if suffix == USD:
        write_usda(path, with_sound)
        return
    if suffix == GLTF and weights is not None and original and original.suffix.lower() in ANIMATED_SUFFIXES:
        write = partial(write_animated_gltf, sound_s=scene.sound_s, stepped=scene.stepped, thinning=scene.thinning)
        if write(path, original, weights, with_sound.sound):
            return
    write_gltf_scene(path, with_sound)


def build_head_scene(
    generation: Generation,
    rate_hz: float | None = None,
    *,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
    frames: slice | None = None,
) -> Scene:
    """Return the 3D head of ``--face head`` with its animation: what its videos show, as weights of blendshapes.

    rate_hz : keys a second; None: those of the motion
    staging, prosody : as of videos; size and background do not count
    frames  : as of ``build_scene``
    The mesh is in metres. Raises InputError: the motion has no channel ``opening``.
    """
    from lipmotion_faces.head.figure import PIVOT
    from lipmotion_faces.head.pose import pose_head
    from lipmotion_faces.head.stage import fit_mouth_weights, make_figure, make_figure_mesh

    motion, units, hertz = generation.motion, generation.units, rate_hz or generation.motion.rate_hz
    times_s = compute_frame_times(len(motion.values), motion.rate_hz, hertz)
    around, wanted = _select_around(frames, MARGIN)
    if frames is None:
        mouth = find_mouth(motion, units, hertz)
    else:  # made of the frames around those that are wanted
        wider, inner = _select_around(around, MOUTH_MARGIN)
        part, phones, there = add_rest(motion, units, wider)
        stop = min(there.start + inner.stop, there.stop)
        mouth = find_mouth(part, phones).within(slice(there.start + inner.start, stop))
    moved = stage_liveliness(times_s[around], motion, units, staging, prosody)
    poses = pose_head(mouth, moved)
    has_mood = any(map(is_mood, motion.names)) or any(pose.mood != CALM for pose in poses)
    character, mesh = make_figure(), make_figure_mesh(moods=has_mood)
    curves = fit_mouth_weights(character, mesh, poses) | eye_and_brow_weights(moved)
    names = [name for name in mesh.shape_names if name in curves]
    table, channels = np.zeros((len(times_s), len(names))), tuple(Channel(name, WEIGHT) for name in names)
    table[around] = np.stack([curves[name] for name in names], axis=1)
    weights = apply_weight_edits(Motion(table, hertz, channels), units, generation.curve_edits)
    weights = replace(weights, values=weights.values[around][wanted])
    shapes = tuple(Blendshape(each.name, each.rows, METRES * each.displacements) for each in mesh.shapes)
    scaled = replace(mesh, vertices=METRES * mesh.vertices, shapes=shapes)
    turns = turn_head(np.stack([pose.turn for pose in poses]))[wanted]
    return Scene(scaled, weights, HeadTurn(METRES * PIVOT, character.weigh_turn(), turns), split=False)


def _select_around(frames: slice | None, margin: int) -> tuple[slice, slice]:
    """Return the frames that are computed for some, None: all; and which of them these are."""
    if frames is None:
        return slice(None), slice(None)
    first = max(frames.start - margin, 0)
    return slice(first, frames.stop + margin), slice(frames.start - first, frames.stop - first)


def build_character_scene(
    generation: Generation,
    character: PosedCharacter,
    rate_hz: float | None = None,
    *,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
    frames: slice | None = None,
) -> Scene:
    """Return the user's own character with its animation; eyes and brows move where it has ARKit's blendshapes.

    rate_hz : keys a second; None: those of the motion. A closure between two keys is at the nearer one
    staging, prosody : seed, and what moves on its own
    frames  : as of ``build_scene``
    Raises InputError: the character has no blendshapes, or the motion has no channel ``opening``.
    """
    motion, units, rate = generation.motion, generation.units, generation.motion.rate_hz
    around, wanted = _select_around(frames, MOUTH_MARGIN)
    is_part = frames is not None and (around.start > 0 or around.stop < len(motion.values))
    part, phones, there = add_rest(motion, units, around) if is_part else (motion, units, slice(None))
    solved, mouth = character.weights(part, phones), find_mouth(with_mouth(part), phones)
    table = np.zeros((len(motion.values), len(solved.names)))
    table[around] = solved.values[there]
    weights = apply_weight_edits(replace(solved, values=table), units, generation.curve_edits, character)
    living = compute_living_curves(with_mouth(motion), units, staging, prosody, around)
    others = {name: living[name].astype(np.float64) for name in living.names}
    extra = character.weigh_others(others, len(living.values))
    extra = {name: curve for name, curve in extra.items() if name not in weights.names}
    extra |= {name: curve[there] for name, curve in character.expressions(part, mouth).items()}
    rows = np.concatenate([weights.values[around], *(curve[:, None] for curve in extra.values())], axis=1)
    channels = weights.channels + tuple(Channel(name, WEIGHT) for name in extra)
    hertz = rate if frames is not None else rate_hz or rate
    shown = sample_pictures(rows, mouth.contact[there], rate, compute_frame_times(len(rows), rate, hertz))
    return Scene(character.mesh, Motion(shown[wanted], hertz, channels), original=character.file)


def add_rest(motion: Motion, units: Timeline[Unit], frames: slice) -> tuple[Motion, Timeline[Unit], slice]:
    """Return frames of a motion with their phones, beside enough silence to have the same rest pose, and where."""
    values, rate_hz, rest = motion.values[frames], motion.rate_hz, find_rest_frames(motion, units)
    still = np.median(motion.values[rest], axis=0)
    count = int(np.count_nonzero(rest[frames])) + len(values) // 5 + 1
    start_s, long_s, silent_s = (number / rate_hz for number in (frames.start, len(values), count))
    phones = units.between(start_s, start_s + long_s)
    silence, label = np.tile(still, (count, 1)), Unit(SILENCE)
    if frames.start == 0:
        spans = (*phones, Span(long_s, long_s + silent_s, label))
        return replace(motion, values=np.concatenate([values, silence])), Timeline(spans), slice(0, len(values))
    spans = (Span(0.0, silent_s, label), *phones.shifted(silent_s))
    together = np.concatenate([silence, values])
    return replace(motion, values=together), Timeline(spans), slice(count, len(together))
