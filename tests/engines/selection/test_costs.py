"""The costs and overlaps of Minnis & Breen 2000, each on units that differ in one thing only."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from engines.selection.drawn_units import (
    PHONE_S,
    array,
    costs_of,
    inventory,
    recorded,
    sentence,
    target_of,
    timeline,
    with_stress,
)
from lipmotion.engines import create_engine, engine_named
from lipmotion.engines.selection import concatenation
from lipmotion.engines.selection import costs as search
from lipmotion.engines.selection.concatenation import join_pieces, to_pieces
from lipmotion.engines.selection.costs import ABUTTING_JOIN, FRACTIONS, JOIN_AFTER, JOIN_BEFORE, select
from lipmotion.engines.selection.inventory import RecordedUnits, list_windows
from lipmotion.types import Span, Timeline, Unit

NAMED = {"protected": "p", "invisible": "t", "normal": "s"}
TABLE_1 = {
    "protected": {"protected": 0.50, "invisible": 0.77, "normal": 0.55},
    "invisible": {"protected": 0.23, "invisible": 0.50, "normal": 0.27},
    "normal": {"protected": 0.45, "invisible": 0.77, "normal": 0.50},
}
"""Table 1 by the phones before (rows: forward) and after (columns: backward) the shared one."""


def test_another_phone_costs_less_the_further_away_and_half_in_one_viseme() -> None:
    units = inventory("s iy aa m uw", "s aa aa m uw", "s iy aa f uw", "f iy aa m uw", "uw m aa iy s")
    costs = costs_of(units, context=0.3, farther=0.2)
    found = costs.target_costs(target_of(costs, "s iy aa m uw"), 2, np.arange(2, 25, 5))
    assert found / found[1] == pytest.approx([0, 1, 1, 0.2, 2.4])
    costs = costs_of(inventory("s iy aa p uw", "s iy aa f uw", "m"), context=0.3)
    assert costs.target_costs(target_of(costs, "s iy aa m uw"), 2, array(2, 7)) == pytest.approx([0.15, 0.3])


def test_each_edge_of_a_word_that_differs_costs_once() -> None:
    units = inventory("iy | aa | iy", "iy aa | iy", "iy | aa iy", "iy aa iy")
    costs, every = costs_of(units, word=0.07), np.arange(1, 12, 3)
    assert costs.target_costs(target_of(costs, "iy | aa | iy"), 1, every) == pytest.approx([0, 0.07, 0.07, 0.14])
    assert costs.target_costs(target_of(costs, "iy aa iy"), 1, every) == pytest.approx([0.14, 0.07, 0.07, 0])
    wordless = costs.target(list_windows([Timeline(tuple(Span(n, n + 1.0, Unit("iy")) for n in range(3)))]), None, None)
    assert costs.target_costs(wordless, 1, every) == pytest.approx(0)


def test_stress_that_is_known_and_differs_costs_and_the_ratio_of_durations_by_its_logarithm() -> None:
    units = inventory("aa", "aa", "aa")
    costs = costs_of(with_stress(units, 1, 0, -1), stress=0.06)
    for stress, wanted in ((1, [0, 0.06, 0]), (0, [0.06, 0, 0]), (-1, [0, 0, 0])):
        assert costs.target_costs(target_of(costs, "aa", [stress]), 0, array(0, 1, 2)) == pytest.approx(wanted)
    cheapest = costs_of(with_stress(units, 0, 1, 0), stress=0.06, candidates=1)
    assert cheapest.candidates(target_of(cheapest, "aa", [1]), 0).tolist() == [1]
    times_s = np.array([[0, PHONE_S], [0, 2 * PHONE_S], [0, PHONE_S / 4]])
    costs = costs_of(replace(units, windows=replace(units.windows, times_s=times_s)), duration=0.3)
    found = costs.target_costs(target_of(costs, "aa"), 0, array(0, 1, 2))
    assert found == pytest.approx([0, 0.3 * np.log(2), 0.6 * np.log(2)])


def test_motion_unlike_the_guide_costs_unless_the_sounds_are_alike() -> None:
    units = inventory("aa", "aa", "aa", levels=(0.5, 0.8, 0.8))
    predicted = np.stack([np.full((len(FRACTIONS), 1), each) for each in (0.5, 0.55, 0.9)]).astype(np.float16)
    costs = costs_of(replace(units, predicted=predicted), guide=2.0, trust=0.1)
    wanted = np.full((1, len(FRACTIONS), 1), 0.5)
    target = costs.target(list_windows([timeline("aa")]), wanted, wanted)
    distance = 0.3**2 * 2 * PHONE_S * 10
    assert costs.target_costs(target, 0, array(0, 1, 2)) == pytest.approx([0, distance / 4, distance], rel=1e-2)


def test_abutting_costs_more_beside_a_protected_phone_and_inside_a_cluster_of_one_word() -> None:
    units = inventory("uw", "uw", "s l p aa")
    for text, wanted in (
        ("s l", 0.15 + 0.1), ("s | l", 0.15), ("s aa", 0.15), ("aa s", 0.15), ("s p", 0.15 + 0.1 + 1),
        ("p aa", 0.15 + 1), ("aa p", 0.15 + 1),
    ):  # fmt: skip
        costs = costs_of(units, hard=0.15, cluster=0.1, protected=1.0)
        assert costs.join_costs(target_of(costs, text), 1, array(0), array(1))[0, 0] == pytest.approx(wanted), text
    limited = costs_of(units, hard=9.0, most=2.0)
    assert limited.join_costs(target_of(limited, "s aa"), 1, array(0), array(1)) == pytest.approx(2)


def test_units_merge_in_an_identical_phone_only_and_another_stress_has_its_cost() -> None:
    units = inventory("iy aa s", "uw aa uw", "iy ae s", "uw ae uw")
    for stresses, wanted in (((1, 1), 0.0), ((1, 0), 0.06), ((0, 1), 0.06), ((1, -1), 0.0)):
        one, other = stresses
        marked = with_stress(units, -1, one, -1, -1, other, -1, -1, one, -1, -1, other, -1)
        costs = costs_of(marked, stress=0.06, hard=1.0)
        target = target_of(costs, "iy aa uw")
        in_the_phone_before = costs.join_costs(target, 2, array(1), array(5, 11))[0]  # after aa, after ae
        in_the_phone_after = costs.join_costs(target, 1, array(0, 6), array(4))[:, 0]  # before aa, before ae
        assert in_the_phone_before == pytest.approx([wanted, 1])
        assert in_the_phone_after == pytest.approx([wanted, 1])
        assert [costs.join_kind(target, 2, 1, unit) for unit in (5, 11)] == [JOIN_BEFORE, ABUTTING_JOIN]
        assert [costs.join_kind(target, 1, unit, 4) for unit in (0, 6)] == [JOIN_AFTER, ABUTTING_JOIN]


def overlapping(before: str, after: str, kind: int):
    """Return units of two recordings, at 0 and at 1, that overlap in aa between two phones."""
    costs = costs_of(inventory(f"{before} aa f", f"f aa {after}", levels=(0, 1)), hard=1.0)
    return costs, target_of(costs, f"{before} aa {after}"), [0, 1, 5] if kind == JOIN_BEFORE else [0, 4, 5]


def test_units_overlap_where_table_1_says() -> None:
    for before, row in TABLE_1.items():
        for after, share in row.items():
            for kind in (JOIN_BEFORE, JOIN_AFTER):
                costs, target, units = overlapping(NAMED[before], NAMED[after], kind)
                pieces = concatenation.to_pieces(costs, target, np.array(units))
                assert [piece.join for piece in pieces[1:]] == [kind]
                middle_s = PHONE_S * (1 + share)
                assert pieces[1].start_s == pytest.approx(middle_s), (before, after)
                motion = concatenation.join_pieces(costs.inventory, target, pieces, 61)[:, 0]
                crossing_s = np.interp(0.5, motion, np.arange(61) / 100)
                assert crossing_s == pytest.approx(middle_s, abs=0.003), (before, after)
                reach_s = min(share, 1 - share) * PHONE_S - 0.01  # as far from the join as it is from an edge of aa
                assert (
                    0 < motion[round((middle_s - reach_s) * 100)] < 0.5 < motion[round((middle_s + reach_s) * 100)] < 1
                )
                recording = concatenation.list_shown_units(target, pieces, 60) // 3
                assert (recording == 1).sum() == pytest.approx((3 * PHONE_S - middle_s) * 100, abs=1)


def test_units_that_overlap_cost_what_they_differ_by_where_they_overlap() -> None:
    for before, row in TABLE_1.items():
        for after, share in row.items():
            costs, target, _ = overlapping(NAMED[before], NAMED[after], JOIN_BEFORE)
            units = costs.inventory
            drawn = units.values.copy()
            drawn[:61, 0] = np.clip(np.arange(61) / 20 - 1, 0, 1)  # rises from 0 to 1 within aa
            drawn[61:] = 0
            costs = costs_of(replace(units, motion=drawn), join=0.1, hard=9.0, most=9.0)
            assert costs.join_costs(target, 2, array(1), array(5)) == pytest.approx(0.1 * share**2), (before, after)
            assert costs.join_costs(target, 1, array(0), array(4)) == pytest.approx(0.1 * share**2), (before, after)


def test_velocities_that_differ_cost_where_units_are_joined() -> None:
    units = inventory("s aa", "iy s")
    drawn = units.values.copy()
    drawn[:41, 0] = np.arange(41) / 100 - 0.4  # one unit per second, up to 0 at the end
    costs = costs_of(replace(units, motion=drawn), join=0.1, velocity=0.05)
    wanted = 0.1 * 0.05**2 / 4  # at the end the motion stands still: the velocity is half of it
    assert costs.join_costs(target_of(costs, "aa iy"), 1, array(1), array(2)) == pytest.approx(wanted)


def test_abutting_pieces_are_bent_in_the_last_and_the_first_twentieth() -> None:
    """§4: "smoothed for the last 5% of the first unit, and the first 5% of the second unit"."""
    units = inventory("s iy", "uw n", levels=(0, 1), duration_s=1.0)
    costs = costs_of(units)
    target = costs.target(list_windows([timeline("s iy uw n", 1.0)]), None, None)
    motion = concatenation.join_pieces(units, target, concatenation.to_pieces(costs, target, np.arange(4)), 401)[:, 0]
    bent = np.flatnonzero((motion > 1e-9) & (motion < 1 - 1e-9))
    assert (bent[0], bent[-1]) == pytest.approx((200 - 0.05 * 200, 200 + 0.05 * 200), abs=1)
    assert np.diff(motion).min() >= 0


def test_by_default_units_merge_in_a_vowel_rather_than_abut_behind_a_plosive() -> None:
    """§4: "/s p u/ and /u n/" rather than "/s p/ and /u n/"."""
    units = inventory("s p", "uw n", "s p uw", "uw n")
    costs = costs_of(units, engine_named("selection", {}).config)
    target = target_of(costs, "s p uw n")
    pieces = concatenation.to_pieces(costs, target, search.select(costs, target)[0])
    assert ABUTTING_JOIN not in [piece.join for piece in pieces[1:]]
    assert (pieces[0].unit, pieces[0].stop + (pieces[1].join == JOIN_AFTER)) == (4, 3)


DEFAULT, PRINTED = engine_named("selection", {}).config, create_engine(preset="minnis2000").config
BOTH = pytest.mark.parametrize("config", [DEFAULT, PRINTED], ids=["default", "printed"])
PRESERVED = ("f", "v", "m", "em", "p", "b")
HOMOPHONES = (
    ("we buy four cats", "we buy for cats"),
    ("so two men go", "so to men go"),
    ("my bee sleeps", "my be sleeps"),
)
"""Stressed and unstressed words of the same phones."""
EDGES = ("we saw ice cream", "we saw i scream"), ("see that's tough", "see that stuff"), ("peace talks", "pea stalks")
"""The same phones, cut into words elsewhere."""


def list_recordings(
    units: RecordedUnits, config: Any, wanted: Timeline[Unit], wrong: Timeline[Unit], by: str = "stress"
) -> set[int]:
    """Return the recordings of the phones that differ between two sentences by their stress or words, if any do."""
    costs = costs_of(units.without(config.suppressed_phones), config)
    one, other = (costs.suppress(list_windows([each])) for each in (wanted, wrong))
    differs = (getattr(one, by) != getattr(other, by)).reshape(len(one), -1).any(axis=1)
    assert one.phones.tolist() == other.phones.tolist()
    found = select(costs, costs.target(one, None, None))[0]
    recordings = costs.inventory.windows.recording[found]
    return set(recordings[differs if differs.any() else slice(None)].tolist())


@BOTH
@pytest.mark.parametrize(("one", "other"), HOMOPHONES)
def test_stress_alone_decides(config: Any, one: str, other: str) -> None:
    for wanted, wrong in ((sentence(one), sentence(other)), (sentence(other), sentence(one))):
        units = recorded(wrong, wanted)
        assert list_recordings(units, config, wanted, wrong) == {1}
        assert list_recordings(units, replace(config, stress=0.0), wanted, wrong) == {0}


@BOTH
@pytest.mark.parametrize(("one", "other"), EDGES)
def test_edges_of_words_alone_decide(config: Any, one: str, other: str) -> None:
    config = replace(config, stress=0.0)
    for wanted, wrong in ((sentence(one), sentence(other)), (sentence(other), sentence(one))):
        units = recorded(wrong, wanted)
        assert list_recordings(units, config, wanted, wrong, by="words") == {1}
        assert list_recordings(units, replace(config, word=0.0), wanted, wrong, by="words") == {0}


def test_pace_alone_decides_but_not_in_print() -> None:
    text = "my bee sleeps"
    for wanted, wrong in ((sentence(text, 0.06), sentence(text, 0.2)), (sentence(text, 0.2), sentence(text, 0.06))):
        units = recorded(wrong, wanted)
        assert list_recordings(units, DEFAULT, wanted, wrong) == {1}
        for deaf in (replace(DEFAULT, duration=0.0), PRINTED):
            assert list_recordings(units, deaf, wanted, wrong) == {0}


@pytest.mark.parametrize("phone", PRESERVED)
def test_units_merge_beside_a_protected_phone_not_in_it(phone: str) -> None:
    """The lips are closed on the teeth or on one another in one recording: "see | v aa n" of three pieces, not two."""
    units = inventory(f"s iy {phone}", f"{phone} aa n", f"iy {phone} aa", levels=(0, 0, 1))
    config = replace(DEFAULT, context=0.0)
    costs = costs_of(units, config)
    target = target_of(costs, f"s iy {phone} aa n")
    assert costs.inventory.windows.recording[select(costs, target)[0][2]] == 2
    careless = costs_of(units, replace(config, protected=0.0))
    assert careless.inventory.windows.recording[select(careless, target)[0][2]] < 2


@pytest.mark.parametrize("phone", PRESERVED)
def test_closures_survive_hard_joins(phone: str) -> None:
    """Where units abut beside a protected phone, its neighbour is bent and it keeps the shape that was recorded."""
    units = inventory("s iy", phone, "uw n", levels=(1, 0, 1))
    costs = costs_of(units, PRINTED)
    target = target_of(costs, f"s iy {phone} uw n")
    pieces = to_pieces(costs, target, np.arange(5))
    assert [piece.join for piece in pieces[1:]] == [ABUTTING_JOIN] * 2
    motion = join_pieces(units, target, pieces, 101)[:, 0]
    assert motion[41:60] == pytest.approx(0, abs=1e-9)
    assert motion[[20, 80]] == pytest.approx(1)
    assert np.abs(np.diff(motion)).max() < 0.9  # bent, not cut


def test_a_cut_in_a_cluster_is_worth_a_worse_merge() -> None:
    """ "s l iy": s l of one recording merged with another l at some distance, or s against l iy inside the cluster."""
    units = inventory("s l", "s", "l iy", levels=(1.4, 0, 0))
    config = replace(DEFAULT, context=0.0, word=0.0)

    def recording_of_s(settings: Any) -> int:
        costs = costs_of(units, settings)
        return int(costs.inventory.windows.recording[select(costs, target_of(costs, "s l iy"))[0][0]])

    assert recording_of_s(config) == 0
    assert recording_of_s(replace(config, cluster=0.0)) == 1
    assert recording_of_s(replace(config, cluster=0.0, hard=0.25)) == 0


def test_units_merge_where_stress_agrees() -> None:
    """The first of two equal recordings is left for the second, whose vowel has the stress of the third."""
    before = with_stress(inventory("b iy", "b iy", "iy s"), 0, 0, 1, 1, 1, -1)
    after = with_stress(inventory("iy s", "iy s", "b iy"), 0, 0, 1, 1, -1, 1)
    for units, phone in ((before, 0), (after, 2)):
        for stress, chosen in ((DEFAULT.stress, 1), (0.0, 0)):
            config = replace(DEFAULT, context=0.0, stress=stress)
            costs = costs_of(units, config)
            found = select(costs, target_of(costs, "b iy s", (-1, 1, -1)))[0]
            assert units.windows.recording[found[phone]] == chosen, (phone, stress)
