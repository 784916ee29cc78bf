"""``lipmotion character``: what a character's files hold, and tables of its lip points and weights."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options, part_of
from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.cli.terminal.output import print_line, print_lines
from lipmotion.pipeline.job import Outputs


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser(
        "character", help="look into a character's files: lip points, blendshapes, control points"
    )
    kinds = "FILE.glb .gltf .vrm .obj, or a folder of .obj files"
    add_input(parser, "character", what="character", metavar="FILE", help=kinds)
    add_options(parser, Outputs, "lip_points", "binding", "control_points")
    points = "write the vertex of each lip point, to correct and give back: point,vertex"
    add_output(parser, "--write-points", metavar="FILE.csv", help=points)
    weights = "write the weights of control points, to paint and give back: vertex,point,weight"
    add_output(parser, "--write-weights", metavar="FILE.csv", help=weights)
    add_output(parser, "--write-binding", metavar="FILE.binding", help="write the binding, which is computed once")
    add_output(parser, "--picture", metavar="FILE.png", help="draw it at rest")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print what was found; write what was asked for."""
    from lipmotion.meshes.files.binding_files import save_binding, write_points, write_weights
    from lipmotion.pipeline.opened_job import character_of
    from lipmotion.pipeline.outputs.curve_sets import described, write_picture

    by_points = bool(options.control_points or options.write_weights or options.write_binding)
    character = character_of(part_of(options, Outputs(), control_points=by_points))
    print_lines("\n".join(described(character)))
    if options.write_points:
        write_points(options.write_points, character.placement)
    if options.write_weights and character.binding is not None:
        write_weights(options.write_weights, character.binding)
    if options.write_binding and character.binding is not None:
        save_binding(options.write_binding, character.binding, character.mesh)
    if options.picture:
        write_picture(options.picture, character)
    for path in (options.write_points, options.write_weights, options.write_binding, options.picture):
        if path:
            print_line(path)
