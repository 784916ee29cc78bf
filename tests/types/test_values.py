import pytest

from lipmotion.errors import InputError
from lipmotion.types.values import (
    SchemaError,
    any_members,
    if_fits,
    items,
    members,
    number,
    one_of,
    optional,
    parse_number,
    parse_whole,
    path,
    text,
    truth,
    value_of,
    whole,
)

POINT = members({"at": items(number(-1, 1), 2, 2), "count": whole(0, 9), "kind": one_of(["a", 1])}, ["at"])
DEEP: list = []
for _ in range(5000):
    DEEP = [DEEP]


def test_what_fits_is_taken_out_in_its_type() -> None:
    found = POINT({"at": [1, 0.5], "count": 3, "kind": 1, "unknown": DEEP})
    assert found == {"at": [1.0, 0.5], "count": 3, "kind": 1}
    assert isinstance(found["at"][0], float)
    assert members({"a": if_fits(text(2)), "b": truth})({"a": "long", "b": True}) == {"b": True}
    assert items(if_fits(whole(0, 1)))([0, "x", 1]) == [0, 1]
    assert any_members(whole(0, 1))({"x": 1, "": 0}) == {"x": 1, "": 0}


def test_what_does_not_fit_is_named_with_its_place() -> None:
    wrong = {
        "at is missing, required a value": {},
        "at[1] is 2, required a number from -1 to 1": {"at": [0, 2]},
        "at[0] is true, required a number": {"at": [True, 0]},
        "at[0] is 1000": {"at": [10**400, 0]},
        "at is a list of 3, required a list of 2 items": {"at": [0, 0, 0]},
        "at is an object, required a list": {"at": {"0": 0}},
        "count is 1.0, required a whole number from 0 to 9": {"at": [0, 0], "count": 1.0},
        "count is null": {"at": [0, 0], "count": None},
        "count is a list": {"at": [0, 0], "count": DEEP},
        "kind is true, required one of a, 1": {"at": [0, 0], "kind": True},
        "kind is an object": {"at": [0, 0], "kind": {}},
        "the document is a list, required an object": [],
    }
    for message, value in wrong.items():
        with pytest.raises(SchemaError) as refused:
            POINT(value)
        assert str(refused.value).startswith(message)
        assert len(str(refused.value)) < 300
    with pytest.raises(SchemaError, match=r"^a\.b\[1\]\.at\[0\] is 5"):
        members({"a": any_members(items(POINT))})({"a": {"b": [{"at": [0, 0]}, {"at": [5, 0]}]}})


def test_numbers_in_texts_are_of_plain_digits() -> None:
    assert parse_number(" -1.5e3 ") == pytest.approx(-1500)
    assert parse_whole("+12") == 12
    for given in ("1_0", "٣", "nan", "1e999", "9" * 400, "0x1", "", "1,5"):
        with pytest.raises(InputError, match="required a number"):
            parse_number(given)
    for given in ("1_0", "٣", "9" * 5000, "1.0", ""):
        with pytest.raises(InputError, match="required a whole number"):
            parse_whole(given)


def test_texts_and_paths_that_no_file_holds() -> None:
    assert path("a/\udce9.wav") == "a/\udce9.wav"  # a name that is no UTF-8
    for wrong in ("a\0b", "\ud800", "x" * 5000, "a/" + "é" * 200, 7, None):
        with pytest.raises(SchemaError):
            path(wrong)
    for wrong in ("\ud800", "x" * 5000, 10**400, float("nan")):
        with pytest.raises(SchemaError):
            text(1000)(wrong)
    for wrong in (10**400, float("inf"), "1", True, None):
        with pytest.raises(SchemaError):
            number()(wrong)


def test_a_value_is_made_of_its_fields_alone() -> None:
    pair = value_of(complex, {"real": number(), "imag": optional(number())}, ["real"])
    assert pair({"real": 1, "imag": 2}) == complex(1, 2)
    for wrong in ({}, {"real": 1, "other": 2}, [1, 2]):
        with pytest.raises(SchemaError):
            pair(wrong)
