"""Descriptions of characters' files; gains and offsets of their tables, from control values that a user states."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from lipmotion.articulation.lip_points import build_mouth
from lipmotion.errors import InputError, shorten
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.meshes.fitting.shape_weights import solve_shape_weights
from lipmotion.meshes.model.rig_tables import COLUMNS, RigRow, suggest_names
from lipmotion.pipeline.outputs.curve_sets import make_rig_sources
from lipmotion.storage.files import atomic_file
from lipmotion.storage.text_table import as_field
from lipmotion.types import Channel, Motion, Span, Timeline, Unit
from lipmotion_faces.characters.binding import PosedCharacter


def describe_character(character: PosedCharacter) -> Iterator[str]:
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


Sources = Mapping[str, Sequence[float]]  # by the name of a curve its value in each of ``POSES``
POSES = ("open", "closed", "rounded")
PHONES = ("aa", "m", "uw")  # the phones that have these mouths
OPENINGS, WIDTHS = (0.25, 0.0, 0.06), (1.0, 0.98, 0.85)
"""Their openings in eye distances (the first is as wide as talkers go), and widths relative to the mouth at rest."""
RATE_HZ, PHONE_S, PAUSE_S = 100.0, 0.3, 0.5
DIGITS = 6
MIN_CHANGE = 1e-3  # a control that changes by less between two poses does not follow them


def calibrate_rows(rows: Sequence[RigRow], sources: Sources, stated: Mapping[str, Mapping[str, float]]) -> list[RigRow]:
    """Return the rows of a table with gains and offsets that give controls the stated values.

    sources : of the curves that the rows follow
    stated  : by pose the values of some controls; a line is fitted to them; beside a single one
              the pose that differs most from it stays as it is
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


def write_rig_table(path: Path, rows: Iterable[RigRow]) -> None:
    """Write a table, which ``read_rig_table`` reads. Raises ExportError: it cannot be written."""
    with atomic_file(path) as unfinished, unfinished.open("w", encoding="utf-8-sig", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for row in rows:
            limits = [f"{limit:g}" if np.isfinite(limit) else "" for limit in (row.low, row.high)]
            names = (as_field(row.control), as_field(row.source))
            table.writerow([*names, f"{row.gain:.4g}", f"{row.offset:.4g}", *limits])


def list_pose_sources(curves: DrivenCharacter | Path, rows: Sequence[RigRow]) -> Sources:
    """Return the values of curves in ``POSES``: those of a character, or those that the rows of a rig follow.

    Raises InputError: the character has no blendshapes of the mouth, or a row follows no curve.
    """
    edges = PAUSE_S + PHONE_S * np.arange(len(PHONES) + 1)
    phones = pairwise([0.0, *edges.tolist(), float(edges[-1] + PAUSE_S)])
    spans = [Span(*times, Unit(phone)) for times, phone in zip(phones, ("sil", *PHONES, "sil"), strict=True)]
    time_s = np.arange(round((edges[-1] + PAUSE_S) * RATE_HZ)) / RATE_HZ
    inside = [at + share * PHONE_S for at in edges[:-1] for share in (0.3, 0.7)]
    keys = [0.0, float(edges[0]), *inside, float(edges[-1]), float(time_s[-1])]
    opening = np.interp(time_s, keys, [0, 0, *np.repeat(OPENINGS, 2), 0, 0])
    width = np.interp(time_s, keys, [1, 1, *np.repeat(WIDTHS, 2), 1, 1]) * build_mouth().width
    motion = Motion(np.stack([opening, width], axis=1), RATE_HZ, (Channel("opening"), Channel("width")))
    units, frames = Timeline(tuple(spans)), [round((at + PHONE_S / 2) * RATE_HZ) for at in edges[:-1]]
    if isinstance(curves, Path):
        sources = make_rig_sources(motion, units, rows)
        return {name: curve[frames].tolist() for name, curve in sources.items()}
    if curves.shapes is None:
        raise InputError("the character is moved by control points, which have no weights to calibrate")
    solved = solve_shape_weights(motion, units, curves.shapes)
    by_name = {name: solved[name][frames].tolist() for name in solved.names}
    return {row.source: by_name[row.control] for row in curves.table_rows() if row.control in by_name}
