"""The model of the trajectory engine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.emission import (
    EMISSION,
    NETWORK_SHARE,
    Emission,
    emission_arrays,
    emission_from_arrays,
)
from lipmotion.hmm.multistream.phone_recogniser import (
    JOINT_PREFIX,
    OwnPhoneRecogniser,
    recogniser_from_arrays,
    recogniser_to_arrays,
)
from lipmotion.motion.arrays import MOTION_ARRAYS, motion_from_arrays, motion_to_arrays
from lipmotion.motion.articulation import KNOWN_VOICE_SHARE, TABLE_WEIGHT_WITH_PREDICTOR, ArticulationPrior
from lipmotion.motion.closure import Closure
from lipmotion.motion.frame_labels import StateLayout
from lipmotion.motion.generation import LearnedMotion
from lipmotion.motion.limits import MotionLimits, check_poses, measure_limits
from lipmotion.motion.modulation_filter import MODULATION, ModulationFilter, filter_from_arrays, filter_to_arrays
from lipmotion.motion.predictors import (
    ADDED,
    Predictor,
    list_predictor_arrays,
    predictor_from_arrays,
    predictor_to_arrays,
)
from lipmotion.motion.space import MotionSpace
from lipmotion.motion.variance_scaling import VarianceScaling
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.units import UnitSet


@dataclass(frozen=True, eq=False)
class TrajectoryModel:
    """Full-context hidden Markov models of motion.

    space    : the Q dimensions in which motion is modelled
    variance_factors : factors of variance scaling about the rest pose [shape=(Q,)]
    closure  : of the lips in p, b and m (None: the motion has no channel ``opening``)
    phone_recogniser : recognises the phones of speakers that it was trained on (None: there was too little speech)
    network  : predicts motion without the states (None: there was too little speech, and no other model)
    network_share : weight of this predictor, 0 to 1, beside the states in contexts that training knows well
    prior    : the table of articulation in the speaker's range (None: it is not used)
    modulation : restores fast movement (None: the motion stays as it is)
    """

    units: UnitSet
    space: MotionSpace
    emission: Emission
    variance_factors: NDArray[np.float64]
    closure: Closure | None
    phone_recogniser: OwnPhoneRecogniser | None = None
    network: Predictor | None = None
    prior: ArticulationPrior | None = None
    network_share: float = NETWORK_SHARE
    modulation: ModulationFilter | None = None

    def __repr__(self) -> str:
        states = f"{len(self.emission.means)} tied states"
        return f"TrajectoryModel({self.units.name} units, {states}, {self.space.dimensions} dimensions)"

    @cached_property
    def limits(self) -> MotionLimits:
        """Limits of plausible motion."""
        return self.poses.extend(np.sqrt(self.emission.variances[:, 0].max(axis=0)))

    @cached_property
    def motion(self) -> LearnedMotion:
        """Motion space, closure, limits and variance scaling, which turn predicted means into motion."""
        scaling = VarianceScaling(self.variance_factors, self.emission.means[-1, 0])
        prior = self.prior
        if prior is not None and self.network is not None:
            beside = replace(prior, weight=TABLE_WEIGHT_WITH_PREDICTOR, known_voice_share=KNOWN_VOICE_SHARE)
            prior = None if self.network.uses_articulation else beside
        return LearnedMotion(self.space, self.closure, self.limits, scaling, prior, self.modulation)

    @property
    def poses(self) -> MotionLimits:
        """Smallest and largest means of all states [each shape=(Q,)]."""
        return measure_limits(self.emission.means[:, 0])


def model_arrays(model: TrajectoryModel) -> dict[str, NDArray[Any]]:
    """Serialise a model."""
    arrays = motion_to_arrays(model.units, model.space, model.closure, model.prior) | {"gain": model.variance_factors}
    recogniser = recogniser_to_arrays(model.phone_recogniser) if model.phone_recogniser is not None else {}
    network = predictor_to_arrays(model.network)
    if model.network is not None:
        network |= {"network_share": np.array([model.network_share])}
    return arrays | emission_arrays(model.emission) | network | recogniser | filter_to_arrays(model.modulation)


def model_from_arrays(
    arrays: Arrays, layout: Callable[[UnitSet], StateLayout], units: str, *, filtered: bool
) -> TrajectoryModel:
    """Deserialise a model, ``filtered`` with a modulation filter. Raises ModelFormatError: an array is missing or
    wrong.
    """
    with format_errors("the trajectory model"):
        joint = (name for name in arrays if name.startswith(JOINT_PREFIX))
        others = list_predictor_arrays(arrays)
        refuse_undeclared(arrays, MOTION_ARRAYS, EMISSION, VARIANCE_FACTORS, others, SHARE, joint, MODULATION)
        unit_set, space, closure, prior = motion_from_arrays(arrays, units)
        emission = emission_from_arrays(arrays, layout(unit_set), space.dimensions)
        factors = check_arrays(arrays, VARIANCE_FACTORS, Q=space.dimensions)["gain"]
        recogniser, network = recogniser_from_arrays(arrays), predictor_from_arrays(arrays, space.dimensions)
        stored = "network_share" in arrays or any(name.startswith(ADDED) for name in others)  # not in former models
        share = float(check_arrays(arrays, SHARE)["network_share"][0]) if stored else NETWORK_SHARE
        modulation = filter_from_arrays(arrays, space.dimensions, needed=filtered)
        model = TrajectoryModel(
            unit_set, space, emission, factors, closure, recogniser, network, prior, share, modulation
        )
        check_poses(model.poses, space, closure)
        return model


VARIANCE_FACTORS = {"gain": ArraySpec(np.float64, "Q", POSITIVE, 10)}
SHARE = {"network_share": ArraySpec(np.float64, "1", 0, 1)}
