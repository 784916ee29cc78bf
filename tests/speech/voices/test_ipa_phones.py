"""Phones of other languages become those of the nearest mouth shape."""

from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.speech.voices.ipa_phones import IPA_PHONES, complete_map, ipa_phones
from lipmotion.units import LIP_CLOSING, PHONES

SPOKEN = set(PHONES) - {"sil", "sp"}


@pytest.mark.parametrize(
    ("label", "phones"),
    [
        ("ˈyː", "uw"), ("œ", "uh"), ("ˈøː", "uw"), ("ɲ", "n"), ("x", "k"), ("ʁ", "hh"), ("ɔ̃", "ao"), ("ɛ̃", "eh"),
        ("pf", "p f"), ("ts", "t s"), ("tʃ", "ch"), ("dʒ", "jh"), ("aɪ", "ay"), ("ˈaʊ", "aw"), ("ɐ̃ʊ", "ah uh"),
        ("rː", "r"), ("n̩", "en"), ("tʰ", "t"), ("ʎ", "l"), ("β", "v"), ("eː", "ey"), ("e", "eh"), ("u˥", "uw"),
        ("(en)", ""), ("ʔ", ""), ("ss", "s s"), ("õ", "ow"), ("ˌɪ", "ih"),
    ],
)  # fmt: skip
def test_the_lips_decide(label: str, phones: str) -> None:
    assert ipa_phones(label) == (tuple(phones.split()), "")
    assert ipa_phones(unicodedata.normalize("NFC", label)) == ipa_phones(label)


def test_only_what_closes_the_lips_closes_them() -> None:
    closing = {symbol for symbol, phones in IPA_PHONES.items() if set(phones) & set(LIP_CLOSING)}
    assert {symbol[0] for symbol in closing} == set("pbɓm")


def test_the_table_leads_to_the_inventory() -> None:
    assert {phone for phones in IPA_PHONES.values() for phone in phones} <= SPOKEN


@settings(max_examples=80)
@given(st.text(max_size=6))
def test_any_label_becomes_phones(label: str) -> None:
    phones, unknown = ipa_phones(label)
    assert set(phones) <= SPOKEN
    assert len(phones) >= len(unknown)


def test_unknown_letters_are_reported_once() -> None:
    found, unknown = complete_map(["ꙮ", "aꙮ", "_", ";", "_", "ꙮ"], {"_": ("sil",), ";": ()}, ipa=True)
    assert found == {"ꙮ": ("ax",), "aꙮ": ("aa", "ax"), "_": ("sil",), ";": ()}
    assert unknown == ("ꙮ",)


def test_unknown_mnemonics_are_read_as_ipa_and_reported() -> None:
    found, unknown = complete_map(["t", "e", "_!"], {"t": ("t",)}, ipa=False)
    assert found == {"t": ("t",), "e": ("eh",), "_!": ("sil",)}
    assert unknown == ("e",)
