from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from lipmotion.engines import Engine, Fit
from lipmotion.errors import InputError
from lipmotion.formats import MotionFormat
from lipmotion.formats.base import MOTION_FORMATS
from lipmotion.motion import (
    LEARNED_MOTION_ARRAYS,
    fit_motion,
    learned_motion_from_arrays,
    learned_motion_to_arrays,
    with_unit_names,
)
from lipmotion.storage.schema import ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.testing import ENGINE_CHECKS, ContractError, TrainedEngine, check_engine, check_exporter
from lipmotion.types import Configuration, Generation, Rule, StateTrace, option
from lipmotion_faces import Face, make_face
from lipmotion_faces.testing import check_face
from lipmotion_faces.tracking.track import track
from testing.toy import toy_motion, toy_sentences, write_toy_recordings

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


def with_values(result: Generation, values: Any) -> Generation:
    return replace(result, motion=replace(result.motion, values=values))


def take_names(result: Generation) -> Generation:
    spans = tuple(replace(span, label=replace(span.label, unit="")) for span in result.units)
    return replace(result, units=replace(result.units, spans=spans))


RESULTS: list[tuple[Callable[[Generation], Generation], str]] = [
    (lambda result: with_values(result, result.motion.values[::2]), "motion has a row for every frame"),
    (lambda result: with_values(result, np.zeros_like(result.motion.values)), "motion is learned"),
    (lambda result: replace(result, trace=StateTrace(("",), result.trace.frames)), "every frame has a state"),
    (take_names, "units keep their times"),
]
"""Ways to break the contract, and the check that must notice."""


def test_an_engine_that_keeps_the_contract_passes():
    check_engine(MeanPoses(Settings()))


@pytest.mark.parametrize(("change", "check"), RESULTS)
def test_a_wrong_result_is_noticed(change, check):
    class Changed(MeanPoses):
        def generate(self, *arguments: Any) -> Generation:
            return change(super().generate(*arguments))

    with pytest.raises(ContractError):
        ENGINE_CHECKS[check](TrainedEngine(Changed(Settings())))


def broken(**methods: Any) -> TrainedEngine:
    return TrainedEngine(type("Changed", (MeanPoses,), methods)(Settings()))


def ignoring_pins(self: Any, model: Any, speech: Any, constraints: Any = None) -> Generation:  # noqa: ARG001
    return MeanPoses.generate(self, model, speech)


def unchecked(_: Any, arrays: Any) -> Any:
    return learned_motion_from_arrays(arrays), arrays["means"]


def ignoring_others(self: Any, arrays: Any) -> Any:
    known = {name: array for name, array in arrays.items() if name in (*LEARNED_MOTION_ARRAYS, *MEANS)}
    return MeanPoses.from_arrays(self, known)


def changing(self: Any, model: Any) -> Any:
    return MeanPoses.to_arrays(self, (model[0], model[1] + 0.1))


def learning_from_all(self: Any, examples: Any, monitor: Any, checkpoint: Any = None) -> Any:
    everything = [replace(one, valid=np.ones_like(one.valid)) for one in examples]
    return MeanPoses.fit(self, everything, monitor, checkpoint)


BROKEN: list[tuple[dict[str, Any], str, str | None]] = [
    ({"generate": ignoring_pins}, "pins are exact", None),
    ({"generate": ignoring_pins}, "wrong pins are input errors", None),
    ({"from_arrays": unchecked}, "damaged arrays are format errors", r"'means' missing: KeyError .* required Model"),
    ({"from_arrays": ignoring_others}, "damaged arrays are format errors", "an unknown array"),
    ({"to_arrays": changing}, "a model comes back from arrays", None),
    ({"fit": learning_from_all}, "frames that are not valid teach nothing", None),
    ({"fit": learning_from_all}, "nothing to learn from is a corpus error", None),
]


@pytest.mark.parametrize(("methods", "check", "message"), BROKEN)
def test_a_method_that_breaks_the_contract_is_noticed(methods, check, message):
    with pytest.raises(ContractError, match=message):
        ENGINE_CHECKS[check](broken(**methods))


class Bars(Face):
    """A small face that keeps the contract."""

    def render(self, motion: Any, units: Any, *, fps: float = 25.0) -> Iterator[Any]:  # noqa: ARG002
        if not fps > 0 or not np.isfinite(motion.values).all():
            raise InputError("not drawable")
        for value in motion.resampled(fps)["opening"]:
            yield np.full((64, 64, 3), int(np.clip(value, 0, 1) * 255), np.uint8)


def draw(frames: Callable[[list[Any]], list[Any]], *, checked: bool = True) -> Face:
    class Changed(Bars):
        def render(self, motion: Any, units: Any, *, fps: float = 25.0) -> Iterator[Any]:
            if not checked:
                motion, fps = replace(motion, values=np.nan_to_num(motion.values)), max(fps, 1.0)
            return iter(frames(list(super().render(motion, units, fps=fps))))

    return Changed()


@pytest.mark.parametrize("face", [Bars(), pytest.param(make_face("portrait"), marks=pytest.mark.long)])
def test_faces_that_keep_the_contract(face):
    check_face(face)


def test_faces_that_break_it():
    for face, words in (
        (draw(lambda frames: frames[1:]), "frames, required"),
        (draw(lambda frames: [frame[:63] for frame in frames]), "H and W even"),
        (draw(lambda frames: [frames[0]] * len(frames)), "does not move"),
        (draw(lambda frames: frames, checked=False), "not finite: no error"),
    ):
        with pytest.raises(ContractError, match=words):
            check_face(face)


def test_formats_that_keep_the_contract():
    for name in MOTION_FORMATS.names:
        check_exporter(MOTION_FORMATS.load(name))


def test_formats_that_break_it():
    npz = MOTION_FORMATS.load("npz")

    def wrong(path: Path) -> Any:
        motion, units = npz.read(path)  # type: ignore[misc]
        return replace(motion, values=motion.values + 0.01), units

    def slower(path: Path) -> Any:
        motion, units = npz.read(path)  # type: ignore[misc]
        return replace(motion, rate_hz=motion.rate_hz / 2), units

    for broken, words in (
        (MotionFormat(lambda *_: None), "no file, or an empty one"),
        (MotionFormat(npz.write, wrong), "values come back that differ"),
        (MotionFormat(npz.write, slower), "Hz come back"),
    ):
        with pytest.raises(ContractError, match=words):
            check_exporter(broken)


FPS = 25.0


@pytest.mark.long
@pytest.mark.video
def test_toy_faces_can_be_tracked(tmp_path):
    pytest.importorskip("mediapipe")
    for path, sentence in zip(write_toy_recordings(tmp_path, sentences=3), toy_sentences(3), strict=True):
        tracked, known = track(path, crops=False), toy_motion(sentence.units, FPS)["opening"]
        opening = tracked.motion["opening"]
        assert tracked.seen.all()
        assert np.corrcoef(opening, known)[0, 1] > 0.9
        assert np.median(opening[known == 0]) < 0.3 * np.percentile(opening, 95)
