"""Coupled chains by enumeration: every path of joint states, every component."""

from itertools import pairwise, product

import numpy as np

from oracles.joint import gaussian


def log_density(group, density, observations, frame):
    """Return the log density of a frame under one density of a group: of all its observed streams, weighted."""
    mixtures, terms = group.mixtures, []
    for component in range(mixtures.log_weights.shape[1]):
        total = float(mixtures.log_weights[density, component])
        for stream, columns, weight in zip(group.streams, group.columns, group.weights, strict=True):
            seen = observations.observed[stream]
            if seen is not None and not seen[frame]:
                continue
            mean = mixtures.means[density, component, columns].astype(float)
            variance = mixtures.variances[density, component, columns].astype(float)
            total += weight * gaussian(observations.streams[stream][frame], mean, variance)
        terms.append(total)
    return np.logaddexp.reduce(terms), np.array(terms)


def paths(chains, observations):
    """Give every possible path of joint states, with its log probability and the densities along it."""
    found = chains.transitions.product
    arcs = dict(
        zip(zip(found.arc_from.tolist(), found.arc_to.tolist(), strict=True), chains.transitions.arc_log, strict=True)
    )
    initial = found.initial
    emission = np.zeros((observations.frames, len(found.joint_states)))
    for frame, state in np.ndindex(emission.shape):
        for group in chains.groups:
            emission[frame, state] += log_density(group, group.tie[state], observations, frame)[0]

    def onward(path, score):
        if len(path) == observations.frames:
            yield path, score
            return
        for state in range(len(found.joint_states)):
            arc = arcs.get((path[-1], state))
            if arc is not None:
                yield from onward((*path, state), score + arc + emission[len(path), state])

    for state in np.flatnonzero(initial > 0).tolist():
        yield from onward((state,), np.log(initial[state]) + emission[0, state])


def posteriors(chains, observations):
    """Return posteriors of joint states [shape=(T, S)], expected arc counts by pair, and the log likelihood."""
    every = list(paths(chains, observations))
    scores = np.array([score for _, score in every])
    log_likelihood = np.logaddexp.reduce(scores)
    joint = np.zeros((observations.frames, len(chains.transitions.product.joint_states)))
    counts: dict[tuple[int, int], float] = {}
    for (path, _), weight in zip(every, np.exp(scores - log_likelihood), strict=True):
        joint[np.arange(len(path)), path] += weight
        for pair in pairwise(path):
            counts[pair] = counts.get(pair, 0.0) + weight
    return joint, counts, float(log_likelihood)


def component_statistics(chains, observations, number, stream):
    """Return Σ γ(q, k) Σ⁻¹ and Σ γ(q, k) Σ⁻¹ μ of a stream [each shape=(T, D)], term by term."""
    joint, _, _ = posteriors(chains, observations)
    group = chains.groups[number]
    columns = group.columns[group.streams.index(stream)]
    size = columns.stop - columns.start
    precision, weighted = np.zeros((observations.frames, size)), np.zeros((observations.frames, size))
    for frame, state in product(range(observations.frames), range(joint.shape[1])):
        density = group.tie[state]
        total, terms = log_density(group, density, observations, frame)
        for component, term in enumerate(terms):
            share = joint[frame, state] * np.exp(term - total)
            inverse = 1 / group.mixtures.variances[density, component, columns].astype(float)
            precision[frame] += share * inverse
            weighted[frame] += share * inverse * group.mixtures.means[density, component, columns]
    return precision, weighted
