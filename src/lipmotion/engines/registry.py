"""The registry of engines: built-in ones, and those of installed packages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

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
    Engine,
)

DEFAULT = "trajectory"


def engine_named(name: str, configuration: Mapping[str, Any] | None = None, *, stored: bool = False) -> Engine[Any]:
    """Return an engine with its configuration.

    name          : ``trajectory``, ``coupled``, ``joint``, or the name of an engine of an installed package
    configuration : values of options, by name; all others have their default values
    stored        : the header of a model holds these options: others have the values that headers leave out
    Raises InputError: no such engine or option, or a value that is not allowed.

    >>> engine = engine_named("trajectory", {"components": 8})
    >>> engine.name, engine.config.components, engine.config.states
    ('trajectory', 8, 5)
    """
    engine: Any = ENGINES.load(name)  # a dataclass with one field
    parsed = engine.Config.stored if stored else engine.Config.parsed
    try:
        return cast(Engine[Any], engine(parsed(configuration or {})))
    except InputError as error:
        raise InputError(f"engine {name!r}: {error}") from error


def create_engine(
    name: str | None = None, *, preset: str | None = None, units: str | None = None, settings: Sequence[str] = ()
) -> Engine[Any]:
    """Return an engine whose configuration is parsed from texts, as on the command line.

    name     : of the engine; None: that of the preset, otherwise ``trajectory``
    preset   : a named configuration: ``hofer2008``, ``xieliu2007``, ``minnis2000``, or a system as ``ph-vi-CHMM``;
               several, with blanks between, if they agree on every option
    units    : the unit set, for engines with an option ``units``
    settings : ``NAME=VALUE`` for any options; these override preset and units
    Raises InputError: no such engine, preset, unit set or option, or a value that is not allowed.
    """
    options: dict[str, Any] = {}
    if preset is not None:
        name, options = _preset(name, preset)
    name = name or DEFAULT
    engine: Any = ENGINES.load(name)
    try:
        if units is not None:
            options |= engine.Config.values_of([f"units={units}"])
        options |= engine.Config.values_of(settings)
        config = engine.Config.parsed(options)
        config.check_files()
        return cast(Engine[Any], engine(config))
    except InputError as error:
        raise InputError(f"engine {name!r}: {error}") from error


def find_visual(preset: str | None) -> str | None:
    """Return the kind of motion that a preset is trained on where none is asked for; None: the default of ``train``."""
    kinds = [ENGINES.load(engine).Config.preset_visual for engine in ENGINES.names]
    return next((kind[each] for kind in kinds for each in (preset or "").split() if each in kind), None)


def _preset(name: str | None, preset: str) -> tuple[str, dict[str, Any]]:
    """Return the engine and the options of presets. Raises InputError: no engine has one, or two differ."""
    engines = {known: engine for engine in ENGINES.names for known in ENGINES.load(engine).Config.presets}
    options: dict[str, Any] = {}
    for each in preset.split() or [preset]:
        if each not in engines:
            raise InputError(f"no preset {each!r}; there are: {', '.join(engines)}")
        name = name or engines[each]
        if name != engines[each]:
            raise InputError(f"{each} is a preset of {engines[each]!r}, not of {name!r}; leave out one of them")
        more = ENGINES.load(name).Config.presets[each]
        for key, value in options.items():
            if more.get(key, value) != value:
                raise InputError(f"presets {preset}: {key} is {value!r} and {more[key]!r}; give one of them")
        options |= more
    return name or DEFAULT, options
