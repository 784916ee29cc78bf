"""What stands behind a frame, in words and in the channels' own units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Single, component_posteriors
from lipmotion.engines.coupled.chains.lattice import Posteriors
from lipmotion.engines.coupled.chains.model import Chains, Inferred
from lipmotion.engines.coupled.chains.product import Product
from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.engines.coupled.chains.visual_streams import VisualStream
from lipmotion.engines.coupled.conversion.em import group_of
from lipmotion.engines.coupled.conversion.regression import gates
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.types import (
    ChainPosteriors,
    ChainStates,
    ChannelValue,
    DominantGaussian,
    Explanation,
    NamedProbability,
    RegressedMean,
)
from lipmotion.units import VISEME_OF

Array = NDArray[np.float64]
MOST_STATES = 3
"""States of a chain that are named."""
REST = "rest"
"""What the mean comes from in silence away from speech."""
LEAST = 0.005
"""What is less probable is not named."""


def explained(
    frames: Sequence[Explanation], model: CoupledModel, inferred: Inferred, rows: Sequence[int]
) -> list[Explanation]:
    """Return explanations of frames with what the chains know of them.

    rows : the frames among those of ``inferred``
    What no path of the chains leads through stays as it is.
    """
    if not np.isfinite(inferred.posteriors.log_likelihood):
        return list(frames)
    streams = range(len(model.chains.streams))
    return [
        replace(
            frame,
            chains=chain_states(model.chains, inferred.posteriors, row),
            joint=joint_state(model.chains, inferred.posteriors, row),
            gaussians=tuple(_gaussian(model, inferred, row, stream) for stream in streams),
            regressions=regressions,
        )
        for frame, row, regressions in zip(frames, rows, _regressions(model, inferred, rows), strict=True)
    ]


def chain_states(chains: Chains, posteriors: Posteriors, row: int) -> tuple[ChainStates, ...]:
    """Return where each chain is in a frame, and how far ahead of the first."""
    structure = chains.structure
    return tuple(
        ChainStates(
            own.name,
            _likely([structure.state_name(number, state) for state in range(count)], posteriors.chains[number][row]),
            dict(zip(leads(chains, number), lead[row].tolist(), strict=True)),
        )
        for number, (own, count, lead) in enumerate(
            zip(structure.chains, structure.counts, lead_posteriors(chains, posteriors), strict=True)
        )
    )


def joint_state(chains: Chains, posteriors: Posteriors, row: int) -> NamedProbability | None:
    """Return the most probable state of all chains together in a frame; None where joint states are not listed."""
    if posteriors.joint is None:
        return None
    best = int(posteriors.joint.probability[row].argmax())
    name = chains.transitions.product.name(int(posteriors.joint.states[best]))
    return NamedProbability(name, float(posteriors.joint.probability[row, best]))


def leads(chains: Chains, chain: int) -> tuple[int, ...]:
    """Return how many states a chain may be ahead of the first; none for the first, and without a limit."""
    limit = chains.structure.limit
    return () if limit is None or chain == 0 else tuple(range(-limit, limit + 1))


def lead_posteriors(chains: Chains, posteriors: Posteriors) -> list[Single]:
    """Return the probabilities of ``leads``, chain by chain [each shape=(T, len(leads))]."""
    product, found = chains.transitions.product, []
    for chain in range(len(chains.structure.chains)):
        ahead = np.array(leads(chains, chain), np.intp)
        lead = np.zeros((len(posteriors.best), len(ahead)), np.float32)
        if isinstance(product, Product) and posteriors.joint is not None:
            own = product.lead[chain][posteriors.joint.states]
            lead = posteriors.joint.probability @ (own[:, None] == ahead).astype(np.float32)
        found.append(lead)
    return found


def units_believed(chains: Chains, posteriors: Posteriors, kept: slice) -> list[ChainPosteriors]:
    """Return what is believed of the units of each chain in some frames."""
    structure = chains.structure
    return [
        ChainPosteriors(
            own.name,
            units,
            posteriors.chains[number][kept].reshape(-1, len(units), structure.states).sum(axis=2),
            leads(chains, number),
            lead[kept],
        )
        for number, (own, units, lead) in enumerate(
            zip(structure.chains, structure.units, lead_posteriors(chains, posteriors), strict=True)
        )
    ]


def joined(parts: Sequence[ChainPosteriors]) -> ChainPosteriors:
    """Return successive beliefs of one chain as one."""
    together = (np.concatenate([getattr(part, name) for part in parts]) for name in ("probability", "lead"))
    probability, lead = together
    return replace(parts[0], probability=probability, lead=lead)


def _likely(names: Sequence[str], probability: NDArray[np.floating]) -> tuple[NamedProbability, ...]:
    best = np.argsort(-probability, kind="stable")[:MOST_STATES]
    named = [NamedProbability(names[i], float(probability[i])) for i in best]
    return (named[0], *(one for one in named[1:] if one.probability >= LEAST))


def _gaussian(model: CoupledModel, inferred: Inferred, row: int, stream: int) -> DominantGaussian:
    """Return the Gaussian of a stream that is most responsible for a frame."""
    chains = model.chains
    number = group_of(chains, stream)
    group, shares = chains.groups[number], inferred.evidence.shares[number]
    posterior = inferred.posteriors.densities[number][row : row + 1]
    weight = component_posteriors(posterior, None if shares is None else shares[row : row + 1])[0]
    component, place = np.unravel_index(weight.argmax(), weight.shape)
    density = int(inferred.lattice.densities[number][place])
    alone = group.of_stream(stream)
    mean, variance = (x[density, component].astype(float) for x in (alone.means, alone.variances))
    seen = inferred.observed.seen[stream]
    distance = None
    if seen is None or seen[row]:
        error = inferred.observed.streams[stream][row] - mean
        distance = float(np.sqrt(np.mean(error * error / variance)))
    channels: Mapping[str, ChannelValue] = {}
    if stream:
        visual = model.visual[stream - 1]
        means, precisions = visual.restored(mean[None], 1 / variance[None])
        channels = _in_channels(model, visual, means[0, 0], 1 / precisions[0, 0])
    return DominantGaussian(
        chains.streams[stream],
        _density_name(chains, group.tie, density),
        int(component) + 1,
        len(weight),
        float(weight[component, place]),
        distance,
        channels,
    )


def _density_name(chains: Chains, tie: NDArray[np.intp], density: int) -> str:
    """Return the states of the chains that a density belongs to: those that all joint states with it share."""
    states = chains.transitions.product.chain_states[:, tie == density]
    return " | ".join(
        chains.structure.state_name(chain, int(own[0])) for chain, own in enumerate(states) if (own == own[0]).all()
    )


def _regressions(model: CoupledModel, inferred: Inferred, rows: Sequence[int]) -> list[tuple[RegressedMean, ...]]:
    """Return what the means of frames come from where they are not those of the densities, frame by frame."""
    if not all(stream.dynamic for stream in model.visual):
        return [() for _ in rows]
    means, precisions = model.statistics(inferred)
    resting, found = model.resting(inferred.posteriors.chains[0]), []
    for row in rows:
        shares = [(NamedProbability(REST, 1.0),)] * len(model.visual) if resting[row] else _shares(model, inferred, row)
        found.append(
            tuple(
                RegressedMean(
                    stream.name,
                    own,
                    _in_channels(model, stream, means[row, 0, columns], 1 / precisions[row, 0, columns]),
                )
                for stream, own, columns in ((s, own, s.columns) for s, own in zip(model.visual, shares, strict=False))
            )
        )
    return found


def _shares(model: CoupledModel, inferred: Inferred, row: int) -> list[tuple[NamedProbability, ...]]:
    """Return how much each regression of every visual stream says; none where means follow nothing."""
    structure, found = model.chains.structure, []
    for number, following in enumerate(model.follow[1] if model.follow is not None else ()):
        chain = structure.chain_of(number + 1)
        gate = inferred.posteriors.chains[chain][row : row + 1]
        share = gates(gate, following.kind, len(following.coefficients))[0]
        found.append(_likely([_regression_name(structure, chain, following.kind, k) for k in range(len(share))], share))
    return found


def _regression_name(structure: Structure, chain: int, kind: NDArray[np.intp], number: int) -> str:
    """Return the viseme, and the place if all are at the same, of the states that a regression serves: ``bi.2``."""
    units, places = np.divmod(np.flatnonzero(kind == number), structure.states)
    phones = {structure.chains[chain].phones(structure.units[chain][unit])[0] for unit in units}
    viseme = "/".join(sorted({VISEME_OF[phone] for phone in phones}))
    return f"{viseme}.{places[0] + 1}" if len(set(places.tolist())) == 1 else viseme


def _in_channels(
    model: CoupledModel, stream: VisualStream, means: Array, variances: Array
) -> Mapping[str, ChannelValue]:
    """Return the means and deviations of a visual stream's channels from those in its dimensions [shapes=(q,)]."""
    space = model.space
    values, variance = np.zeros((1, space.dimensions)), np.full((1, space.dimensions), np.nan)
    values[:, stream.columns], variance[:, stream.columns] = means, variances
    motion, spread = space.restore(values, variance)
    found = zip(space.channels, motion[0].tolist(), np.sqrt(spread[0]).tolist(), strict=True)
    return {
        channel.name: ChannelValue(value, deviation) for channel, value, deviation in found if np.isfinite(deviation)
    }
