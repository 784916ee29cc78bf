"""Motion for characters: weights of blendshapes, visemes, MPEG-4 parameters, controls of a user's rig."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.curve_edits import apply_curve_edits
from lipmotion.articulation.expression import read_moods
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.errors import InputError
from lipmotion.formats.fap import PARAMETERS, move_faps
from lipmotion.meshes.files.rig_tables import RigRow, apply_rig, read_rig_table
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth, vowel_mouth, with_mouth
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.meshes.fitting.eyes_and_brows import compute_living_curves
from lipmotion.meshes.fitting.shape_weights import (
    VISEME_CHANNELS,
    expression_weights,
    solve_shape_weights,
    weigh_visemes,
)
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS, CLOSED, arkit_name
from lipmotion.types import WEIGHT, Channel, CurveEdit, Generation, Motion, Prosody, Timeline, Unit
from lipmotion.types.staging import Staging

ARKIT, WHOLE_FACE, VOWELS = "arkit", "face", "vowels"
LIVING_SETS = (WHOLE_FACE, VOWELS)
"""Sets of curves with eyes, brows and head, which move on their own."""
WEIGHTS = (*ARKIT_MOUTH, *ARKIT_OTHERS, *VISEME_CHANNELS)
KNOWN_CURVES = (*WEIGHTS, *(row[1] for row in PARAMETERS))
"""Curves that outputs may have, whatever the motion has: ARKit's blendshapes, visemes, MPEG-4's parameters."""
SHAPE_SETS = (ARKIT, WHOLE_FACE, "visemes", VOWELS, "fap")
"""Sets of curves that need no mesh: ARKit's blendshapes of the mouth, the same with eyes, brows and head (which move on
their own), the 15 visemes of Oculus and OpenXR, the five vowels of VRM with pressed lips, moods, eyes, brows and head,
and MPEG-4's facial animation parameters of lips and jaw."""


def check_curve_set(curves: str | Path) -> None:
    """Raise InputError unless there is such a set of curves, or such a table of a rig, for ``make_curves``."""
    if Path(curves).suffix.lower() == ".csv":
        read_rig_table(Path(curves))
    elif curves not in SHAPE_SETS:
        raise InputError(f"no set of curves {str(curves)!r}, required one of {', '.join(SHAPE_SETS)}, or a FILE.csv")


def curve_names(curves: str | Path | DrivenCharacter) -> tuple[str, ...]:
    """Return the names that a character or a rig has for its curves; none, for the sets of ``SHAPE_SETS``."""
    if isinstance(curves, DrivenCharacter):
        return (*curves.mesh.shape_names, *known_names(curves.mesh))
    return () if curves in SHAPE_SETS else tuple(row.control for row in read_rig_table(Path(curves)))


def make_curves(
    motion: Motion,
    units: Timeline[Unit],
    curves: str | Path | DrivenCharacter,
    *,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
    edits: Sequence[CurveEdit] = (),
) -> Motion:
    """Return motion as curves that drive a character.

    Motion of blendshapes keeps its weights.
    curves : ``arkit``, ``face``, ``visemes``, ``vowels``, ``fap``, a table of a rig's controls (``.csv``), or a
             character with blendshapes
    staging, prosody : of the eyes, brows and head of ``face`` and ``vowels``, as of ``compute_living_curves``
    edits  : pins and gains of curves; controls of a rig also follow those of the curves that they are made of
    Raises InputError: no such set or file, the character has no blendshapes, or the motion has no channel ``opening``.
    """
    if isinstance(curves, DrivenCharacter):
        return edit_weights(curves.weights(motion, units), units, edits, known_names(curves.mesh))
    check_curve_set(curves)
    if curves in SHAPE_SETS:
        return apply_curve_edits(_make_set(motion, units, str(curves), staging, prosody), units, edits)
    rows = read_rig_table(Path(curves))
    sources = make_rig_sources(motion, units, rows, staging=staging, prosody=prosody, edits=edits)
    own = [edit for edit in edits if edit.channel not in sources]
    return apply_curve_edits(apply_rig(rows, sources, motion.rate_hz), units, own)


def make_rig_sources(
    motion: Motion,
    units: Timeline[Unit],
    rows: Sequence[RigRow],
    *,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
    edits: Sequence[CurveEdit] = (),
) -> dict[str, NDArray[np.float64]]:
    """Return the curves that controls of a rig may follow, by their names [each shape=(T,)].

    Channels of motion, ARKit's blendshapes, visemes; where rows ask for others, also vowels, moods, eyes, brows and the
    head. staging, prosody, edits : as of ``make_curves``
    """

    def plain(name: str) -> Motion:
        return apply_curve_edits(_make_set(motion, units, name, staging, prosody), units, edits)

    sets = [with_mouth(motion), plain(ARKIT), plain("visemes")]
    if not all(row.source in {"", *(name for each in sets for name in each.names)} for row in rows):
        sets.append(plain(VOWELS))
    sources = {name: each[name].astype(np.float64) for each in sets for name in each.names}
    return {name: np.zeros(len(motion.values)) for name in ARKIT_OTHERS} | sources


def edit_weights(
    weights: Motion, units: Timeline[Unit], edits: Sequence[CurveEdit], known: Mapping[str, str] | None = None
) -> Motion:
    """Return weights of a character with pins and gains, which name its blendshapes as it does or as ``known``.

    known : its blendshapes by other names
    """
    named = {other: name for other, name in (known or {}).items() if name in weights.names}
    named |= {name: name for name in weights.names}
    ours = [replace(edit, channel=named[edit.channel]) for edit in edits if edit.channel in named]
    return apply_curve_edits(weights, units, ours)


def known_names(mesh: Mesh) -> dict[str, str]:
    """Return the blendshapes of a mesh by the names of the curves that they follow, or by ARKit's."""
    return {arkit_name(shape.called) or shape.called: shape.name for shape in reversed(mesh.shapes) if shape.called}


def _make_set(
    motion: Motion, units: Timeline[Unit], name: str, staging: Staging | None, prosody: Prosody | None
) -> Motion:
    """Return the curves of one of ``SHAPE_SETS``."""
    if name == ARKIT:
        return solve_shape_weights(motion, units, arkit_mouth())
    motion = with_mouth(motion)
    if name == WHOLE_FACE:
        mouth = solve_shape_weights(motion, units, arkit_mouth())
        return join_channels(mouth, compute_living_curves(motion, units, staging, prosody))
    if name == VOWELS:  # with how far the lips are pressed together, and VRM's expressions of moods
        lips, moods = spoken_mouth(motion, units), expression_weights(read_moods(motion))
        curves = {CLOSED: lips.closing if CLOSED not in motion.names else motion[CLOSED]}
        curves |= {
            mood: curve * lips.free for mood, curve in moods.items()
        }  # only the model knows which parts the lips
        channels = tuple(Channel(curve, WEIGHT) for curve in curves)
        pressed = Motion(np.stack(list(curves.values()), axis=1), motion.rate_hz, channels)
        vowels = join_channels(solve_shape_weights(motion, units, vowel_mouth()), pressed)
        return join_channels(vowels, compute_living_curves(motion, units, staging, prosody))
    return weigh_visemes(units, spoken_mouth(motion, units)) if name == "visemes" else move_faps(motion, units)


def join_channels(first: Motion, second: Motion) -> Motion:
    """Return two motions of the same frames as one, the channels of the first one before those of the second one.

    Raises InputError: other numbers of frames, or a channel that both have.
    """
    if len(first.values) != len(second.values):
        raise InputError(f"motions have {len(first.values)} and {len(second.values)} frames, required the same number")
    values = np.concatenate([first.values, second.values], axis=1)
    return Motion(values, first.rate_hz, first.channels + second.channels)


def with_curves(
    generation: Generation,
    curves: str | Path | DrivenCharacter,
    *,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
) -> tuple[Generation, tuple[str, ...]]:
    """Return a generation with the channels of ``make_curves`` after its own, and the names of those channels.

    Channels that the motion has already are replaced. The variance of all channels of ``make_curves`` is 0.
    Raises InputError: as ``make_curves``.
    """
    edits = generation.curve_edits
    added = make_curves(generation.motion, generation.units, curves, staging=staging, prosody=prosody, edits=edits)
    kept = [name for name in generation.motion.names if name not in added.names]
    if len(kept) < len(generation.motion.names):
        generation = generation.selected(kept)
    return generation.with_motion(join_channels(generation.motion, added)), added.names


def describe_character(character: DrivenCharacter) -> Iterator[str]:
    """Yield what was found in a character's files, line by line."""
    mesh, placement = character.mesh, character.placement
    parts = ", ".join(part.name or "(no name)" for part in mesh.parts)
    yield f"{'vertices':14} {len(mesh.vertices)}, triangles {len(mesh.triangles)}"
    yield f"{'parts':14} {parts}"
    yield f"{'blendshapes':14} {len(mesh.shapes)}"
    yield f"{'eye distance':14} {placement.scale:.6g} units of the mesh, by the width of the mouth"
    if character.table:
        yield f"{'table':14} {character.table_file}, {len(character.table)} rows"
    if character.shapes is not None:
        named = zip(character.shapes.names, character.shapes.known, strict=True)
        listed = ", ".join(name if known in {"", name} else f"{name} = {known}" for name, known in named)
        yield f"{'moved by':14} {character.shapes.style}: {listed}"
        widest = int(character.shapes.gap.argmax())
        opens = f"{character.shapes.names[widest]} opens the lips by {character.shapes.gap[widest]:.3g} eye distances"
        yield f"{'opening':14} {opens}"
    elif character.binding is not None:
        yield f"{'moved by':14} {len(placement.points)} control points, {len(character.binding.rows)} vertices follow"
