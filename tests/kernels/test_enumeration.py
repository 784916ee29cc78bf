"""Recursions over state paths against the enumeration of all paths, in random cases at which scaling loses paths.

Posteriors may be off by 1e-9 + 1e-14 times the spread of log densities, log likelihoods by as much and 1e-14 of
themselves, counts by one such tolerance for every frame; in single precision by 5e-4, and 1e-6 of themselves. The log
probability of a best path may be lower than that of the best of all by the rounding of single precision.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from kernels.networks import arrays_of
from lipmotion.kernels import factorial, forward_backward
from lipmotion.kernels.factorial_loops import FactorialLogLikelihoods, Loop, find_factorial_path
from lipmotion.kernels.network import ForwardBackwardNetwork
from lipmotion.kernels.paths import NetworkArrays, Windows, best_path
from oracles import factorial as factorial_oracle
from oracles import paths


def log_densities(draw, frames, columns, spread):
    """Return log densities [shape=(T, G)]: normal, of two or three levels with ties, or with states that take turns.

    Where they take turns, a state that is best over all frames may be the worst both at first and at last.
    Of every third case, some are -inf.
    """
    kind = draw.integers(3)
    if kind == 0:
        values = draw.normal(0, spread, (frames, columns))
    elif kind == 1:
        values = -spread * draw.integers(0, 3, (frames, columns)).astype(float)
    else:
        turns = np.repeat(draw.integers(0, 2, (3, columns)), -(-frames // 3), axis=0)[:frames]
        values = -spread * turns * draw.uniform(0.3, 3, (1, columns)) + draw.normal(0, 1, (frames, columns))
    if draw.integers(3) == 0:
        values[draw.random(values.shape) < 0.15] = -np.inf
    return values


def log_probabilities(draw, shape, extreme):
    """Return logarithms about -2; extreme: down to -1000, and some of them -inf."""
    if not extreme:
        return draw.normal(-2, 1, shape)
    return np.where(draw.random(shape) < 0.1, -np.inf, -(10.0 ** draw.uniform(-2, 3, shape)))


def network(draw, states, extreme, some=None):
    """Return a network whose states all have a loop, as arrays without ``emission``, and its arcs.

    some : whether there is an arc from each state to each [shape=(S, S)]; None: of all, of some, or no others
    """
    logs = log_probabilities(draw, (states, states), extreme)
    if some is None:
        some = draw.random((states, states)) < draw.choice([0.0, 0.4, 1.0])
    kept = some | np.eye(states, dtype=bool)
    arcs = {(int(a), int(b)): logs[a, b] for b in range(states) for a in range(states) if kept[a, b]}
    arrays = arrays_of(arcs, states)
    arrays["arc_log"] = np.array([arcs[arc] for arc in sorted(arcs, key=lambda arc: arc[1])])
    for name in ("log_initial", "log_final"):
        arrays[name] = np.where(draw.random(states) < 0.2, -np.inf, log_probabilities(draw, states, extreme))
    return arrays, arcs


def network_with_block(draw, extreme):
    """Return a network in which eight states lead to eight others, and some of these back."""
    some = np.zeros((16, 16), bool)
    some[:8, 8:] = True
    some[range(8, 16), range(8)] = draw.random(8) < 0.5
    return network(draw, 16, extreme, some)


def loop(draw, states, units, extreme):
    """Return a loop; extreme: with probabilities down to 1e-70, and some of them 0."""

    def some(*shape):
        values = 10.0 ** -draw.choice([0.3, 5.0, 40.0, 70.0], shape) if extreme else draw.uniform(0.1, 0.9, shape)
        return np.where(draw.random(shape) < (0.15 if extreme else 0.0), 0.0, values)

    return Loop(
        some(states, units), some(states - 1, units), some(units), some(units, units), some(states, units),
        some(states, units),
    )  # fmt: skip


def factorial_model(draw, frames, spread, extreme, shapes=((2, 2), (2, 1))):
    """Return two loops and log densities, of which up to three pairs have their own."""
    audio, visual = (loop(draw, *shape, extreme) for shape in shapes)
    sizes = audio.stay.size, visual.stay.size
    pairs = draw.choice(sizes[0] * sizes[1], size=draw.integers(4), replace=False)
    logs = (log_densities(draw, frames, size, spread) for size in (*sizes, len(pairs)))
    return audio, visual, FactorialLogLikelihoods(*logs, np.stack(np.unravel_index(pairs, sizes), axis=1))


def chain(draw, frames, states, spread, extreme):
    """Return finite log densities [shape=(T, S)], and log probabilities of staying and of moving on [shape=(S,)]."""
    log_emission = log_densities(draw, frames, states, spread)
    log_emission[np.isneginf(log_emission)] = -10 * spread
    stay, move = log_probabilities(draw, (2, states), extreme)
    return log_emission, stay, move


def test_two_loops_without_a_path_have_probability_0():
    draw = np.random.default_rng(7)
    audio, visual, logs = factorial_model(draw, 5, 30.0, False)
    logs.visual[3] = logs.pair[3] = -np.inf
    found = factorial.infer_factorial(audio, visual, logs)
    assert found.log_likelihood == find_factorial_path(audio, visual, logs)[2] == -np.inf
    assert not any(part.any() for part in (*found[:2], *found.audio_counts, *found.visual_counts))


SPREADS = (30.0, 100.0, 300.0, 1e3, 1e4, 1e5)


def near(found, wanted, spread, single=False, times=1):
    """Return whether numbers agree."""
    found, wanted = np.asarray(found, float), np.asarray(wanted, float)
    infinite = np.isneginf(wanted)
    if not np.array_equal(np.isneginf(found), infinite):
        return False
    absolute, relative = (5e-4, 1e-6) if single else (1e-9 + 1e-14 * spread, 1e-14)
    off = np.abs(found[~infinite] - wanted[~infinite])
    return bool((off <= times * absolute + relative * np.abs(wanted[~infinite])).all())


def of_network(draw, spread, extreme, kind=np.float64, chains_of=1, block=False):
    """Forward–backward of a network; densities are products of one or more chains'."""
    frames = int(draw.integers(1, 4 if block else 6))
    states = 16 if block else int(draw.integers(1, 5))
    arrays, arcs = network_with_block(draw, extreme) if block else network(draw, states, extreme)
    prepared = ForwardBackwardNetwork.of(arrays["arc_from"], arrays["arc_start"])
    sizes = draw.integers(1, 17 if block else 4, chains_of)
    logs = [log_densities(draw, frames, size, spread).astype(kind) for size in sizes]
    columns = [draw.integers(size, size=states) for size in sizes]
    order, place = prepared.layout.order, prepared.layout.place
    starts = arrays["arc_log"], arrays["log_initial"]
    found = prepared.posteriors(*starts, logs, [column[order] for column in columns])
    joint = sum(log.astype(np.longdouble)[:, column] for log, column in zip(logs, columns, strict=True))
    ends = arrays["log_initial"], np.zeros(states)
    posterior, counts, log_likelihood = paths.posteriors(joint, np.arange(states), arcs, *ends)
    ordered = [counts[arc] for arc in sorted(arcs, key=lambda arc: arc[1])]
    single = kind is np.float32
    return (
        near(found.posterior[:, place], posterior, spread, single)
        and near(found.counts, ordered, spread, single, frames)
        and near(found.log_likelihood, log_likelihood, spread, single)
    )


def of_factorial(draw, spread, extreme, kind=np.float64, sparse=False):
    """Forward–backward of two loops; sparse: few of whose joint states are possible."""
    frames = int(draw.integers(1, 5))
    audio, visual, logs = factorial_model(draw, frames, spread, extreme)
    if sparse:
        logs.audio[draw.random(logs.audio.shape) < 0.7] = logs.visual[draw.random(logs.visual.shape) < 0.4] = -np.inf
    logs = logs._replace(**{name: getattr(logs, name).astype(kind) for name in ("audio", "visual", "pair")})
    found = factorial.infer_factorial(audio, visual, logs, stretch=int(draw.integers(1, 5)))
    joint, counts, log_likelihood = factorial_oracle.posteriors(audio, visual, logs)
    single = kind is np.float32
    right = near(found.log_likelihood, log_likelihood, spread, single)
    right &= near(found.audio, joint.sum(axis=2), spread, single)
    right &= near(found.visual, joint.sum(axis=1), spread, single)
    right &= near(found.pair, joint[:, logs.pairs[:, 0], logs.pairs[:, 1]], spread, single)
    for mine, wanted in zip((found.audio_counts, found.visual_counts), counts, strict=True):
        right &= all(near(getattr(mine, name), wanted[name], spread, single, frames) for name in wanted)
    return bool(right)


def of_factorial_path(draw, spread, extreme):
    """The best path of two loops."""
    frames = int(draw.integers(1, 4))
    audio, visual, logs = factorial_model(draw, frames, spread, extreme)
    one, other, score = find_factorial_path(audio, visual, logs, stretch=int(draw.integers(1, 4)))
    log_density, *ends = factorial_oracle.joint_logs(audio, visual, logs)
    ways = factorial_oracle.best_arcs(audio, visual)
    states = np.arange(log_density.shape[1])
    _, best = paths.best_path(log_density, states, ways, *ends)
    path = one * visual.stay.size + other
    return near(score, best, spread) and (
        np.isneginf(best) or near(paths.path_score(path, log_density, states, ways, *ends), best, spread)
    )


def of_chains(draw, spread, extreme):
    """Forward–backward of chains without skips, two of them padded to one size."""
    sizes = [(int(draw.integers(1, 7)), int(draw.integers(1, 5))) for _ in range(2)]
    alone = [chain(draw, *size, spread, extreme) for size in sizes]
    frames, states = np.array(sizes).T.copy()
    log_emission = np.full((frames.max(), 2, states.max()), draw.choice([0.0, 50.0, -1e4, 1e4]))
    stay, move = np.zeros((2, 2, states.max()))
    for u, (emission, *moves) in enumerate(alone):
        log_emission[: frames[u], u, : states[u]] = emission
        stay[u, : states[u]], move[u, : states[u]] = moves
    posterior, kept, log_likelihood = forward_backward.chain_posteriors(log_emission, stay, move, frames, states)
    right = True
    for u, case in enumerate(alone):
        wanted, wanted_kept, wanted_log_likelihood = paths.chain_posteriors(*case)
        found = log_likelihood[u] if log_likelihood[u] > forward_backward.LOG_ZERO / 2 else -np.inf
        right &= near(found, wanted_log_likelihood, spread)
        right &= near(posterior[: frames[u], u, : states[u]], wanted, spread)
        right &= near(kept[u, : states[u]], wanted_kept, spread, times=int(frames[u]))
        padded = posterior[frames[u] :, u], posterior[:, u, states[u] :], kept[u, states[u] :]
        right &= not any(part.any() for part in padded)
    return bool(right)


def of_path(draw, spread, extreme, windowed=False):
    """The best path through a network, which is searched in single precision."""
    frames, states = int(draw.integers(1, 6)), int(draw.integers(1, 5))
    arrays, arcs = network(draw, states, extreme)
    arrays = {n: a.astype(np.float32) if a.dtype == float else a for n, a in arrays.items()}
    columns, log_emission = draw.integers(3, size=states), log_densities(draw, frames, 3, spread)
    log_emission = log_emission.astype(np.float32)
    given = NetworkArrays(emission=columns, **arrays)
    of_states = log_emission[:, columns].astype(float)
    if windowed:
        first, end = np.sort(draw.integers(0, frames, states)), np.sort(draw.integers(1, frames + 1, states))
        windows = Windows(first, end)
        block = int(draw.integers(1, 5))
        path, score = best_path(lambda a, b: log_emission[a:b], frames, given, windows=windows, block_frames=block)
        moments = np.arange(frames)[:, None]
        of_states[(moments < first) | (moments >= end)] = -np.inf
    else:
        path, score = best_path(lambda a, b: log_emission[a:b], frames, given)
    single = {arc: float(np.float32(log)) for arc, log in arcs.items()}
    ends = arrays["log_initial"].astype(float), arrays["log_final"].astype(float)
    _, best = paths.best_path(of_states, np.arange(states), single, *ends)
    if np.isneginf(best):
        return score == -np.inf
    own = paths.path_score(path, of_states, np.arange(states), single, *ends)
    finite = [abs(part[np.isfinite(part)]).max(initial=1) for part in (of_states, arrays["arc_log"], *ends)]
    rounding = 4 * frames**2 * sum(finite) * np.finfo(np.float32).eps
    return bool(abs(own - best) <= rounding and abs(score - best) <= rounding)


RECURSIONS: dict[str, Callable[..., bool]] = {
    "network, double": of_network,
    "network, single": lambda *case: of_network(*case, np.float32),
    "products of 2 chains, double": lambda *case: of_network(*case, np.float64, 2),
    "products of 2 chains, single": lambda *case: of_network(*case, np.float32, 2),
    "network with a block, double": lambda *case: of_network(*case, block=True),
    "network with a block, single": lambda *case: of_network(*case, np.float32, block=True),
    "factorial, double": of_factorial,
    "factorial, single": lambda *case: of_factorial(*case, np.float32),
    "factorial, sparse": lambda *case: of_factorial(*case, sparse=True),
    "factorial, best path": of_factorial_path,
    "chains": of_chains,
    "best path": of_path,
    "best path in windows": lambda *case: of_path(*case, True),
}


def is_right(name: str, spread: float, number: int) -> bool:
    """Return whether a recursion is right in one case; every other one is extreme."""
    draw = np.random.default_rng([number, int(spread), *name.encode()])
    with np.errstate(divide="ignore", invalid="ignore"):
        return RECURSIONS[name](draw, spread, number % 2 == 1)


ONCE_WRONG = json.loads(Path(__file__).with_name("once_wrong.json").read_text(encoding="utf-8"))
"""Spreads and numbers of cases in which probabilities counted that compiled forms once set to 0, or raised."""


def wrong_cases(name: str) -> list[tuple[float, int]]:
    cases = [(spread, number) for spread in SPREADS for number in range(4)] + ONCE_WRONG.get(name, [])
    return [case for case in cases if not is_right(name, *case)]


@pytest.mark.parametrize("name", [name for name in RECURSIONS if not name.startswith("best path")])
def test_no_recursion_loses_a_path_however_far_densities_and_probabilities_spread(name):
    assert wrong_cases(name) == []


@pytest.mark.usefixtures("form")
@pytest.mark.parametrize("name", ["best path", "best path in windows"])
def test_no_search_loses_the_best_path_however_far_densities_and_probabilities_spread(name):
    assert wrong_cases(name) == []
