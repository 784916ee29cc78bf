"""Labels of synthesisers become phones of the inventory."""

from __future__ import annotations

from lipmotion.speech.voices.synthesiser import complete_map


def test_unknown_letters_are_reported_once() -> None:
    found, unknown = complete_map(["ꙮ", "aꙮ", "_", ";", "_", "ꙮ"], {"_": ("sil",), ";": ()}, ipa=True)
    assert found == {"ꙮ": ("ax",), "aꙮ": ("aa", "ax"), "_": ("sil",), ";": ()}
    assert unknown == ("ꙮ",)


def test_unknown_mnemonics_are_read_as_ipa_and_reported() -> None:
    found, unknown = complete_map(["t", "e", "_!"], {"t": ("t",)}, ipa=False)
    assert found == {"t": ("t",), "e": ("eh",), "_!": ("sil",)}
    assert unknown == ("e",)
