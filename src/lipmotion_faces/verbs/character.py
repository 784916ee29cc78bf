"""``lipmotion character``: what a character's files hold; tables of its curves, lip points and weights."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, cast

from lipmotion.cli.arguments.declared import add_options, pick_part
from lipmotion.cli.arguments.options import add_verb
from lipmotion.cli.terminal.printing import print_line
from lipmotion.cli.terminal.progress import Report
from lipmotion.errors import InputError, shorten
from lipmotion.pipeline.request import Outputs
from lipmotion.types.progress import Progress
from lipmotion.types.values import parse_number

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from lipmotion.meshes.fitting.driven import DrivenCharacter
    from lipmotion.meshes.model.rig_tables import RigRow
    from lipmotion_faces.characters.binding import PosedCharacter

POSES = ("open", "closed", "rounded")  # in which values of controls are stated


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "character", run)
    add_options(parser, Outputs, "lip_points", "binding", "control_points")


def run(options: argparse.Namespace) -> None:
    """Print what was found; write what was asked for."""
    from lipmotion.extensions import load_provided
    from lipmotion.meshes.fitting.driven import list_rig_rows
    from lipmotion.meshes.model.rig_tables import find_table, read_rig_table
    from lipmotion.pipeline.job import open_character
    from lipmotion.storage.sources import is_file
    from lipmotion_faces.characters.binding import save_binding, write_points, write_weights
    from lipmotion_faces.characters.calibration import describe_character, write_rig_table
    from lipmotion_faces.characters.character_files import read_character

    report = Report(options)
    stated, path = _read_values(options), options.character
    if path.suffix.lower() == ".csv":
        rows = read_rig_table(path)
        if not stated:
            raise InputError(f"{path}: is a rig's table; state values of its controls: --open NAME=X")
        _write_table(path, rows, path, stated)
        return
    by_points = bool(options.control_points or options.write_weights or options.write_binding)
    report.receive(Progress("reading the character", 0, 1, 0.0))
    try:
        character = cast("PosedCharacter", open_character(pick_part(options, Outputs(), control_points=by_points)))
    except InputError:
        table = find_table(path)
        if options.write_table and not is_file(table):  # the mouth was not found: the table is to be filled in
            write_rig_table(table, list_rig_rows(read_character(path), None, {}))
            print_line(table)
        raise
    report.finish("\n".join(describe_character(character)))
    if options.write_table or stated:
        _write_table(character.table_file, character.table_rows(), character, stated)
    if options.write_points:
        write_points(options.write_points, character.placement)
    if options.write_weights and character.binding is not None:
        write_weights(options.write_weights, character.binding)
    if options.write_binding and character.binding is not None:
        save_binding(options.write_binding, character.binding, character.mesh)
    if options.picture:
        report.receive(Progress("drawing the picture", 0, 1, 0.0))
        load_provided("write_picture")(options.picture, character)
        report.close()
    for output in (options.write_points, options.write_weights, options.write_binding, options.picture):
        if output:
            print_line(output)


def _write_table(
    path: Path, rows: Sequence[RigRow], curves: DrivenCharacter | Path, stated: dict[str, dict[str, float]]
) -> None:
    """Write a table with the gains and offsets by which its controls have the stated values; print those."""
    from lipmotion_faces.characters.calibration import calibrate_rows, list_pose_sources, write_rig_table

    changed = calibrate_rows(rows, list_pose_sources(curves, rows), stated) if stated else rows
    for row in changed:
        if row not in rows:
            print_line(f"{shorten(row.control):14} {row.source}: gain {row.gain:.3g}, offset {row.offset:.3g}")
    write_rig_table(path, changed)
    print_line(path)


def _read_values(options: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Return what options say of controls in poses. Raises InputError: something that states no value."""
    stated: dict[str, dict[str, float]] = {}
    for pose in POSES:
        for part in filter(None, getattr(options, pose).split(",")):
            name, _, text = part.rpartition("=")
            value = parse_number(text, f"--{pose}: the value in {shorten(part)!r} is", "NAME=X, as A=0.8")
            if not name.strip():
                raise InputError(f"--{pose}: {shorten(part)!r} names no control, required NAME=X, as A=0.8")
            stated.setdefault(pose, {})[name.strip()] = value
    return stated
