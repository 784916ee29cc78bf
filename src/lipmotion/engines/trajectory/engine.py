"""The trajectory engine: from the states of all frames to motion, and its files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Engine, Fit, Inputs
from lipmotion.engines.trajectory.model import (
    EMISSION,
    NETWORK_SHARE,
    SHARE,
    VARIANCE_FACTORS,
    Experts,
    TrajectoryConfig,
    TrajectoryModel,
    emission_from_arrays,
)
from lipmotion.hmm.multistream.phone_recogniser import JOINT_PREFIX, recogniser_from_arrays, recogniser_to_arrays
from lipmotion.motion.arrays import MOTION_ARRAYS, motion_from_arrays, motion_to_arrays
from lipmotion.motion.context_window import acoustic_context_to_arrays
from lipmotion.motion.frame_labels import find_digital_silence, label_full_context, with_unit_names
from lipmotion.motion.modulation_filter import MODULATION, filter_from_arrays, filter_to_arrays
from lipmotion.motion.network_steps import hear_articulators
from lipmotion.motion.predictors import (
    ADDED,
    count_conditions,
    list_predictor_arrays,
    predictor_from_arrays,
    predictor_to_arrays,
)
from lipmotion.motion.space import check_poses
from lipmotion.printable import printable
from lipmotion.stats.trees import trees_to_arrays
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.storage.schema import Arrays, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import Configuration, Constraints, Example, Generation, Monitor, Speech, StateTrace, Timeline, Unit


@final
@dataclass(frozen=True)
class TrajectoryEngine(Engine[TrajectoryModel]):
    """Full-context hidden Markov models of motion, and maximum-likelihood parameter generation from them.

    Source: Hofer 2008, §5.  Deviations: the state of a frame follows from the times of its phone, which are known from
    recognition or forced alignment; means are regressed on the acoustic features around the frame.
    """

    config: TrajectoryConfig
    name: ClassVar[str] = "trajectory"
    Config: ClassVar[type[Configuration]] = TrajectoryConfig

    def inputs(self, motion_s: float = math.inf) -> Inputs:  # noqa: D102
        conditions = count_conditions(self.config.predictor, motion_s, self.config.conditions)
        return Inputs(self.config.joint_recogniser, conditions, prior=True, posteriors=True, encoding=True)

    def fit(  # noqa: D102
        self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT
    ) -> Fit[TrajectoryModel]:
        from lipmotion.engines.trajectory.trajectory_training import fit_trajectory  # who animates does not train

        model = fit_trajectory(examples, self.config, monitor, checkpoint)
        frames = sum(int(example.valid.sum()) for example in examples)
        uses_prior = model.network is not None and model.network.uses_prior
        return Fit(model, {"frames": frames, "leaves": len(model.emission.means)}, uses_prior)

    def hidden(  # noqa: D102
        self, model: TrajectoryModel, speech: Speech
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]] | None:
        return model.network.hidden(speech) if model.network is not None else None

    def recognise(self, model: TrajectoryModel, speech: Speech) -> Timeline[Unit] | None:  # noqa: D102
        return model.phone_recogniser.phones(speech) if model.phone_recogniser is not None else None

    def generate(self, model: TrajectoryModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        frames = len(speech.features.values)
        states = label_full_context(speech.units, frames, model.emission.layout)
        distinct = {state: number for number, state in enumerate(dict.fromkeys(states))}
        path = np.array([distinct[state] for state in states], np.intp)
        densities = model.emission.rows(states)
        silent = find_digital_silence(np.asarray(speech.features.values), speech.units)
        densities[silent] = len(model.emission.means) - 1
        experts = Experts(model.emission, densities, speech, model.network, model.prior, model.network_share, silent)

        learned = model.motion if self.config.variance_scaling else replace(model.motion, scaling=None)
        motion, variance = learned.for_voice(speech.voice).generate(
            experts.statistics,
            frames,
            speech.units,
            constraints,
            close=self.config.closures,
            reliability=experts.reliability,
            articulators=None if model.prior is None else hear_articulators(speech),
            voice=speech.voice,
            range_db=np.where(silent, 0.0, speech.range_db),
        )
        return Generation(
            motion,
            variance,
            with_unit_names(speech.units, model.units),
            StateTrace(tuple(model.emission.source(state) for state in distinct), path),
        )

    def describe(self, model: TrajectoryModel) -> str:  # noqa: D102
        return "\n\n".join(f"{printable(name)}\n{tree.text()}" for name, tree in model.emission.forest.items())

    def to_arrays(self, model: TrajectoryModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        emission, regression = model.emission, model.emission.regression
        arrays = motion_to_arrays(model.units, model.space, model.closure, model.prior)
        arrays |= {"gain": model.variance_factors} | trees_to_arrays(emission.forest)
        arrays |= {"means": emission.means.astype(np.float16), "variances": emission.variances}
        if regression is not None:
            arrays |= acoustic_context_to_arrays(regression.context)
            arrays |= {"coefficients": regression.coefficients.astype(np.float16), "coefficient_rows": regression.rows}
        if model.network is not None:
            arrays |= predictor_to_arrays(model.network) | {"network_share": np.array([model.network_share])}
        if model.phone_recogniser is not None:
            arrays |= recogniser_to_arrays(model.phone_recogniser)
        return arrays | filter_to_arrays(model.modulation)

    def from_arrays(self, arrays: Arrays) -> TrajectoryModel:  # noqa: D102
        with format_errors("the trajectory model"):
            joint = (name for name in arrays if name.startswith(JOINT_PREFIX))
            others = list_predictor_arrays(arrays)
            refuse_undeclared(arrays, MOTION_ARRAYS, EMISSION, VARIANCE_FACTORS, others, SHARE, joint, MODULATION)
            units, space, closure, prior = motion_from_arrays(arrays, self.config.units)
            emission = emission_from_arrays(arrays, self.config.layout(units), space.dimensions)
            factors = check_arrays(arrays, VARIANCE_FACTORS, Q=space.dimensions)["gain"]
            recogniser, network = recogniser_from_arrays(arrays), predictor_from_arrays(arrays, space.dimensions)
            # former models hold no share
            has_share = "network_share" in arrays or any(name.startswith(ADDED) for name in others)
            share = float(check_arrays(arrays, SHARE)["network_share"][0]) if has_share else NETWORK_SHARE
            modulation = filter_from_arrays(arrays, space.dimensions, needed=self.config.modulation_filter > 0)
            model = TrajectoryModel(
                units, space, emission, factors, closure, recogniser, network, prior, share, modulation
            )
            check_poses(model.poses, space, closure)
            return model
