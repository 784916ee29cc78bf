"""Sentences that differ in what the corpus of commands cannot show: stress, edges of words, pace, clusters, closures.

Each case is an inventory with a wrong recording first and the right one behind it. With the costs as they are the right
one is chosen; without the one cost that sees the difference, and with all others, the wrong one.
"""

from dataclasses import replace

import numpy as np
import pytest

from engines.selection.drawn_units import costs_of, inventory, recorded, sentence, target_of, with_stress
from lipmotion.engines.selection.concatenation import concatenated, pieces_of
from lipmotion.engines.selection.costs import ABUTTING_JOIN, MINNIS_2000, SelectionConfig, select
from lipmotion.engines.selection.inventory import RecordedUnits
from lipmotion.engines.selection.windows import phone_windows
from lipmotion.types import Timeline, Unit

DEFAULT, PRINTED = SelectionConfig(), SelectionConfig.parsed(MINNIS_2000)
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
    units: RecordedUnits, config: SelectionConfig, wanted: Timeline[Unit], wrong: Timeline[Unit], by: str = "stress"
) -> set[int]:
    """Return the recordings of the phones that differ between two sentences by their stress or words, if any do."""
    costs = costs_of(units.without(config.suppressed_phones), config)
    one, other = (costs.shown(phone_windows([each])) for each in (wanted, wrong))
    differs = (getattr(one, by) != getattr(other, by)).reshape(len(one), -1).any(axis=1)
    assert one.phones.tolist() == other.phones.tolist()
    found = select(costs, costs.target(one, None, None)).units
    recordings = costs.inventory.windows.recording[found]
    return set(recordings[differs if differs.any() else slice(None)].tolist())


@BOTH
@pytest.mark.parametrize(("one", "other"), HOMOPHONES)
def test_stress_alone_decides(config: SelectionConfig, one: str, other: str) -> None:
    for wanted, wrong in ((sentence(one), sentence(other)), (sentence(other), sentence(one))):
        units = recorded(wrong, wanted)
        assert list_recordings(units, config, wanted, wrong) == {1}
        assert list_recordings(units, replace(config, stress=0.0), wanted, wrong) == {0}


@BOTH
@pytest.mark.parametrize(("one", "other"), EDGES)
def test_edges_of_words_alone_decide(config: SelectionConfig, one: str, other: str) -> None:
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
    assert costs.inventory.windows.recording[select(costs, target).units[2]] == 2
    careless = costs_of(units, replace(config, protected=0.0))
    assert careless.inventory.windows.recording[select(careless, target).units[2]] < 2


@pytest.mark.parametrize("phone", PRESERVED)
def test_closures_survive_hard_joins(phone: str) -> None:
    """Where units abut beside a protected phone, its neighbour is bent and it keeps the shape that was recorded."""
    units = inventory("s iy", phone, "uw n", levels=(1, 0, 1))
    costs = costs_of(units, PRINTED)
    target = target_of(costs, f"s iy {phone} uw n")
    pieces = pieces_of(costs, target, np.arange(5))
    assert [piece.join for piece in pieces[1:]] == [ABUTTING_JOIN] * 2
    motion = concatenated(units, target, pieces, 101)[:, 0]
    assert motion[41:60] == pytest.approx(0, abs=1e-9)
    assert motion[[20, 80]] == pytest.approx(1)
    assert np.abs(np.diff(motion)).max() < 0.9  # bent, not cut


def test_a_cut_in_a_cluster_is_worth_a_worse_merge() -> None:
    """ "s l iy": s l of one recording merged with another l at some distance, or s against l iy inside the cluster."""
    units = inventory("s l", "s", "l iy", levels=(1.4, 0, 0))
    config = replace(DEFAULT, context=0.0, word=0.0)

    def recording_of_s(settings: SelectionConfig) -> int:
        costs = costs_of(units, settings)
        return int(costs.inventory.windows.recording[select(costs, target_of(costs, "s l iy")).units[0]])

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
            found = select(costs, target_of(costs, "b iy s", (-1, 1, -1))).units
            assert units.windows.recording[found[phone]] == chosen, (phone, stress)
