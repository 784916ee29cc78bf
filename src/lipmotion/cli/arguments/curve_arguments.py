"""Arguments of the verbs that move a character of the user's own."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lipmotion.cli.arguments.paths import add_input

if TYPE_CHECKING:
    from lipmotion.meshes.fitting.driven import DrivenCharacter


def add_character_file(parser: argparse.ArgumentParser) -> None:
    """Add what tells where the mouth of a character is, and what moves it."""
    points = "the vertices of lip points: point,vertex (default: found by the blendshape that opens the mouth)"
    add_input(parser, "--lip-points", what="table of lip points", metavar="FILE.csv", help=points)
    binding = "weights of control points: stored (.binding) or painted (.csv)"
    add_input(parser, "--binding", what="binding", metavar="FILE", help=binding)
    by_points = "move it by control points, though it has blendshapes"
    parser.add_argument("--control-points", action="store_true", help=by_points)


def add_character_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the character that videos show, and curves that drive one elsewhere."""
    shown = "your own character in videos: FILE.glb .gltf .vrm .obj, or a folder of .obj; motion files get its weights"
    add_input(parser, "--character", what="character", metavar="FILE", help=shown)
    add_character_file(parser)
    curves = "what motion files hold: arkit, face, visemes, fap, or the controls of a rig (FILE.csv; docs/meshes.md)"
    parser.add_argument("--curves", metavar="SET", help=curves)


def open_character(options: argparse.Namespace) -> None:
    """Read the character that was asked for, as the face of videos; check what is written of it."""
    from lipmotion.errors import InputError
    from lipmotion.pipeline.outputs.curve_sets import check_curve_set

    if options.curves:
        check_curve_set(options.curves)
    options.driven = None
    if options.character is None:
        if options.lip_points or options.binding or options.control_points:
            raise InputError("lip points and bindings belong to a character; name it: --character FILE")
        return
    from lipmotion.faces.mesh import MeshFace

    options.driven = driven(options)
    options.face = MeshFace(options.driven)


def driven(options: argparse.Namespace) -> DrivenCharacter:
    """Return the character that the options name."""
    from lipmotion.meshes.fitting.driven import driven_character

    how = {"points": options.lip_points, "binding": options.binding, "by_points": options.control_points}
    return driven_character(options.character, **how)


def chosen_curves(options: argparse.Namespace) -> str | DrivenCharacter | None:
    """Return what motion files hold: the set of ``--curves``, else the weights of a character that has blendshapes.

    None: the channels of the motion.
    """
    weighed = options.driven if options.driven is not None and options.driven.shapes is not None else None
    return options.curves or weighed
