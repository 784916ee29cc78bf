"""The coupled engine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit, Inputs, explain_by_trace
from lipmotion.engines.coupled.arrays import coupled_arrays, coupled_from_arrays
from lipmotion.engines.coupled.chains.lattice import Lattice
from lipmotion.engines.coupled.chains.model import Inference
from lipmotion.engines.coupled.conversion.em_conversion import convert, path_means
from lipmotion.engines.coupled.explanation import concatenated, describe, explain_frames, unit_posteriors
from lipmotion.engines.coupled.model import PATH, TRAJECTORY, CoupledConfig, CoupledModel
from lipmotion.engines.coupled.training.alignment import allowed_units
from lipmotion.engines.coupled.training.coupled_training import THREADS, fit_coupled
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion.articulation import slice_dynamics, unseen_share
from lipmotion.motion.generation import Statistics, split_into_blocks
from lipmotion.storage.archive import Checkpoint
from lipmotion.types import (
    ChainPosteriors,
    Configuration,
    Constraints,
    Example,
    Explanation,
    Generation,
    Monitor,
    Speech,
    StateTrace,
    Timeline,
    Unit,
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
        return fit_coupled(examples, self.config, monitor, checkpoint)

    def without_closures(self) -> CoupledEngine:  # noqa: D102
        return replace(self, config=replace(self.config, closures=False))

    def generate(self, model: CoupledModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        frames = len(speech.features.values)
        path = np.empty(frames, np.intp)

        def statistics(wanted: slice) -> Statistics:
            motion_statistics, path[wanted] = self._statistics(model, speech, wanted)
            return motion_statistics

        learned = model.motion if self.config.variance_scaling else replace(model.motion, scaling=None)
        learned = learned.for_voice(speech.voice)
        motion, variance = learned.generate(
            statistics,
            frames,
            speech.units,
            constraints,
            close=self.config.closures,
            reliability=np.maximum(speech.confidence, 1 - speech.voice),  # the chains know their own voice better
        )
        states, positions = np.unique(path, return_inverse=True)
        return Generation(
            motion,
            variance,
            _with_units(model, speech.units),
            StateTrace(tuple(model.chains.transitions.product.name(int(state)) for state in states), positions),
        )

    def lattice(self, model: CoupledModel, speech: Speech, wanted: slice) -> Lattice:
        """Return the lattice of some frames: joint states near the phones of a transcript, or all without one."""
        chains = model.chains
        if not speech.units_decide:
            return chains.full_lattice
        frames = len(speech.features.values)
        allowed = allowed_units(chains.structure, speech.units, frames)[wanted]
        return chains.lattice(allowed)

    def _statistics(self, model: CoupledModel, speech: Speech, frames: slice) -> tuple[Statistics, NDArray[np.intp]]:
        """Return means and precisions [each shape=(T, 3, Q)], and the most probable joint state of every frame."""
        chains = model.chains
        if self.config.conversion == PATH:
            observations, lattice = model.speech_observations(speech, frames), self.lattice(model, speech, frames)
            path, _ = chains.best_path(chains.emission_log_densities(observations, lattice), lattice)
            return model.frame_statistics([path_means(chains, path, s + 1) for s in range(len(model.visual))]), path
        inference = self.infer(model, speech, frames)
        if self.config.conversion != TRAJECTORY:
            streams = convert(chains, inference.observations, inference.lattice, self.config.em, inference).streams[1:]
            return model.frame_statistics(streams), inference.posteriors.most_probable
        means, precisions = model.motion_statistics(inference)
        share = ENCODING_SHARE * min(2 * unseen_share(speech.voice), 1.0)
        if share and model.encoding is not None and speech.encoding is not None:
            means += share * (slice_dynamics(model.encoding.predict(speech)[0], frames) - means)
            precisions += share * (1 / model.encoding.variances - precisions)
        return (means, precisions), inference.posteriors.most_probable

    def infer(self, model: CoupledModel, speech: Speech, frames: slice) -> Inference:
        """Return the posteriors of the chains given some frames of speech.

        With ``trajectory`` conversion, each of its steps infers again, with the generated motion as observed motion.
        """
        observations, lattice = model.speech_observations(speech, frames), self.lattice(model, speech, frames)
        inference = model.chains.infer(observations, lattice)
        for _ in range(self.config.steps if self.config.conversion == TRAJECTORY else 0):
            values = solve_mlpg(*model.motion_statistics(inference))[0]
            inference = model.chains.infer(model.with_motion(observations, values), lattice)
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
            kept = slice(inner.start - outer.start, inner.stop - outer.start)
            blocks.append(unit_posteriors(model.chains, inference.posteriors, kept))
        return tuple(concatenated(parts) for parts in zip(*blocks, strict=True))

    def describe(self, model: CoupledModel) -> str:  # noqa: D102
        return describe(model)

    def to_arrays(self, model: CoupledModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        return coupled_arrays(model)

    def from_arrays(self, arrays: Arrays) -> CoupledModel:  # noqa: D102
        return coupled_from_arrays(arrays, self.config)


def _with_units(model: CoupledModel, units: Timeline[Unit]) -> Timeline[Unit]:
    chains = model.chains.structure.chains
    return Timeline(
        tuple(replace(s, label=replace(s.label, unit="/".join(c.unit(s.label.phone) for c in chains))) for s in units)
    )
