"""Predictors: methods that predict motion from speech, beside the states or recorded units of an engine.

A model has one at most, which may contain another. Engines know the interface alone, ``Predictor``; the registry knows
the classes (docs/extend/predictor.md).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ModelFormatError
from lipmotion.extensions import Registry
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, refuse_undeclared, select_arrays
from lipmotion.types import FRAME_RATE_HZ, Example, Monitor, Speech, silent_monitor

Array = NDArray[np.float64]
PredictorT = TypeVar("PredictorT", bound="Predictor")
AUTOMATIC = "auto"  # stands for the predictor that suits the examples, where no name is given
MIN_OWN_S = 480.0  # from this much measured motion on, a model does not stand on another one
FOLDS = 4


@dataclass(frozen=True, eq=False)
class PredictorTraining:
    """What a predictor is trained on, and with."""

    examples: Sequence[Example]  # speech with motion; those frames count in which ``Example.valid`` is True
    values: Sequence[Array]  # the motion of each example in the motion space [each shape=(T, Q)]
    direct: int  # number of channels that are modelled as they are, the first dimensions; the others are components
    epochs: int = 1  # how often each example is used, in methods that use it several times
    monitor: Monitor = silent_monitor  # called with reports of progress
    checkpoint: Checkpoint = NO_CHECKPOINT  # stores finished stages of long training


class PredictorFit(NamedTuple):
    """A trained predictor.

    held_out : predictions for each example by predictors trained on the other ``split_folds`` [each shape=(T, Q)];
               the trajectory engine then measures how far to rely on the predictor. None: its weight is a constant
    """

    predictor: Predictor
    held_out: Sequence[Array] | None = None


class Predictor(ABC):
    """A method that predicts motion from speech.

    A subclass is a frozen dataclass of what was learned; the arrays in ``ARRAYS`` are fields.

    name              : under which it is registered, and its arrays are stored
    ARRAYS            : the stored arrays, where Q is the number of dimensions of motion
    CONTAINS          : names of predictors whose arrays may be stored with its own: it has one of them inside
    uses_prior        : whether it predicts from ``Speech.prior``: then the model stands on another model
    uses_articulation : whether the table of articulation is among its inputs: then engines do not lean on it once more
    variances         : of the error of static value, Δ and Δ² [shape=(3, Q)]
    """

    name: ClassVar[str]
    ARRAYS: ClassVar[Mapping[str, ArraySpec]]
    CONTAINS: ClassVar[frozenset[str]] = frozenset()
    needs: ClassVar[str] = ""
    uses_prior: ClassVar[bool] = False
    uses_articulation: ClassVar[bool] = False
    variances: Array

    @classmethod
    @abstractmethod
    def fit(cls, training: PredictorTraining) -> PredictorFit:
        """Return a predictor that is trained on examples. Raises CorpusError: it cannot be trained on these."""

    @classmethod
    def conditions(cls, motion_s: float, most: int) -> int:  # noqa: ARG003
        """Return in how many of ``most`` acoustic conditions each example is taken, by seconds of measured motion."""
        return most

    @abstractmethod
    def predict(self, speech: Speech) -> tuple[Array, Array]:
        """Return motion [shape=(T, Q)] and distortion, 0 to 1 [shape=(T,)]. Raises InputError: something is missing."""

    def can_predict(self, speech: Speech) -> bool:
        """Return whether speech has what ``predict`` needs of it."""
        return not self.needs or getattr(speech, self.needs) is not None

    def hidden(self, speech: Speech) -> tuple[NDArray[np.float32], Array] | None:  # noqa: ARG002
        """Return a hidden layer every 40 ms [shape=(ceil(T / 4), H)] and the distortion, to stand on, or None."""
        return None

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Serialise the predictor: the arrays of ``ARRAYS``."""
        return {name: getattr(self, name) for name in self.ARRAYS}

    @classmethod
    def from_arrays(cls: type[PredictorT], arrays: Arrays, dimensions: int) -> PredictorT:
        """Deserialise a predictor in Q dimensions. Raises KeyError, ValueError: an array is missing or damaged."""
        constructor: Any = cls  # every predictor is a dataclass
        restored: PredictorT = constructor(**check_arrays(arrays, cls.ARRAYS, Q=dimensions).arrays)
        return restored


PREDICTORS: Registry[type[Predictor]] = Registry(
    "predictor",
    "lipmotion.predictors",
    {
        "network": "lipmotion.motion.acoustic_network:AcousticNetwork",
        "posteriors": "lipmotion.motion.posterior_network:PosteriorNetwork",
        "prior": "lipmotion.motion.prior_regression:PriorRegression",
        "encoding": "lipmotion.motion.prior_regression:EncodingRegression",
    },
    Predictor,
    named=True,
)


def check_predictor(name: str) -> None:
    """Raise InputError if no predictor can be chosen by a name, which may be ``AUTOMATIC``."""
    if name != AUTOMATIC:
        PREDICTORS.load(name)


def choose_predictor(name: str, examples: Sequence[Example]) -> type[Predictor] | None:
    """Return the predictor of a name; for ``AUTOMATIC`` the one that suits the examples, None if there is none.

    With little motion and another model to stand on, it is a regression; with much motion a network, given acoustic
    conditions; else a network from posteriors, given those.
    """
    if name != AUTOMATIC:
        return PREDICTORS.load(name)
    measured_s = sum(int(example.valid.sum()) for example in examples) / FRAME_RATE_HZ
    if measured_s < MIN_OWN_S and all(example.speech.prior is not None for example in examples):
        return PREDICTORS.load("prior")
    network = PREDICTORS.load("network")
    if network.conditions(measured_s, 1) and all(example.condition_spectra for example in examples):
        return network
    if all(example.speech.posteriors is not None for example in examples):
        return PREDICTORS.load("posteriors")
    return None


def count_conditions(name: str, motion_s: float, most: int) -> int:
    """Return in how many acoustic conditions training takes each example, as ``Predictor.conditions``, by a name."""
    names = ("network", "posteriors") if name == AUTOMATIC else (name,)
    return max(PREDICTORS.load(each).conditions(motion_s, most) for each in names)


def split_folds(count: int) -> Iterator[tuple[list[int], list[int]]]:
    """Yield the numbers of the examples inside and outside of each fold; a single example is both."""
    if count == 1:
        yield [0], [0]
        return
    for fold in range(min(FOLDS, count)):
        outside = list(range(fold, count, FOLDS))
        yield [number for number in range(count) if number not in outside], outside


ADDED = "predictor."
"""Arrays of added predictors are stored as ``predictor.NAME.ARRAY``, those of built-in ones under their own names."""


def predictor_to_arrays(predictor: Predictor | None) -> dict[str, NDArray[Any]]:
    """Serialise a predictor; no array where there is none."""
    if predictor is None:
        return {}
    prefix = "" if predictor.name in PREDICTORS.built_in else f"{ADDED}{predictor.name}."
    return {prefix + name: array for name, array in predictor.arrays().items()}


def list_predictor_arrays(arrays: Arrays) -> set[str]:
    """Return the names of those arrays that are a predictor's."""
    built_in = {name for known in PREDICTORS.built_in for name in PREDICTORS.load(known).ARRAYS}
    return {name for name in arrays if name in built_in or name.startswith(ADDED)}


def predictor_from_arrays(arrays: Arrays, dimensions: int) -> Predictor | None:
    """Deserialise a predictor; None where there is none, as in models of earlier versions.

    dimensions : of the motion space, Q
    Raises KeyError, ValueError: an array is missing or undeclared, or has a wrong shape, type or range; or there are
    several predictors. ModelFormatError: the predictor is of a package that is not installed.
    """
    names = {name.rpartition(".")[0] for name in select_arrays(arrays, ADDED)}
    added = {name: select_arrays(arrays, f"{ADDED}{name}.") for name in sorted(names)}
    fitting = [name for name in PREDICTORS.built_in if arrays.keys() & PREDICTORS.load(name).ARRAYS]
    inside = {part for name in fitting for part in PREDICTORS.load(name).CONTAINS}
    stored = {name: arrays for name in fitting if name not in inside} | added
    if len(stored) > 1:
        raise ValueError(f"the predictors {' and '.join(stored)}, required one of them")
    if not stored:
        return None
    ((name, chosen_arrays),) = stored.items()
    if name not in PREDICTORS.names:
        known = ", ".join(PREDICTORS.names)
        raise ModelFormatError(f"no predictor {name!r}; there are: {known}; install the package that adds it")
    chosen = PREDICTORS.load(name)
    if name in added:
        refuse_undeclared(chosen_arrays, chosen.ARRAYS)
    return chosen.from_arrays(chosen_arrays, dimensions)
