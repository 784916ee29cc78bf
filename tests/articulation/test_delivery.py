from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion import Delivery
from lipmotion.articulation import delivery
from lipmotion.articulation.contact import find_closures
from lipmotion.errors import InputError
from lipmotion.types import WEIGHT, Channel, Generation, Motion, StateTrace, Timeline
from meshes.speech import motion, units


@pytest.fixture
def said() -> Generation:
    curves = motion()
    states = StateTrace(("a", "b"), (np.arange(len(curves.values)) > 100).astype(np.intp))
    return Generation(curves, np.full(curves.values.shape, 0.01), units(), states)


def test_the_mouth_moves_earlier_and_the_phones_with_it(said: Generation) -> None:
    early = delivery.shift_in_time(said, Delivery(anticipation_ms=40))
    assert early.motion["opening"][:-4] == pytest.approx(said.motion["opening"][4:])
    assert len(early.motion.values) == len(said.motion.values)
    assert early.units[1].start_s == pytest.approx(said.units[1].start_s - 0.04)
    assert (early.units[0].start_s, early.units[len(early.units) - 1].end_s) == (0, 2)
    assert early.trace.frames[:-4].tolist() == said.trace.frames[4:].tolist()


def test_everything_comes_later(said: Generation) -> None:
    late = delivery.shift_in_time(said, Delivery(offset_ms=500))
    assert len(late.motion.values) == len(said.motion.values) + 50
    assert late.motion["opening"][50:] == pytest.approx(said.motion["opening"])
    assert late.motion["opening"][:50] == pytest.approx(said.motion["opening"][0])
    assert (late.units[0].start_s, late.units[1].start_s) == (0, 1.0)
    assert delivery.delay_units(said.units, Delivery(offset_ms=500, anticipation_ms=80), 2.0) == late.units


@pytest.mark.parametrize("offset_ms", [1000.0, -250.0])
def test_phones_that_end_after_the_last_frame_are_not_cut(said: Generation, offset_ms: float) -> None:
    *spans, last = said.units
    longer = Timeline((*spans, replace(last, end_s=2.005)))
    late, end_s = Delivery(offset_ms=offset_ms), pytest.approx(2.005 + offset_ms / 1000)
    assert delivery.shift_in_time(replace(said, units=longer), late).units[len(spans)].end_s == end_s
    assert delivery.delay_units(longer, late, 2.0)[len(spans)].end_s == end_s


def test_what_is_before_the_beginning_is_cut(said: Generation) -> None:
    cut = delivery.shift_in_time(said, Delivery(offset_ms=-550))
    assert cut.motion["opening"] == pytest.approx(said.motion["opening"][55:])
    assert (cut.units[0].label.phone, cut.units[0].start_s) == ("m", 0)
    with pytest.raises(InputError, match=r"the offset is -3000 ms, and the motion lasts 2\.00 s: nothing is left"):
        delivery.shift_in_time(said, Delivery(offset_ms=-3000))


def test_closures_survive_a_shift_between_two_frames(said: Generation) -> None:
    spiky = said.motion.values.copy()
    column = said.motion.column("opening")
    spiky[90:101, column] = 0.1
    spiky[95, column] = 0.0
    moved = replace(said, motion=replace(said.motion, values=spiky))
    early = delivery.shift_in_time(moved, Delivery(anticipation_ms=33))
    assert early.motion["opening"][86:100].min() == pytest.approx(0.0)


@pytest.mark.parametrize("intensity", [0.5, 1.5, 2.0, 3.0])
def test_movements_grow_and_closures_stay(said: Generation, intensity: float) -> None:
    larger = delivery.intensify(said, intensity)
    before, after = said.motion["opening"], larger.motion["opening"]
    assert after.max() > before.max() if intensity > 1 else after.max() < before.max()
    assert after.max() <= 2 * before.max()
    closed = [each.frame for each in find_closures(said.motion, said.units)]
    assert after[closed] == pytest.approx(before[closed])
    silent = said.motion.time_s < 0.45
    np.testing.assert_allclose(larger.motion.values[silent], said.motion.values[silent], rtol=1e-6, equal_nan=False)
    points = larger.motion["y_13"] - larger.motion["y_14"]
    rest = said.motion["y_13"][0] - said.motion["y_14"][0]
    assert points - rest == pytest.approx(after - after[0], abs=0.01)


def test_weights_stay_between_0_and_1(said: Generation) -> None:
    ramp = np.interp(said.motion.time_s, [0.5, 0.9, 1.3], [0, 0.8, 0])[:, None]
    weights = Motion(np.hstack([ramp, ramp]), 100.0, (Channel("jawOpen", WEIGHT), Channel("protrusion", WEIGHT)))
    larger = delivery.intensify(replace(said, motion=weights, spread=np.zeros((len(ramp), 2))), 3.0).motion
    assert larger.values.min() >= 0
    assert larger.values.max() <= 1
    assert larger["jawOpen"][70] > weights["jawOpen"][70] > 0


@pytest.mark.parametrize(("rate_hz", "frames"), [(24.0, 2), (25.0, 3), (100.0, 12)])
def test_held_poses_last_long_enough_and_close(said: Generation, rate_hz: float, frames: int) -> None:
    closed_s = delivery.find_closed_times(said)
    assert len(closed_s) == 2
    steps = delivery.hold_poses(delivery.close_on_frame_grid(said, rate_hz).resampled(rate_hz), frames, closed_s)
    changes = np.flatnonzero(np.abs(np.diff(steps.motion.values, axis=0)).max(axis=1) > 1e-12) + 1
    assert np.diff([0, *changes, len(steps.motion.values)]).min() >= frames
    for time_s in closed_s:
        assert steps.motion["opening"][round(time_s * rate_hz)] == pytest.approx(said.motion["opening"].min(), abs=1e-9)
    assert len(steps.trace.frames) == len(steps.motion.values) == len(np.asarray(steps.variance))


def test_holds_in_frames() -> None:
    for settings, rate_hz, frames in (
        (Delivery(), 24, 0),
        (Delivery(stepped=True), 24, 2),
        (Delivery(stepped=True), 100, 9),
        (Delivery(min_hold_ms=120), 25, 3),
        (Delivery(min_hold_ms=1), 25, 1),
    ):
        assert settings.hold_frames(rate_hz) == frames


def error(rows: NDArray[np.float64], borders: list[int], fixed: list[int]) -> float:
    """Return the sum of squared differences between curves and held poses."""
    total = 0.0
    for first, stop in pairwise(borders):
        inside = [frame for frame in fixed if first <= frame < stop] or slice(first, stop)
        total += float(((rows[first:stop] - rows[inside].mean(axis=0)) ** 2).sum())
    return total


def least_error(rows: NDArray[np.float64], hold: int, fixed: list[int]) -> float:
    """Return the least error of all divisions into poses of ``hold`` frames or more, one after another.

    With fixed frames, of those into poses of ``hold`` to 2 · ``hold`` − 1 frames.
    """
    longest = 2 * hold - 1 if fixed else len(rows)
    best = {0: 0.0}
    for stop in range(1, len(rows) + 1):
        starts = [first for first in best if hold <= stop - first <= longest]
        if starts:
            best[stop] = min(best[first] + error(rows, [first, stop], fixed) for first in starts)
    return best[len(rows)]


def test_no_division_is_nearer() -> None:
    for seed in (*range(10), 189):  # in the last, a pose of twice the hold would be nearer
        rng = np.random.default_rng(seed)
        hold = int(rng.integers(1, 6))
        rows = rng.normal(size=(int(rng.integers(2 * hold, 30)), 2)).cumsum(axis=0)
        fixed = sorted(rng.choice(len(rows), int(rng.integers(0, 3)), replace=False).tolist())
        borders = delivery.choose_holds(rows, hold, fixed)
        assert borders[0] == 0
        assert borders[-1] == len(rows)
        assert np.diff(borders).min() >= hold
        assert error(rows, borders, fixed) == pytest.approx(least_error(rows, hold, fixed), abs=1e-9)


def test_a_curve_of_steps_is_found_again_and_few_frames_are_one_pose() -> None:
    rows = np.repeat([0.0, 3.0, 1.0, 2.0], [5, 4, 6, 7])[:, None]
    borders = delivery.choose_holds(rows, 4)
    assert {5, 9, 15} <= set(borders)
    assert error(rows, borders, []) == pytest.approx(0, abs=1e-12)
    for frames, borders in ((0, [0]), (1, [0, 1]), (7, [0, 7])):
        assert delivery.choose_holds(np.arange(frames, dtype=float)[:, None], 4) == borders
