"""Words that are in no dictionary are read by a network, where it is installed, else by rules."""

from __future__ import annotations

import pytest

from lipmotion.errors import InputError
from lipmotion.units import Lexicon
from lipmotion.units import lexicon as spelling_network
from lipmotion.units.lexicon import pronounce_by_network


def test_a_made_up_word_is_read_as_people_read_it() -> None:
    pytest.importorskip("hama.inference")
    assert Lexicon().pronunciations("lipmotion") == (tuple("l ih p m ow sh ax n".split()),)
    assert Lexicon().pronunciations("lípmotion") == Lexicon().pronunciations("lipmotion")
    assert pronounce_by_network("abc" * 20) == ()
    with pytest.raises(InputError, match="cannot guess"):
        Lexicon().pronunciations("лип")


def test_without_the_network_rules_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spelling_network, "find_spec", lambda _: None)
    spelling_network._network.cache_clear()
    pronounce_by_network.cache_clear()
    try:
        assert Lexicon().pronunciations("lipmotion") == (tuple("l ih p m aa sh ax n".split()),)
    finally:
        spelling_network._network.cache_clear()
        pronounce_by_network.cache_clear()
