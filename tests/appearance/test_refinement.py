from itertools import product

import numpy as np
import pytest

from appearance.test_eigenlips import pictures
from lipmotion import Corpus
from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import Eigenlips, fit_eigenlips
from lipmotion.stats.pca import fit_pca
from lipmotion_faces.appearance.candidates import (
    PAPER,
    RefinementOptions,
    Refiner,
    best_sequence,
    choose_candidates,
    make_candidates,
    sharpen,
)

TRAINING, HELD_OUT = np.split(pictures(count=160), [120])


@pytest.fixture(scope="module")
def space() -> Eigenlips:
    return fit_eigenlips(TRAINING, 4)


@pytest.fixture(scope="module")
def refiner(space: Eigenlips) -> Refiner:
    return Refiner(space, make_candidates(space, TRAINING[::4]), PAPER)


def refine(refiner: Refiner, coefficients: np.ndarray) -> np.ndarray:
    return refiner.pictures(coefficients, refiner.choose(coefficients))


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
    low = [
        np.square(a[:, None] - b).sum(axis=2) for a, b in zip(np.split(wanted, 3, 1), candidates.by_colour, strict=True)
    ]
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


def test_parts_of_a_video_are_those_of_the_whole(space: Eigenlips, refiner: Refiner) -> None:
    wanted = space.project(HELD_OUT[:30])
    steady = Refiner(space, refiner.candidates)
    chosen, whole = steady.choose(wanted), refine(steady, wanted)
    parts = [steady.pictures(wanted[part], chosen[part]) for part in (slice(0, 11), slice(11, 30))]
    assert np.abs(np.concatenate(parts).astype(int) - whole).max() <= 1  # products of other sizes may round otherwise


def test_a_change_is_worth_its_cost() -> None:
    costs = np.array([[[0.0, 5.0], [3.0, 0.0], [0.0, 5.0]]], np.float32)
    numbers = np.tile([0, 1], (1, 3, 1))
    change = np.array([[[0.0, 1.0], [1.0, 0.0]]], np.float32)
    assert best_sequence(costs, numbers, change).tolist() == [[0, 1, 0]]
    assert best_sequence(costs, numbers, 2 * change).tolist() == [[0, 0, 0]]


def test_the_mouths_of_a_corpus_become_sharper(toy_corpus: Corpus) -> None:
    crops = {split: mouths(toy_corpus, split) for split in ("train", "val")}
    space = fit_eigenlips(crops["train"][::4], 2)
    known = space.project(crops["train"])
    refiner = Refiner(space, make_candidates(space, crops["train"][choose_candidates(known, 100)]))
    wanted = space.project(crops["val"])
    true, blurred, refined = map(edges, (crops["val"], space.restore(wanted), refine(refiner, wanted)))
    assert blurred < 0.97 * true
    assert abs(refined - true) < 0.5 * (true - blurred)


def mouths(corpus: Corpus, split: str) -> np.ndarray:
    """The mouth pictures of all utterances of a split."""
    tracks = [corpus.utterance(name).track for name in corpus.names(split)]
    return np.concatenate([track.crops for track in tracks if track.crops is not None])


def edges(images: np.ndarray) -> float:
    """The energy of the gradient."""
    return float(sum(np.square(np.diff(images.astype(float), axis=axis)).mean() for axis in (1, 2)))


def test_short_videos_and_far_coefficients(space: Eigenlips, refiner: Refiner) -> None:
    for options in (PAPER, RefinementOptions()):
        for count in (0, 1, 2):
            result = refine(Refiner(space, refiner.candidates, options), space.project(HELD_OUT[:2])[:count])
            assert (result.shape, result.dtype) == ((count, 9, 12, 3), np.uint8)
    assert {0, 255} <= set(np.unique(refine(refiner, np.array([[1e5] * 12, [-1e5] * 12]))))


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
    sharp = sharpen(edge, 0.5, 1).astype(int)
    assert (sharp[:, :, 10] - sharp[:, :, 9] > 55).all()  # 50 before
    assert (np.ptp(sharp - edge, axis=3) <= 1).all()  # no colour gets more than another
    assert np.abs(sharp - edge)[:, :, [0, -1]].max() == 0
    assert np.abs(sharpen(edge, 0.5, 2).astype(int) - edge)[:, :, 6].max() > np.abs(sharp - edge)[:, :, 6].max()
    assert sharpen(edge, 0, 1) is edge
    lips = np.repeat(np.repeat(edge[:, :1], 56, axis=1), 3, axis=2)
    gained = np.abs(sharpen(lips, 0.5, 1).astype(int) - lips).max(axis=(0, 2, 3))
    assert gained[28] > 1.2 * gained[0]  # the lips are in the middle
