"""The joint engine: what is given wins, and what it recognises are its own units."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lipmotion.engines import engine_named
from lipmotion.engines.joint.engine import JointEngine, JointModel
from lipmotion.errors import InputError
from lipmotion.testing.examples import examples, speech, timeline
from lipmotion.types import Generation, Span, Speech, Timeline, Unit
from lipmotion.types.progress import silent_monitor
from lipmotion.units import UNIT_SETS

SOUND = speech(timeline(("t", "aa", "p", "iy", "m", "uw", "s", "aa")))
OTHER_WORDS = timeline(("s", "uw", "t", "uw", "iy", "t", "aa", "s"))
E_VIS = UNIT_SETS["eVis"]


@cache
def trained(units: str) -> JointModel:
    return engine(units).fit(examples(8), silent_monitor).model


def engine(units: str = "eVis", recognises: bool = True, **options: object) -> JointEngine:
    found = engine_named("joint", {"units": units, "recognise_units": recognises, "mixtures": 1} | options)
    assert isinstance(found, JointEngine)
    return found


def generated(spoken: Speech, units: str = "eVis", **options: object) -> Generation:
    return engine(units, **options).generate(trained(units), spoken)


def recognised(units: str = "eVis", **options: object) -> Generation:
    """What it makes of sound alone: the phones of another recogniser, which it does not ask."""
    return generated(replace(SOUND, units=OTHER_WORDS, units_known=False), units, **options)


def spans(units: Timeline[Unit]) -> list[tuple[float, float, str]]:
    return [(span.start_s, span.end_s, span.label.phone) for span in units]


def test_other_words_of_the_same_sound_move_the_lips_otherwise() -> None:
    one, other = (generated(replace(SOUND, units=units), paths=5) for units in (SOUND.units, OTHER_WORDS))
    assert np.abs(one.motion["opening"] - other.motion["opening"]).max() > 0.1
    assert (spans(one.units), spans(other.units)) == (spans(SOUND.units), spans(OTHER_WORDS))


def test_words_that_are_known_are_not_recognised() -> None:
    own, shared = (generated(SOUND, recognises=recognises) for recognises in (True, False))
    assert own.motion.values == pytest.approx(shared.motion.values, abs=1e-9)
    assert own.units == shared.units


def test_untranscribed_speech_is_recognised_whatever_the_given_units() -> None:
    one = recognised()
    other = generated(replace(SOUND, units_known=False))
    assert one.motion.values == pytest.approx(other.motion.values, abs=1e-9)
    assert one.units == other.units


def test_recognised_units_are_units_and_no_phones() -> None:
    said = [E_VIS.unit(span.label.phone) for span in SOUND.units]
    found = recognised().units
    assert [E_VIS.unit_of(span.label) for span in found] == said
    for span, unit in zip(found, said, strict=True):
        if unit == "silence":
            assert span.label.phone == "sil"
        else:
            assert len(E_VIS.phones(unit)) > 1
            assert span.label == Unit("", unit, confidence=0.0)


@pytest.mark.long
def test_a_recognised_unit_of_one_phone_is_that_phone() -> None:
    found = recognised("phone").units
    assert [span.label.phone for span in found] == [span.label.phone for span in SOUND.units]
    assert found[2].label.unit == "t-aa+p"


def test_recognised_units_may_be_given_and_come_back_as_they_are() -> None:
    first = recognised()
    again = generated(replace(SOUND, units=first.units))
    assert again.units == first.units
    silent_from = round(100 * first.units[-1].start_s) - 15
    assert again.motion.values[:silent_from] == pytest.approx(first.motion.values[:silent_from], abs=1e-9)


def test_lips_meet_in_recognised_units_of_p_b_m_alone() -> None:
    closed, free = recognised().motion["opening"], recognised(closures=False).motion["opening"]
    closure = trained("eVis").closure
    assert closure is not None
    lips = [slice(80, 90), slice(100, 110)]
    for span in lips:
        assert closed[span].min() <= closure.closed + 1e-9
    assert any(free[span].min() > closure.closed for span in lips)


@pytest.mark.long
def test_a_closed_unit_that_silence_shares_closes_nothing_by_itself() -> None:
    pinned, free = recognised("2vis"), recognised("2vis", closures=False)
    assert "closed" in {span.label.unit for span in pinned.units}
    assert pinned.motion.values == pytest.approx(free.motion.values, abs=1e-9)


def test_a_unit_of_another_set_is_refused() -> None:
    unknown = Timeline((Span(0.0, 1.0, Unit("", "WQ")),))
    with pytest.raises(InputError, match=r"unknown unit 'WQ' without a phone; give a phone, or one of aw ay"):
        generated(replace(SOUND, units=unknown))
