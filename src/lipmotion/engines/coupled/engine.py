"""The coupled engine."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit, Inputs, explain_by_trace
from lipmotion.engines.coupled.arrays import coupled_from_arrays, coupled_to_arrays
from lipmotion.engines.coupled.chains.densities import infer_components
from lipmotion.engines.coupled.chains.lattice import Lattice, LatticePosteriors
from lipmotion.engines.coupled.chains.model import Chains, Inference, speech_observations
from lipmotion.engines.coupled.chains.product import Product
from lipmotion.engines.coupled.conversion import VITERBI, convert, group_index
from lipmotion.engines.coupled.model import PATH, TRAJECTORY, CoupledConfig, CoupledModel
from lipmotion.engines.coupled.training.chain_training import mark_allowed_units
from lipmotion.engines.coupled.training.coupled_training import THREADS, grow_models
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion.articulation import Statistics, count_unseen, slice_dynamics
from lipmotion.motion.generation import split_into_blocks
from lipmotion.storage.archive import Checkpoint
from lipmotion.types import (
    ChainPosteriors,
    ChainStates,
    ChannelValue,
    Configuration,
    Constraints,
    DominantGaussian,
    Example,
    Explanation,
    Generation,
    Monitor,
    NamedProbability,
    Speech,
    StateTrace,
    Timeline,
)

Array = NDArray[np.float64]
MAX_STATES = 3  # greatest number of states of a chain that an explanation names
MIN_PROBABILITY = 0.005  # states with less probability are not named


def explain_frames(
    frames: Sequence[Explanation], model: CoupledModel, inference: Inference, rows: Sequence[int]
) -> list[Explanation]:
    """Return explanations with chains and Gaussians; unchanged where no path leads through the chains."""
    if not np.isfinite(inference.posteriors.log_likelihood):
        return list(frames)
    streams = range(len(model.chains.streams))
    return [
        replace(
            frame,
            chains=list_chain_states(model.chains, inference.posteriors, row),
            joint=find_joint_state(model.chains, inference.posteriors, row),
            gaussians=tuple(_find_dominant_gaussian(model, inference, row, stream) for stream in streams),
        )
        for frame, row in zip(frames, rows, strict=True)
    ]


def list_chain_states(chains: Chains, posteriors: LatticePosteriors, row: int) -> tuple[ChainStates, ...]:
    """Return the most probable states of each chain in a frame, and the probabilities of its asynchrony."""
    ranked_chains = []
    for number, units in enumerate(infer_units(chains, posteriors, slice(None))):
        probability = posteriors.chains[number][row]
        best = np.argsort(-probability, kind="stable")[:MAX_STATES].tolist()
        named = [NamedProbability(chains.structure.state_name(number, i), float(probability[i])) for i in best]
        ranked = (named[0], *(state for state in named[1:] if state.probability >= MIN_PROBABILITY))
        ahead = dict(zip(units.leads, units.lead[row].tolist(), strict=True))
        ranked_chains.append(ChainStates(units.name, ranked, ahead))
    return tuple(ranked_chains)


def find_joint_state(chains: Chains, posteriors: LatticePosteriors, row: int) -> NamedProbability | None:
    """Return the most probable joint state in a frame; None where joint states are not listed."""
    if posteriors.joint is None:
        return None
    states, probability = posteriors.joint
    best = int(probability[row].argmax())
    name = chains.structure.name(chains.transitions.product.chain_states[:, states[best]].tolist())
    return NamedProbability(name, float(probability[row, best]))


def infer_units(chains: Chains, posteriors: LatticePosteriors, frames: slice) -> list[ChainPosteriors]:
    """Return the posteriors of the units of each chain, and of its leads over the first chain, in some frames."""
    structure, product, by_chain = chains.structure, chains.transitions.product, []
    for chain, units in enumerate(structure.units):
        probability = posteriors.chains[chain][frames].reshape(-1, len(units), structure.states).sum(axis=2)
        leads = () if structure.limit is None or chain == 0 else range(-structure.limit, structure.limit + 1)
        lead = np.zeros((len(probability), len(leads)), np.float32)
        if isinstance(product, Product) and posteriors.joint is not None:
            states, of_states = posteriors.joint
            ahead = product.lead[chain][states, None] == np.array(leads, np.intp)
            lead = (of_states @ ahead.astype(np.float32))[frames]
        by_chain.append(ChainPosteriors(structure.chains[chain].name, units, probability, tuple(leads), lead))
    return by_chain


def _find_dominant_gaussian(model: CoupledModel, inference: Inference, row: int, stream: int) -> DominantGaussian:
    chains = model.chains
    number = group_index(chains, stream)
    group, responsibilities = chains.groups[number], inference.responsibilities[number]
    posterior = inference.posteriors.densities[number][row : row + 1]
    weight = infer_components(posterior, None if responsibilities is None else responsibilities[row : row + 1])[0]
    component, position = np.unravel_index(weight.argmax(), weight.shape)
    density = int(inference.lattice.densities[number][position])
    mixtures = group.stream_mixtures(stream)
    mean, variance = (x[density, component].astype(float) for x in (mixtures.means, mixtures.variances))
    channels: Mapping[str, ChannelValue] = {}
    if stream:
        visual, space = model.visual[stream - 1], model.space
        means, precisions = visual.unstandardised(mean[None], 1 / variance[None])
        values, variances = np.zeros((2, 1, space.dimensions))
        values[:, visual.columns], variances[:, visual.columns] = means[0, 0], 1 / precisions[0, 0]
        motion, deviations = space.restore(values)[0].tolist(), np.sqrt(variances @ space.mixing)[0].tolist()
        missing = np.delete(space.mixing, visual.columns, axis=0).max(axis=0, initial=0) > 0  # of other streams
        rows = zip(space.channels, motion, deviations, missing.tolist(), strict=True)
        channels = {channel.name: ChannelValue(value, spread) for channel, value, spread, gone in rows if not gone}
    observed, distance = inference.observations.observed[stream], None
    if observed is None or observed[row]:  # how far the observation is from the Gaussian, in standard deviations (RMS)
        error = inference.observations.streams[stream][row] - mean
        distance = float(np.sqrt(np.mean(error * error / variance)))
    states = chains.transitions.product.chain_states[:, group.tie == density]
    return DominantGaussian(
        chains.streams[stream],
        " | ".join(
            chains.structure.state_name(chain, int(each[0]))
            for chain, each in enumerate(states)
            if (each == each[0]).all()
        ),
        int(component) + 1,
        len(weight),
        float(weight[component, position]),
        distance,
        channels,
    )


ENCODING_SHARE = 0.8
"""Share of the regression on the encoding for a voice that training knows half or less; one that it knows has none."""


@final
@dataclass(frozen=True)
class CoupledEngine(Engine[CoupledModel]):
    """Coupled hidden Markov models of speech and lips; motion is generated from expectations over all paths.

    Source: Xie & Liu 2007. Beyond the paper: the visual chain also emits slope and curvature (Δ, Δ²), and motion comes
    from its expected precisions and means by parameter generation (``conversion = trajectory``).
    """

    config: CoupledConfig
    name: ClassVar[str] = "coupled"
    Config: ClassVar[type[Configuration]] = CoupledConfig

    def inputs(self, motion_s: float = math.inf) -> Inputs:  # noqa: D102, ARG002
        return Inputs(speech_alone=True, encoding=self.config.uses_encoding)

    def fit(  # noqa: D102
        self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = THREADS
    ) -> Fit[CoupledModel]:
        return deque(grow_models(examples, self.config, monitor, checkpoint), maxlen=1)[0]()

    def generate(self, model: CoupledModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        frames = len(speech.features.values)
        path = np.empty(frames, np.intp)

        def statistics(wanted: slice) -> Statistics:
            motion_statistics, path[wanted] = self._statistics(model, speech, wanted)
            return motion_statistics

        learned = model.motion if self.config.variance_scaling else replace(model.motion, scaling=None)
        motion, variance = learned.generate(
            statistics,
            frames,
            speech.units,
            constraints,
            close=self.config.closures,
            reliability=np.maximum(speech.confidence, 1 - speech.voice),  # the chains know their own voice better
        )
        states, positions = np.unique(path, return_inverse=True)
        structure, chain_states = model.chains.structure, model.chains.transitions.product.chain_states
        names = tuple(structure.name(each) for each in chain_states[:, states].T.tolist())
        of_chains = ("/".join(each.unit(span.label.phone) for each in structure.chains) for span in speech.units)
        labelled = zip(speech.units, of_chains, strict=True)
        units = Timeline(tuple(replace(span, label=replace(span.label, unit=unit)) for span, unit in labelled))
        return Generation(motion, variance, units, StateTrace(names, positions))

    def lattice(self, model: CoupledModel, speech: Speech, wanted: slice) -> Lattice:
        """Return the lattice of some frames: joint states near the phones of a transcript, or all without one."""
        if not speech.units_decide:
            return model.chains.full_lattice
        allowed = mark_allowed_units(model.chains.structure, speech.units, len(speech.features.values))
        return model.chains.lattice(allowed[wanted])

    def _statistics(self, model: CoupledModel, speech: Speech, frames: slice) -> tuple[Statistics, NDArray[np.intp]]:
        """Return means and precisions [each shape=(T, 3, Q)], and the most probable joint state of every frame."""
        chains = model.chains
        if self.config.conversion == PATH or (self.config.conversion != TRAJECTORY and self.config.start == VITERBI):
            observations = speech_observations(speech, model.visual, frames)
            lattice = self.lattice(model, speech, frames)
            path, _ = chains.best_path(observations, lattice)
            steps = self.config.steps if self.config.conversion != PATH else 0
            streams, _ = convert(chains, observations, lattice, VITERBI, self.config.update, steps, path)
            return model.frame_statistics(streams), path
        inference = self.infer(model, speech, frames)
        if self.config.conversion != TRAJECTORY:
            how = self.config.start, self.config.update, self.config.steps
            streams, _ = convert(chains, inference.observations, inference.lattice, *how, inference)
            return model.frame_statistics(streams), inference.posteriors.most_probable
        means, precisions = model.motion_statistics(inference)
        share = ENCODING_SHARE * min(2 * count_unseen(speech.voice), 1.0)
        if share and model.encoding is not None and speech.encoding is not None:
            means += share * (slice_dynamics(model.encoding.predict(speech)[0], frames) - means)
            precisions += share * (1 / model.encoding.variances - precisions)
        return (means, precisions), inference.posteriors.most_probable

    def infer(self, model: CoupledModel, speech: Speech, frames: slice) -> Inference:
        """Return the posteriors of the chains given some frames of speech.

        With ``trajectory`` conversion, each of its steps infers again, with the generated motion as observed motion.
        """
        observations = speech_observations(speech, model.visual, frames)
        lattice = self.lattice(model, speech, frames)
        inference = model.chains.infer(observations, lattice)
        for _ in range(self.config.steps if self.config.conversion == TRAJECTORY else 0):
            values = solve_mlpg(*model.motion_statistics(inference))[0]
            seen = observations.with_visual_streams([stream.standardised(values) for stream in model.visual])
            inference = model.chains.infer(seen, lattice)
        return inference

    def explain(self, model: CoupledModel, speech: Speech, frames: Sequence[int]) -> tuple[Explanation, ...]:  # noqa: D102
        result, explanations = self.generate(model, speech), dict[int, Explanation]()
        for inner, outer in split_into_blocks(len(speech.features.values)):
            inside = [frame for frame in frames if inner.start <= frame < inner.stop]
            if inside:
                inference = self.infer(model, speech, outer)
                by_trace = [explain_by_trace(result, frame) for frame in inside]
                rows = [frame - outer.start for frame in inside]
                explanations.update(zip(inside, explain_frames(by_trace, model, inference, rows), strict=True))
        return tuple(explanations[frame] for frame in frames)

    def posteriors(self, model: CoupledModel, speech: Speech) -> tuple[ChainPosteriors, ...]:  # noqa: D102
        blocks = []
        for inner, outer in split_into_blocks(len(speech.features.values)):
            inference = self.infer(model, speech, outer)
            frames = slice(inner.start - outer.start, inner.stop - outer.start)
            blocks.append(infer_units(model.chains, inference.posteriors, frames))
        return tuple(
            replace(
                parts[0],
                probability=np.concatenate([part.probability for part in parts]),
                lead=np.concatenate([part.lead for part in parts]),
            )
            for parts in zip(*blocks, strict=True)
        )

    def to_arrays(self, model: CoupledModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        return coupled_to_arrays(model)

    def from_arrays(self, arrays: Arrays) -> CoupledModel:  # noqa: D102
        return coupled_from_arrays(arrays, self.config)
