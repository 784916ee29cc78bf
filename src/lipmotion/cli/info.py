"""``lipmotion info``: what a model is and where it comes from."""

from __future__ import annotations

import argparse

from lipmotion.cli.output import say, say_lines
from lipmotion.cli.paths import add_input


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("info", help="say what a model is, and whose recordings it comes from")
    shipped = "default: the model that ships with the package"
    add_input(parser, "model", what="model", nargs="?", help=shipped)
    parser.add_argument(
        "--trees", action="store_true", help="print its decision trees, or its chains, and nothing else"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the model's header."""
    from lipmotion.pipeline.model import load_model, read_header, shipped_path

    path = options.model or shipped_path()
    if options.trees:
        model = load_model(path)
        say_lines(model.engine.trees(model.learned))
        return
    header = read_header(path)
    say(f"{'file':14} {path} ({path.stat().st_size / 1e6:.1f} MB)")
    for name, value in header.items():
        say(f"{name:14} {_plain(value)}")


def _plain(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}={item}" for key, item in value.items())
    return "; ".join(map(str, value)) if isinstance(value, list) else str(value)
