"""Random cases at which recursions that scale, floor or prune lose paths."""

from __future__ import annotations

import numpy as np

from kernels.networks import arrays_of
from lipmotion.kernels.factorial_loops import FactorialLogLikelihoods, Loop


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
