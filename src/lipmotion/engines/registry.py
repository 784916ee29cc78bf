"""Engines by name: the built-in ones, and those of installed packages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.engines.base import Engine
from lipmotion.errors import InputError
from lipmotion.extensions import Registry

ENGINES: Registry[type[Engine[Any]]] = Registry(
    "engine",
    "lipmotion.engines",
    {
        "trajectory": "lipmotion.engines.trajectory.engine:TrajectoryEngine",
        "coupled": "lipmotion.engines.coupled.engine:CoupledEngine",
        "joint": "lipmotion.engines.joint.engine:JointEngine",
    },
)


def engine_named(name: str, configuration: Mapping[str, Any] | None = None) -> Engine[Any]:
    """Return an engine with its configuration.

    name          : ``trajectory``, ``coupled``, ``joint``, or one that an installed package adds
    configuration : options by name; all others have their defaults
    Raises InputError: no such engine or option, or a value that is not allowed.
    """
    chosen = _class_of(name)
    try:
        return _made(chosen, chosen.Config.parsed(configuration or {}))
    except InputError as error:
        raise InputError(f"engine {name!r}: {error}") from error


def engine_from_settings(
    name: str, *, preset: str | None = None, units: str | None = None, settings: Sequence[str] = ()
) -> Engine[Any]:
    """Return an engine configured by texts, as a command line gives them.

    preset   : a named combination of options, as ``ph-vi-CHMM`` of the engine ``coupled``
    units    : the unit set, of engines with an option ``units``
    settings : ``NAME=VALUE`` for any option of the configuration; these override the others
    Raises InputError: no such engine, preset, unit set or option, or a value that is not allowed.
    """
    chosen = _class_of(name)
    options: dict[str, Any] = dict(_preset(chosen, name, preset)) if preset is not None else {}
    try:
        if units is not None:
            options |= chosen.Config.values_of([f"units={units}"])
        options |= chosen.Config.values_of(settings)
        engine = _made(chosen, chosen.Config.parsed(options))
        engine.config.check_files()
    except InputError as error:
        raise InputError(f"engine {name!r}: {error}") from error
    return engine


def _class_of(name: str) -> type[Engine[Any]]:
    """Return the class of an engine. Raises InputError: none of that name, or what a package adds is no engine."""
    chosen = ENGINES.load(name)
    if not (isinstance(chosen, type) and issubclass(chosen, Engine)):
        raise InputError(
            f"{chosen!r} is called an engine, {name!r}, by an installed package; required a class of Engine"
        )
    return chosen


def _made(chosen: type[Engine[Any]], config: Any) -> Engine[Any]:
    make: Any = chosen  # every engine is a dataclass of one field
    made: Engine[Any] = make(config)
    return made


def _preset(chosen: type[Engine[Any]], name: str, preset: str) -> Mapping[str, Any]:
    presets = chosen.Config.presets
    if preset in presets:
        return presets[preset]
    having = [other for other in ENGINES.names if preset in _class_of(other).Config.presets]
    if having:
        raise InputError(f"{preset} is a system of the engine {having[0]!r}, not of {name!r}; add --engine {having[0]}")
    known = f"there are: {', '.join(presets)}" if presets else f"the engine {name!r} has none"
    raise InputError(f"no system {preset!r}; {known}")
