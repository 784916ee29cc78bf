"""Configurations: frozen dataclasses that check their values, parsed from texts and from headers of models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import Field, asdict, dataclass, field, fields
from typing import Any, ClassVar, TypeVar

from lipmotion.errors import InputError, shortened

ConfigurationT = TypeVar("ConfigurationT", bound="Configuration")
LARGEST = 1e6
"""Largest absolute value of a number in a configuration."""
_WORDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
_BOOLEANS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


@dataclass(frozen=True)
class Rule:
    """A requirement on the value of an option, besides its type.

    least        : smallest value that is allowed
    above        : bound that the value must exceed
    odd          : only odd numbers are allowed
    power_of_two : only powers of two are allowed
    choices      : the texts that are allowed; empty: any text
    """

    least: float | None = None
    above: float | None = None
    odd: bool = False
    power_of_two: bool = False
    choices: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """The requirement in words, as the end of an error message."""
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
    """Return a dataclass field with a default value and a rule for its values."""
    return field(default=default, metadata={"rule": rule})


@dataclass(frozen=True)
class Configuration:
    """Base class of configurations. A subclass is a frozen dataclass; every field is an option and has a default value.

    The type of an option is that of its default: bool, int, float or str. The values are checked when the configuration
    is created.

    presets : combinations of options by name
    former  : former names of options, mapped to the present names; both are accepted
    gone    : options that no longer exist, mapped to the only value that is still accepted
    hints   : names that users might try, mapped to a text that says what to use instead
    Raises InputError: a value has another type than its option, or its rule does not allow it.
    """

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    former: ClassVar[Mapping[str, str]] = {}
    gone: ClassVar[Mapping[str, Any]] = {}
    hints: ClassVar[Mapping[str, str]] = {}

    def __post_init__(self) -> None:
        for option_field in fields(self):
            check_value(option_field, getattr(self, option_field.name))

    def check_files(self) -> None:
        """Raise InputError if a file that the configuration names cannot be read; called before long work begins."""

    @classmethod
    def parsed(cls: type[ConfigurationT], values: Mapping[str, Any]) -> ConfigurationT:
        """Return a configuration with some options, by name; all others have their default values.

        Raises InputError: unknown option, or a value that is not allowed.
        """
        known = {option_field.name for option_field in fields(cls)}
        options: dict[str, Any] = {}
        for name, value in values.items():
            if name in cls.gone and name not in known:
                if value != cls.gone[name]:
                    raise InputError(f"{name} is {value!r}; this option no longer exists, required {cls.gone[name]!r}")
                continue
            present = cls.former.get(name, name)
            if present not in known:
                raise InputError(cls._unknown(name))
            options[present] = value
        return cls(**options)

    @classmethod
    def values_of(cls, settings: Sequence[str]) -> dict[str, Any]:
        """Return the values of options, by name, that are parsed from texts ``NAME=VALUE``.

        Raises InputError: a text without value, an unknown option, or a value that is not of the option's type.
        """
        options = {option_field.name: option_field for option_field in fields(cls)}
        values = {}
        for setting in settings:
            name, equals, text = setting.partition("=")
            if not equals:
                raise InputError(f"the setting {setting!r} has no value; required NAME=VALUE")
            present = cls.former.get(name, name)
            if present not in options:
                raise InputError(cls._unknown(name))
            values[present] = _from_text(options[present], text)
        return values

    @classmethod
    def _unknown(cls, name: str) -> str:
        """Return the message that there is no option of this name."""
        if name in cls.hints:
            return f"no option {name!r}; {cls.hints[name]}"
        return f"no option {name!r}; there are: {', '.join(option_field.name for option_field in fields(cls))}"

    def as_mapping(self) -> dict[str, Any]:
        """Return the values of all options, by name, as the header of a model stores them."""
        return asdict(self)


def check_value(option_field: Field[Any], value: Any) -> None:
    """Raise InputError unless a value has the type of an option and satisfies its rule."""
    kind, rule = _kind(option_field), option_field.metadata.get("rule", ANY)
    fits = type(value) is kind or (kind is float and type(value) is int)
    if fits and kind in (int, float) and not -LARGEST <= value <= LARGEST:
        raise InputError(f"{option_field.name} is {value}, required at most {LARGEST:g} in size")
    if not fits or not rule.allows(value):
        is_complete = rule.odd or rule.power_of_two or bool(rule.choices)
        required = rule.words if is_complete and fits else _WORDS[kind] + ("" if is_complete else rule.words)
        raise InputError(f"{option_field.name} is {shortened(repr(value))}, required {required}")


def _from_text(option_field: Field[Any], text: str) -> Any:
    """Return the value of an option that a text holds. Raises InputError: a text of another type."""
    kind = _kind(option_field)
    try:
        return _BOOLEANS[text.lower()] if kind is bool else kind(text)
    except (ValueError, KeyError) as error:
        raise InputError(f"{option_field.name} is {text!r}, required {_WORDS[kind]}") from error


def _kind(option_field: Field[Any]) -> type[Any]:
    """Return the type of an option: that of its default value."""
    return type(option_field.default)
