import numpy as np
import pytest

from appearance.test_eigenlips import pictures
from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import Eigenlips, fit_eigenlips
from lipmotion_faces.appearance.candidates import (
    MIXTURE_SHARE,
    choose_candidates,
    draw_to_recorded,
    make_candidates,
    measure_details,
    squared_distances,
)

HELD_OUT = pictures(count=160)[120:]


@pytest.fixture(scope="module")
def space() -> Eigenlips:
    return fit_eigenlips(pictures(count=160)[:120], 4)


def mouths(seed: int = 0) -> np.ndarray:
    """Coefficients of a mouth that is mostly still, sometimes moves, and rarely opens wide."""
    draw = np.random.default_rng(seed)
    rare = draw.normal(0, 1, (8, 6)) + 60
    return np.concatenate([draw.normal(0, 1, (900, 6)), draw.normal(0, 8, (300, 6)), rare]).astype(np.float32)


def coverage(values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Distance of every mouth to the nearest chosen one: the definition."""
    return np.array([np.sqrt(np.square(values[chosen] - value).sum(axis=1)).min() for value in values])


def test_chosen_mouths_cover_the_others_better_than_evenly_spaced_and_random_ones() -> None:
    values = mouths()
    ours = coverage(values, choose_candidates(values, 60))
    even = coverage(values, np.linspace(0, len(values) - 1, 60).round().astype(int))
    drawn = coverage(values, np.random.default_rng(0).choice(len(values), 60, replace=False))
    for others in (even, drawn):
        assert ours.mean() < others.mean()
        assert ours.max() < 0.9 * others.max()


def test_the_choice_is_ascending_distinct_and_repeatable() -> None:
    chosen = choose_candidates(mouths(), 50)
    assert (np.diff(chosen) > 0).all()
    assert 45 <= len(chosen) <= 50
    assert np.array_equal(chosen, choose_candidates(mouths(), 50))


def test_all_are_chosen_where_there_are_few_and_equal_ones_once() -> None:
    few = mouths()[:7]
    assert choose_candidates(few, 500).tolist() == list(range(7))
    assert len(choose_candidates(np.repeat(few, 3, axis=0), 500)) == 7
    assert len(choose_candidates(np.ones((5, 3)), 3)) == 1


def test_what_nothing_can_be_chosen_from() -> None:
    for values, count, says in (
        (np.zeros((0, 6)), 5, r"shape \(0, 6\), required finite"),
        (np.full((4, 6), np.nan), 5, "finite"),
        (np.zeros((4, 6)), 0, "0 candidate mouths asked for, required at least 1"),
    ):
        with pytest.raises(InputError, match=says):
            choose_candidates(values, count)


def test_squared_distances_are_those_of_the_definition() -> None:
    some, others = mouths(1)[:9], mouths(2)[:5]
    expected = [[float(np.square(a.astype(float) - b).sum()) for b in others] for a in some]
    assert squared_distances(some, others) == pytest.approx(np.array(expected), rel=1e-4, abs=1e-2)


def test_a_candidate_is_its_eigenlips_and_its_detail(space: Eigenlips) -> None:
    images = HELD_OUT[:20]
    candidates = make_candidates(space, images)
    assert (len(candidates), candidates.size) == (20, (9, 12))
    again = np.rint(space.expand(candidates.coefficients) + candidates.details)
    assert np.abs(again - images).max() <= 1
    detail_coefficients = np.stack(
        [candidates.details[..., c].reshape(20, -1).astype(float) @ space.basis[c].T for c in range(3)]
    )
    assert np.abs(detail_coefficients).max() < 3  # of rounding alone: detail has no part in the space of the eigenlips


def test_a_damaged_picture_is_no_candidate(space: Eigenlips) -> None:
    images = HELD_OUT[:20].copy()
    images[7, :3, :3] = 255, 0, 255
    candidates = make_candidates(space, images)
    assert len(candidates) == 19
    others = make_candidates(space, np.delete(images, 7, axis=0))
    assert candidates.coefficients == pytest.approx(others.coefficients, abs=1e-2)
    with pytest.raises(InputError, match=r"1 pictures, all of which differ .* more than 100 grey levels"):
        make_candidates(space, images[7:8])


def test_distances_between_details(space: Eigenlips) -> None:
    candidates = make_candidates(space, HELD_OUT[:6])
    for colour in range(3):
        details = candidates.details[..., colour].astype(float)
        expected = [[np.square(a - b).sum() for b in details] for a in details]
        assert candidates.detail_distances[colour] == pytest.approx(np.array(expected), abs=1e-1)


def test_details_are_what_the_eigenlips_leave_out(space: Eigenlips) -> None:
    images = HELD_OUT[:20].copy()
    images[3, :2] = 255 - images[3, :2]
    codes = space.project(images)
    details, deepest = measure_details(space, images, codes)
    exact = np.rint(images - space.expand(codes))
    assert np.array_equal(details, np.clip(exact, -100, 100).astype(np.int8))
    assert deepest == pytest.approx(np.abs(exact).max(axis=(1, 2, 3)))


def test_recorded_mouths_stay_where_they_are() -> None:
    values = mouths()[::5]
    assert draw_to_recorded(values, values) == pytest.approx(values, abs=0.2)  # they are up to 147 from 0


def test_a_mouth_between_recorded_ones_stays_and_one_far_away_comes_nearer() -> None:
    grid = np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1).reshape(-1, 2).astype(np.float32)
    between, far = draw_to_recorded(np.array([[3.4, 2.7], [3.5, 20.0]], np.float32), grid)
    assert between == pytest.approx([3.4, 2.7], abs=0.1)
    assert far == pytest.approx([3.5, (1 - MIXTURE_SHARE) * 20 + MIXTURE_SHARE * 7], abs=0.5)  # 7 is the last recorded
    one = grid[:1]
    assert draw_to_recorded(one + 4, one) == pytest.approx(one + 4 * (1 - MIXTURE_SHARE), abs=1e-3)


def test_mouths_are_drawn_smoothly_over_time() -> None:
    recorded = mouths(1)[::3]
    path = np.linspace(recorded[0], recorded[50], 400)
    steps = np.linalg.norm(np.diff(draw_to_recorded(path.astype(np.float32), recorded), axis=0), axis=1)
    assert steps.max() < 0.02 * np.linalg.norm(path[-1] - path[0])  # where the nearest ones change
