"""Motion for characters: weights of blendshapes, visemes, MPEG-4 parameters, controls of a user's rig."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import EDITED, GAP, gap_to_opening, read_edited, read_gap
from lipmotion.articulation.curve_edits import apply_curve_edits, check_drawn, weigh_edits
from lipmotion.articulation.expression import is_mood, read_moods
from lipmotion.articulation.mouth import find_mouth
from lipmotion.articulation.phone_targets import GESTURES, OVAL, with_gestures
from lipmotion.errors import InputError, shorten
from lipmotion.formats.fap import NAMES, PARAMETERS, move_faps
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth, vowel_mouth, with_mouth
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.meshes.fitting.eyes_and_brows import GROUPS, compute_living_curves
from lipmotion.meshes.fitting.shape_weights import (
    VISEME_CHANNELS,
    solve_shape_weights,
    weigh_expressions,
    weigh_visemes,
)
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.rig_tables import RigRow, apply_rig, read_rig_table
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS, CLOSED, VRM_VOWELS, to_arkit
from lipmotion.motion.generation import find_pinned_frame
from lipmotion.pipeline.analysis.speech_analysis import LATE_S
from lipmotion.types import (
    WEIGHT,
    Channel,
    CurveEdit,
    DrawnCurve,
    Generation,
    Hold,
    Motion,
    Pin,
    Prosody,
    Timeline,
    Unit,
)
from lipmotion.types.delivery import Staging
from lipmotion.types.edits import Locked
from lipmotion.types.values import suggest

ARKIT, WHOLE_FACE, VOWELS = "arkit", "face", "vowels"
VISEMES, HELD_VISEMES = "visemes", "held-visemes"
LIVING_SETS = (WHOLE_FACE, VOWELS)  # sets of curves with eyes, brows and head, which move on their own
WEIGHTS = (*ARKIT_MOUTH, *ARKIT_OTHERS, *VISEME_CHANNELS, *VRM_VOWELS)
FAPS = {name: NAMES[number] for number, name, *_ in PARAMETERS}
KNOWN_CURVES = (*WEIGHTS, *FAPS)
"""Curves that outputs may have, whatever the motion has: ARKit's blendshapes, visemes, MPEG-4's parameters."""
UNEDITABLE = (*EDITED.values(), OVAL)  # channels that edits add, and that nobody edits
LIP_POINT = re.compile(r"[xyz]_\d+")
SETS_OF = {WHOLE_FACE: (*ARKIT_MOUTH, *ARKIT_OTHERS), VISEMES: VISEME_CHANNELS, VOWELS: VRM_VOWELS}
"""The curves that are edited in each set (``show_edited_curves``)."""
GAP_CHANNELS = ("opening", "outer", GAP, EDITED["opening"])  # channels that say how far the lips are apart
PHONETIC = (*VISEME_CHANNELS, *VRM_VOWELS, CLOSED)
"""Curves that phones make, beside what they ask of the mouth (``articulation.phone_targets.SAID``)."""
SHAPE_SETS = (ARKIT, WHOLE_FACE, VISEMES, HELD_VISEMES, VOWELS, "fap")
"""Sets of curves that need no mesh: ARKit's blendshapes of the mouth, the same with eyes, brows and head (which move on
their own), the 15 visemes of Oculus and OpenXR as far as the mouth moves, the same one after another, the five vowels
of VRM with pressed lips, moods, eyes, brows and head, and MPEG-4's facial animation parameters of lips and jaw."""


def check_curve_set(curves: str | Path) -> None:
    """Raise InputError unless there is such a set of curves, or such a table of a rig, for ``make_curves``."""
    if Path(curves).suffix.lower() == ".csv":
        read_rig_table(Path(curves))
    elif curves not in SHAPE_SETS:
        raise InputError(f"no set of curves {str(curves)!r}, required one of {', '.join(SHAPE_SETS)}, or a FILE.csv")


def list_curve_names(curves: str | Path | DrivenCharacter) -> tuple[str, ...]:
    """Return the names that a character or a rig has for its curves; none, for the sets of ``SHAPE_SETS``."""
    if isinstance(curves, DrivenCharacter):
        return (*curves.mesh.shape_names, *list_known_names(curves.mesh))
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
    curves : one of ``SHAPE_SETS``, a table of a rig's controls (``.csv``), or a character with blendshapes
    staging, prosody : of the eyes, brows and head of ``face`` and ``vowels``, as of ``compute_living_curves``
    edits  : pins and gains of curves; controls of a rig also follow those of the curves that they are made of
    Raises InputError: no such set or file, the character has no blendshapes, or the motion has no channel ``opening``.
    """
    if isinstance(curves, DrivenCharacter):
        return apply_weight_edits(curves.weights(motion, units), units, edits, curves)
    check_curve_set(curves)
    if curves in SHAPE_SETS:
        return edit_face_curves(_make_set(motion, units, str(curves), staging, prosody), units, edits)
    rows = read_rig_table(Path(curves))
    sources = make_rig_sources(motion, units, rows, staging=staging, prosody=prosody, edits=edits)
    of_rig = [edit for edit in edits if edit.channel not in sources]
    return apply_curve_edits(apply_rig(rows, sources, motion.rate_hz), units, of_rig)


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
        return edit_face_curves(_make_set(motion, units, name, staging, prosody), units, edits)

    sets = [with_mouth(motion), plain(ARKIT), plain(VISEMES)]
    if not all(row.source in {"", *(name for each in sets for name in each.names)} for row in rows):
        sets.append(plain(VOWELS))
    sources = {name: each[name].astype(np.float64) for each in sets for name in each.names}
    return {name: np.zeros(len(motion.values)) for name in ARKIT_OTHERS} | sources


def apply_weight_edits(
    weights: Motion, units: Timeline[Unit], edits: Sequence[CurveEdit], character: DrivenCharacter | None = None
) -> Motion:
    """Return weights of a character with pins and gains, which name its blendshapes as it does or as others do.

    character : whose weights of the mouth these are, which stay where it is held; None: of the 3D head
    """
    known = list_known_names(character.mesh) if character else {}
    named = {other: name for other, name in known.items() if name in weights.names and other not in weights.names}
    return apply_curve_edits(weights, units, rename_edits(edits, named), held=weights.names if character else ())


def rename_edits(edits: Sequence[CurveEdit], named: Mapping[str, str]) -> tuple[CurveEdit, ...]:
    """Return edits of curves by other names: those of ``named`` by their values."""

    def rename(edit: CurveEdit) -> CurveEdit:
        if isinstance(edit, Locked):
            return replace(edit, edits=rename_edits(edit.edits, named))
        return edit if isinstance(edit, Hold) else replace(edit, channel=named.get(edit.channel, edit.channel))

    return tuple(map(rename, edits))


def check_edit(edit: CurveEdit, motion: Motion, others: Collection[str] = ()) -> None:
    """Raise InputError if an edit is of no curve that is known, or of no time of the recording.

    others : names of curves that outputs will have besides
    """
    names = dict.fromkeys(name for name in (*motion.names, *GESTURES) if name not in UNEDITABLE)
    known = (*names, *KNOWN_CURVES, *others)
    if edit.channel and edit.channel not in known:
        verb = {Pin: "pin", DrawnCurve: "draw"}.get(type(edit), "change")
        name = shorten(repr(edit.channel)) + suggest(edit.channel, known)
        of_mouth = ", ".join(each for each in names if not LIP_POINT.match(each))
        known_curves = "lip points, as y_14; curves, as jawOpen, viseme_PP, open_jaw"
        raise InputError(f"cannot {verb} {name}; channels that can be pinned: {of_mouth}; {known_curves}")
    last_s = (len(motion.values) - 1) / motion.rate_hz
    if isinstance(edit, Pin):
        find_pinned_frame(edit, len(motion.values), motion.rate_hz, is_weight=edit.channel in WEIGHTS)
    elif not 0 <= edit.start_s <= edit.end_s <= last_s + LATE_S:
        verb = {DrawnCurve: "draw", Hold: "hold"}.get(type(edit), "gain")
        raise InputError(f"{verb} from {edit.start_s} to {edit.end_s} s, required times from 0 to {last_s:.2f} s")
    if isinstance(edit, DrawnCurve):
        check_drawn(edit, is_weight=edit.channel in WEIGHTS)


def edit_face_curves(curves: Motion, units: Timeline[Unit], edits: Sequence[CurveEdit]) -> Motion:
    """Return curves of one of ``SHAPE_SETS`` with edits; those that phones make stay where the mouth is held."""
    return apply_curve_edits(curves, units, rename_edits(edits, FAPS), held=PHONETIC)


def list_known_names(mesh: Mesh) -> dict[str, str]:
    """Return the blendshapes of a mesh by the names of the curves that they follow, or by ARKit's."""
    return {to_arkit(shape.called) or shape.called: shape.name for shape in reversed(mesh.shapes) if shape.called}


def _make_set(
    motion: Motion, units: Timeline[Unit], name: str, staging: Staging | None, prosody: Prosody | None
) -> Motion:
    if name == ARKIT:
        return solve_shape_weights(motion, units, arkit_mouth())
    motion = with_mouth(motion)
    if name == WHOLE_FACE:
        mouth = solve_shape_weights(motion, units, arkit_mouth())
        return join_channels(mouth, compute_living_curves(motion, units, staging, prosody))
    if name == VOWELS:  # with how far the lips are pressed together, and VRM's expressions of moods
        lips, moods = find_mouth(motion, units), weigh_expressions(read_moods(motion))
        curves = {CLOSED: lips.closing if CLOSED not in motion.names else motion[CLOSED]}
        # only the model knows which parts the lips
        curves |= {mood: curve * lips.free for mood, curve in moods.items()}
        channels = tuple(Channel(curve, WEIGHT) for curve in curves)
        pressed = Motion(np.stack(list(curves.values()), axis=1), motion.rate_hz, channels)
        vowels = join_channels(solve_shape_weights(motion, units, vowel_mouth()), pressed)
        return join_channels(vowels, compute_living_curves(motion, units, staging, prosody))
    if name in (VISEMES, HELD_VISEMES):
        return weigh_visemes(units, find_mouth(motion, units), held=name == HELD_VISEMES)
    return move_faps(motion, units)


def show_edited_curves(
    generation: Generation, staging: Staging | None = None, prosody: Prosody | None = None, *, mouth: bool = True
) -> Generation:
    """Return a generation whose motion shows its edits of curves, for faces that have no such curves.

    What edits change of blendshapes, visemes or vowels moves the mouth as it moves ARKit's (``arkit_mouth``). Edited
    eyes and brows take the place of what they would do by themselves, with staging and prosody.
    mouth : False: the face has curves of the mouth, and shows these itself
    """
    edits = generation.curve_edits
    names, motion = {edit.channel for edit in edits if edit.channel}, generation.motion
    calm = motion.selected([name for name in motion.names if not is_mood(name)])
    for name in (WHOLE_FACE, "visemes", VOWELS):
        if not names & {*SETS_OF[name]}:
            continue
        plain = _make_set(calm, generation.units, name, staging, prosody)
        edited = edit_face_curves(plain, generation.units, edits)
        if mouth and names & {*SETS_OF[name]} - {*ARKIT_OTHERS}:
            motion = _move_mouth(motion, calm, generation.units, (plain, edited), edits)
        living = [each for group in GROUPS if names & {*group} for each in group if each in edited.names]
        if name == WHOLE_FACE and living:
            motion = join_channels(motion, edited.selected([each for each in living if each not in motion.names]))
    return generation if motion is generation.motion else generation.with_motion(motion)


def _move_mouth(
    motion: Motion, calm: Motion, units: Timeline[Unit], curves: tuple[Motion, Motion], edits: Sequence[CurveEdit]
) -> Motion:
    """Return motion whose mouth changes as that of curves without and with edits; ``calm``: the motion in no mood."""
    before, after = map(with_mouth, curves)
    share = weigh_edits(motion.time_s, [edit for edit in edits if edit.channel in curves[0].names])
    motion = with_gestures(motion, units, (*GESTURES, EDITED["opening"]))
    values, gap = motion.values.astype(np.float64), find_mouth(calm, units).gap
    for column, channel in enumerate(motion.channels):
        if channel.name in after.names and channel.name not in (*curves[0].names, *GAP_CHANNELS):
            changed = values[:, column] + after[channel.name] - before[channel.name]
            values[:, column] = np.clip(changed, 0, 1) if channel.unit == WEIGHT else changed
    gap = np.maximum(gap + after[GAP] - before[GAP], 0)
    further = share * (gap_to_opening(gap) - motion["opening"])
    thicker = (after["outer"] - after["opening"]) - (before["outer"] - before["opening"])
    changes = further, further + thicker, share * (gap - read_gap(motion)), share * (1 - read_edited(motion, "opening"))
    for name, change in zip(GAP_CHANNELS, changes, strict=True):
        if name in motion.names:
            values[:, motion.column(name)] += change
    return replace(motion, values=values)


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
    others = [name for name in generation.motion.names if name not in added.names]
    generation = generation.selected(others)
    return generation.with_motion(join_channels(generation.motion, added)), added.names
