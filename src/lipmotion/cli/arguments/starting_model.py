"""The model that a training starts from: ``--from``."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.paths import add_input

if TYPE_CHECKING:
    from lipmotion.engines import Engine
    from lipmotion.pipeline.model import Model

FROM = "stand on this model (default: the one that ships), or 'none' (docs/own-model.md)"
NONE = "none"


def add_start_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--from``; default: the model that ships with the package, for engines whose models stand on others."""
    add_input(
        parser, "--from", what="model to start from", dest="start", default="", type=str, metavar="MODEL", help=FROM
    )


def model_to_start_from(name: str, engine: Engine[Any]) -> Model | None:
    """Return the model of ``--from``: a file, the one that ships (nothing given), or none.

    Raises InputError: a model is given, but the engine's models do not stand on others.
    """
    from lipmotion.errors import InputError
    from lipmotion.pipeline.model import load_model

    if name == NONE:
        return None
    if engine.inputs().prior:
        return load_model(name or None)
    if name:
        raise InputError(f"the engine {engine.name!r} does not start from another model; leave --from out")
    return None
