from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from engines.selection.drawn_units import recorded, timeline
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.inventory import standing_in, unit_index
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.windows import INVISIBLE_SYMBOL, PHONE_NUMBER, SILENT, covering, phone_windows
from lipmotion.errors import InputError
from lipmotion.testing.examples import PHONES as SPOKEN
from lipmotion.testing.examples import examples
from lipmotion.types import Span, Timeline, Unit, silent_monitor
from oracles.biases import longest, matches


def test_motion_that_is_not_stored_is_a_line_between_its_edges() -> None:
    units = recorded(timeline("s aa"), timeline("iy s"))
    assert len(units.values) == 82
    motion = np.arange(20.0)[:, None]
    cut = replace(units, kept=np.array([[5, 15], [31, 36], [60, 65]]), motion=motion)
    assert cut.values[:6, 0] == pytest.approx([0] * 6)
    assert cut.values[14:32, 0] == pytest.approx(np.linspace(9, 10, 18))
    assert cut.values[35:41, 0] == pytest.approx([14] * 6)
    assert cut.values[41:60, 0] == pytest.approx([15] * 19)
    assert cut.values[64:, 0] == pytest.approx([19] * 18)


def spoken(text: str, word: str = "") -> Timeline[Unit]:
    phones = text.split()
    return Timeline(tuple(Span(n / 10, (n + 1) / 10, Unit(phone, word=word)) for n, phone in enumerate(phones)))


def test_a_window_has_the_phones_around_and_silence_beyond_a_recording() -> None:
    windows = phone_windows([spoken("b aa t"), spoken("iy")])
    numbers = [[PHONE_NUMBER[p] for p in window] for window in ("sil sil b aa t".split(), "sil sil iy sil sil".split())]
    assert windows.contexts((), 2)[[0, 3]].tolist() == numbers
    assert windows.continues.tolist() == [True, True, False, False]


def test_words_begin_and_end_where_the_word_changes_and_suppressed_phones_are_one_symbol() -> None:
    one, two = spoken("b iy", "be"), spoken("g aa", "go")
    both = Timeline((*one.spans, *two.shifted(0.2).spans))
    assert phone_windows([both]).words.tolist() == [[True, False], [False, True], [True, False], [False, True]]
    symbols = phone_windows([spoken("t d k sp")]).symbols({"t", "d"})
    assert symbols.tolist() == [INVISIBLE_SYMBOL, INVISIBLE_SYMBOL, PHONE_NUMBER["k"], SILENT]
    with pytest.raises(InputError, match="unknown phone 'xx' at 0"):
        phone_windows([spoken("xx")])


def test_gaps_are_silence() -> None:
    filled = covering(Timeline((Span(0.2, 0.3, Unit("b")), Span(0.5, 0.6, Unit("aa")))), 1.0)
    edges_s, phones = [0.0, 0.2, 0.3, 0.5, 0.6, 1.0], "sil b sil aa sil".split()
    found = [(span.start_s, span.end_s, span.label.phone) for span in filled]
    assert found == list(zip(edges_s, edges_s[1:], phones, strict=False))


AROUND = (("s", "f"), ("iy", "uw"), ("aa",), ("m", "n"), ("uw", "s"))
"""A phone in every context in which each of four neighbours is the wanted one, the first of a pair, or another."""


def test_each_bias_finds_the_longest_agreement_on_its_own_side_first() -> None:
    """§3: "with reference to their left context match, their right context match and the complete (no bias) match"."""
    contexts = list(product(*AROUND)) * 2
    without = [context for context in contexts if context[1] != "iy" or context[3] != "m"]  # no match on both sides
    for kept in (contexts, contexts[1:16], contexts[3:16], contexts[9:16], without):
        units = recorded(*(spoken(" ".join(context)) for context in kept))
        index, wanted = unit_index(units, (), 5), phone_windows([spoken("s iy aa m uw")]).contexts((), 2)[2]
        windows = index.contexts.tolist()
        for count in range(1, 12):
            found, (must, may) = set(index.candidates(wanted, count).tolist()), longest(wanted, windows, count)
            assert must <= found <= may, (len(kept), count)
        every = set(index.candidates(wanted, 0).tolist())
        assert every == matches(wanted.tolist(), windows)
        assert len(every) > 1


def test_where_matches_are_excluded_the_next_shorter_ones_enter() -> None:
    units = recorded(*(spoken(text) for text in ("s iy aa m uw", "f iy aa n s", "f uw aa m s", "f uw aa n s")))
    index, wanted = unit_index(units, (), 5), phone_windows([spoken("s iy aa m uw")]).contexts((), 2)[2]
    excluded = np.zeros(len(units.windows), bool)
    for left_out, entering in ((17, [2]), (2, [7, 12]), (7, [12]), (12, [])):
        excluded[left_out] = True
        assert index.candidates(wanted, 0, excluded).tolist() == entering
    excluded[17] = False
    assert index.candidates(wanted, 0, excluded).tolist() == [17]


def test_a_phone_without_units_has_a_similar_one_in_its_place(model: SelectionModel) -> None:
    stand_ins = standing_in(model.inventory.windows, model.inventory.usable)
    assert stand_ins["ao"] == "aa"
    assert not set(SPOKEN) & set(stand_ins)


def test_what_was_not_measured_is_no_unit(model: SelectionModel, engine) -> None:
    blind = examples(3)[0]
    valid = blind.valid.copy()
    span = blind.speech.units[2]
    valid[int(span.start_s * 100) + 2] = False
    plain = SelectionEngine(replace(engine.config, guide=0.0))
    inventory = plain.fit([replace(blind, valid=valid), *examples(3)[1:]], silent_monitor).model.inventory
    assert model.inventory.usable[2]
    assert not inventory.usable[2]
    assert inventory.usable[4]
