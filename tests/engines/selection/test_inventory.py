"""Suppressed phones: "the following vowel gives the shape of the mouth" (Minnis & Breen 2000, §3)."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from engines.selection.drawn_units import costs_of, inventory, recorded, timeline
from lipmotion import engines, types
from lipmotion.engines.selection.concatenation import join_pieces, to_pieces
from lipmotion.engines.selection.costs import select
from lipmotion.engines.selection.inventory import (
    INVISIBLE_SYMBOL,
    PHONE_NUMBER,
    SILENT,
    TABLE_1,
    RecordedUnits,
    index_units,
    list_windows,
)
from lipmotion.engines.selection.selection_training import build_target
from lipmotion.errors import InputError
from lipmotion.testing import PHONES as SPOKEN
from lipmotion.testing import examples, speech
from lipmotion.testing import timeline as spoken
from lipmotion.types import Span, Timeline, Unit, silent_monitor
from lipmotion.units import PHONES
from oracles.biases import longest, matches


def phones_of(text: str, word: str = "") -> Timeline[Unit]:
    phones = text.split()
    return Timeline(tuple(Span(n / 10, (n + 1) / 10, Unit(phone, word=word)) for n, phone in enumerate(phones)))


def test_a_window_has_the_phones_around_and_silence_beyond_a_recording() -> None:
    windows = list_windows([phones_of("b aa t"), phones_of("iy")])
    numbers = [[PHONE_NUMBER[p] for p in window] for window in ("sil sil b aa t".split(), "sil sil iy sil sil".split())]
    assert windows.contexts((), 2)[[0, 3]].tolist() == numbers
    assert windows.continues.tolist() == [True, True, False, False]


def test_words_begin_and_end_where_the_word_changes_and_suppressed_phones_are_one_symbol() -> None:
    one, two = phones_of("b iy", "be"), phones_of("g aa", "go")
    both = Timeline((*one.spans, *two.shifted(0.2).spans))
    assert list_windows([both]).words.tolist() == [[True, False], [False, True], [True, False], [False, True]]
    symbols = list_windows([phones_of("t d k sp")]).contexts({"t", "d"}, 0)[:, 0]
    assert symbols.tolist() == [INVISIBLE_SYMBOL, INVISIBLE_SYMBOL, PHONE_NUMBER["k"], SILENT]
    with pytest.raises(InputError, match="unknown phone 'xx' at 0"):
        list_windows([phones_of("xx")])


AROUND = (("s", "f"), ("iy", "uw"), ("aa",), ("m", "n"), ("uw", "s"))
"""A phone in every context in which each of four neighbours is the wanted one, the first of a pair, or another."""


def test_each_bias_finds_the_longest_agreement_on_its_own_side_first() -> None:
    """§3: "with reference to their left context match, their right context match and the complete (no bias) match"."""
    contexts = list(product(*AROUND)) * 2
    without = [context for context in contexts if context[1] != "iy" or context[3] != "m"]  # no match on both sides
    for kept in (contexts, contexts[1:16], contexts[3:16], contexts[9:16], without):
        units = recorded(*(phones_of(" ".join(context)) for context in kept))
        index, wanted = index_units(units, (), 5), list_windows([phones_of("s iy aa m uw")]).contexts((), 2)[2]
        windows = index.contexts.tolist()
        for count in range(1, 12):
            found, (must, may) = set(index.candidates(wanted, count).tolist()), longest(wanted, windows, count)
            assert must <= found <= may, (len(kept), count)
        every = set(index.candidates(wanted, 0).tolist())
        assert every == matches(wanted.tolist(), windows)
        assert len(every) > 1


def test_where_matches_are_excluded_the_next_shorter_ones_enter() -> None:
    units = recorded(*(phones_of(text) for text in ("s iy aa m uw", "f iy aa n s", "f uw aa m s", "f uw aa n s")))
    index, wanted = index_units(units, (), 5), list_windows([phones_of("s iy aa m uw")]).contexts((), 2)[2]
    excluded = np.zeros(len(units.windows), bool)
    for left_out, entering in ((17, [2]), (2, [7, 12]), (7, [12]), (12, [])):
        excluded[left_out] = True
        assert index.candidates(wanted, 0, excluded).tolist() == entering
    excluded[17] = False
    assert index.candidates(wanted, 0, excluded).tolist() == [17]


def test_a_phone_without_units_has_a_similar_one_in_its_place(model, engine) -> None:
    stand_ins = model.costs(engine.config).stand_ins
    assert stand_ins["ao"] == "aa"
    assert not set(SPOKEN) & set(stand_ins)


def test_what_was_not_measured_is_no_unit(model, engine) -> None:
    blind = examples(3)[0]
    valid = blind.valid.copy()
    span = blind.speech.units[2]
    valid[int(span.start_s * 100) + 2] = False
    plain = replace(engine, config=replace(engine.config, guide=0.0))
    inventory = plain.fit([replace(blind, valid=valid), *examples(3)[1:]], silent_monitor).model.inventory
    assert model.inventory.usable[2]
    assert not inventory.usable[2]
    assert inventory.usable[4]


PRESET = engines.create_engine(preset="minnis2000")
PRINTED = PRESET.config
INVISIBLE = ("t", "d", "g", "k")


def times_of(text: str) -> dict[str, tuple[float, float]]:
    """Return start and end of each phone that is left, by its name, in phones of a second."""
    windows = list_windows([timeline(text, 1.0)]).suppressed(INVISIBLE)
    names = [PHONES[phone] for phone in windows.phones]
    return dict(zip(names, map(tuple, windows.times_s.tolist()), strict=True))


def test_the_vowel_that_follows_takes_the_time() -> None:
    assert times_of("sil t uw | m d") == {"sil": (0, 1), "uw": (1, 3), "m": (3, 5)}
    assert times_of("aa k t iy") == {"aa": (0, 1), "iy": (1, 4)}
    assert times_of("aa k t s iy") == {"aa": (0, 3), "s": (3, 4), "iy": (4, 5)}
    assert times_of("t s iy") == {"s": (0, 2), "iy": (2, 3)}
    assert times_of("aa t sil") == {"aa": (0, 2), "sil": (2, 3)}
    assert times_of("t aa") == {"aa": (0, 2)}
    assert times_of("t") == {"t": (0, 1)}


def test_a_word_whose_edge_is_suppressed_keeps_it() -> None:
    windows, kept = list_windows([timeline("iy t | d uw | k ae t s")]).without(INVISIBLE)
    assert kept.tolist() == [0, 3, 5, 7]
    assert windows.words.tolist() == [[True, True], [True, True], [True, False], [False, True]]
    assert windows.hidden.tolist() == [False, True, True, True]


def joined(units: RecordedUnits, text: str, config=PRINTED):
    costs = costs_of(units.without(config.suppressed_phones), config)
    target = costs.target(costs.suppress(list_windows([timeline(text)])), None, None)
    pieces = to_pieces(costs, target, select(costs, target)[0])
    return target, join_pieces(costs.inventory, target, pieces, round(timeline(text)[-1].end_s * 100) + 1)[:, 0]


def with_spikes(units: RecordedUnits) -> RecordedUnits:
    """Return units whose motion is far away inside every invisible phone."""
    drawn = units.values.copy()
    for recording, phone, times_s in zip(
        units.windows.recording, units.windows.phones, units.windows.times_s, strict=True
    ):
        if PHONES[phone] in INVISIBLE:
            start, stop = (units.first[recording] + np.round(times_s * 100)).astype(int)
            drawn[start + 1 : stop] = 9
    return replace(units, motion=drawn)


def test_no_recorded_invisible_phone_is_played() -> None:
    """Not even that of the sentence itself, nor in a merge beside it."""
    units = with_spikes(inventory("s iy t uw d aa s", "m aa k iy d", "s t aa n"))
    for text in ("s iy t uw d aa s", "m aa k iy", "s aa t iy n", "iy d m k aa"):
        assert joined(units, text)[1].max() == pytest.approx(0, abs=1e-9), text
        assert joined(units, text, replace(PRINTED, suppressed=False))[1].max() > 8, text


@pytest.mark.parametrize("guide", [0.0, 20.0])
def test_a_recorded_sentence_costs_nothing_without_its_suppressed_phones(model, guide: float) -> None:
    """Neither the phones that are wanted nor the recorded ones have them, so that its units succeed one another."""
    costs = model.costs(replace(PRINTED, guide=guide))
    for one in examples(4):
        target = build_target(model, costs, one.speech)
        assert not {PHONES[phone] for phone in target.windows.phones} & {*INVISIBLE}
        assert select(replace(costs, config=PRINTED), target)[1] == pytest.approx(0)
    assert {PHONES[phone] for phone in costs.inventory.windows.phones} <= {"sil", "b", "aa", "iy", "m", "uw", "s", "p"}


def test_the_vowel_gives_the_shape() -> None:
    units = inventory("m iy", "t uw", levels=(0, 1))
    _, motion = joined(units, "m iy t uw")
    assert motion[[5, 35]] == pytest.approx(0)
    assert motion[43:] == pytest.approx(1)


def test_a_suppressed_phone_is_an_invisible_neighbour_in_table_1() -> None:
    config = replace(PRINTED, context=0.0)
    for text, before, after in (("m aa t iy", "protected", "invisible"), ("s t aa m", "invisible", "protected"),
                                ("k aa d s", "invisible", "invisible"), ("m aa s", "protected", "normal")):  # fmt: skip
        costs = costs_of(inventory("m aa s iy").without(INVISIBLE), config)
        target = costs.target(costs.suppress(list_windows([timeline(text)])), None, None)
        shared = [PHONES[phone] for phone in target.windows.phones].index("aa")
        assert costs.forward_share(target, shared) == TABLE_1[before, after], text


def test_a_model_of_the_preset_knows_no_stand_ins_of_suppressed_phones_and_names_what_it_plays(model) -> None:
    engine = PRESET
    assert "t" not in engine.stand_ins(model)
    sentence = spoken(("b", "aa", "t", "iy", "m", "uw", "t"))
    result = engine.generate(model, speech(sentence))
    assert {source.split()[-1] for source in result.trace.states} <= {"sil", "b", "aa", "iy", "m", "uw"}
    named = [span.label.unit.split()[-1] for span in result.units]
    assert named == ["sil", "b", "aa", "iy", "iy", "m", "uw", "uw", "sil"]
    again = engine.generate(model, speech(result.units))
    assert again.motion.values == pytest.approx(result.motion.values)


def test_the_preset_is_the_default_without_its_additions() -> None:
    """So that all rows of the experiment may use one model."""
    default = engines.engine_named("selection", {"guide": 0.0, "joint_recogniser": False, "articulation": False})
    own, model = (engine.fit(examples(3), types.silent_monitor).model for engine in (PRESET, default))
    for sentence in (("b", "aa", "t", "iy", "m", "uw"), ("s", "t", "uw", "p", "iy", "t")):
        wanted = speech(spoken(sentence))
        of_both = [PRESET.generate(each, wanted).motion.values for each in (own, model)]
        assert of_both[0] == pytest.approx(of_both[1], abs=1e-6)
