"""The configuration and the model of the coupled engine: chains, and how their posteriors become motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import read_presets
from lipmotion.engines.coupled.chains.densities import Single
from lipmotion.engines.coupled.chains.model import EIGENLIPS, Chains, Inference, VisualStream
from lipmotion.engines.coupled.chains.product import STRUCTURES, UNSEEN_LOSS, Structure, list_unit_sets
from lipmotion.engines.coupled.conversion import (
    EXACT,
    SOFT,
    STARTS,
    UPDATES,
    RegressionInputs,
    VisualRegression,
    group_index,
    sum_precisions,
)
from lipmotion.motion.articulation import ArticulationPrior
from lipmotion.motion.closure import Closure
from lipmotion.motion.generation import LearnedMotion, VarianceScaling
from lipmotion.motion.predictors import Predictor
from lipmotion.motion.space import MotionLimits, MotionSpace, measure_limits
from lipmotion.types import FRAME_RATE_HZ, Configuration, Rule, option
from lipmotion.units import UnitSet

TRAJECTORY, FRAMES, PATH = "trajectory", "em", "viterbi"
CONVERSIONS = (TRAJECTORY, FRAMES, PATH)
COUNT, MIXTURES, WEIGHT = Rule(least=1), Rule(least=1, power_of_two=True), Rule(least=0)


@dataclass(frozen=True)
class CoupledConfig(Configuration):
    """How the coupled engine models speech and lips (chosen on the validation list; see docs/decisions/engines.md).

    structure  : ``hmm``, ``multistream``, ``factorial`` or ``coupled`` (``presets`` has the paper's six systems)
    chains     : the unit set of each chain, separated by blanks: names or table files; the first chain emits speech
    states     : states per unit, left to right, no skips
    asynchrony : number of states that chains may be apart; -1: no limit, of two factorial chains
    cross_units : let chains leave a unit at different times
    start_asynchrony, unseen_loss : of factorial chains without a limit: how far apart the chains may be while the first
                 densities are learned, and the nats that rare joint states lose (``chains.product.Structure``)
    moves_together : coupled chains may move on in the same frame more often than by chance; the paper's may not
    mixtures, visual_mixtures : Gaussians per state, of speech (``hmm``: of all) and of visual streams (powers of two)
    speech_only_mixtures, speech_only_steps, speech_only_weight : of the second stage of training, on speech without
                 motion: Gaussians per state of speech, EM steps for each number of Gaussians, and the weight of such a
                 frame relative to one of speech with motion
    audio_weight, visual_weight, eigenlips_weight : exponents of the densities of speech, geometry and eigenlips
    conversion : ``trajectory``: parameter generation from expected precisions and means of static values, Δ and Δ²;
                 ``em``: the paper's, frame by frame;  ``viterbi``: means along the best path
    start, update, steps : of EM conversion (``conversion.convert``); ``trajectory`` has a soft start and such steps
    acoustic_regression : regress visual means on features and state posteriors around the frame (``trajectory`` only)
    components : principal components that all point channels are reduced to
    variance_scaling : scale movements to the variance of the recorded ones
    closures   : make the lips meet in every p, b and m
    articulation : lean on the table of English articulation in contexts that training saw little of; less where the
                 phones are recognised, words do not confirm them, and training knows the voice
    """

    structure: str = option("coupled", Rule(choices=STRUCTURES))
    chains: str = "phone viseme"
    states: int = option(3, COUNT)
    asynchrony: int = option(1, Rule(least=-1))
    cross_units: bool = True
    mixtures: int = option(8, MIXTURES)
    visual_mixtures: int = option(1, MIXTURES)
    speech_only_mixtures: int = option(8, MIXTURES)
    speech_only_steps: int = option(8, COUNT)
    speech_only_weight: float = option(0.3, WEIGHT)
    audio_weight: float = option(1.0, WEIGHT)
    visual_weight: float = option(1.0, WEIGHT)
    eigenlips_weight: float = option(1.0, WEIGHT)
    conversion: str = option(TRAJECTORY, Rule(choices=CONVERSIONS))
    start: str = option(SOFT, Rule(choices=STARTS))
    update: str = option(EXACT, Rule(choices=UPDATES))
    steps: int = option(0, Rule(least=0))
    acoustic_regression: bool = True
    components: int = option(16, COUNT)
    variance_scaling: bool = True
    closures: bool = True
    articulation: bool = True
    start_asynchrony: int = option(1, Rule(least=0), omit_default=True)
    unseen_loss: float = option(UNSEEN_LOSS, Rule(least=0), omit_default=True)
    moves_together: bool = option(default=False, omit_default=True)

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = read_presets("coupled")
    preset_visual: ClassVar[Mapping[str, str]] = dict.fromkeys(presets, EIGENLIPS)
    aliases: ClassVar[Mapping[str, str]] = {
        "crosses": "cross_units",
        "more_mixtures": "speech_only_mixtures",
        "more_steps": "speech_only_steps",
        "more_weight": "speech_only_weight",
        "follows": "acoustic_regression",
        "full_range": "variance_scaling",
    }
    hints: ClassVar[Mapping[str, str]] = {"units": 'each chain has its own; say --set chains="phone viseme"'}

    def check_files(self) -> None:  # noqa: D102
        self.structure_with(list_unit_sets(self.chains))

    def structure_with(self, chains: tuple[UnitSet, ...]) -> Structure:
        """Return the structure of chains of these unit sets. Raises InputError: as ``Structure``."""
        limit = self.asynchrony if self.asynchrony >= 0 else None if len(chains) > 1 else 0
        others = self.start_asynchrony, self.unseen_loss, self.moves_together
        return Structure(self.structure, chains, self.states, limit, self.cross_units, *others)

    @property
    def dynamic(self) -> bool:
        """Whether slope and curvature are modelled."""
        return self.conversion == TRAJECTORY

    @property
    def uses_encoding(self) -> bool:
        """Whether voices that training does not know follow their encoding."""
        return self.dynamic and self.acoustic_regression


Array = NDArray[np.float64]
AWAY_FROM_SPEECH_S = 0.45
"""In silence this far from speech the mouth is in the rest pose; nearer, it is still closing or gets ready."""
LARGEST_SPEECH_POSTERIOR = 0.05  # greatest posterior of speech in a frame that counts as silent
REST_PRECISION_FACTOR = 100.0  # how many times more precise the rest pose is than the means that it replaces


@dataclass(frozen=True, eq=False)
class CoupledModel:
    """Coupled chains with everything that turns their posteriors into motion.

    space      : the motion space, of Q dimensions
    visual     : the visual streams, in the order of the chains' streams after speech
    regression : of the visual means: inputs, and the regression of each visual stream; None: means are the densities'
    scaling    : factors of variance scaling, away from the rest pose [shape=(Q,)]
    rest_pose  : the pose in silence away from speech [shape=(Q,)]
    closure    : how the lips close; None: the motion has no opening
    prior      : the table of articulation in the speaker's range (None: there is none)
    encoding   : of voices that training does not know, the motion by their encoding (None: there was none)
    """

    chains: Chains
    space: MotionSpace
    visual: tuple[VisualStream, ...]
    regression: tuple[RegressionInputs, tuple[VisualRegression, ...]] | None
    scaling: Array
    rest_pose: Array
    closure: Closure | None
    prior: ArticulationPrior | None = None
    encoding: Predictor | None = None

    def __repr__(self) -> str:
        size = f"{self.chains.parameters} parameters, {self.space.dimensions} dimensions"
        return f"CoupledModel({', '.join(self.chains.streams)}; {size})"

    @cached_property
    def motion(self) -> LearnedMotion:
        """What turns means and precisions into motion; limits are those of all poses, and a standard deviation more."""
        poses, deviation = self.pose_limits, np.zeros(self.space.dimensions)
        for stream in self.visual:
            deviation[stream.columns] = stream.deviation[: len(stream.columns)]
        low, high = np.minimum(poses.low, self.rest_pose), np.maximum(poses.high, self.rest_pose)
        scaling = VarianceScaling(self.scaling, self.rest_pose)
        return LearnedMotion(self.space, self.closure, MotionLimits(low, high).extend(deviation), scaling, self.prior)

    @property
    def pose_limits(self) -> MotionLimits:
        """The limits of the means of all densities."""
        low, high = np.zeros(self.space.dimensions), np.zeros(self.space.dimensions)
        for number, stream in enumerate(self.visual, start=1):
            group = self.chains.groups[group_index(self.chains, number)]
            means = group.stream_mixtures(number).means.astype(float)
            flat = means.reshape(-1, means.shape[2])
            poses = stream.unstandardised(flat, np.ones_like(flat))[0][:, 0]
            low[stream.columns], high[stream.columns] = measure_limits(poses)
        return MotionLimits(low, high)

    def motion_statistics(self, inference: Inference) -> tuple[Array, Array]:
        """Return the expected means and precisions of the motion in its space [each shape=(T, 3, Q)].

        Axis 1: value, slope, curvature. In silence away from speech the mean is the rest pose.
        """
        shape = (inference.observations.frames, 3, self.space.dimensions)
        means, precisions = np.zeros(shape), np.zeros(shape)
        regressions: tuple[VisualRegression, ...] = ()
        if self.regression is not None:
            regression_inputs, regressions = self.regression
            inputs = regression_inputs(inference.observations.streams[0], inference.posteriors.chains[0])
        for number, stream in enumerate(self.visual):
            if not regressions:
                precision, weighted = sum_precisions(self.chains, inference, number + 1)
                mean = weighted / np.maximum(precision, 1e-300)
            else:
                posterior = inference.posteriors.chains[self.chains.structure.chain_of(number + 1)]
                regression = regressions[number]
                mean, precision = regression.means(inputs, posterior), regression.precisions(posterior)
            means[:, :, stream.columns], precisions[:, :, stream.columns] = stream.unstandardised(mean, precision)
        away = self.is_away_from_speech(inference.posteriors.chains[0])
        means[away] = 0
        means[away, 0] = self.rest_pose
        precisions[away] *= REST_PRECISION_FACTOR
        return means, precisions

    def frame_statistics(self, streams: Sequence[Array]) -> tuple[Array, Array]:
        """Return means and precisions of motion whose frames are converted one by one [each shape=(T, 3, Q)].

        streams : the values of all visual streams [each shape=(T, D)]
        These values are the means; only values have a precision, so parameter generation returns the means unchanged.
        """
        shape = (len(streams[0]), 3, self.space.dimensions)
        means, precisions = np.zeros(shape), np.zeros(shape)
        for stream, values in zip(self.visual, streams, strict=True):
            mean, precision = stream.unstandardised(values, np.ones_like(values))
            means[:, :, stream.columns], precisions[:, :, stream.columns] = mean, precision
        precisions[:, 1:] = 0
        return means, precisions

    def is_away_from_speech(self, posterior: Single) -> NDArray[np.bool_]:
        """Return whether each frame is silence away from speech [shape=(T,)], by posteriors of the first chain."""
        structure = self.chains.structure
        silent = np.repeat([structure.chains[0].silent(unit) for unit in structure.units[0]], structure.states)
        speech = posterior @ (~silent).astype(np.float32) > LARGEST_SPEECH_POSTERIOR
        reach = round(AWAY_FROM_SPEECH_S * FRAME_RATE_HZ)
        speech_before = np.cumsum(np.pad(speech.astype(np.intp), (reach + 1, reach)))
        return np.asarray(speech_before[2 * reach + 1 :] == speech_before[: -2 * reach - 1])
