"""Multi-stream models: densities term by term, recognition and posteriors by enumeration."""

import numpy as np

from oracles.sequences import price, segmentations


def gaussian(x, mean, variance) -> float:
    return float((-0.5 * (np.log(2 * np.pi * variance) + (x - mean) ** 2 / variance)).sum())


def mixture(x, weights, means, variances) -> float:
    return float(
        np.logaddexp.reduce([w + gaussian(x, m, v) for w, m, v in zip(weights, means, variances, strict=True)])
    )


def stream_density(model, leaf, value, known) -> float:
    """Return the log density of one frame of one stream, in the units it was observed in."""
    mixtures, voiced = model.tied.mixtures, model.tied.voiced
    if not known:
        return 0.0 if voiced is None else float(np.log(1 - voiced[leaf]))
    means = mixtures.means[leaf] * model.scale.deviation + model.scale.mean
    found = mixture(value, mixtures.log_weights[leaf], means, mixtures.variances[leaf] * model.scale.deviation**2)
    return found if voiced is None else found + float(np.log(voiced[leaf]))


def log_density(hmm, observed, state, frame, weights) -> float:
    """Return the weighted sum of all streams' log densities of a state in its context."""
    total = 0.0
    for name, weight in vars(weights).items():
        if weight and name in hmm.models and name in observed.streams:
            stream, model = observed.streams[name], hmm.models[name]
            leaf = model.forest.leaf(state)
            total += weight * stream_density(model, leaf, stream.values[frame], stream.known[frame])
    return total


def score(hmm, densities, units, lengths) -> float:
    """Return the log probability of units whose states last so many frames, with the scores of recognition.

    densities : of a state and a frame
    """
    silence, inventory = hmm.inventory.silence, hmm.inventory
    total = price(hmm, units, silence)
    frame, lasting = 0, iter(lengths)
    neighbours = (silence, *units, silence)
    for position, unit in enumerate(units):
        for state in range(inventory.count(unit)):
            triphone, length = ((neighbours[position], unit, neighbours[position + 2]), state), next(lasting)
            total += sum(densities(triphone, t) for t in range(frame, frame + length))
            stay = hmm.log_stay[inventory.monophones[unit, state]]
            total += (length - 1) * stay + np.log(1 - np.exp(stay))
            frame += length
    return float(total)


def everything(hmm, densities, frames, candidates):
    """Give score, units and durations of every possible unit sequence."""
    for units in candidates:
        for lengths in segmentations(frames, sum(hmm.inventory.count(unit) for unit in units)):
            yield score(hmm, densities, units, lengths), units, lengths
