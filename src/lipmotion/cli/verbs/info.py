"""``lipmotion info``: the header of a model, or its decision trees or chains."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.terminal.printing import print_line, print_lines

OF_PRIOR = ("engine", "corpus", "split", "utterances", "minutes", "licence", "attribution")
"""What is printed of the model on which a model stands and which is part of its file."""


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("info", help="print what a model is, and whose recordings it was trained on")
    shipped = "default: the model that ships with the package"
    add_input(parser, "model", what="model", nargs="?", help=shipped)
    parser.add_argument("--structure", action="store_true", help="print only its decision trees, or its chains")
    parser.add_argument("--trees", action="store_true", dest="structure", help=argparse.SUPPRESS)  # its former name
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the header of the model, or its structure."""
    from lipmotion.errors import InputError
    from lipmotion.pipeline.model import load_model, read_header, shipped_path

    path = options.model or shipped_path()
    if options.structure:
        model = load_model(path)
        text = model.engine.describe(model.learned)
        if not text:
            raise InputError(f"models of the engine {model.engine.name!r} cannot be printed; leave --structure out")
        print_lines(text)
        return
    header = read_header(path)
    print_line(f"{'file':14} {path} ({path.stat().st_size / 1e6:.1f} MB)")
    inside = header.pop("prior", None)
    for name, value in header.items():
        print_line(f"{name:14} {_plain(value) or 'none stated'}")
    for name, value in (inside or {}).items():
        if name in OF_PRIOR and value:
            print_line(f"prior {name:12} {_plain(value)}")


def _plain(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}={item}" for key, item in value.items())
    return "; ".join(map(str, value)) if isinstance(value, list) else str(value)
