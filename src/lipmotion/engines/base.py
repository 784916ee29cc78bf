"""The interface of engines: what each must do, and what it may do besides, with defaults for those that do not."""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any, ClassVar, Generic, Protocol, TypeVar, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import (
    ChainPosteriors,
    ChannelValue,
    Configuration,
    Constraints,
    Example,
    Explanation,
    Generation,
    Monitor,
    Speech,
    Timeline,
    Unit,
)

ModelT = TypeVar("ModelT")
Arrays = Mapping[str, NDArray[Any]]


def read_presets(engine: str) -> dict[str, dict[str, Any]]:
    """Return the options of each system of a paper, as printed (docs/papers), that is a preset of a built-in engine."""
    presets = json.loads(resources.files(__package__).joinpath("presets.json").read_text("utf-8"))[engine]
    return cast(dict[str, dict[str, Any]], presets)


@dataclass(frozen=True, eq=False)
class Fit(Generic[ModelT]):
    """A trained model, figures of its training, and whether it needs another model's output (``Speech.prior``)."""

    model: ModelT
    figures: Mapping[str, float]
    uses_prior: bool = False


@dataclass(frozen=True)
class Inputs:
    """What an engine takes besides acoustic features, phones in time and motion.

    f0           : F0, ``Speech.log_f0``
    conditions   : acoustic conditions in which training takes each example (``Example.condition_spectra``), and with
                   them spectra (``Speech.spectrum``); 0: neither
    prior        : what another model makes of the speech, ``Speech.prior``: its models can stand on other ones
    posteriors   : those of a phone recogniser, ``Speech.posteriors``, where one is installed
    encoding     : that of the speech encoder, ``Speech.encoding``
    speech_alone : examples without any valid frame: of other speakers, for instance
    """

    f0: bool = False
    conditions: int = 0
    prior: bool = False
    posteriors: bool = False
    encoding: bool = False
    speech_alone: bool = False


class Animator(ABC, Generic[ModelT]):
    """A method that learns motion from examples and generates motion from speech, as baselines of experiments do."""

    @abstractmethod
    def fit(self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT) -> Fit[ModelT]:
        """Return a model that is trained on speech with its motion, and figures of the training.

        examples   : speech with motion; frames in which ``Example.valid`` is False must not change the model
        monitor    : called with reports of progress
        checkpoint : stores finished stages of long training; training that continues from it gives the same bytes
        Raises CorpusError: no example, no valid motion in speech, or examples of different channels.
        """

    @abstractmethod
    def generate(self, model: ModelT, speech: Speech, constraints: Constraints | None = None) -> Generation:
        """Return the motion of one recording, one row for each frame of ``speech.features``, with variances and trace.

        constraints : values that the motion must take
        Raises InputError: a pin names no channel, lies outside the recording or is not finite; an unknown phone.
        """

    def inputs(self, motion_s: float = math.inf) -> Inputs:  # noqa: ARG002
        """Return what training and generation take, with so many seconds of measured motion (infinite: any)."""
        return Inputs()

    def recognise(self, model: ModelT, speech: Speech) -> Timeline[Unit] | None:  # noqa: ARG002
        """Return the phones in time that a model recognises in speech without them; None: not trained on this voice."""
        return None

    def without_closures(self) -> Animator[ModelT]:
        """Return the method without forced closures in p, b and m, for the same models; itself, if it forces none."""
        return self


class Engine(Animator[ModelT]):
    """An engine: a configuration, training, generation, and serialisation of models.

    A subclass is a frozen dataclass with a single field, ``config``; it holds no other state. ``name`` is stored in
    model files; ``Config`` is the class of the configuration. An entry point of the group ``lipmotion.engines``
    registers the engine under its name (docs/extend/engine.md). ``lipmotion.testing.check_engine`` tests the contract.
    """

    name: ClassVar[str]
    Config: ClassVar[type[Configuration]]
    config: Any

    def without_closures(self) -> Engine[ModelT]:
        """Return the engine whose option ``closures`` is off, for the same models; itself, if it has none."""
        if not getattr(self.config, "closures", False):
            return self
        engine: Engine[ModelT] = replace(cast(Any, self), config=replace(self.config, closures=False))
        return engine

    @abstractmethod
    def to_arrays(self, model: ModelT) -> dict[str, NDArray[Any]]:
        """Serialise a model: arrays of numbers, or of text of fixed width, by name."""

    @abstractmethod
    def from_arrays(self, arrays: Arrays) -> ModelT:
        """Deserialise a model. Raises ModelFormatError: an array is missing, unknown, misshapen or out of range."""

    def hidden(self, model: ModelT, speech: Speech) -> tuple[NDArray[np.float32], NDArray[np.float64]] | None:  # noqa: ARG002
        """Return features on which models of other people stand, and the distortion of the sound; None: there are none.

        They have one row every 40 ms: features [shape=(ceil(T / 4), H)], distortion [shape=(ceil(T / 4),)].
        """
        return None

    def explain(self, model: ModelT, speech: Speech, frames: Sequence[int]) -> tuple[Explanation, ...] | None:  # noqa: ARG002
        """Return explanations of frames of generated motion; None: the trace says all (``explain_by_trace``)."""
        return None

    def posteriors(self, model: ModelT, speech: Speech) -> tuple[ChainPosteriors, ...]:  # noqa: ARG002
        """Return, for every chain of hidden states, the posterior probability of each of its units in every frame."""
        return ()

    def describe(self, model: ModelT) -> str:  # noqa: ARG002
        """Return the decision trees of a model as readable text; empty: there are none."""
        return ""


@dataclass(frozen=True)
class SourcePiece:
    """A piece of one recording that says several phones; ``phones_s``: their beginnings in it, by number."""

    recording: str
    start_s: float
    end_s: float
    phones_s: Mapping[int, float]


@runtime_checkable
class SelectsRecordings(Protocol):
    """An engine whose models know recordings of which pieces, one after the other, say any phones."""

    def recordings(self, model: Any) -> tuple[str, ...]:
        """Return the names of the recordings."""

    def stand_ins(self, model: Any) -> Mapping[str, str]:
        """Return the recorded phone in place of each phone that was never recorded."""

    def typical_duration_s(self, model: Any, phone: str) -> float:
        """Return the median duration of a phone in the recordings."""

    def source_pieces(
        self, model: Any, units: Timeline[Unit], features: Mapping[str, NDArray[np.floating[Any]]]
    ) -> tuple[tuple[SourcePiece, ...], Timeline[Unit]]:
        """Return the pieces of recordings that say some phones best, and the phones with the sources of their units.

        units    : phones in time, from 0 s
        features : acoustic features of every recording, by its name [each shape=(T, D)]; pieces join where these agree
        Raises InputError: an unknown phone, or features of other recordings.
        """


def explain_by_trace(generation: Generation, frame: int) -> Explanation:
    """Return an explanation of one frame of generated motion, from its values, variances, units and trace."""
    motion, trace = generation.motion, generation.trace
    time_s = frame / motion.rate_hz
    deviations = np.sqrt(generation.variance_of(slice(frame, frame + 1))[0]).tolist()
    values = zip(motion.names, motion.values[frame].tolist(), deviations, strict=True)
    return Explanation(
        time_s,
        frame,
        next((span for span in generation.units if span.start_s <= time_s < span.end_s), None),
        trace.states[trace.frames[frame]],
        {name: ChannelValue(value, deviation) for name, value, deviation in values},
    )
