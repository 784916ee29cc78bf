from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.units import PAUSE, PHONES, SILENCE, SIMILAR_PHONES, VISEME_OF, is_silent, most_similar_phone

SPOKEN = tuple(phone for phone in PHONES if not is_silent(phone))
VOWELS = frozenset("aa ae ah ao aw ax axr ay eh er ey ih ix iy ow oy uh uw el em en".split())
CONSONANTS = frozenset(SPOKEN) - VOWELS
UNSAID_IN_GRID = ("er", "hh", "ng", "oy", "sh", "uh", "zh")
"""What a model of GRID's speaker s1 must borrow."""


def test_the_inventory() -> None:
    assert len(PHONES) == 47
    assert list(PHONES) == sorted(set(PHONES))
    assert [phone for phone in PHONES if is_silent(phone)] == [SILENCE, PAUSE] == ["sil", "sp"]


def test_relatives_are_other_phones() -> None:
    assert set(SIMILAR_PHONES) == set(PHONES)
    for phone, relatives in SIMILAR_PHONES.items():
        assert relatives
        assert set(relatives) <= set(PHONES) - {phone}
        assert len(set(relatives)) == len(relatives)


def test_silence_and_speech_are_no_relatives() -> None:
    for phone, relatives in SIMILAR_PHONES.items():
        assert {is_silent(relative) for relative in relatives} == {is_silent(phone)}


def test_a_known_phone_stands_for_itself() -> None:
    for phone in PHONES:
        assert most_similar_phone(phone, PHONES) == phone


def test_the_first_relative_that_is_known_stands_in() -> None:
    for phone in PHONES:
        for position, relative in enumerate(SIMILAR_PHONES[phone]):
            assert most_similar_phone(phone, set(PHONES) - {phone, *SIMILAR_PHONES[phone][:position]}) == relative


def steps_to(phone: str) -> dict[str, int]:
    """Return over how many relatives every other phone is reached."""
    steps = {phone: 0}
    while reached := {r for p in steps for r in SIMILAR_PHONES[p]} - set(steps):
        steps |= dict.fromkeys(reached, max(steps.values()) + 1)
    return steps


@settings(max_examples=100)
@given(st.sampled_from(SPOKEN), st.sets(st.sampled_from(SPOKEN), min_size=1, max_size=8))
def test_the_nearest_known_relative_stands_in(phone: str, known: set[str]) -> None:
    chosen, steps = most_similar_phone(phone, known), steps_to(phone)
    assert chosen in known
    assert chosen == most_similar_phone(phone, sorted(known, reverse=True))
    assert steps.get(chosen, 99) == min(steps.get(other, 99) for other in known)  # nobody nearer is passed over


@pytest.mark.parametrize("phone", UNSAID_IN_GRID)
def test_vowels_stand_in_for_vowels(phone: str) -> None:
    chosen = most_similar_phone(phone, [other for other in SPOKEN if other not in UNSAID_IN_GRID])
    assert (chosen in VOWELS) == (phone in VOWELS)


@pytest.mark.parametrize(("phone", "closest"), [("p", "b"), ("b", "p"), ("v", "f"), ("zh", "jh"), ("er", "axr")])
def test_what_looks_alike_stands_in(phone: str, closest: str) -> None:
    assert most_similar_phone(phone, [other for other in SPOKEN if other != phone]) == closest
    assert VISEME_OF[closest] == VISEME_OF[phone] or closest in SIMILAR_PHONES[phone]
