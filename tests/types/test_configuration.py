from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import pytest

from lipmotion.errors import InputError
from lipmotion.types import Configuration, Rule, option


@dataclass(frozen=True)
class Example(Configuration):
    count: int = option(3, Rule(least=1))
    odd: int = option(5, Rule(least=1, odd=True))
    mixtures: int = option(4, Rule(power_of_two=True))
    weight: float = option(0.5, Rule(above=0))
    kind: str = option("soft", Rule(choices=("soft", "hard")))
    on: bool = True
    free: str = "anything"

    aliases: ClassVar[Mapping[str, str]] = {"how_many": "count"}
    removed: ClassVar[Mapping[str, Any]] = {"steps": 0}
    hints: ClassVar[Mapping[str, str]] = {"amount": "say count"}


def test_a_value_that_is_not_allowed() -> None:
    for values, words in (
        ({"count": 0}, "count is 0, required a whole number from 1"),
        ({"count": 1.0}, "count is 1.0, required a whole number from 1"),
        ({"count": True}, "count is true, required a whole number from 1"),
        ({"count": 10**9}, "count is 1000000000, required at most 1e+06 in size"),
        ({"odd": 4}, "odd is 4, required an odd number from 1"),
        ({"odd": "many"}, "odd is 'many', required a whole number"),
        ({"mixtures": 3}, "mixtures is 3, required a power of two"),
        ({"mixtures": 0}, "mixtures is 0, required a power of two"),
        ({"weight": 0.0}, "weight is 0.0, required a number more than 0"),
        ({"weight": float("nan")}, "weight is nan"),
        ({"weight": float("inf")}, "weight is inf, required at most 1e+06 in size"),
        ({"weight": "0.5"}, "weight is '0.5', required a number more than 0"),
        ({"kind": "medium"}, "kind is 'medium', required one of: soft, hard"),
        ({"kind": 1}, "kind is 1, required text"),
        ({"on": 1}, "on is 1, required true or false"),
        ({"free": None}, "free is null, required text"),
        ({"no": 1}, "no option 'no'; there are: count, odd, mixtures, weight, kind, on, free"),
        ({"amount": 1}, "no option 'amount'; say count"),
        ({"steps": 3}, "steps is 3; this option no longer exists, required 0"),
    ):
        with pytest.raises(InputError) as error:
            Example.parsed(values)
        assert words in str(error.value)


def test_options_come_back() -> None:
    one = Example.parsed({"how_many": 7, "weight": 2, "steps": 0})
    assert (one.count, one.weight) == (7, 2)
    assert Example.parsed(one.as_mapping()) == one
    assert Example.parsed({}) == Example()


def test_texts_are_parsed_as_their_types() -> None:
    for settings, values in (
        (["count=4", "weight=2", "kind=hard"], {"count": 4, "weight": 2.0, "kind": "hard"}),
        (["on=no"], {"on": False}), (["on=TRUE"], {"on": True}), (["free=a=b"], {"free": "a=b"}),
        (["how_many=2"], {"count": 2}), ([], {}),
    ):  # fmt: skip
        assert Example.values_of(settings) == values


def test_texts_that_cannot_be_parsed() -> None:
    for setting, words in (
        ("count", "the setting 'count' has no value; required NAME=VALUE"),
        ("count=four", "count is 'four', required a whole number"),
        ("on=perhaps", "on is 'perhaps', required true or false"),
        ("weight=much", "weight is 'much', required a number"),
        ("no=1", "no option 'no'; there are: count"),
    ):
        with pytest.raises(InputError, match=words):
            Example.values_of([setting])
