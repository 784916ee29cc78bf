"""Motion for characters: weights of blendshapes, visemes, MPEG-4 parameters, controls of a user's rig."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import EDITED, GAP, gap_to_opening, read_edited, read_gap
from lipmotion.articulation.curve_edits import apply_curve_edits, edited_share
from lipmotion.articulation.expression import is_mood, read_moods
from lipmotion.articulation.lip_points import mouth_template
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.articulation.phone_targets import GESTURES, with_gestures
from lipmotion.errors import InputError, shorten
from lipmotion.formats.fap import NAMES, PARAMETERS, move_faps
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth, vowel_mouth, with_mouth
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.meshes.fitting.eyes_and_brows import GROUPS, compute_living_curves
from lipmotion.meshes.fitting.shape_weights import (
    VISEME_CHANNELS,
    expression_weights,
    solve_shape_weights,
    weigh_visemes,
)
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.rig_tables import RigRow, apply_rig, read_rig_table, suggest_names
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, ARKIT_OTHERS, CLOSED, VRM_VOWELS, arkit_name
from lipmotion.types import WEIGHT, Channel, CurveEdit, Generation, Hold, Motion, Prosody, Span, Timeline, Unit
from lipmotion.types.delivery import Staging
from lipmotion.types.edits import Locked

ARKIT, WHOLE_FACE, VOWELS = "arkit", "face", "vowels"
VISEMES, HELD_VISEMES = "visemes", "held-visemes"
LIVING_SETS = (WHOLE_FACE, VOWELS)
"""Sets of curves with eyes, brows and head, which move on their own."""
WEIGHTS = (*ARKIT_MOUTH, *ARKIT_OTHERS, *VISEME_CHANNELS, *VRM_VOWELS)
FAPS = {name: NAMES[number] for number, name, *_ in PARAMETERS}
KNOWN_CURVES = (*WEIGHTS, *FAPS)
"""Curves that outputs may have, whatever the motion has: ARKit's blendshapes, visemes, MPEG-4's parameters."""
SETS_OF = {WHOLE_FACE: (*ARKIT_MOUTH, *ARKIT_OTHERS), VISEMES: VISEME_CHANNELS, VOWELS: VRM_VOWELS}
"""The curves that are edited in each set (``show_edited_curves``)."""
GAP_CHANNELS = ("opening", "outer", GAP, EDITED["opening"])
"""Channels that say how far the lips are apart."""
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
    curves : one of ``SHAPE_SETS``, a table of a rig's controls (``.csv``), or a character with blendshapes
    staging, prosody : of the eyes, brows and head of ``face`` and ``vowels``, as of ``compute_living_curves``
    edits  : pins and gains of curves; controls of a rig also follow those of the curves that they are made of
    Raises InputError: no such set or file, the character has no blendshapes, or the motion has no channel ``opening``.
    """
    if isinstance(curves, DrivenCharacter):
        return edit_weights(curves.weights(motion, units), units, edits, curves)
    check_curve_set(curves)
    if curves in SHAPE_SETS:
        return edit_curves(_make_set(motion, units, str(curves), staging, prosody), units, edits)
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
        return edit_curves(_make_set(motion, units, name, staging, prosody), units, edits)

    sets = [with_mouth(motion), plain(ARKIT), plain(VISEMES)]
    if not all(row.source in {"", *(name for each in sets for name in each.names)} for row in rows):
        sets.append(plain(VOWELS))
    sources = {name: each[name].astype(np.float64) for each in sets for name in each.names}
    return {name: np.zeros(len(motion.values)) for name in ARKIT_OTHERS} | sources


def edit_weights(
    weights: Motion, units: Timeline[Unit], edits: Sequence[CurveEdit], character: DrivenCharacter | None = None
) -> Motion:
    """Return weights of a character with pins and gains, which name its blendshapes as it does or as others do.

    character : whose weights of the mouth these are, which stay where it is held; None: of the 3D head
    """
    known = known_names(character.mesh) if character else {}
    named = {other: name for other, name in known.items() if name in weights.names}
    named |= {name: name for name in weights.names}
    return apply_curve_edits(weights, units, rename_edits(edits, named), held=weights.names if character else ())


def rename_edits(edits: Sequence[CurveEdit], named: Mapping[str, str]) -> tuple[CurveEdit, ...]:
    """Return edits of curves by other names: those of ``named`` by their values."""
    renamed: list[CurveEdit] = []
    for edit in edits:
        if isinstance(edit, Locked):
            renamed.append(replace(edit, edits=rename_edits(edit.edits, named)))
        else:
            renamed.append(
                edit if isinstance(edit, Hold) else replace(edit, channel=named.get(edit.channel, edit.channel))
            )
    return tuple(renamed)


def edit_curves(curves: Motion, units: Timeline[Unit], edits: Sequence[CurveEdit]) -> Motion:
    """Return curves of one of ``SHAPE_SETS`` with edits; those that phones make stay where the mouth is held."""
    return apply_curve_edits(curves, units, rename_edits(edits, FAPS), held=PHONETIC)


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
    if name in (VISEMES, HELD_VISEMES):
        return weigh_visemes(units, spoken_mouth(motion, units), held=name == HELD_VISEMES)
    return move_faps(motion, units)


def show_edited_curves(
    generation: Generation,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
    *,
    mouth: bool = True,
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
        edited = edit_curves(plain, generation.units, edits)
        if mouth and names & {*SETS_OF[name]} - {*ARKIT_OTHERS}:
            motion = _move_mouth(motion, calm, generation.units, (plain, edited), edits)
        given = [each for group in GROUPS if names & {*group} for each in group if each in edited.names]
        if name == WHOLE_FACE and given:
            motion = join_channels(motion, edited.selected([each for each in given if each not in motion.names]))
    return generation if motion is generation.motion else generation.with_motion(motion)


def _move_mouth(
    motion: Motion, calm: Motion, units: Timeline[Unit], curves: tuple[Motion, Motion], edits: Sequence[CurveEdit]
) -> Motion:
    """Return motion whose mouth changes as that of curves without and with edits; ``calm``: the motion in no mood."""
    before, after = map(with_mouth, curves)
    share = edited_share(motion.time_s, [edit for edit in edits if edit.channel in curves[0].names])
    motion = with_gestures(motion, units, (*GESTURES, EDITED["opening"]))
    values, gap = motion.values.astype(np.float64), spoken_mouth(calm, units).gap
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


Sources = Mapping[str, Sequence[float]]
"""By the name of a curve its value in each of ``POSES``."""
POSES = ("open", "closed", "rounded")
PHONES = ("aa", "m", "uw")
"""The phones whose mouths they are."""
OPENINGS, WIDTHS = (0.25, 0.0, 0.06), (1.0, 0.98, 0.85)
"""Their openings, in eye distances (the first is as wide as talkers open their mouths), and widths, that at rest 1."""
RATE_HZ, PHONE_S, PAUSE_S = 100.0, 0.3, 0.5
DIGITS = 6
MIN_CHANGE = 1e-3
"""A control that changes by less between two poses does not follow them."""


def calibrate_rows(rows: Sequence[RigRow], sources: Sources, stated: Mapping[str, Mapping[str, float]]) -> list[RigRow]:
    """Return the rows of a table with gains and offsets by which controls have the stated values.

    sources : of the curves that the rows follow
    stated  : by pose the values of some controls; what is not stated of a control stays as it is, as far as the line
              through what is stated allows
    Raises InputError: no such control, or one that does not change between the poses.
    """
    values: dict[str, np.ndarray] = {}  # of each control in the poses, without its limits
    for row in rows:
        followed = np.array(sources.get(row.source, np.zeros(len(POSES))))
        values[row.control] = values.get(row.control, 0.0) + row.offset + row.gain * followed
    lines = {}
    for control in dict.fromkeys(name for controls in stated.values() for name in controls):
        if control not in values:
            raise InputError(f"the table has no {shorten(control)!r}; {suggest_names(control, values)}")
        now = values[control]
        targets = {
            number: stated[pose][control] for number, pose in enumerate(POSES) if control in stated.get(pose, {})
        }
        if len(targets) == 1:
            only = next(iter(targets))
            other = int(np.abs(now - now[only]).argmax())
            targets[other] = float(now[other])
        before, wanted = now[list(targets)], np.array(list(targets.values()))
        apart = before - before.mean()
        if np.abs(apart).max() < MIN_CHANGE:
            raise InputError(
                f"{shorten(control)!r} follows no curve that tells these poses apart; give it another source in the "
                "table"
            )
        gain = float(apart @ (wanted - wanted.mean()) / (apart @ apart))
        lines[control] = gain, round(float(wanted.mean() - gain * before.mean()), DIGITS)
    calibrated, seen = [], set[str]()
    for row in rows:
        if row.control in lines:
            gain, offset = lines[row.control]
            first = offset if row.control not in seen else 0.0
            row = replace(row, gain=gain * row.gain, offset=gain * row.offset + first)  # noqa: PLW2901
            seen.add(row.control)
        calibrated.append(row)
    return calibrated


def pose_sources(curves: DrivenCharacter | Path, rows: Sequence[RigRow]) -> Sources:
    """Return the values of curves in ``POSES``: those of a character, or those that the rows of a rig follow.

    Raises InputError: the character has no blendshapes of the mouth, or a row follows no curve.
    """
    edges = PAUSE_S + PHONE_S * np.arange(len(PHONES) + 1)
    spans = [Span(0.0, PAUSE_S, Unit("sil"))]
    spans += [Span(float(at), float(at + PHONE_S), Unit(phone)) for at, phone in zip(edges, PHONES, strict=False)]
    spans.append(Span(float(edges[-1]), float(edges[-1] + PAUSE_S), Unit("sil")))
    time_s = np.arange(round((edges[-1] + PAUSE_S) * RATE_HZ)) / RATE_HZ
    inside = [at + share * PHONE_S for at in edges[:-1] for share in (0.3, 0.7)]
    keys = [0.0, float(edges[0]), *inside, float(edges[-1]), float(time_s[-1])]
    opening = np.interp(time_s, keys, [0, 0, *np.repeat(OPENINGS, 2), 0, 0])
    width = np.interp(time_s, keys, [1, 1, *np.repeat(WIDTHS, 2), 1, 1]) * mouth_template().width
    motion = Motion(np.stack([opening, width], axis=1), RATE_HZ, (Channel("opening"), Channel("width")))
    units, frames = Timeline(tuple(spans)), [round((at + PHONE_S / 2) * RATE_HZ) for at in edges[:-1]]
    if isinstance(curves, Path):
        found = make_rig_sources(motion, units, rows)
        return {name: curve[frames].tolist() for name, curve in found.items()}
    if curves.shapes is None:
        raise InputError("the character is moved by control points, which have no weights to calibrate")
    solved = solve_shape_weights(motion, units, curves.shapes)
    by_name = {name: solved[name][frames].tolist() for name in solved.names}
    return {row.source: by_name[row.control] for row in curves.table_rows() if row.control in by_name}
