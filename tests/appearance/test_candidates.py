"""Eigenlips, the recorded mouths that are chosen as candidates, and refinement by them."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.motion.eigenlips import Eigenlips, eigenlips_from_arrays, eigenlips_to_arrays, fit_eigenlips
from lipmotion.stats.pca import fit_pca
from lipmotion_faces.appearance.candidates import (
    MIXTURE_SHARE,
    PAPER,
    Candidates,
    RefinementOptions,
    Refiner,
    choose_candidates,
    draw_to_recorded,
    measure_details,
    sharpen,
)
from oracles.statistics import components, share


def pictures(seed: int = 0, count: int = 40, height: int = 9, width: int = 12) -> np.ndarray:
    """Coloured blobs that come and go, and a little noise."""
    draw = np.random.default_rng(seed)
    blobs = draw.normal(0, 1, (6, height, width, 3)) * 0.6 ** np.arange(6)[:, None, None, None]
    values = 120 + 25 * np.einsum("tk,khwc->thwc", draw.normal(0, 1, (count, 6)), blobs)
    return np.clip(values + draw.normal(0, 1, values.shape), 0, 255).astype(np.uint8)


def make_candidates(space: Eigenlips, images: np.ndarray) -> Candidates:
    coefficients = space.project(images)
    return Candidates(coefficients, measure_details(space, images, coefficients)[0])


TRAINING, HELD_OUT = np.split(pictures(count=160), [120])


@pytest.fixture(scope="module")
def space() -> Eigenlips:
    return fit_eigenlips(TRAINING, 4)


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


def test_the_choice_is_ascending_distinct_and_repeatable_and_all_where_there_are_few() -> None:
    chosen = choose_candidates(mouths(), 50)
    assert (np.diff(chosen) > 0).all()
    assert 45 <= len(chosen) <= 50
    assert np.array_equal(chosen, choose_candidates(mouths(), 50))
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


def test_a_candidate_is_its_eigenlips_and_its_detail(space: Eigenlips) -> None:
    candidates, images = make_candidates(space, HELD_OUT[:20]), HELD_OUT[:20]
    assert (len(candidates), candidates.size) == (20, (9, 12))
    again = np.rint(space.expand(candidates.coefficients) + candidates.details)
    assert np.abs(again - images).max() <= 1
    detail_coefficients = np.stack(
        [candidates.details[..., c].reshape(20, -1).astype(float) @ space.basis[c].T for c in range(3)]
    )
    assert np.abs(detail_coefficients).max() < 3  # of rounding alone: detail has no part in the space of the eigenlips


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


@pytest.fixture(scope="module")
def refiner(space: Eigenlips) -> Refiner:
    return Refiner(space, make_candidates(space, TRAINING[::4]), PAPER)


def refine(refiner: Refiner, coefficients: np.ndarray) -> np.ndarray:
    return refiner.refine(coefficients, refiner.choose(coefficients))


def test_the_paper_frame_by_frame(space: Eigenlips, refiner: Refiner) -> None:
    """Eqs. 14 to 16 as printed, with coefficients of all dimensions, one colour and frame at a time."""
    training, wanted = TRAINING, space.project(HELD_OUT[:6])
    result = refine(refiner, wanted).astype(float)
    for colour in range(3):
        values = training[..., colour].reshape(120, -1)
        basis = fit_pca(values, 108).basis
        g = (values[::4] - space.mean[colour]) @ basis.T  # Eq. 14
        for frame in range(6):
            first = wanted[frame, 4 * colour : 4 * colour + 4]
            j = np.linalg.norm(first - g[:, :4], axis=1).argmin()  # Eq. 15
            expected = space.mean[colour] + np.concatenate([first, g[j, 4:]]) @ basis  # Eq. 16
            assert result[frame, :, :, colour].ravel() == pytest.approx(np.clip(expected, 0, 255), abs=1.1)


def test_a_candidate_comes_back_whole(space: Eigenlips, refiner: Refiner) -> None:
    images, coefficients = TRAINING[::4], space.project(TRAINING[::4])
    for options in (PAPER, RefinementOptions(steadiness=0.0, neighbours=1)):
        restored = refine(Refiner(space, refiner.candidates, options), coefficients)
        assert np.abs(restored.astype(int) - images).max() <= 1
    assert np.abs(space.restore(coefficients).astype(int) - images).max() > 4  # which eigenlips alone do not give


def test_one_candidate_for_all_colours(space: Eigenlips, refiner: Refiner) -> None:
    wanted = space.project(HELD_OUT[:40])
    apart, together = refiner.choose(wanted), Refiner(space, refiner.candidates).choose(wanted)
    assert (apart != apart[:, :1]).any()
    assert (together == together[:, :1]).all()
    nearest = Refiner(space, refiner.candidates, RefinementOptions(steadiness=0.0)).choose(wanted)[:, 0]
    distances = np.square(wanted[:, None] - refiner.candidates.coefficients).sum(axis=2)
    assert np.array_equal(nearest, distances.argmin(axis=1))


@pytest.mark.parametrize("together", [False, True])
def test_the_search_finds_the_cheapest_of_all_sequences(space: Eigenlips, together: bool) -> None:
    candidates = make_candidates(space, TRAINING[:5])
    options = RefinementOptions(together, steadiness=2.0, neighbours=5)
    wanted = space.project(HELD_OUT[:4])
    chosen = Refiner(space, candidates, options).choose(wanted)
    colours_of = (np.split(each, 3, 1) for each in (wanted, candidates.coefficients))
    low = [np.square(a[:, None] - b).sum(axis=2) for a, b in zip(*colours_of, strict=True)]
    for colours in ([0, 1, 2],) if together else ([0], [1], [2]):

        def cost(path: tuple[int, ...], colours: list[int] = colours) -> float:
            near = sum(low[c][t, j] for c in colours for t, j in enumerate(path))
            change = sum(candidates.detail_distances[c][path[t - 1], path[t]] for c in colours for t in range(1, 4))
            return float(near + 2.0 * change)

        least = min(cost(path) for path in product(range(5), repeat=4))
        assert cost(tuple(chosen[:, colours[0]])) == pytest.approx(least, rel=1e-4)


def test_a_steadier_sequence_changes_detail_less(space: Eigenlips, refiner: Refiner) -> None:
    noise = np.random.default_rng(0).normal(0, 30, (60, 12))
    wanted, changes = space.project(HELD_OUT)[:30].repeat(2, axis=0) + noise, []
    for steadiness in (0.0, 1.0, 10.0):
        steady = Refiner(space, refiner.candidates, RefinementOptions(steadiness=steadiness))
        chosen = steady.choose(wanted)[:, 0]
        changes.append(refiner.candidates.detail_distances.sum(axis=0)[chosen[:-1], chosen[1:]].sum())
    assert changes[0] > changes[1] > changes[2]


def test_what_cannot_be_refined(refiner: Refiner) -> None:
    for values, says in (
        (np.zeros((2, 11)), r"shape \(2, 11\), required finite ones of shape \(T, 12\)"),
        (np.full((2, 12), np.inf), "finite"),
    ):
        with pytest.raises(InputError, match=says):
            refine(refiner, values)
    for others in (fit_eigenlips(pictures(), 5), fit_eigenlips(pictures(height=8), 4)):
        with pytest.raises(InputError, match="make them with the same eigenlips"):
            Refiner(others, refiner.candidates)
    for options in ({"steadiness": -1.0}, {"steadiness": np.nan}, {"neighbours": 0}):
        with pytest.raises(InputError, match="required"):
            RefinementOptions(**options)  # type: ignore[arg-type]


def test_edges_become_steeper_in_lightness_alone() -> None:
    edge = np.zeros((2, 20, 20, 3), np.uint8)
    edge[:, :, :10], edge[:, :, 10:] = (60, 80, 100), (110, 130, 150)
    sharp = sharpen(edge, 0.5).astype(int)
    assert (sharp[:, :, 10] - sharp[:, :, 9] > 55).all()  # 50 before
    assert (np.ptp(sharp - edge, axis=3) <= 1).all()  # no colour gets more than another
    assert np.abs(sharp - edge)[:, :, [0, -1]].max() == 0
    assert sharpen(edge, 0) is edge


@pytest.fixture(scope="module")
def five() -> Eigenlips:
    return fit_eigenlips(pictures(), 5)


def test_each_colour_has_the_components_of_its_own(five: Eigenlips) -> None:
    assert (five.mean.shape, five.basis.shape, five.size) == ((3, 108), (3, 5, 108), (9, 12))
    for colour in range(3):
        values = pictures()[..., colour].reshape(40, -1).astype(float)
        mean, basis = components(values, 5)
        assert five.mean[colour] == pytest.approx(mean, rel=1e-6)
        assert five.basis[colour] == pytest.approx(basis, abs=1e-4)
        assert five.explained[colour] == pytest.approx(share(values, basis), rel=1e-5)


def test_coefficients_are_what_the_paper_says(five: Eigenlips) -> None:
    """Eq. 13, one picture and one component at a time; red first, then green, then blue."""
    images = pictures(1, 3)
    coefficients = five.project(images)
    assert (coefficients.shape, coefficients.dtype) == ((3, 15), np.float32)
    for t, colour, k in np.ndindex(3, 3, 5):
        left = images[t, :, :, colour].astype(float).ravel() - five.mean[colour]
        assert coefficients[t, 5 * colour + k] == pytest.approx(five.basis[colour, k] @ left, abs=1e-2)


def test_channels_say_colour_and_number(five: Eigenlips) -> None:
    names = [channel.name for channel in five.channels]
    assert (names[0], names[4], names[5], names[-1]) == ("lips_r_01", "lips_r_05", "lips_g_01", "lips_b_05")
    assert {channel.unit for channel in five.channels} == {"grey"}
    assert five.summary.startswith("15 of 12 × 9 px, 9")


def test_as_arrays_and_back_and_damaged_arrays(five: Eigenlips) -> None:
    whole, images = eigenlips_to_arrays(five), pictures(3)
    again = eigenlips_from_arrays(whole)
    assert np.array_equal(again.project(images), five.project(images))
    assert (again.size, again.explained.tolist()) == (five.size, five.explained.tolist())
    for what, array in whole.items():
        number = np.full_like(array, -1 if what == "size" else np.nan)
        for damaged in ({}, {what: array[:-1]}, {what: number}):
            others = {name: each for name, each in whole.items() if name != what}
            with pytest.raises(ModelFormatError, match=r"the eigenlips are damaged .*; train the model again"):
                eigenlips_from_arrays(others | damaged)


def test_what_cannot_be_learned_from() -> None:
    for images, count, message in (
        (pictures()[..., 0], 5, r"shape \(40, 9, 12\) and type uint8, required \(N, H, W, 3\)"),
        (pictures().astype(float), 5, "type float64"),
        (pictures()[:0], 5, r"shape \(0, 9, 12, 3\)"),
        (pictures()[:1], 5, "1 mouth pictures, all the same; required at least two that differ"),
        (pictures(), 0, "0 components asked for, required at least 1"),
    ):
        with pytest.raises(InputError, match=message):
            fit_eigenlips(images, count)


def test_other_pictures_than_those_learned(five: Eigenlips) -> None:
    with pytest.raises(InputError, match=r"shape \(40, 8, 12, 3\) .*required \(T, 9, 12, 3\), uint8; prepare"):
        five.project(pictures(height=8))
    with pytest.raises(InputError, match=r"coefficients of shape \(2, 14\), required \(T, 15\)"):
        five.restore(np.zeros((2, 14)))
    with pytest.raises(InputError, match="required"):
        replace(five, size=(12, 9)).project(pictures())
