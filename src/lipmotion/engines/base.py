"""What every engine does."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.checkpoint import NOTHING_KEPT, Checkpoint
from lipmotion.types import Constraints, Example, Generation, Monitor, Speech, Timeline, Unit

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

    @abstractmethod
    def generate(self, model: ModelT, speech: Speech, constraints: Constraints | None = None) -> Generation:
        """Return the motion that goes with speech, at 100 Hz, one row a feature frame.

        Raises InputError: a constraint names no channel, or lies outside the recording.
        """


class Engine(Animator[ModelT]):
    """An animator whose models are kept in files. Holds its configuration only."""

    name: ClassVar[str]
    config: Any

    @abstractmethod
    def trees(self, model: ModelT) -> str:
        """Return the decision trees of a model for people to read."""

    @abstractmethod
    def to_arrays(self, model: ModelT) -> dict[str, NDArray[Any]]:
        """Return the model as plain arrays (numbers, or fixed-width text)."""

    @abstractmethod
    def from_arrays(self, arrays: Arrays) -> ModelT:
        """Return the model again. Raises ModelFormatError: an array is missing or has the wrong shape."""


def frame_of(time_s: float, frames: int, rate_hz: float) -> int | None:
    """Return the frame nearest to a time, or None where the recording has none."""
    frame = np.floor(time_s * rate_hz + 0.5)
    return int(frame) if 0 <= frame < frames else None
