"""The model that a training starts from: ``--from``."""

from __future__ import annotations

from typing import Any

from lipmotion.engines.base import Engine, StandsOnPrior
from lipmotion.errors import InputError
from lipmotion.pipeline.model import Model, load_model

NONE = "none"


def model_to_start_from(name: str, engine: Engine[Any]) -> Model | None:
    """Return the model of ``--from``: a file, the one that ships (nothing given), or none.

    Raises InputError: a model is given, but the engine's models do not stand on others.
    """
    if name == NONE:
        return None
    if isinstance(engine, StandsOnPrior):
        return load_model(name or None)
    if name:
        raise InputError(f"the engine {engine.name!r} does not start from another model; leave --from out")
    return None
