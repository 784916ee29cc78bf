import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernels.conftest import load_numba
from kernels.networks import phone_loop, random_network
from lipmotion.kernels import paths
from lipmotion.kernels.paths import NetworkArrays, Windows
from oracles import paths as oracle


def random_emission(seed: int, frames: int, densities: int) -> np.ndarray:
    return np.random.default_rng([seed, 1]).normal(-20, 4, (frames, densities)).astype(np.float32)


def log_emission_of(log_emission: np.ndarray):
    """Return the function of log densities that the kernel takes, and the number of frames."""
    return lambda first, end: log_emission[first:end], len(log_emission)


pytestmark = pytest.mark.usefixtures("form")


@given(seed=st.integers(0, 2**32 - 1), frames=st.integers(1, 80), block=st.integers(1, 90))
@settings(max_examples=25)
def test_blocks_change_nothing(seed, frames, block):
    arrays, arcs = random_network(seed, states=7, densities=4, density_of_arcs=0.3)
    log_emission = random_emission(seed, frames, 4)
    whole, score = paths.best_path(*log_emission_of(log_emission), NetworkArrays(**arrays))
    path, in_blocks = paths.best_path(*log_emission_of(log_emission), NetworkArrays(**arrays), block_frames=block)
    assert np.array_equal(path, whole)
    assert in_blocks == pytest.approx(score, abs=1e-3)
    if np.isfinite(score):  # and the score is that of the path
        ends = arrays["log_initial"], arrays["log_final"]
        own = oracle.path_score(tuple(path), log_emission, arrays["emission"], arcs, *ends)
        assert score == pytest.approx(own, abs=1e-2)


def left_to_right(states: int, densities: int = 8) -> dict:
    """Return a chain of states, with paths from the first to the last."""
    nowhere = np.full(states, -np.inf, np.float32)
    first, last = nowhere.copy(), nowhere.copy()
    first[0] = last[-1] = 0
    sources = [source for target in range(states) for source in (target - 1, target) if source >= 0]
    return {
        "emission": np.arange(states) % densities,
        "arc_from": np.array(sources, np.intp),
        "arc_log": np.full(len(sources), -0.5, np.float32),
        "arc_start": np.array([0, *range(1, 2 * states - 1, 2)], np.intp),
        "log_initial": first,
        "log_final": last,
    }


@pytest.mark.parametrize("block", [1, 3, None])
def test_a_network_longer_than_the_recording_is_impossible_and_one_as_long_has_one_path(block):
    chain = NetworkArrays(**left_to_right(8))
    for frames in [1, 2, 3, 4, 6, 7]:
        _, score = paths.best_path(*log_emission_of(np.zeros((frames, 8), np.float32)), chain, block_frames=block)
        assert score == -np.inf
    path, score = paths.best_path(*log_emission_of(np.zeros((8, 8), np.float32)), chain, block_frames=block)
    assert path.tolist() == list(range(8))
    assert score == pytest.approx(-3.5)
    gap = Windows(np.array([0, 600, 700]), np.array([100, 1000, 1000]))  # windows without room
    three, log_emission = NetworkArrays(**left_to_right(3, 7)), random_emission(0, 1000, 7)
    assert paths.best_path(*log_emission_of(log_emission), three, windows=gap, block_frames=block)[1] == -np.inf


def test_hours_lose_no_precision():
    chain = left_to_right(2)
    log_emission = np.full((30_000, 2), -80.0, np.float32)
    log_emission[:17_000, 0] += 0.25
    log_emission[17_000:, 1] += 0.25
    path, score = paths.best_path(*log_emission_of(log_emission), NetworkArrays(**chain), block_frames=2048)
    assert path.argmax() == 17_000
    assert score == pytest.approx(30_000 * -79.75 - 29_999 * 0.5, rel=1e-6)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("is_tied", [False, True])
def test_both_forms_find_the_same_to_the_bit_and_break_ties_alike(seed, is_tied, monkeypatch):
    is_loop = is_tied or seed % 2
    arrays, _ = phone_loop(seed) if is_loop else random_network(seed, states=9, densities=4, density_of_arcs=0.4)
    log_emission = random_emission(seed, 90, len(arrays["emission"]))
    if is_tied:
        arrays["arc_log"], log_emission = np.round(arrays["arc_log"]), np.round(log_emission / 4)
    found = []
    for compiled in (False, True):
        load_numba(monkeypatch, compiled)
        found.append(paths.best_path(*log_emission_of(log_emission), NetworkArrays(**arrays)))
    (plain, score), (fast, same_score) = found
    assert score == same_score
    assert np.isfinite(score)
    assert np.array_equal(plain, fast)


def test_wide_windows_change_nothing_and_narrow_ones_are_kept():
    states, frames = 60, 900
    log_emission, chain = random_emission(3, frames, 7), NetworkArrays(**left_to_right(states, 7))
    everywhere = Windows(np.zeros(states, np.intp), np.full(states, frames))
    free, score = paths.best_path(*log_emission_of(log_emission), chain)
    path, same = paths.best_path(*log_emission_of(log_emission), chain, everywhere, 37)
    assert np.array_equal(path, free)
    assert same == pytest.approx(score, abs=0.1)
    middles = np.linspace(0, frames, states).astype(np.intp)
    windows = Windows(np.maximum(middles - 40, 0), np.minimum(middles + 40, frames))
    path, less = paths.best_path(*log_emission_of(log_emission), chain, windows, 37)
    assert less <= score + 0.1
    assert np.all(windows.first[path] <= np.arange(frames))
    assert np.all(np.arange(frames) < windows.end[path])
    assert set(np.diff(path)) <= {0, 1}


def test_what_is_in_memory_does_not_grow_with_the_recording():
    states, frames = 600, 6_000
    seen: list[int] = []

    def log_emission(first: int, end: int) -> np.ndarray:
        seen.append(end - first)
        return random_emission(first, end - first, 7)

    middles = np.linspace(0, frames, states).astype(np.intp)
    windows = Windows(np.maximum(middles - 60, 0), np.minimum(middles + 60, frames))
    path, score = paths.best_path(log_emission, frames, NetworkArrays(**left_to_right(states, 7)), windows)
    assert np.isfinite(score)
    assert (path[0], path[-1]) == (0, states - 1)
    assert max(seen) <= paths.WINDOW_BLOCK + 1
    assert sum(seen) <= 2.1 * frames
