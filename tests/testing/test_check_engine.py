from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from lipmotion.engines import Engine, Fit
from lipmotion.errors import CorpusError, InputError, ModelFormatError
from lipmotion.motion import (
    LEARNED_MOTION_ARRAYS,
    fit_motion,
    learned_motion_from_arrays,
    learned_motion_to_arrays,
    with_unit_names,
)
from lipmotion.storage.schema import ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.testing import ENGINE_CHECKS, ContractError, TrainedEngine, check_engine
from lipmotion.types import Configuration, Generation, Rule, StateTrace, option

MEANS = {"means": ArraySpec(np.float64, "N Q")}


@dataclass(frozen=True)
class Settings(Configuration):
    shrinkage: float = option(1.0, Rule(above=0))


@dataclass(frozen=True)
class MeanPoses(Engine[Any]):
    """The mean pose of every phone: about the simplest engine that keeps the contract."""

    config: Settings
    name: ClassVar[str] = "mean poses"
    Config: ClassVar[type[Configuration]] = Settings

    def fit(self, examples: Any, monitor: Any, checkpoint: Any = None) -> Fit[Any]:  # noqa: ARG002
        motion, values = fit_motion(examples, 4)
        overall = np.concatenate([x[e.valid] for e, x in zip(examples, values, strict=True)]).mean(axis=0)
        sums, counts = np.tile(overall, (256, 1)), np.ones(256)
        for one, x in zip(examples, values, strict=True):
            rows = label_phones(one.speech)
            np.add.at(sums, rows[one.valid], x[one.valid])
            np.add.at(counts, rows[one.valid], 1)
        return Fit((motion, sums / counts[:, None]), {})

    def generate(self, model: Any, speech: Any, constraints: Any = None) -> Generation:
        motion, poses = model
        means = np.zeros((len(speech.features.values), 3, poses.shape[1]))
        means[:, 0] = poses[label_phones(speech)]
        precisions = np.broadcast_to(np.array([1e3, 1e4, 1e4])[None, :, None], means.shape)
        values, variance = motion.generate(lambda x: (means[x], precisions[x]), len(means), speech.units, constraints)
        trace = StateTrace(("pose",), np.zeros(len(means), int))
        return Generation(values, variance, with_unit_names(speech.units), trace)

    def to_arrays(self, model: Any) -> dict[str, Any]:
        return learned_motion_to_arrays(model[0]) | {"means": model[1]}

    def from_arrays(self, arrays: Any) -> Any:
        motion = learned_motion_from_arrays(arrays)
        with format_errors("the model"):
            refuse_undeclared(arrays, LEARNED_MOTION_ARRAYS, MEANS)
            means = check_arrays(arrays, MEANS, N=256, Q=motion.space.dimensions)["means"]
        return motion, means


def label_phones(speech: Any) -> Any:
    """Return a number for the phone of every frame."""
    time_s, rows = np.arange(len(speech.features.values)) / 100, np.zeros(len(speech.features.values), int)
    for span in speech.units:
        rows[(time_s >= span.start_s) & (time_s < span.end_s)] = sum(map(ord, span.label.phone)) % 255 + 1
    return rows


class Broken:
    """Ways to break the contract: what each of them changes, and the check that must notice."""

    def half(self, result: Generation) -> Generation:
        motion = replace(result.motion, values=result.motion.values[::2])
        return replace(result, motion=motion)

    def still(self, result: Generation) -> Generation:
        return replace(result, motion=replace(result.motion, values=np.zeros_like(result.motion.values)))

    def noisy(self, result: Generation) -> Generation:
        noise = np.random.default_rng().normal(0, 1e-9, result.motion.values.shape)
        return replace(result, motion=replace(result.motion, values=result.motion.values + noise))

    def traceless(self, result: Generation) -> Generation:
        return replace(result, trace=StateTrace(("",), result.trace.frames))

    def nameless(self, result: Generation) -> Generation:
        spans = tuple(replace(span, label=replace(span.label, unit="")) for span in result.units)
        return replace(result, units=replace(result.units, spans=spans))


RESULTS: list[tuple[Callable[[Broken, Generation], Generation], str]] = [
    (Broken.half, "motion has a row for every frame"),
    (Broken.still, "motion is learned"),
    (Broken.noisy, "the same input gives the same bytes"),
    (Broken.traceless, "every frame has a state"),
    (Broken.nameless, "units keep their times"),
]


def test_an_engine_that_keeps_the_contract_passes():
    check_engine(MeanPoses(Settings()))


@pytest.mark.parametrize(("change", "check"), RESULTS)
def test_a_wrong_result_is_noticed(change, check):
    class Changed(MeanPoses):
        def generate(self, *arguments: Any) -> Generation:
            return change(Broken(), super().generate(*arguments))

    with pytest.raises(ContractError):
        ENGINE_CHECKS[check](TrainedEngine(Changed(Settings())))
    with pytest.raises(ContractError):
        check_engine(Changed(Settings()))


def broken(**methods: Any) -> TrainedEngine:
    return TrainedEngine(type("Changed", (MeanPoses,), methods)(Settings()))


def test_pins_that_are_ignored_are_noticed():
    def generate(self: Any, model: Any, speech: Any, constraints: Any = None) -> Generation:  # noqa: ARG001
        return MeanPoses.generate(self, model, speech)

    for check in ("pins are exact", "wrong pins are input errors"):
        with pytest.raises(ContractError):
            ENGINE_CHECKS[check](broken(generate=generate))


def test_arrays_that_are_not_checked_are_noticed():
    def from_arrays(_: Any, arrays: Any) -> Any:
        return learned_motion_from_arrays(arrays), arrays["means"]

    with pytest.raises(ContractError, match=r"'means' missing: KeyError .* required ModelFormatError"):
        ENGINE_CHECKS["damaged arrays are format errors"](broken(from_arrays=from_arrays))


def test_arrays_of_nobody_are_noticed():
    def from_arrays(self: Any, arrays: Any) -> Any:
        known = {name: array for name, array in arrays.items() if name in (*LEARNED_MOTION_ARRAYS, *MEANS)}
        return MeanPoses.from_arrays(self, known)

    with pytest.raises(ContractError, match="an unknown array"):
        ENGINE_CHECKS["damaged arrays are format errors"](broken(from_arrays=from_arrays))


def test_a_model_that_does_not_come_back_is_noticed():
    def to_arrays(self: Any, model: Any) -> Any:
        return MeanPoses.to_arrays(self, (model[0], model[1] + 0.1))

    with pytest.raises(ContractError):
        ENGINE_CHECKS["a model comes back from arrays"](broken(to_arrays=to_arrays))


def test_learning_from_frames_that_are_not_valid_is_noticed():
    def fit(self: Any, examples: Any, monitor: Any, checkpoint: Any = None) -> Any:
        everything = [replace(one, valid=np.ones_like(one.valid)) for one in examples]
        return MeanPoses.fit(self, everything, monitor, checkpoint)

    for check in ("frames that are not valid teach nothing", "nothing to learn from is a corpus error"):
        with pytest.raises(ContractError):
            ENGINE_CHECKS[check](broken(fit=fit))


@pytest.mark.parametrize("error", [InputError, CorpusError, ModelFormatError])
def test_an_error_of_the_engine_names_the_check(error):
    def generate(*_: Any) -> Any:
        raise error("out of order")

    with pytest.raises(ContractError, match=f"motion has a row for every frame: .*{error.__name__}: out of order"):
        check_engine(broken(generate=generate).engine)


def test_a_configuration_that_is_none_is_noticed():
    with pytest.raises(ContractError, match="configuration can be stored"):
        check_engine(MeanPoses(None))  # type: ignore[arg-type]
