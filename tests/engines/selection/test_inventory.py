from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engines.selection.drawn_units import recorded, timeline
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.inventory import digits, standing_in
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.windows import INVISIBLE_SYMBOL, PHONE_NUMBER, SILENT, covering, phone_windows
from lipmotion.errors import InputError
from lipmotion.testing.examples import PHONES as SPOKEN
from lipmotion.testing.examples import examples
from lipmotion.types import Span, Timeline, Unit, silent_monitor


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


@settings(max_examples=20)
@given(st.lists(st.sampled_from(SPOKEN), min_size=5, max_size=5), st.integers(1, 12), st.integers(0, 2))
def test_the_index_finds_the_longest_agreement(
    model: SelectionModel, engine, window: list[str], count: int, bias: int
) -> None:
    costs = model.costs(engine.config)
    target = phone_windows([spoken(" ".join(window))]).contexts(engine.config.invisible_phones, 2)[2]
    order = digits(bias, 5)
    agree = costs.index.contexts[:, order] == target[order]
    lengths = np.where(model.inventory.usable, np.cumprod(agree, axis=1).sum(axis=1), 0)
    longest = np.sort(lengths)[::-1]
    needed = longest[min(count, len(longest)) - 1]
    found = costs.index.candidates(target, count)
    assert (lengths[found] > 0).all()
    better = np.flatnonzero(lengths > max(needed, 0)) if needed else np.flatnonzero(lengths > 0)
    assert np.isin(better, found).all()


def test_excluded_units_are_not_found(model: SelectionModel, engine) -> None:
    index = model.costs(engine.config).index
    target = phone_windows([spoken("sil b aa t iy")]).contexts(engine.config.invisible_phones, 2)[2]
    found = index.candidates(target, 5)
    excluded = np.zeros(len(model.inventory.windows), bool)
    excluded[found] = True
    assert not np.isin(index.candidates(target, 5, excluded), found).any()


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
