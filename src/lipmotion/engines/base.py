"""What every engine does."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.storage.checkpoint import NOTHING_KEPT, Checkpoint
from lipmotion.types import (
    ChainPosteriors,
    ChannelValue,
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
    """A trained model, and figures of its training by name."""

    model: ModelT
    figures: Mapping[str, float]


class Animator(ABC, Generic[ModelT]):
    """Learns to make motion of speech. What was learned is the model, what came out is the ``Generation``."""

    @property
    def hears_f0(self) -> bool:
        """Whether it wants ``Speech.log_f0``."""
        return False

    @property
    def hears_others(self) -> bool:
        """Whether it learns from examples in which no motion was seen: speech of other speakers."""
        return False

    @abstractmethod
    def fit(self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NOTHING_KEPT) -> Fit[ModelT]:
        """Learn from speech with its motion.

        checkpoint : keeps what is finished of long work; going on from there gives the same bytes

        Raises CorpusError: no example, or none with motion that was seen.
        """

    def listen(self, model: ModelT, speech: Speech) -> Timeline[Unit] | None:  # noqa: ARG002
        """Return the phones that the engine's own models hear; None where they do not know the voice."""
        return None

    def unpinned(self) -> Animator[ModelT]:
        """Return the animator that makes no lips meet in p, b and m, but does as it has learned; by default itself."""
        return self

    @abstractmethod
    def generate(self, model: ModelT, speech: Speech, constraints: Constraints | None = None) -> Generation:
        """Return the motion that goes with speech, at 100 Hz, one row a feature frame.

        Raises InputError: a constraint names no channel, or lies outside the recording.
        """


class Engine(Animator[ModelT]):
    """An animator whose models are kept in files. Holds its configuration only."""

    name: ClassVar[str]
    config: Any

    def explain(self, model: ModelT, speech: Speech, frames: Sequence[int]) -> tuple[Explanation, ...]:
        """Return what stands behind some frames of what ``generate`` makes of speech.

        frames : numbers from 0 to T - 1
        """
        result = self.generate(model, speech)
        return tuple(traced(result, frame) for frame in frames)

    @property
    def has_chains(self) -> bool:
        """Whether it has chains of states that ``beliefs`` tells of."""
        return False

    def check_chains(self) -> None:
        """Raise InputError unless the engine has chains."""
        if not self.has_chains:
            raise InputError(
                f"the engine {self.name!r} has no chains of states whose posteriors could be shown; give a model that "
                "was trained with --engine coupled"
            )

    def beliefs(self, model: ModelT, speech: Speech) -> tuple[ChainPosteriors, ...]:  # noqa: ARG002
        """Return what is believed of every chain of states over time. Raises InputError: the engine has no chains."""
        self.check_chains()
        return ()

    @abstractmethod
    def trees(self, model: ModelT) -> str:
        """Return the decision trees of a model for people to read."""

    @abstractmethod
    def to_arrays(self, model: ModelT) -> dict[str, NDArray[Any]]:
        """Return the model as plain arrays (numbers, or fixed-width text)."""

    @abstractmethod
    def from_arrays(self, arrays: Arrays) -> ModelT:
        """Return the model again. Raises ModelFormatError: an array is missing or has the wrong shape."""


def traced(result: Generation, frame: int) -> Explanation:
    """Return what a result itself says of one of its frames."""
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
