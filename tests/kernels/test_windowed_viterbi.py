from __future__ import annotations

import numpy as np
import pytest

from kernels.networks import random_network
from lipmotion.kernels.sequences import viterbi, windowed_viterbi
from lipmotion.kernels.sequences.arcs import NetworkArrays
from lipmotion.kernels.sequences.windowed_viterbi import Windows, best_path_within
from oracles import paths


@pytest.fixture(params=["numpy", "compiled"], autouse=True)
def form(request, monkeypatch) -> None:
    """Every test runs with both forms, NumPy and compiled."""
    if request.param == "compiled":
        pytest.importorskip("numba")
    monkeypatch.setattr(windowed_viterbi, "compiled_pays", lambda _: request.param == "compiled")


@pytest.fixture(params=[1, 3, 512])
def block(request, monkeypatch) -> int:
    monkeypatch.setattr(windowed_viterbi, "BLOCK", request.param)
    return request.param


def random_emission(seed: int, frames: int, densities: int) -> np.ndarray:
    return np.random.default_rng([seed, 1]).normal(-20, 4, (frames, densities)).astype(np.float32)


def random_windows(seed: int, states: int, frames: int) -> Windows:
    draw = np.random.default_rng([seed, 2])
    first = np.sort(draw.integers(0, max(frames // 2, 1), states))
    return Windows(first, np.sort(draw.integers(0, frames + 2, states)))


@pytest.mark.usefixtures("block")
def test_agrees_with_the_enumeration_of_all_paths_in_the_windows():
    possible = 0
    for frames in range(1, 6):
        for seed in range(8):
            arrays, arcs = random_network(seed, states=4, densities=3, density_of_arcs=0.6)
            windows = random_windows(seed, 4, frames)
            log_emission = random_emission(seed, frames, 3)
            path, score = best_path_within(
                lambda first, end, values=log_emission: values[first:end], frames, NetworkArrays(**arrays), windows
            )
            moments = np.arange(frames)[:, None]
            inside = (moments >= windows.first) & (moments < windows.end)
            of_states = np.where(inside, log_emission[:, arrays["emission"]], -np.inf)
            ends = arrays["log_initial"], arrays["log_final"]
            wanted, best = paths.best_path(of_states, np.arange(4), arcs, *ends)
            if np.isinf(best):
                assert score == -np.inf
            else:
                possible += 1
                assert tuple(path) == wanted
                assert score == pytest.approx(best, abs=1e-3)
    assert possible > 15


def chain(states: int) -> NetworkArrays:
    """Return a chain of states; paths lead from the first to the last."""
    nowhere = np.full(states, -np.inf, np.float32)
    first, last = nowhere.copy(), nowhere.copy()
    first[0] = last[-1] = 0
    sources = [source for target in range(states) for source in (target - 1, target) if source >= 0]
    return NetworkArrays(
        np.arange(states) % 7,
        np.array(sources, np.intp),
        np.full(len(sources), -0.5, np.float32),
        np.array([0, *range(1, 2 * states - 1, 2)], np.intp),
        first,
        last,
    )


def test_wide_windows_change_nothing_and_narrow_ones_are_kept(monkeypatch):
    monkeypatch.setattr(windowed_viterbi, "BLOCK", 37)
    states, frames = 60, 900
    log_emission = random_emission(3, frames, 7)
    asked = lambda first, end: log_emission[first:end]  # noqa: E731
    everywhere = Windows(np.zeros(states, np.intp), np.full(states, frames))
    free, score = viterbi.best_path(asked, frames, chain(states))
    path, same = best_path_within(asked, frames, chain(states), everywhere)
    assert np.array_equal(path, free)
    assert same == pytest.approx(score, abs=0.1)
    middles = np.linspace(0, frames, states).astype(np.intp)
    windows = Windows(np.maximum(middles - 40, 0), np.minimum(middles + 40, frames))
    path, less = best_path_within(asked, frames, chain(states), windows)
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
    path, score = best_path_within(log_emission, frames, chain(states), windows)
    assert np.isfinite(score)
    assert (path[0], path[-1]) == (0, states - 1)
    assert max(seen) <= windowed_viterbi.BLOCK + 1
    assert sum(seen) <= 2.1 * frames


def test_windows_without_room_have_no_path():
    asked = lambda first, end: random_emission(0, 1000, 7)[first:end]  # noqa: E731
    gap = Windows(np.array([0, 600, 700]), np.array([100, 1000, 1000]))
    assert best_path_within(asked, 1000, chain(3), gap)[1] == -np.inf
