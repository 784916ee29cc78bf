"""Engines by the name that stands in a model's header."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lipmotion.engines.base import Engine
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.trajectory.engine import TrajectoryConfig, TrajectoryEngine
from lipmotion.engines.trajectory.joint.engine import JointEngine, JointEngineConfig
from lipmotion.errors import InputError

ENGINES: dict[str, Callable[..., Engine[Any]]] = {
    TrajectoryEngine.name: lambda **options: TrajectoryEngine(TrajectoryConfig(**options)),
    CoupledEngine.name: lambda **options: CoupledEngine(CoupledConfig(**options)),
    JointEngine.name: lambda **options: JointEngine(JointEngineConfig(**options)),
}


def engine_named(name: str, configuration: Mapping[str, Any]) -> Engine[Any]:
    """Return an engine with its configuration. Raises InputError: unknown engine or option."""
    if name not in ENGINES:
        raise InputError(f"no engine {name!r}; there are: {', '.join(ENGINES)}")
    try:
        return ENGINES[name](**configuration)
    except TypeError as error:
        raise InputError(f"engine {name!r}: {error}") from error
