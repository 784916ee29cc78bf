"""Configurations: frozen dataclasses that check their values, parsed from texts, headers of models and job files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from lipmotion.errors import InputError
from lipmotion.types.values import describe_value, is_path, parse_number, parse_whole

ConfigurationT = TypeVar("ConfigurationT", bound="Configuration")
LARGEST_NUMBER = 1e6  # largest absolute value of a number in a configuration
_WORDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
_WORDS |= {Path: "a path", tuple: "a list of texts"}
_BOOLEANS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


@dataclass(frozen=True)
class Rule:
    """A requirement on the value of an option, besides its type.

    least        : smallest value that is allowed
    above        : bound that the value must exceed
    odd          : only odd numbers are allowed
    power_of_two : only powers of two are allowed
    choices      : the texts that are allowed; empty: any text
    most, unit   : largest value that is allowed, where there is a least one, and the unit of both
    """

    least: float | None = None
    above: float | None = None
    odd: bool = False
    power_of_two: bool = False
    choices: tuple[str, ...] = ()
    most: float | None = None
    unit: str = ""

    @property
    def words(self) -> str:
        """The requirement in words, as the end of an error message."""
        if self.choices:
            return f"one of: {', '.join(self.choices)}"
        if self.most is not None:
            return f"{self.least:g} to {self.most:g}{self.unit}"
        kind = "an odd number" if self.odd else "a power of two" if self.power_of_two else ""
        bound = f" from {self.least:g}" if self.least is not None else ""
        return kind + (f" more than {self.above:g}" if self.above is not None else bound)

    def allows(self, value: Any) -> bool:
        """Return whether a value of the right type satisfies the rule."""
        if self.choices:
            return value in self.choices
        if (self.odd and value % 2 != 1) or (self.power_of_two and (value < 1 or value & (value - 1))):
            return False
        if self.most is not None and not value <= self.most:
            return False
        return (self.least is None or value >= self.least) and (self.above is None or value > self.above)


ANY = Rule()


def option(default: Any, rule: Rule = ANY, *, omit_default: bool = False, **shown: Any) -> Any:
    """Return a dataclass field with a default value and a rule for its values.

    omit_default : the option was added after models were published: a header leaves it out where it has its default
            value, so that earlier versions can read the model
    shown : ``kind``: the type of the values, where it is not that of the default: None, which then is allowed;
            ``what``: what messages call it; ``values``: the classes whose values are taken, too, by their names (so
            they need not be imported), and what messages say of them. What the command line shows, of options that
            are there (``cli.arguments.declared``): ``help``, ``metavar``, ``flags`` (the names, where they are not
            the field's), still (the option that lists what of several is switched off). Of files: reads (what
            it is), replaceable, default_path, writes, all as of cli.arguments.declared
    """
    return field(default=default, metadata={"rule": rule, "omit_default": omit_default, **shown})


@dataclass(frozen=True)
class Configuration:
    """Base class of configurations. A subclass is a frozen dataclass; every field is an option and has a default value.

    The type of an option is that of its default: bool, int, float, str, Path, tuple (of texts), or a configuration. The
    values are checked when the configuration is created; texts become paths and lists tuples where these are asked for.

    presets : combinations of options by name
    preset_visual : the kind of motion that a preset is trained on where none is asked for (``train``), by its name
    aliases : former names of options, mapped to the present names; both are accepted
    removed : options that no longer exist, mapped to the only value that is still accepted
    default_if_missing : options that headers of models leave out where they have this value, which is not the default
              any more
    hints   : names that users might try, mapped to a text that says what to use instead
    Raises InputError: a value has another type than its option, or its rule does not allow it.
    """

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    preset_visual: ClassVar[Mapping[str, str]] = {}
    aliases: ClassVar[Mapping[str, str]] = {}
    removed: ClassVar[Mapping[str, Any]] = {}
    default_if_missing: ClassVar[Mapping[str, Any]] = {}
    hints: ClassVar[Mapping[str, str]] = {}

    def __post_init__(self) -> None:
        for option_field in fields(self):
            value, kind = getattr(self, option_field.name), kind_of(option_field)
            if (kind is Path and isinstance(value, str)) or (kind is tuple and isinstance(value, list)):
                object.__setattr__(self, option_field.name, kind(value))
            check_value(option_field, getattr(self, option_field.name))

    def check_files(self) -> None:
        """Raise InputError if a file that the configuration names cannot be read; called before long work begins."""

    @classmethod
    def parsed(cls: type[ConfigurationT], values: Mapping[str, Any]) -> ConfigurationT:
        """Return a configuration with some options, by name. Raises InputError: unknown, or a value not allowed."""
        known = {option_field.name: kind_of(option_field) for option_field in fields(cls)}
        options: dict[str, Any] = {}
        for name, value in values.items():
            if name in cls.removed and name not in known:
                if value != cls.removed[name]:
                    stated = f"{name} is {value!r}; this option no longer exists"
                    raise InputError(f"{stated}, required {cls.removed[name]!r}")
                continue
            present = cls._find_present(name)
            if issubclass(known[present], Configuration) and isinstance(value, Mapping):
                try:
                    value = known[present].parsed(value)  # noqa: PLW2901
                except InputError as error:
                    raise InputError(f"in [{present}]: {error}") from error
            options[present] = value
        return cls(**options)

    @classmethod
    def values_of(cls, settings: Sequence[str]) -> dict[str, Any]:
        """Return the values of options in texts ``NAME=VALUE``. Raises InputError: no value, or of another type."""
        kinds = {option_field.name: kind_of(option_field) for option_field in fields(cls)}
        values: dict[str, Any] = {}
        for setting in settings:
            name, equals, text = setting.partition("=")
            if not equals:
                raise InputError(f"the setting {setting!r} has no value; required NAME=VALUE")
            present = cls._find_present(name)
            kind = kinds[present]
            if kind is int:
                values[present] = parse_whole(text, f"{present} is")
            elif kind is float:
                values[present] = parse_number(text, f"{present} is", "a number", finite=False)
            elif kind is bool and text.lower() not in _BOOLEANS:
                raise InputError(f"{present} is {describe_value(text)}, required {_WORDS[kind]}")
            else:
                values[present] = _BOOLEANS[text.lower()] if kind is bool else kind(text)
        return values

    @classmethod
    def _find_present(cls, name: str) -> str:
        """Return the present name of an option. Raises InputError: there is none of this name."""
        present, flag = cls.aliases.get(name, name), f"--{name.replace('_', '-')}"
        options = {each.name: each for each in fields(cls)}
        if present in options:
            return present
        flagged = next((other for other, each in options.items() if flag in each.metadata.get("flags", ())), None)
        called = f"here it is called {flagged!r}" if flagged else f"there are: {', '.join(options)}"
        raise InputError(f"no option {name!r}; {cls.hints.get(name, called)}")

    def as_mapping(self) -> dict[str, Any]:
        """Return the values of all options, by name, as the header of a model stores them."""
        omitted = {each.name: each.default for each in fields(self) if each.metadata.get("omit_default")}
        omitted |= self.default_if_missing
        return {name: value for name, value in asdict(self).items() if name not in omitted or value != omitted[name]}

    @classmethod
    def stored(cls: type[ConfigurationT], values: Mapping[str, Any]) -> ConfigurationT:
        """Return the configuration of which ``as_mapping`` returned some values. Raises as ``parsed``."""
        return cls.parsed({**cls.default_if_missing, **values})


_FITS: dict[type[Any], Callable[[Any], bool]] = {
    float: lambda value: type(value) is int or isinstance(value, float),
    tuple: lambda value: type(value) is tuple and all(isinstance(each, str) for each in value),
    Path: lambda value: isinstance(value, Path) and is_path(str(value)),
}
"""Which values options take of the types of which it is not every value of exactly that type."""


def check_value(option_field: Field[Any], value: Any) -> None:
    """Raise InputError unless a value has the type of an option and satisfies its rule."""
    kind, rule = kind_of(option_field), option_field.metadata.get("rule", ANY)
    values = option_field.metadata.get("values", {})
    if any(each.__name__ in values for each in type(value).__mro__) or (value is None and option_field.default is None):
        return
    if values and not isinstance(value, str | Path):
        required = " or ".join(words for words in values.values() if words)
        raise InputError(f"{option_field.name}: found a {type(value).__name__}, required {_WORDS[kind]}, or {required}")
    fits = _FITS.get(kind, lambda each: type(each) is kind)(value)
    in_range = not fits or kind not in (int, float) or -LARGEST_NUMBER <= value <= LARGEST_NUMBER
    if fits and rule.most is not None and not (in_range and rule.allows(value)):
        what = option_field.metadata.get("what", option_field.name)
        described = describe_value(value) if type(value) is int else f"{value:g}"
        raise InputError(f"the {what} is {described}{rule.unit}, required {rule.words}")
    if not in_range:
        raise InputError(f"{option_field.name} is {describe_value(value)}, required at most {LARGEST_NUMBER:g} in size")
    if not fits or not rule.allows(value):
        is_complete = rule.odd or rule.power_of_two or bool(rule.choices) or rule.most is not None
        words = _WORDS.get(kind, "a table of options")
        required = rule.words if is_complete and fits else words + ("" if is_complete else rule.words)
        described = describe_value(str(value) if isinstance(value, Path) else value)
        raise InputError(f"{option_field.name} is {described}, required {required}")


def kind_of(option_field: Field[Any]) -> type[Any]:
    """Return the type of an option: the one that it names, or else that of its default value."""
    kind: type[Any] = option_field.metadata.get("kind") or type(option_field.default)
    return kind
