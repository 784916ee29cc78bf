"""Suppressed phones: "the following vowel gives the shape of the mouth" (Minnis & Breen 2000, §3)."""

from dataclasses import replace

import numpy as np
import pytest

from engines.selection.drawn_units import costs_of, inventory, timeline
from lipmotion import engines, types
from lipmotion.engines.selection.concatenation import concatenated, pieces_of
from lipmotion.engines.selection.costs import MINNIS_2000, SelectionConfig, Target, select
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.inventory import RecordedUnits
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.selection_training import target_of
from lipmotion.engines.selection.windows import TABLE_1, phone_windows
from lipmotion.testing.examples import examples, speech
from lipmotion.testing.examples import timeline as spoken
from lipmotion.units import PHONES

PRINTED = SelectionConfig.parsed(MINNIS_2000)
INVISIBLE = ("t", "d", "g", "k")


def times_of(text: str) -> dict[str, tuple[float, float]]:
    """Return start and end of each phone that is left, by its name, in phones of a second."""
    windows = phone_windows([timeline(text, 1.0)]).suppressed(INVISIBLE)
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
    windows, kept = phone_windows([timeline("iy t | d uw | k ae t s")]).without(INVISIBLE)
    assert kept.tolist() == [0, 3, 5, 7]
    assert windows.words.tolist() == [[True, True], [True, True], [True, False], [False, True]]
    assert windows.hidden.tolist() == [False, True, True, True]


def joined(units: RecordedUnits, text: str, config: SelectionConfig = PRINTED) -> tuple[Target, np.ndarray]:
    costs = costs_of(units.without(config.suppressed_phones), config)
    target = costs.target(costs.shown(phone_windows([timeline(text)])), None, None)
    pieces = pieces_of(costs, target, select(costs, target).units)
    return target, concatenated(costs.inventory, target, pieces, round(timeline(text)[-1].end_s * 100) + 1)[:, 0]


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
def test_a_recorded_sentence_costs_nothing_without_its_suppressed_phones(model: SelectionModel, guide: float) -> None:
    """Neither the phones that are wanted nor the recorded ones have them, so that its units succeed one another."""
    costs = model.costs(replace(PRINTED, guide=guide))
    for one in examples(4):
        target = target_of(model, costs, one.speech)
        assert not {PHONES[phone] for phone in target.windows.phones} & {*INVISIBLE}
        assert select(replace(costs, config=PRINTED), target).cost == pytest.approx(0)
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
        target = costs.target(costs.shown(phone_windows([timeline(text)])), None, None)
        shared = [PHONES[phone] for phone in target.windows.phones].index("aa")
        assert costs.forward_share(target, shared) == TABLE_1[before, after], text


def test_the_preset_needs_nothing_but_phones() -> None:
    engine = engines.engine_from_settings(preset="minnis2000")
    assert isinstance(engine, SelectionEngine)
    needs = engine.inputs()
    assert (needs.prior, needs.posteriors, needs.conditions) == (False, False, 0)
    assert (engine.config.candidates, engine.config.beam) == (0, 0)
    assert engine.without_closures() == engine
    changed = engines.engine_from_settings(preset="minnis2000", settings=["candidates=300"])
    assert changed.config == replace(engine.config, candidates=300)  # type: ignore[attr-defined]


def test_a_model_of_the_preset_knows_no_stand_ins_of_suppressed_phones_and_names_what_it_plays(
    model: SelectionModel,
) -> None:
    engine = SelectionEngine(PRINTED)
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
    default = SelectionConfig(guide=0.0, joint_recogniser=False, articulation=False)
    own, model = (SelectionEngine(config).fit(examples(3), types.silent_monitor).model for config in (PRINTED, default))
    for sentence in (("b", "aa", "t", "iy", "m", "uw"), ("s", "t", "uw", "p", "iy", "t")):
        wanted = speech(spoken(sentence))
        of_both = [SelectionEngine(PRINTED).generate(each, wanted).motion.values for each in (own, model)]
        assert of_both[0] == pytest.approx(of_both[1], abs=1e-6)
