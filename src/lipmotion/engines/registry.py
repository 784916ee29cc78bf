"""Engines by the name that stands in a model's header."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, fields
from typing import Any

from lipmotion.engines.base import Engine
from lipmotion.engines.coupled.chains.structures import SYSTEMS, structure_of
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.joint.engine import JointEngine, JointEngineConfig
from lipmotion.engines.trajectory.engine import TrajectoryConfig, TrajectoryEngine
from lipmotion.errors import InputError
from lipmotion.units import unit_set

ENGINES: dict[str, Callable[..., Engine[Any]]] = {
    TrajectoryEngine.name: lambda **options: TrajectoryEngine(TrajectoryConfig(**options)),
    CoupledEngine.name: lambda **options: CoupledEngine(CoupledConfig(**options)),
    JointEngine.name: lambda **options: JointEngine(JointEngineConfig(**options)),
}


CONFIGURATIONS: dict[str, type[Any]] = {
    TrajectoryEngine.name: TrajectoryConfig,
    CoupledEngine.name: CoupledConfig,
    JointEngine.name: JointEngineConfig,
}
TRUTHS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def engine_named(name: str, configuration: Mapping[str, Any]) -> Engine[Any]:
    """Return an engine with its configuration. Raises InputError: unknown engine or option."""
    if name not in ENGINES:
        raise InputError(f"no engine {name!r}; there are: {', '.join(ENGINES)}")
    try:
        return ENGINES[name](**configuration)
    except TypeError as error:
        raise InputError(f"engine {name!r}: {error}") from error


def engine_as_told(
    name: str, *, system: str | None = None, units: str | None = None, settings: Sequence[str] = ()
) -> Engine[Any]:
    """Return an engine as a command line asks for it.

    system   : one of the coupled engine's six, whose structure and chains it sets
    units    : the unit set of an engine that has one
    settings : ``NAME=VALUE`` for any option of its configuration; these have the last word
    Raises InputError: no such engine, system, unit set or option, or a value that is not of its kind.
    """
    if name not in ENGINES:
        raise InputError(f"no engine {name!r}; there are: {', '.join(ENGINES)}")
    options: dict[str, Any] = {}
    if system is not None:
        options |= _of_system(name, system)
    if units is not None:
        options |= _of_units(name, units)
    engine = engine_named(name, options | _settings(name, settings))
    _check_units(engine.config)
    return engine


def _check_units(config: Any) -> None:
    """Raise InputError unless all unit sets are there, and fit together: before long work."""
    if isinstance(config, CoupledConfig):
        structure_of(config.structure, config.chains, config.states, config.asynchrony, config.crosses)
    else:
        unit_set(config.units)


def _of_system(name: str, system: str) -> Mapping[str, Any]:
    if name != CoupledEngine.name:
        raise InputError(f"a system ({system}) is of the coupled engine, not of {name!r}; add --engine coupled")
    if system not in SYSTEMS:
        raise InputError(f"no system {system!r}; there are: {', '.join(SYSTEMS)}")
    return SYSTEMS[system]


def _of_units(name: str, units: str) -> Mapping[str, Any]:
    if "units" not in {option.name for option in fields(CONFIGURATIONS[name])}:
        raise InputError(f'the engine {name!r} has a unit set a chain; say --set chains="phone viseme", not --units')
    return {"units": units}


def _settings(name: str, settings: Sequence[str]) -> dict[str, Any]:
    options = {option.name: option for option in fields(CONFIGURATIONS[name])}
    found = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals:
            raise InputError(f"the setting {setting!r} has no value; required NAME=VALUE")
        if key not in options:
            raise InputError(f"the engine {name!r} has no option {key!r}; there are: {', '.join(options)}")
        found[key] = _value(options[key], text)
    return found


def _value(option: Field[Any], text: str) -> Any:
    """Return what a text says for an option; the configuration itself decides whether it will do."""
    kinds: dict[str, Callable[[str], Any]] = {"int": int, "float": float, "bool": lambda t: TRUTHS[t.lower()]}
    kind = str(option.type)
    try:
        return kinds.get(kind, str)(text)
    except (ValueError, KeyError) as error:
        wanted = {"int": "a whole number", "float": "a number", "bool": "true or false"}[kind]
        raise InputError(f"{option.name} is {text!r}, required {wanted}") from error
