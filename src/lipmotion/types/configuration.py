"""Configurations: frozen dataclasses that check themselves, and that are parsed from texts and from model headers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import Field, asdict, dataclass, field, fields
from typing import Any, ClassVar, TypeVar

from lipmotion.errors import InputError, shortened

ConfigurationT = TypeVar("ConfigurationT", bound="Configuration")
LARGEST = 1e6
"""No number of a configuration is larger."""
_WORDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
_TRUTHS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


@dataclass(frozen=True)
class Rule:
    """What the value of an option must satisfy besides its type.

    least, above : the smallest value, or a bound that it must exceed
    odd, power_of_two : of whole numbers
    choices      : the texts that are allowed; empty: any
    """

    least: float | None = None
    above: float | None = None
    odd: bool = False
    power_of_two: bool = False
    choices: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """What is required, as the end of a message."""
        if self.choices:
            return f"one of: {', '.join(self.choices)}"
        kind = "an odd number" if self.odd else "a power of two" if self.power_of_two else ""
        bound = f" from {self.least:g}" if self.least is not None else ""
        return kind + (f" more than {self.above:g}" if self.above is not None else bound)

    def allows(self, value: Any) -> bool:
        """Return whether a value of the right type satisfies the rule."""
        if self.choices:
            return value in self.choices
        if (self.odd and value % 2 != 1) or (self.power_of_two and (value < 1 or value & (value - 1))):
            return False
        return (self.least is None or value >= self.least) and (self.above is None or value > self.above)


ANY = Rule()


def option(default: Any, rule: Rule) -> Any:
    """Return a dataclass field with a default and a rule that its values must satisfy."""
    return field(default=default, metadata={"rule": rule})


@dataclass(frozen=True)
class Configuration:
    """Base of all configurations: subclasses are frozen dataclasses whose fields have a default each.

    The type of an option is that of its default: bool, int, float or str. Every value is checked when the configuration
    is made.

    presets : named combinations of options
    former  : names that options had before, to their present ones; both are understood
    gone    : options that no longer exist, and the only value of theirs that is still accepted
    hints   : names that users might expect, and what to use instead
    Raises InputError: a value of another type, or one that its rule does not allow.
    """

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    former: ClassVar[Mapping[str, str]] = {}
    gone: ClassVar[Mapping[str, Any]] = {}
    hints: ClassVar[Mapping[str, str]] = {}

    def __post_init__(self) -> None:
        for one in fields(self):
            check_value(one, getattr(self, one.name))

    def check_files(self) -> None:
        """Raise InputError unless all files that the configuration names can be read: before long work begins."""

    @classmethod
    def parsed(cls: type[ConfigurationT], values: Mapping[str, Any]) -> ConfigurationT:
        """Return the configuration with some options by name, as a model's header or a program gives them.

        Raises InputError: unknown option, or a value that is not allowed.
        """
        known = {one.name for one in fields(cls)}
        present: dict[str, Any] = {}
        for name, value in values.items():
            if name in cls.gone and name not in known:
                if value != cls.gone[name]:
                    raise InputError(f"{name} is {value!r}; this option is gone, required {cls.gone[name]!r}")
                continue
            now = cls.former.get(name, name)
            if now not in known:
                raise InputError(cls._unknown(name))
            present[now] = value
        return cls(**present)

    @classmethod
    def values_of(cls, settings: Sequence[str]) -> dict[str, Any]:
        """Return options by name from texts ``NAME=VALUE``, each parsed as its type.

        Raises InputError: no value, unknown option, or a text that is not of the option's type.
        """
        options = {one.name: one for one in fields(cls)}
        found = {}
        for setting in settings:
            name, equals, text = setting.partition("=")
            if not equals:
                raise InputError(f"the setting {setting!r} has no value; required NAME=VALUE")
            now = cls.former.get(name, name)
            if now not in options:
                raise InputError(cls._unknown(name))
            found[now] = _from_text(options[now], text)
        return found

    @classmethod
    def _unknown(cls, name: str) -> str:
        if name in cls.hints:
            return f"no option {name!r}; {cls.hints[name]}"
        return f"no option {name!r}; there are: {', '.join(one.name for one in fields(cls))}"

    def as_mapping(self) -> dict[str, Any]:
        """Return all options by name, as a model's header holds them."""
        return asdict(self)


def check_value(one: Field[Any], value: Any) -> None:
    """Raise InputError unless an option may have a value."""
    kind, rule = _kind(one), one.metadata.get("rule", ANY)
    fits = type(value) is kind or (kind is float and type(value) is int)
    if fits and kind in (int, float) and not -LARGEST <= value <= LARGEST:
        raise InputError(f"{one.name} is {value}, required at most {LARGEST:g} in size")
    if not fits or not rule.allows(value):
        named = rule.odd or rule.power_of_two or bool(rule.choices)
        required = rule.words if named and fits else _WORDS[kind] + ("" if named else rule.words)
        raise InputError(f"{one.name} is {shortened(repr(value))}, required {required}")


def _from_text(one: Field[Any], text: str) -> Any:
    kind = _kind(one)
    try:
        return _TRUTHS[text.lower()] if kind is bool else kind(text)
    except (ValueError, KeyError) as error:
        raise InputError(f"{one.name} is {text!r}, required {_WORDS[kind]}") from error


def _kind(one: Field[Any]) -> type[Any]:
    """Return the type of an option: that of its default."""
    kind: type[Any] = type(one.default)
    return kind
