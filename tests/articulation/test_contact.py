import numpy as np
import pytest

from lipmotion.articulation import contact
from lipmotion.motion.frame_labels import find_runs
from lipmotion.types import Channel, Motion
from meshes.speech import said

RATES = (24.0, 25.0, 29.97, 30.0, 60.0, 100.0)


def motion(opening: np.ndarray, rate_hz: float = 100.0, name: str = "opening") -> Motion:
    return Motion(np.asarray(opening, float)[:, None], rate_hz, (Channel(name),))


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    return [(first, stop) for first, stop in find_runs(mask).tolist()]


def test_the_gap_is_0_where_trackers_see_closed_lips_and_grows_with_the_opening():
    assert not contact.opening_to_gap(np.array([-0.01, 0, 0.005, contact.CLOSED_OPENING])).any()
    gap = contact.opening_to_gap(np.linspace(0, 1, 1001))
    assert (np.diff(gap) >= 0).all()
    assert np.diff(gap).max() < 0.004
    assert gap[-1] <= contact.LARGEST_GAP
    people = np.array([0.05, 0.1, 0.25])
    assert contact.opening_to_gap(people) == pytest.approx(people + contact.TRACKER_DEFICIT, abs=1e-3)


def test_an_opening_has_the_gap_that_it_was_made_of_or_its_own():
    gap = np.array([0.0, contact.MIN_GAP, 0.02, 0.1, 0.25, 0.4])
    assert contact.opening_to_gap(contact.gap_to_opening(gap)) == pytest.approx(gap, abs=1e-3)
    assert contact.opening_to_gap(contact.gap_to_opening(np.zeros(1)))[0] == 0
    both = Motion(np.array([[0.3, 0.1], [0.3, -0.1]]), 100.0, (Channel("opening"), Channel(contact.GAP)))
    assert contact.read_gap(both) == pytest.approx([0.1, 0.0])


@pytest.mark.parametrize(("phone", "start_s"), [("p", 0.2), ("b", 0.213), ("em", 0.227)])
@pytest.mark.parametrize("length_s", [0.02, 0.08, 0.15])
def test_lips_touch_once_in_every_p_b_and_m_for_longer_than_a_picture(phone, start_s, length_s):
    dip = 0.1 - 0.06 * np.exp(-(((np.arange(101) / 100 - start_s - length_s / 2) / 0.04) ** 2))
    units = said((0, start_s, "aa"), (start_s, start_s + length_s, phone), (start_s + length_s, 1, "aa"))
    gap = contact.close_lips(contact.opening_to_gap(dip), motion(dip), units)
    [(first, stop)] = runs(gap == 0)
    assert contact.CONTACT_S[0] - 0.011 <= (stop - first) / 100 <= contact.CONTACT_S[1] + 0.021
    assert start_s - 0.04 < (first + stop - 1) / 200 < start_s + length_s + 0.04
    assert gap[gap > 0].min() >= contact.MIN_GAP
    assert np.abs(np.diff(gap)).max() < 0.04
    for fps in RATES:
        assert contact.show_contact(gap == 0, 100.0, np.arange(int(fps)) / fps).sum() >= 2


def test_a_contact_that_the_motion_has_is_neither_longer_nor_shorter():
    opening, wide = np.full(101, 0.1), np.full(101, contact.EDITED_GAP + 0.05)  # wide open in all of a p is meant so
    opening[40:55] = 0.005
    for curve, units, contacts in ((opening, said((0.35, 0.6, "m")), [(40, 55)]), (wide, said((0.3, 0.5, "p")), [])):
        assert runs(contact.close_lips(contact.opening_to_gap(curve), motion(curve), units) == 0) == contacts


def test_closing_twice_changes_nothing():
    dip = np.full(101, 0.08)
    units = said((0.3, 0.4, "b"), (0.7, 0.75, "m"))
    for rate_hz in (25.0, 100.0):
        once = contact.close_lips(contact.opening_to_gap(dip), motion(dip, rate_hz), units)
        channels = (Channel("opening"), Channel(contact.GAP))
        again = Motion(np.stack([contact.gap_to_opening(once), once], axis=1), rate_hz, channels)
        assert contact.close_lips(contact.read_gap(again), again, units) == pytest.approx(once, abs=1e-12)


def test_closures_are_the_least_open_frames():
    opening = np.full(101, 0.1)
    opening[33], opening[52:57] = 0.02, 0.0
    units = said((0.3, 0.4, "p"), (0.5, 0.6, "m"), (0.6, 0.7, "f"))
    assert [each.frame for each in contact.find_closures(motion(opening), units)] == [33, 54]
    assert contact.find_closures(motion(opening, name="width"), units) == []
    assert [each.frame for each in contact.find_closures(motion(opening[::4], 25.0), said((0.405, 0.41, "p")))] == [10]


def test_pictures_show_every_contact_and_no_other():
    draw = np.random.default_rng(4)
    for _ in range(20):
        gap = np.where(np.repeat(draw.random(20) < 0.3, 6), 0.0, draw.uniform(contact.MIN_GAP, 0.2, 120))
        gap[50:53] = 0.1, 0.0, 0.1  # a contact of one frame
        for fps in RATES:
            time_s = np.arange(int(1.19 * fps) + 1) / fps
            shown = contact.show_contact(gap == 0, 100.0, time_s)
            values = contact.sample_pictures(gap, gap == 0, 100.0, time_s)
            assert np.array_equal(values == 0, shown)
            assert values[values > 0].min() >= contact.MIN_GAP
            for first, stop in runs(gap == 0):
                near = (time_s > (first - 1) / 100 - 0.5 / fps) & (time_s < stop / 100 + 0.5 / fps)
                assert shown[near].any()
    assert contact.sample_pictures(gap, gap == 0, 100.0, np.arange(120) / 100) == pytest.approx(gap)
