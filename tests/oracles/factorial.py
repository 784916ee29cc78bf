"""Factorial hidden Markov models as one network of joint states, whose paths are enumerated."""

from itertools import product

import numpy as np

from oracles import paths


def steps(loop):
    """Give every transition of a loop: its states, the name and the position of its count, and its probability."""
    n, units = loop.stay.shape
    for state, unit in product(range(n), range(units)):
        here = state * units + unit
        yield here, here, "stay", (state, unit), loop.stay[state, unit]
        if state + 1 < n:
            yield here, here + units, "onward", (state, unit), loop.onward[state, unit]
        else:
            for other in range(units):
                yield here, other, "enter", (unit, other), loop.leave[unit] * loop.enter[unit, other]


def joint_arcs(audio, visual):
    """Return the probabilities of all arcs between joint states by source and target."""
    arcs, wide = {}, visual.stay.size
    for (a, b, *_, p), (c, d, *_, q) in product(steps(audio), steps(visual)):
        if p * q > 0:
            arcs[a * wide + c, b * wide + d] = arcs.get((a * wide + c, b * wide + d), 0.0) + p * q
    return arcs


def best_arcs(audio, visual):
    """Return the log probability of the best transition between joint states by source and target."""
    ways, wide = {}, visual.stay.size
    with np.errstate(divide="ignore"):
        moves = [[(a, b, float(np.log(p))) for a, b, *_, p in steps(loop)] for loop in (audio, visual)]
    for (a, b, p), (c, d, q) in product(*moves):
        arc = a * wide + c, b * wide + d
        ways[arc] = max(ways.get(arc, -np.inf), p + q)
    return ways


def joint_logs(audio, visual, logs):
    """Return log densities [shape=(T, Na·Nv)] and log probabilities of beginning and ending in joint states."""
    log_density = logs.audio[:, :, None].astype(float) + logs.visual[:, None, :]
    for position, (a, b) in enumerate(logs.pairs):
        log_density[:, a, b] = logs.pair[:, position]
    with np.errstate(divide="ignore"):
        ends = [np.log(np.outer(getattr(audio, end), getattr(visual, end))).ravel() for end in ("initial", "final")]
    return log_density.reshape(len(log_density), -1), *ends


def posteriors(audio, visual, logs):
    """Return joint posteriors [shape=(T, Na, Nv)], the counts of each loop by name, and the log likelihood."""
    log_density, initial, final = joint_logs(audio, visual, logs)
    arcs = joint_arcs(audio, visual)
    arc_logs = {arc: float(np.log(probability)) for arc, probability in arcs.items()}
    states = np.arange(log_density.shape[1])
    posterior, followed, log_likelihood = paths.posteriors(log_density, states, arc_logs, initial, final)
    counts = [
        {name: np.zeros_like(getattr(loop, name)) for name in ("stay", "onward", "enter")} for loop in (audio, visual)
    ]
    wide = visual.stay.size
    for (a, b, name, at, p), (c, d, other, where, q) in product(steps(audio), steps(visual)):
        if p * q > 0:
            arc = a * wide + c, b * wide + d
            share = followed[arc] * p * q / arcs[arc]
            counts[0][name][at] += share
            counts[1][other][where] += share
    return posterior.reshape(len(posterior), audio.stay.size, wide), counts, log_likelihood
