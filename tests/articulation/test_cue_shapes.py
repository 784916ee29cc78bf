from __future__ import annotations

import pytest

from lipmotion.articulation.cue_sheets import ANY_OPEN, ANY_SHAPE, PHONE_SHAPES, shapes_of_phone
from lipmotion.units import LIP_CLOSING, PHONES, VISEMES, is_silent
from lipmotion.units.visemes import OPTIONAL, SHAPES, choose_drawn_shape

BLAIR = "AI E O U FV L MBP WQ etc rest".split()
"""The names that OpenToonz knows."""


def test_every_phone_but_h_has_shapes() -> None:
    assert set(PHONES) - set(PHONE_SHAPES) == {"hh"}
    assert set(PHONE_SHAPES) <= set(PHONES)
    assert shapes_of_phone("hh") == shapes_of_phone("a phone of another language") == ANY_OPEN
    assert shapes_of_phone("") == ANY_SHAPE


def test_the_parts_of_a_phone_are_the_whole() -> None:
    for phone in PHONES:
        assert sum(look.share for look in shapes_of_phone(phone)) == pytest.approx(1)
        for look in shapes_of_phone(phone):
            assert look.best
            assert set(look.best + look.allowed) <= set(SHAPES)
            assert not set(look.best) & set(look.allowed)


def shown(name: str) -> set[str]:
    return {phone for phone in PHONES if any(name in look.best for look in shapes_of_phone(phone))}


def test_the_special_shapes_belong_to_their_sounds() -> None:
    assert shown("A") == set(LIP_CLOSING)
    assert shown("G") == set(VISEMES["ld"])
    assert shown("H") == {"l", "el"}
    assert shown("X") == {phone for phone in PHONES if is_silent(phone)}


def test_optional_shapes_fall_back_as_rhubarb_does() -> None:
    assert OPTIONAL == "GHX"
    assert [choose_drawn_shape(name, "ABCDEF") for name in "ABCDEFGHX"] == list("ABCDEFACA")
    assert [choose_drawn_shape(name, "ABCDEFX") for name in "GHX"] == ["A", "C", "X"]
