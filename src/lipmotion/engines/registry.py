"""The registry of engines: built-in ones, and those of installed packages."""

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
        "selection": "lipmotion.engines.selection.engine:SelectionEngine",
    },
)


def engine_named(name: str, configuration: Mapping[str, Any] | None = None) -> Engine[Any]:
    """Return an engine with its configuration.

    name          : ``trajectory``, ``coupled``, ``joint``, or the name of an engine of an installed package
    configuration : values of options, by name; all others have their default values
    Raises InputError: no such engine or option, or a value that is not allowed.

    >>> engine = engine_named("trajectory", {"components": 8})
    >>> engine.name, engine.config.components, engine.config.states
    ('trajectory', 8, 5)
    """
    chosen = _class_of(name)
    try:
        return _create(chosen, chosen.Config.parsed(configuration or {}))
    except InputError as error:
        raise InputError(f"engine {name!r}: {error}") from error


def engine_from_settings(
    name: str, *, preset: str | None = None, units: str | None = None, settings: Sequence[str] = ()
) -> Engine[Any]:
    """Return an engine whose configuration is parsed from texts, as on the command line.

    preset   : a named combination of options: ``ph-vi-CHMM`` of the engine ``coupled``, for instance
    units    : the unit set, for engines with an option ``units``
    settings : ``NAME=VALUE`` for any options; these override preset and units
    Raises InputError: no such engine, preset, unit set or option, or a value that is not allowed.
    """
    chosen = _class_of(name)
    options: dict[str, Any] = dict(_preset(chosen, name, preset)) if preset is not None else {}
    try:
        if units is not None:
            options |= chosen.Config.values_of([f"units={units}"])
        options |= chosen.Config.values_of(settings)
        engine = _create(chosen, chosen.Config.parsed(options))
        engine.config.check_files()
    except InputError as error:
        raise InputError(f"engine {name!r}: {error}") from error
    return engine


def _class_of(name: str) -> type[Engine[Any]]:
    """Return the class of an engine. Raises InputError: no such engine, or an extension that is not an ``Engine``."""
    chosen = ENGINES.load(name)
    if not (isinstance(chosen, type) and issubclass(chosen, Engine)):
        raise InputError(
            f"{chosen!r} is called an engine, {name!r}, by an installed package; required a class of Engine"
        )
    return chosen


def _create(chosen: type[Engine[Any]], config: Any) -> Engine[Any]:
    constructor: Any = chosen  # every engine is a dataclass with one field
    return constructor(config)


def _preset(chosen: type[Engine[Any]], name: str, preset: str) -> Mapping[str, Any]:
    """Return the options of a preset. Raises InputError: the engine has no such preset."""
    presets = chosen.Config.presets
    if preset in presets:
        return presets[preset]
    having = [other for other in ENGINES.names if preset in _class_of(other).Config.presets]
    if having:
        raise InputError(f"{preset} is a system of the engine {having[0]!r}, not of {name!r}; add --engine {having[0]}")
    known = f"there are: {', '.join(presets)}" if presets else f"the engine {name!r} has none"
    raise InputError(f"no system {preset!r}; {known}")
