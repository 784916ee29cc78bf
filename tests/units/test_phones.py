from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.units import PHONES, SIMILAR_PHONES, VISEMES, find_similar_phone, is_silent

SPOKEN = tuple(phone for phone in PHONES if not is_silent(phone))
VOWELS = frozenset("aa ae ah ao aw ax axr ay eh er ey ih ix iy ow oy uh uw el em en".split())
UNSAID_IN_GRID = ("er", "hh", "ng", "oy", "sh", "uh", "zh")
"""What a model of GRID's speaker s1 must borrow."""


def test_the_first_relative_that_is_known_stands_in() -> None:
    for phone in PHONES:
        for position, relative in enumerate(SIMILAR_PHONES[phone]):
            assert find_similar_phone(phone, set(PHONES) - {phone, *SIMILAR_PHONES[phone][:position]}) == relative


def steps_to(phone: str) -> dict[str, int]:
    """Return over how many relatives every other phone is reached."""
    steps = {phone: 0}
    while reached := {r for p in steps for r in SIMILAR_PHONES[p]} - set(steps):
        steps |= dict.fromkeys(reached, max(steps.values()) + 1)
    return steps


@settings(max_examples=40)
@given(st.sampled_from(SPOKEN), st.sets(st.sampled_from(SPOKEN), min_size=1, max_size=8))
def test_the_nearest_known_relative_stands_in(phone: str, known: set[str]) -> None:
    chosen, steps = find_similar_phone(phone, known), steps_to(phone)
    assert chosen in known
    assert chosen == find_similar_phone(phone, sorted(known, reverse=True))
    assert steps.get(chosen, 99) == min(steps.get(other, 99) for other in known)  # nobody nearer is passed over


def test_vowels_stand_in_for_vowels() -> None:
    for phone in UNSAID_IN_GRID:
        chosen = find_similar_phone(phone, [other for other in SPOKEN if other not in UNSAID_IN_GRID])
        assert (chosen in VOWELS) == (phone in VOWELS)


TABLE_1 = """
sip sil sp
lr1 ao aa ah er oy aw hh
lr2 uw uh ow em
lr3 ae eh ey ay
lr4 ih iy ax axr ix
as  l el r y
af  s z
al  t d n en
pa  sh zh ch jh
bi  p b m
de  th dh
ld  f v
ve  ng k g w
"""
"""Xie & Liu 2007, Table 1, copied from the paper line by line."""


def test_the_visemes_are_those_of_the_paper() -> None:
    printed = {line.split()[0]: tuple(line.split()[1:]) for line in TABLE_1.strip().splitlines()}
    assert printed == VISEMES
    assert len(VISEMES) == 13
