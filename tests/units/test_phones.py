import unicodedata
from itertools import groupby

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.units import LIP_CLOSING, PHONES, SIMILAR_PHONES, VISEMES, find_similar_phone, is_silent
from lipmotion.units.ipa_phones import IPA_PHONES, VOWEL_CHART, is_mark, read_ipa, read_tokens
from lipmotion.units.phones import CLASSES

SPOKEN = tuple(phone for phone in PHONES if not is_silent(phone))
VOWELS = frozenset("aa ae ah ao aw ax axr ay eh er ey ih ix iy ow oy uh uw el em en".split())
UNSAID_IN_GRID = ("er", "hh", "ng", "oy", "sh", "uh", "zh")  # what a model of GRID's speaker s1 must borrow


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


TABLE_1 = (
    "sip sil sp; lr1 ao aa ah er oy aw hh; lr2 uw uh ow em; lr3 ae eh ey ay; lr4 ih iy ax axr ix; as l el r y; af s z; "
    "al t d n en; pa sh zh ch jh; bi p b m; de th dh; ld f v; ve ng k g w"
)
"""Xie & Liu 2007, Table 1, copied from the paper line by line."""


def test_the_visemes_are_those_of_the_paper() -> None:
    printed = {line.split()[0]: tuple(line.split()[1:]) for line in TABLE_1.split("; ")}
    assert printed == VISEMES
    assert len(VISEMES) == 13


LABELS = {
    "ˈyː": "uw", "œ": "ao", "ɲ": "n", "x": "k", "ʁ": "hh", "ɔ̃": "ao", "pf": "p f", "tʃ": "ch", "ɐ̃ʊ": "aa uh",
    "n̩": "en", "tʰ": "t", "β": "v", "eː": "ey", "e": "eh", "u˥": "uw", "(en)": "", "ʔ": "", "ss": "s s", "ˌɪ": "ih",
    "t͡ɕʰ": "ch", "kʷ": "k w", "ɯᵝ": "uh", "a˞": "aa r", "o̞": "ow", "<blank>": "", "<": "", "⁽": "",
}  # fmt: skip


def test_the_lips_decide() -> None:
    for label, phones in LABELS.items():
        assert read_ipa(label) == (tuple(phones.split()), "")
        assert read_ipa(unicodedata.normalize("NFC", label)) == read_ipa(label)


def test_a_vowel_keeps_its_rounding_and_its_height() -> None:
    rounded = {*CLASSES["rounded"]}
    assert all((vowel.phone in rounded) == vowel.rounded for vowel in VOWEL_CHART.values())
    by_height = sorted((vowel for vowel in VOWEL_CHART.values() if vowel.rounded), key=lambda vowel: vowel.height)
    phones = [{vowel.phone for vowel in row} for _, row in groupby(by_height, key=lambda vowel: vowel.height)]
    assert phones == [{"uw"}, {"uh"}, {"ow"}, {"ao"}, {"ao"}]  # wherever the tongue is


def test_only_what_closes_the_lips_closes_them() -> None:
    closing = {symbol for symbol, phones in IPA_PHONES.items() if set(phones) & set(LIP_CLOSING)}
    assert {symbol[0] for symbol in closing} == set("pbɓʙʘm不")
    lips = {read_ipa(letter)[0] for letter in "ɸβɱʋⱱ"}
    assert lips == {("f",), ("v",)}  # nearly closed, but open


def test_every_token_of_the_network_has_a_meaning() -> None:
    tokens = pytest.importorskip("hama.asr").ASRModel().decoder_tokens
    assert len(tokens) == 191
    for token in tokens:
        phones, unknown = read_ipa(token)
        assert not unknown, token
        silent = token[0] in "<ʔ" or all(map(is_mark, unicodedata.normalize("NFD", token)))
        assert silent != bool(phones), token


def test_tokens_that_are_one_sound_are_one() -> None:
    tokens = ["<blank>", "t", "͡", "ʃ", "ɔ", "ɪ", "<wb>", "k", "ʷ", "ɯ", "ᵝ", "n", "̩", "ː", "t", "<wb>", "ʃ"]
    phones, places = zip(*read_tokens(tokens), strict=True)
    assert (" ".join(phones), places) == ("ch oy k w uh en t sh", (1, 4, 7, 8, 9, 11, 14, 16))


@settings(max_examples=40)
@given(st.lists(st.sampled_from("aeəɪʊtʃdʒpbmɲʁøœ̃ːˈˌ̩ʰ˥()ꙮ? "), max_size=6).map("".join))
def test_any_label_becomes_phones(label: str) -> None:
    phones, unknown = read_ipa(label)
    assert set(phones) <= {*SPOKEN}
    assert len(phones) >= len(unknown)
