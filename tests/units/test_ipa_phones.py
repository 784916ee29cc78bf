import unicodedata
from itertools import groupby

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.units import LIP_CLOSING, PHONES
from lipmotion.units.ipa_phones import IPA_PHONES, VOWEL_CHART, is_mark, read_ipa, read_tokens
from lipmotion.units.phones import CLASSES

SPOKEN = set(PHONES) - {"sil", "sp"}


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
@given(st.text(st.sampled_from("aeəɪʊtʃdʒpbmɲʁøœ̃ːˈˌ̩ʰ˥()ꙮ? "), max_size=6))
def test_any_label_becomes_phones(label: str) -> None:
    phones, unknown = read_ipa(label)
    assert set(phones) <= SPOKEN
    assert len(phones) >= len(unknown)
