"""The interface of engines: five members that every engine has, and protocols for what only some can do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
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


@dataclass(frozen=True, eq=False)
class Fit(Generic[ModelT]):
    """A trained model, and figures of its training by name (``frames``, ``leaves``, ...)."""

    model: ModelT
    figures: Mapping[str, float]


class Animator(ABC, Generic[ModelT]):
    """A method that learns motion from examples and generates it from speech.

    Baselines that are only compared stop here; an ``Engine`` can be configured, saved and loaded as well.
    """

    @abstractmethod
    def fit(self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT) -> Fit[ModelT]:
        """Return a model trained on speech with its motion.

        examples   : frames in which ``Example.valid`` is False must not change the model
        monitor    : called with the progress of training
        checkpoint : stores finished stages of long training; a run that continues from it gives the same bytes
        Raises CorpusError: no example, no valid motion in speech, or examples of different channels.
        """

    @abstractmethod
    def generate(self, model: ModelT, speech: Speech, constraints: Constraints | None = None) -> Generation:
        """Return the motion of one recording: a row for each feature frame, at 100 Hz, with variances and trace.

        Raises InputError: a pin names no channel, lies outside the recording or is not finite; an unknown phone.
        """


class Engine(Animator[ModelT]):
    """An engine: a configuration, training, generation, and the model as arrays.

    A subclass is a frozen dataclass with the one field ``config``; it holds no state. Give it a ``name``, which model
    files store, and the class of its ``Config``; an entry point of the group ``lipmotion.engines`` makes it known under
    that name (docs/extend/engine.md). ``lipmotion.testing.check_engine`` tests the contract.
    """

    name: ClassVar[str]
    Config: ClassVar[type[Configuration]]
    config: Any

    @abstractmethod
    def to_arrays(self, model: ModelT) -> dict[str, NDArray[Any]]:
        """Serialise a model: arrays of numbers or of fixed-width text by name."""

    @abstractmethod
    def from_arrays(self, arrays: Arrays) -> ModelT:
        """Deserialise a model.

        Raises ModelFormatError: an array is missing or unknown, or has a wrong shape, type or range.
        """


@runtime_checkable
class WantsF0(Protocol):
    """An engine that may need the fundamental frequency."""

    @property
    def wants_f0(self) -> bool:
        """Whether ``Speech.log_f0`` must be given, in training and in generation."""


@runtime_checkable
class TrainsOnSpeechAlone(Protocol):
    """An engine that also learns from speech without motion: of other speakers, for instance."""

    @property
    def trains_on_speech_alone(self) -> bool:
        """Whether ``fit`` takes examples none of whose frames is valid."""


@runtime_checkable
class RecognisesPhones(Protocol):
    """An engine whose models can recognise phones."""

    def recognise(self, model: Any, speech: Speech) -> Timeline[Unit] | None:
        """Return the phones recognised by a model; None where it was not trained on this voice.

        speech : ``units`` are empty
        """


@runtime_checkable
class ForcesClosures(Protocol):
    """An engine that makes the lips meet in p, b and m."""

    def without_closures(self) -> Animator[Any]:
        """Return the engine that forces no closures, for models that it trained; itself, if it never forces any."""


@runtime_checkable
class Explains(Protocol):
    """An engine that says more of a frame than its trace."""

    def explain(self, model: Any, speech: Speech, frames: Sequence[int]) -> tuple[Explanation, ...]:
        """Return an explanation of each of some frames, numbered from 0 to T - 1, of what ``generate`` returns."""


@runtime_checkable
class HasPosteriors(Protocol):
    """An engine with chains of hidden states."""

    def posteriors(self, model: Any, speech: Speech) -> tuple[ChainPosteriors, ...]:
        """Return the posterior probabilities of the units of every chain in every frame."""


@runtime_checkable
class Describes(Protocol):
    """An engine whose models can be printed."""

    def describe(self, model: Any) -> str:
        """Return the parts of a model as text: its decision trees, its chains."""


def explain_by_trace(result: Generation, frame: int) -> Explanation:
    """Return an explanation of one frame from the motion, variances, units and trace of a result."""
    motion, trace = result.motion, result.trace
    time_s = frame / motion.rate_hz
    deviations = np.sqrt(result.variance_of(slice(frame, frame + 1))[0]).tolist()
    values = zip(motion.names, motion.values[frame].tolist(), deviations, strict=True)
    return Explanation(
        time_s,
        frame,
        next((span for span in result.units if span.start_s <= time_s < span.end_s), None),
        trace.states[trace.frames[frame]],
        {name: ChannelValue(value, deviation) for name, value, deviation in values},
    )
