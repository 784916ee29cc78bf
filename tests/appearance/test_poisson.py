import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion_faces.appearance import poisson
from lipmotion_faces.appearance.poisson import CLEARANCE, CloningSystem, GridFiller, build_cloning_system, nest_grids
from oracles.membranes import cloned

WIDTH, HEIGHT = 72, 56


def ellipse(height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    y, x = np.mgrid[:height, :width]
    return ((x + 0.5) / width - 0.5) ** 2 + ((y + 0.5) / height - 0.5) ** 2 < 0.23


def two_parts_and_a_hole() -> np.ndarray:
    mask = np.zeros((50, 70), bool)
    mask[4:40, 5:38] = True
    mask[15:20, 12:30] = False
    mask[20:46, 44:65] = True
    mask[10, 60] = True
    return mask


MASKS = {
    "ellipse": ellipse(),
    "large": ellipse(80, 100),
    "parts": two_parts_and_a_hole(),
    "one pixel": np.pad(np.ones((1, 1), bool), 3),
    "smallest picture": np.ones((3, 3), bool),
    "scattered": np.random.default_rng(3).random((30, 40)) < 0.6,
}


def correct(system: CloningSystem, source: np.ndarray, background: np.ndarray) -> np.ndarray:
    """Return what cloning adds to the source: the membrane in the region, else the background minus the source."""
    result = np.subtract(background, source, dtype=np.float32)
    for frames, membrane in system._solve_membranes(source, background):
        np.copyto(result[(frames, *system.box)], membrane, where=system.grids.region[..., None])
    return result


def noise(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


@pytest.mark.parametrize("name", MASKS)
def test_the_result_is_within_one_grey_level_of_the_printed_equation(name: str) -> None:
    system = build_cloning_system(MASKS[name])
    source, background = (noise((2, *system.mask.shape, 3), seed) for seed in (1, 2))
    result = system.clone(source, background)
    assert result.dtype == np.uint8
    for t in range(2):
        exact = np.clip(np.rint(cloned(system.mask, source[t], background[t])), 0, 255)
        assert np.abs(result[t] - exact).max() <= 1
        assert (result[t][~system.mask] == background[t][~system.mask]).all()


def test_constants_and_linear_functions_are_reproduced() -> None:
    """A difference on the edge that is linear in x and y has itself as its membrane, on every grid; none, none."""
    for name in ("ellipse", "scattered"):
        system = build_cloning_system(MASKS[name])
        height, width = system.mask.shape
        y, x = np.mgrid[:height, :width] / max(height, width)
        linear = np.stack([np.full_like(x, 40), 90 * x - 30 * y, 120 * y], axis=-1)[None]
        source = noise(linear.shape)
        np.testing.assert_allclose(
            correct(system, source.astype(float), source + linear), linear, rtol=0, atol=2e-3, equal_nan=False
        )
        assert (system.clone(source, source) == source).all()


def test_many_pictures_give_what_each_gives_alone() -> None:
    system = build_cloning_system(ellipse(20, 24))
    count = poisson.BATCH + 7
    source, background = (noise((count, 20, 24, 3), seed) for seed in (1, 2))
    together = correct(system, source, background)
    for t in (0, 31, poisson.BATCH - 1, poisson.BATCH, count - 1):
        alone = correct(system, source[t : t + 1], background[t : t + 1])[0]
        assert together[t] == pytest.approx(alone, abs=1e-2)


@settings(max_examples=12)
@given(seed=st.integers(0, 10**6), height=st.integers(3, 40), width=st.integers(3, 40), share=st.floats(0.1, 1))
def test_the_membrane_lies_between_its_edge_values(seed: int, height: int, width: int, share: float) -> None:
    """The maximum principle, up to the error of interpolation, and the printed equation, for masks of any kind."""
    draw = np.random.default_rng(seed)
    mask = draw.random((height, width)) < share
    mask[1, 1] = True
    system = build_cloning_system(mask)
    source, background = (draw.integers(0, 256, (1, height, width, 3), np.uint8) for _ in range(2))
    correction = correct(system, source, background)[0]
    exact = cloned(system.mask, source[0], background[0]) - source[0]
    assert np.abs(correction - exact).max() < 1
    outside = correction[~system.mask]
    assert (correction[system.mask] <= outside.max(axis=0) + 1).all()
    assert (correction[system.mask] >= outside.min(axis=0) - 1).all()


def test_pictures_that_do_not_fit_are_refused() -> None:
    system = build_cloning_system(MASKS["parts"])
    good = noise((2, 50, 70, 3))
    bad = good.astype(float)
    bad[1, 7, 7, 2] = np.nan
    for source, background, message in (
        (good[0], good, "source of shape"),
        (good, good[:, 1:], "background of shape"),
        (good[:1], good, "as many of each"),
        (good.astype(int), good, "source of type int64"),
        (good, bad, "not finite"),
    ):
        with pytest.raises(InputError, match=message):
            system.clone(source, background)


def test_other_than_a_mask_is_refused() -> None:
    frame = np.ones((6, 9), bool)
    frame[1:-1, 1:-1] = False
    y, x = np.mgrid[:100, :100]
    for mask, message in (
        (np.ones((5, 5)), r"required \(h, w\) and bool"),
        (np.ones((5, 5, 1), bool), r"required \(h, w\) and bool"),
        (frame, "none of these inside"),
        (np.ones((2, 30), bool), "none of these inside"),
        ((x + y) % 2 == 0, f"at most {poisson.LARGEST_EDGE}"),
    ):
        with pytest.raises(InputError, match=message):
            build_cloning_system(mask)  # type: ignore[arg-type]


@pytest.mark.parametrize("shape", [(57, 71), (130, 101), (5, 40), (3, 3)])
def test_filling_is_the_matrix(shape: tuple[int, int]) -> None:
    grids = nest_grids(np.pad(ellipse(*shape)[1:-1, 1:-1], 1))
    matrix = grids.build_matrix()
    for colours in (1, 3):
        filler = GridFiller(grids, 2, colours)
        for count in (2, 1):  # memory that was used before changes nothing
            values = np.random.default_rng(count).normal(size=(count, matrix.shape[1], colours)).astype(np.float32)
            filled = filler.fill(values)
            for t in range(count):
                expected = (matrix @ values[t]).reshape(*shape, colours)
                assert np.abs(filled[t] - expected)[grids.region].max() < 1e-5


def test_all_pixels_near_the_edge_are_nodes_and_few_inside() -> None:
    nodes = np.zeros((200, 200), bool)
    nodes.flat[np.concatenate(nest_grids(np.pad(np.ones((198, 198), bool), 1)).nodes)] = True
    assert nodes[1 : 1 + CLEARANCE, 1:-1].all()
    assert nodes[80:120, 80:120].mean() < 0.01
