"""The joint engine and its options: one hidden Markov model of five streams of speech, F0 and motion."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit, Inputs, read_presets
from lipmotion.errors import AlignmentError, CorpusError, InputError
from lipmotion.hmm.multistream.densities import MOTION, StreamObservations, StreamWeights, stream_observations
from lipmotion.hmm.multistream.model import JointConfig, JointHmm, joint_from_arrays, joint_to_arrays
from lipmotion.hmm.multistream.multistream_training import TrainingUtterance, grow_joint
from lipmotion.hmm.multistream.recognise import StatePath, align, merge_gaussians, recognise_units, select_densities
from lipmotion.hmm.multistream.unit_states import Inventory, frames_to_units, units_to_frames
from lipmotion.motion.arrays import MOTION_ARRAYS, motion_from_arrays, motion_to_arrays
from lipmotion.motion.articulation import ArticulationPrior, fit_articulation_prior
from lipmotion.motion.closure import Closure, fit_closure
from lipmotion.motion.frame_labels import with_unit_names
from lipmotion.motion.generation import LearnedMotion
from lipmotion.motion.space import MotionLimits, MotionSpace, check_poses, fit_reduced_motion, measure_limits
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.storage.schema import format_errors, refuse_undeclared, select_arrays
from lipmotion.types import (
    FRAME_RATE_HZ,
    Configuration,
    Constraints,
    Example,
    Generation,
    Monitor,
    Rule,
    Speech,
    StateTrace,
    Timeline,
    Unit,
    option,
)
from lipmotion.units import LIP_CLOSING, UnitSet, is_silent, load_unit_set

COUNT = Rule(least=1)
WEIGHT = Rule(least=0)


@dataclass(frozen=True)
class JointEngineConfig(Configuration):
    """Options of the joint engine.

    units      : name of a unit set, or path of a table of units (docs/unit-sets.md)
    states     : states per unit, left to right, without skips
    mixtures, motion_mixtures : Gaussians per state of speech, and of motion (powers of two)
    components : principal components that all point channels are reduced to
    channels   : channels of motion that are modelled, as ``opening width``; empty: all
    f0         : model the three streams of F0 (False: their weights are 0 everywhere)
    motion_in_training : the motion stream takes part when states are aligned in training (False: its weight is 0)
    speech_weight, f0_weight, motion_weight : of the streams when states are aligned in training
    recognition_speech_weight, recognition_f0_weight : of the streams in recognition and in alignment
    bigram_weight, insertion : scale of the log bigram, and log insertion penalty of every unit, in recognition
    both_neighbours : trees of speech and F0 ask about both neighbours in every state (False: states before a unit's
                 middle about the left one, those after it about the right one, and the middle about none)
    flat_start : training starts from states of equal length (False: from the phones in time)
    recognise_units : where neither words nor units are given, recognise the units of the model by its own bigram
                 (False: use the phones of the shared recogniser)
    own_alignment : the model itself times the phones of given words (False: they have the times of the shared
                 aligner). Times that are given with the units stay as they are
    closures   : make the lips meet in every p, b and m, and in every recognised unit that has no other phones
    articulation : lean on the table of English articulation in contexts that training saw little of
    """

    units: str = "phone"
    states: int = option(3, COUNT)
    mixtures: int = option(4, COUNT)
    motion_mixtures: int = option(1, COUNT)
    components: int = option(16, COUNT)
    f0: bool = True
    motion_in_training: bool = True
    recognise_units: bool = False
    own_alignment: bool = option(False, omit_default=True)
    closures: bool = True
    articulation: bool = True
    speech_weight: float = option(1.0, WEIGHT, omit_default=True)
    f0_weight: float = option(1.0, WEIGHT, omit_default=True)
    motion_weight: float = option(1.0, WEIGHT, omit_default=True)
    recognition_speech_weight: float = option(1.0, WEIGHT, omit_default=True)
    recognition_f0_weight: float = option(1.0, WEIGHT, omit_default=True)
    bigram_weight: float = option(4.0, WEIGHT, omit_default=True)
    insertion: float = option(-4.0, omit_default=True)
    both_neighbours: bool = option(False, omit_default=True)
    flat_start: bool = option(False, omit_default=True)
    channels: str = option("", omit_default=True)

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = read_presets("joint")
    removed: ClassVar[Mapping[str, Any]] = {"paths": 1, "seed": 0}
    aliases: ClassVar[Mapping[str, str]] = {"sees": "motion_in_training", "recognises": "recognise_units"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.hmm.training.active:
            raise InputError("all streams are switched off in training; give at least one a weight")
        if not self.hmm.recognition.active:
            raise InputError("no stream takes part in recognition; give speech or F0 a weight")

    def check_files(self) -> None:  # noqa: D102
        load_unit_set(self.units)

    @property
    def hmm(self) -> JointConfig:
        """Configuration of the joint model: its states and mixtures, and the stream weights."""
        training, recognition = (weight if self.f0 else 0.0 for weight in (self.f0_weight, self.recognition_f0_weight))
        motion = self.motion_weight if self.motion_in_training else 0.0
        return JointConfig(
            states=self.states,
            mixtures=self.mixtures,
            motion_mixtures=self.motion_mixtures,
            both_neighbours=self.both_neighbours,
            bigram_weight=self.bigram_weight,
            insertion=self.insertion,
            training=StreamWeights(self.speech_weight, training, training, training, motion),
            recognition=StreamWeights(self.recognition_speech_weight, recognition, recognition, recognition, 0.0),
        )


PREFIX = "joint_"


@dataclass(frozen=True, eq=False)
class JointModel:
    """A joint model with the space of its motion.

    closure : of the lips in p, b and m (None: the motion has no channel ``opening``)
    prior   : the table of articulation in the speaker's range (None: there is none)
    """

    units: UnitSet
    space: MotionSpace
    hmm: JointHmm
    closure: Closure | None
    prior: ArticulationPrior | None

    def __repr__(self) -> str:
        size = f"{len(self.hmm.models)} streams, {self.space.dimensions} dimensions"
        return f"JointModel({self.units.name} units, {size})"

    @cached_property
    def motion(self) -> LearnedMotion:
        """What turns predicted means into motion."""
        limits = self.poses.extend(self.hmm.models[MOTION].scale.deviation[: self.space.dimensions])
        return LearnedMotion(self.space, self.closure, limits, prior=self.prior)

    @property
    def poses(self) -> MotionLimits:
        """Smallest and largest means of all states [each shape=(Q,)]."""
        stream, Q = self.hmm.models[MOTION], self.space.dimensions
        means = stream.tied.mixtures.means[:, :, :Q].reshape(-1, Q)
        return measure_limits(means * stream.scale.deviation[:Q] + stream.scale.mean[:Q])


@final
@dataclass(frozen=True)
class JointEngine(Engine[JointModel]):
    """One model of speech, F0 and motion: speech and F0 recognise or align, motion generates.

    Source: Hofer 2008, §4 and §5.  Deviations, which the preset ``hofer2008`` does not have: trees of speech and F0
    ask about one neighbour, those of motion about both; phones of untranscribed speech are those of the shared
    recogniser; lips are made to meet in p, b and m, and means lean on a table of articulation.
    """

    config: JointEngineConfig
    name: ClassVar[str] = "joint"
    Config: ClassVar[type[Configuration]] = JointEngineConfig

    def inputs(self, motion_s: float = math.inf) -> Inputs:  # noqa: D102, ARG002
        return Inputs(f0=self.config.f0)

    def fit(  # noqa: D102
        self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT
    ) -> Fit[JointModel]:
        *_, model = self.growing_models(examples, monitor, checkpoint)
        figures = {f"leaves_{name}": float(stream.forest.size) for name, stream in model.hmm.models.items()}
        frames = sum(int(example.valid.sum()) for example in examples)
        return Fit(model, {"frames": frames, **figures})

    def growing_models(
        self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT
    ) -> Iterator[JointModel]:
        """Yield a model for every number of Gaussians, 1, 2, 4 …, of one training; the last is that of ``fit``.

        Raises InputError: no such channel. Raises CorpusError: no speech.
        """
        if names := self.config.channels.split():
            examples = [replace(each, motion=each.motion.selected(names)) for each in examples]
        units = load_unit_set(self.config.units)
        space, values = fit_reduced_motion(examples, self.config.components)
        utterances = []
        for example, x in zip(examples, values, strict=True):
            observed = self._observations(example.speech, x, example.valid)
            spoken, bounds = units_to_frames(example.speech.units, observed.frames, units.silence[0], units.unit_of)
            utterances.append(TrainingUtterance(observed, spoken, None if self.config.flat_start else bounds))
        if all(set(utterance.units) <= set(units.silence) for utterance in utterances):
            raise CorpusError(f"no speech in {len(examples)} examples; train on speech")
        silence = units.silence[:1] + tuple(unit for unit in units.silence[1:] if units.silent(unit))  # only silence
        inventory = Inventory(units.units, silence, self.config.states)
        closure = fit_closure(space.direct_names, values, examples)
        prior = fit_articulation_prior(space, values, examples) if self.config.articulation else None
        for hmm in grow_joint(utterances, inventory, units.classes(), self.config.hmm, monitor, checkpoint):
            yield JointModel(units, space, hmm, closure, prior)

    def generate(self, model: JointModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        observations, duration_s = self._observations(speech), speech.features.duration_s

        def recognise() -> tuple[Timeline[Unit], StatePath]:
            names, bounds = recognise_units(model.hmm, observations)
            labels = (replace(model.units.label(name), confidence=0.0) for name in names)
            units = frames_to_units(labels, bounds, duration_s)
            return units, align(model.hmm, observations, names, bounds)

        if self.config.recognise_units and not speech.units_decide:
            units, path = speech.cached(model.hmm, recognise)
        else:
            units = speech.units
            if self.config.own_alignment and speech.units_known and not speech.times_given:
                units = _align_times(model, observations, units, duration_s)
            names, bounds = units_to_frames(units, observations.frames, model.units.silence[0], model.units.unit_of)
            path = align(model.hmm, observations, names, bounds)
        means, precisions = merge_gaussians(select_densities(model.hmm, path))
        motion, variance = model.motion.generate(
            lambda frames: (means[frames], precisions[frames]),
            len(speech.features.values),
            units,
            constraints,
            close=self.config.closures,
            closing_units=tuple(u for u in model.units.units if set(model.units.phones(u)).issubset(LIP_CLOSING)),
        )
        forest = model.hmm.models[MOTION].forest
        states = tuple(
            f"{left}-{unit}+{right}.{state}: {forest.name(forest.leaf(((left, unit, right), state)))}"
            for (left, unit, right), state in path.states.triphones
        )
        return Generation(motion, variance, with_unit_names(units, model.units), StateTrace(states, path.frames))

    def describe(self, model: JointModel) -> str:  # noqa: D102
        return model.hmm.text()

    def to_arrays(self, model: JointModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        joint = {f"{PREFIX}{name}": array for name, array in joint_to_arrays(model.hmm).items()}
        return motion_to_arrays(model.units, model.space, model.closure, model.prior) | joint

    def from_arrays(self, arrays: Arrays) -> JointModel:  # noqa: D102
        with format_errors("the joint model"):
            joint = (name for name in arrays if name.startswith(PREFIX))
            refuse_undeclared(arrays, MOTION_ARRAYS, joint)
            units, space, closure, prior = motion_from_arrays(arrays, self.config.units)
            hmm = joint_from_arrays(select_arrays(arrays, PREFIX), self.config.hmm)
            if set(hmm.inventory.names) != set(units.units):
                raise ValueError(f"the units {' '.join(hmm.inventory.names)}, required {' '.join(units.units)}")
            if MOTION not in hmm.models or len(hmm.models[MOTION].scale.mean) != 3 * space.dimensions:
                raise ValueError(f"motion that is not of {space.dimensions} dimensions")
            model = JointModel(units, space, hmm, closure, prior)
            check_poses(model.poses, space, closure)
            return model

    def _observations(
        self, speech: Speech, motion: NDArray[np.float64] | None = None, valid: NDArray[np.bool_] | None = None
    ) -> StreamObservations:
        f0 = speech.log_f0 if self.config.f0 else None
        return stream_observations(np.asarray(speech.features.values), f0, motion, valid)


def _align_times(
    model: JointModel, observations: StreamObservations, units: Timeline[Unit], duration_s: float
) -> Timeline[Unit]:
    """Return units at the times that the model gives them by forced alignment."""
    min_s = model.hmm.inventory.states / FRAME_RATE_HZ
    spoken = [span for span in units if span.duration_s >= min_s or not is_silent(span.label.phone)]
    names = [model.units.unit_of(span.label) for span in spoken]
    try:
        bounds = align(model.hmm, observations, names).bounds(len(names))
    except AlignmentError:
        return units
    return frames_to_units((span.label for span in spoken), bounds, duration_s)
