"""Networks for the tests of kernels."""

import numpy as np

from lipmotion.kernels.network import ForwardBackwardNetwork


def network_posteriors(log_emission, emission, arc_from, arc_log, arc_start, log_initial, **_):
    """Return posteriors [shape=(T, S)], expected arc counts [shape=(E,)] and log likelihood of one recording.

    log_emission : [shape=(T, G)];  the rest as in ``lipmotion.kernels.paths.NetworkArrays``
    """
    network = ForwardBackwardNetwork.of(arc_from, arc_start)
    order, place = network.layout.order, network.layout.place
    found = network.posteriors(arc_log, log_initial, [log_emission], [emission[order]])
    return found.posterior[:, place], found.counts, found.log_likelihood


def arrays_of(arcs: dict, states: int) -> dict:
    """Return arcs, given as log probabilities by (source, target), as arrays for the kernels."""
    ordered = sorted(arcs, key=lambda arc: arc[1])
    return {
        "arc_from": np.array([source for source, _ in ordered], np.intp),
        "arc_log": np.array([arcs[arc] for arc in ordered], np.float32),
        "arc_start": np.searchsorted([target for _, target in ordered], np.arange(states)).astype(np.intp),
    }


def random_network(seed: int, states: int, densities: int, density_of_arcs: float):
    """Return a network with loops and random arcs as arrays, and its arcs by (source, target)."""
    draw = np.random.default_rng(seed)
    arcs = {}
    for target in range(states):
        for source in range(states):
            if source == target or draw.random() < density_of_arcs:
                arcs[source, target] = np.float32(draw.normal(-2, 1))
    some = draw.random((2, states)) < 0.6
    initial, final = np.where(some, draw.normal(-1, 1, (2, states)), -np.inf).astype(np.float32)
    ends = {"log_initial": initial, "log_final": final}
    return {"emission": draw.integers(densities, size=states), **arrays_of(arcs, states), **ends}, arcs


def phone_loop(seed: int, units: int = 11, states: int = 3):
    """Return a loop in which every unit may follow every other, which has blocks.

    Its last unit has one state, and only two arcs lead to it.
    """
    draw = np.random.default_rng(seed)
    counts = [states] * (units - 1) + [1]
    firsts = np.append(0, np.cumsum(counts))
    total = int(firsts[-1])
    arcs = {(s, s): np.float32(np.log(0.7)) for s in range(total)}
    for unit in range(units):
        for s in range(firsts[unit], firsts[unit + 1] - 1):
            arcs[s, s + 1] = np.float32(np.log(0.3))
        for other in range(units):
            if counts[other] > 1:
                arcs[int(firsts[unit + 1]) - 1, int(firsts[other])] = np.float32(draw.normal(-3, 1))
    arcs[0, total - 1] = np.float32(-2)
    ends = {"log_initial": np.full(total, -3, np.float32), "log_final": np.zeros(total, np.float32)}
    return {"emission": draw.permutation(total), **arrays_of(arcs, total), **ends}, arcs
