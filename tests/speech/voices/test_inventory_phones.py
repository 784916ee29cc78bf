from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion import errors, types
from lipmotion.speech.voices import inventory_phones as module
from lipmotion.speech.voices.inventory_phones import inventory_timeline, matches, with_words
from lipmotion.speech.voices.synthesiser import ARPABET_PHONES, ESPEAK_PHONES, complete_map
from lipmotion.units import PHONES, Lexicon
from oracles.edits import least_cost

LEXICON = Lexicon({"butter": (("b", "ah", "t", "axr"),), "is": (("ix", "z"),), "it": (("ih", "t"),)})
SOUNDS = [phone for phone in PHONES if phone not in ("sil", "sp")]


def timeline(*labels: tuple[str, float, float]) -> types.Timeline[str]:
    return types.Timeline(tuple(types.Span(start, end, label) for label, start, end in labels))


def cost_of(found: Sequence[str], wanted: Sequence[str]) -> float:
    matched = matches(found, wanted)
    pairs = [(f, wanted[m]) for f, m in zip(found, matched, strict=True) if m >= 0]
    gaps = len(found) + len(wanted) - 2 * len(pairs)
    return sum(module._cost(*pair) for pair in pairs) + module.GAP_COST * gaps


@settings(max_examples=40)
@given(st.lists(st.sampled_from(SOUNDS), max_size=5), st.lists(st.sampled_from(SOUNDS), max_size=5))
def test_matches_are_the_cheapest(found: list[str], wanted: list[str]) -> None:
    matched = [match for match in matches(found, wanted) if match >= 0]
    assert matched == sorted(set(matched))
    assert cost_of(found, wanted) == pytest.approx(least_cost(found, wanted, module._cost, module.GAP_COST))


def test_unstressed_vowels_are_reduced_and_words_known() -> None:
    said = "b ah dh t er ih z ih t".split()  # dh: nobody's
    wanted = {"butter": "b ah dh t axr", "is": "ix z", "it": "ih t"}
    units = [types.Unit(phone, word=word) for word, phones in wanted.items() for phone in phones.split()]
    assert with_words(said, [*wanted], LEXICON) == units


def test_a_word_that_is_said_again_is_known_as_such() -> None:
    for phones, words, again in (
        ("ih t ih z ix t", ["it", "is", "it"], [False] * 6),
        ("ih t ax t", ["it", "it"], [False, False, True, False]),
    ):
        assert [unit.again for unit in with_words(phones.split(), words, LEXICON)] == again


def test_pauses_are_named_by_place_and_length() -> None:
    said = timeline(
        ("pau", 0.0, 0.1), ("ih", 0.1, 0.2), ("pau", 0.2, 0.35), ("t", 0.35, 0.4), ("pau", 0.4, 0.65), ("ih", 0.65, 1.0)
    )
    units = inventory_timeline(said, ARPABET_PHONES, ["it"], LEXICON, 1.1)
    assert [span.label.phone for span in units] == ["sil", "ih", "sp", "t", "sil", "ih", "sil"]
    assert [span.start_s for span in units] == pytest.approx([0, 0.1, 0.2, 0.35, 0.4, 0.65, 1.0])
    assert units[-1].end_s == pytest.approx(1.1)


def test_what_is_not_covered_is_silent_and_what_is_too_late_is_cut() -> None:
    said = timeline(("ih", 0.1, 0.2), ("t", 0.3, 0.6), ("t", 0.7, 0.8))
    units = inventory_timeline(said, ARPABET_PHONES, ["it"], LEXICON, 0.5)
    found = [(span.label.phone, span.start_s, span.end_s) for span in units]
    assert found == [("sil", 0.0, 0.1), ("ih", 0.1, 0.2), ("sp", 0.2, 0.3), ("t", 0.3, 0.5)]


def test_several_phones_share_a_label_and_parts_join() -> None:
    said = timeline(("A@", 0.0, 0.2), (";", 0.2, 0.3), ("t", 0.3, 0.3), ("z", 0.3, 0.4))
    units = inventory_timeline(said, ESPEAK_PHONES, ["is"], LEXICON, 0.4)
    found = [(span.label.phone, span.start_s, span.end_s) for span in units]
    assert found == [("aa", 0.0, 0.1), ("r", 0.1, pytest.approx(0.3)), ("z", 0.3, 0.4)]


def test_it_says_what_is_wrong() -> None:
    for label, message in (("xx", "'xx', which is no phone"), ("pau", "no phone; give")):
        with pytest.raises(errors.InputError, match=message):
            inventory_timeline(timeline((label, 0.0, 0.1)), ARPABET_PHONES, ["it"], LEXICON, 0.2)


def test_tables_lead_to_the_inventory() -> None:
    for table in (ARPABET_PHONES, ESPEAK_PHONES):
        assert {phone for phones in table.values() for phone in phones} <= set(PHONES)
    spoken = {phone for phones in ESPEAK_PHONES.values() for phone in phones}
    assert set(PHONES) - spoken == {"sp"}


def test_unknown_letters_are_reported_once() -> None:
    found, unknown = complete_map(["ꙮ", "aꙮ", "_", ";", "_", "ꙮ"], {"_": ("sil",), ";": ()}, ipa=True)
    assert found == {"ꙮ": ("ax",), "aꙮ": ("aa", "ax"), "_": ("sil",), ";": ()}
    assert unknown == ("ꙮ",)
    found, unknown = complete_map(["t", "e", "_!"], {"t": ("t",)}, ipa=False)  # mnemonics, read as IPA
    assert found == {"t": ("t",), "e": ("eh",), "_!": ("sil",)}
    assert unknown == ("e",)
