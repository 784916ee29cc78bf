"""The contract of engines as checks: ``check_engine(engine)`` runs them all on a few synthetic sentences."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from lipmotion.engines.base import Engine
from lipmotion.errors import CorpusError, InputError, LipMotionError, ModelFormatError
from lipmotion.formats.base import MotionFormat
from lipmotion.formats.fap import FAP
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, CLOSED
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.types import (
    Channel,
    Configuration,
    Constraints,
    Example,
    Features,
    Generation,
    Motion,
    Pin,
    Span,
    Speech,
    StateTrace,
    Timeline,
    Unit,
    silent_monitor,
)
from lipmotion.types.motion import RADIAN
from lipmotion.units import PHONES as INVENTORY

RATE_HZ = 100.0
CHANNELS = tuple(map(Channel, ("opening", "width", "x_17", "y_17", "z_17", "x_61", "y_61")))
OPENINGS = {"sil": 0.02, "p": 0.0, "b": 0.0, "m": 0.0, "aa": 0.30, "iy": 0.12, "uw": 0.08, "t": 0.10, "s": 0.07}
WIDTHS = {"sil": 0.55, "p": 0.54, "b": 0.54, "m": 0.54, "aa": 0.56, "iy": 0.62, "uw": 0.42, "t": 0.57, "s": 0.58}
PHONES = tuple(OPENINGS)
MARGIN_S = 0.6  # silence at both ends, long enough for the mouth to rest in it


def timeline(phones: Sequence[str], duration_s: float = 0.1) -> Timeline[Unit]:
    """Return phones of equal duration in seconds, between two silences of ``MARGIN_S``."""
    edges = np.cumsum([0, MARGIN_S, *(duration_s for _ in phones), MARGIN_S]).round(6).tolist()
    labels = ["sil", *phones, "sil"]
    return Timeline(tuple(Span(a, b, Unit(p)) for a, b, p in zip(edges, edges[1:], labels, strict=False)))


def speech(units: Timeline[Unit], seed: int = 0) -> Speech:
    """Return features [shape=(T, 39)] whose mean is another one for every phone, with the phones in time."""
    duration_s = units.spans[-1].end_s if len(units) else 0.5
    time_s = np.arange(int(np.floor(duration_s * RATE_HZ + 1e-9)) + 1) / RATE_HZ
    sounds = np.random.default_rng(1).normal(0, 1, (64, 39))
    values = np.random.default_rng([2, seed]).normal(0, 0.2, (len(time_s), 39))
    for span in units:
        inside = (time_s >= span.start_s) & (time_s < span.end_s)
        values[inside] += sounds[sum(map(ord, span.label.phone)) % 64]
    return Speech(Features(values.astype(np.float32), duration_s), units)


def motion(units: Timeline[Unit], frames: int, seed: int = 0, noise: float = 0.002) -> Motion:
    """Return poses joined smoothly, at 100 Hz; the points move with the distances, and ``z_17`` never moves.

    units : phones of ``PHONES``;  noise : its standard deviation, eye distances
    """
    time_s = np.arange(frames) / RATE_HZ
    pose = np.array([[OPENINGS["sil"], WIDTHS["sil"]]] * frames)
    for span in units:
        inside = (time_s >= span.start_s) & (time_s < span.end_s)
        pose[inside] = OPENINGS[span.label.phone], WIDTHS[span.label.phone]
    window = np.hanning(9) / np.hanning(9).sum()
    pose = np.stack([np.convolve(np.pad(curve, 4, "edge"), window, "valid") for curve in pose.T], axis=1)
    opening, width = (pose + np.random.default_rng([3, seed]).normal(0, noise, pose.shape)).T
    still = np.zeros(frames)
    points = [still + 0.01, -0.6 - opening, still, width / 2, -0.5 - opening / 4]
    return Motion(np.stack([opening, width, *points], axis=1), RATE_HZ, CHANNELS)


def example(phones: Sequence[str], seed: int = 0, duration_s: float = 0.1) -> Example:
    """Return the speech of some phones with its motion, all of it valid."""
    spoken = speech(timeline(phones, duration_s), seed)
    frames = len(spoken.features.values)
    return Example(f"number{seed}", spoken, motion(spoken.units, frames, seed), np.ones(frames, bool))


def examples(count: int = 12, seed: int = 0) -> list[Example]:
    """Return sentences of twelve phones, ten of them drawn at random; no lip closure first or last."""
    draw = np.random.default_rng(seed)
    spoken = [["t", *(PHONES[i] for i in draw.integers(1, len(PHONES), 10)), "aa"] for _ in range(count)]
    return [example(phones, number, 0.08 + 0.02 * (number % 3)) for number, phones in enumerate(spoken)]


def check_exporter(exporter: MotionFormat) -> None:
    """Check that a motion format writes a result and, if it reads, reads the same motion back to 1e-5.

    Formats of curves are given curves; those of MPEG-4's parameters whole numbers. Channels may come back in another
    order, and beside others; eyes, brows, head and pressed lips may be left out.
    Raises ContractError: what was found.

    >>> from lipmotion.formats.base import MOTION_FORMATS
    >>> check_exporter(MOTION_FORMATS.load("csv"))
    """
    require(isinstance(exporter, MotionFormat), f"found {exporter!r}, required a MotionFormat")
    one = example(("m", "aa"))
    sent = make_curves(one.motion, one.speech.units, exporter.curves) if exporter.curves else one.motion
    if all(channel.unit == FAP for channel in sent.channels):
        sent = replace(sent, values=np.rint(sent.values))
    if exporter.fixed_rate and exporter.rate_hz:
        sent = sent.resampled(exporter.rate_hz)
    trace = StateTrace(("state",), np.zeros(len(sent.values), np.intp))
    result = Generation(sent, np.zeros_like(sent.values), one.speech.units, trace)
    exporter.check(sent)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "motion"
        exporter.write(path, result, {"file": "speech.wav"}, {"name": "model"})
        require(path.is_file() and path.stat().st_size > 0, "no file, or an empty one, is written")
        first = path.read_bytes()
        exporter.write(path, result, {"file": "speech.wav"}, {"name": "model"})
        require(path.read_bytes() == first, "the same result gives other bytes")
        if exporter.read is None:
            return
        motion, _ = exporter.read(path)
    required = {channel.name for channel in sent.channels if channel.unit != RADIAN} - {*ARKIT_OTHERS, CLOSED}
    require(required <= {*motion.names}, f"channels {motion.names} come back, required {sorted(required)}")
    require(abs(motion.rate_hz - sent.rate_hz) < 1e-6, f"{motion.rate_hz} Hz come back, required {sent.rate_hz}")
    require(len(motion.values) == len(sent.values), f"{len(motion.values)} frames come back")
    difference = max(float(np.abs(motion[name] - sent[name]).max()) for name in {*sent.names} & {*motion.names})
    require(difference < 1e-5, f"values come back that differ by {difference:g}")


class ContractError(LipMotionError):
    """An extension breaks the contract of its kind."""


def require(holds: bool, found: str) -> None:
    """Raise ContractError, saying what was found, unless something holds."""
    if not holds:
        raise ContractError(found)


def require_error(kind: type[LipMotionError], call: Callable[[], object], what: str) -> None:
    """Raise ContractError unless a call raises an error of one kind."""
    try:
        call()
    except kind:
        return
    except Exception as error:
        raise ContractError(f"{what}: {type(error).__name__} ({error}), required {kind.__name__}") from error
    raise ContractError(f"{what}: no error, required {kind.__name__}")


SENTENCE = ("t", "aa", "p", "iy", "m", "uw", "s", "aa")
MIN_CORRELATION = 0.5  # between generated and recorded opening, in a sentence of the kind trained on


class TrainedEngine:
    """An engine, and what it learned from twelve synthetic sentences; it is trained when it is first used."""

    def __init__(self, engine: Engine[Any]):
        self.engine = engine

    @cached_property
    def model(self) -> Any:
        """The model."""
        return self.engine.fit(examples(), silent_monitor).model

    def generate(self, spoken: Speech, *pins: Pin) -> Generation:
        """Return what the engine generates for speech, through pins."""
        return self.engine.generate(self.model, spoken, Constraints(pins))


def check_engine(engine: Engine[Any]) -> None:
    """Run every check of the contract of engines on an engine; takes seconds.

    Raises ContractError: the name of the first check that fails, and what was found.

    >>> from lipmotion.engines import engine_named
    >>> check_engine(engine_named("trajectory", {"components": 2, "acoustic_components": 20}))
    """
    trained = TrainedEngine(engine)
    for name, check in ENGINE_CHECKS.items():
        try:
            check(trained)
        except ContractError as error:
            raise ContractError(f"{name}: {error}") from error
        except Exception as error:
            raise ContractError(f"{name}: the engine raises {type(error).__name__}: {error}") from error


def configuration_can_be_stored(trained: TrainedEngine) -> None:
    """The configuration is a ``Configuration``, and comes back from its mapping; the engine has a name."""
    engine = trained.engine
    require(isinstance(engine.config, Configuration), "config is no Configuration")
    require(isinstance(engine.config, engine.Config), f"config is no {engine.Config.__name__}, which Config says")
    back = engine.Config.stored(engine.config.as_mapping())
    require(back == engine.config, f"the configuration comes back as {back}")
    require(bool(engine.name) and engine.name.isprintable(), f"the name is {engine.name!r}")


def motion_has_a_row_for_every_frame(trained: TrainedEngine) -> None:
    """Motion at 100 Hz of all channels trained on, finite, with variances that are not negative."""
    spoken = speech(timeline(SENTENCE))
    result = trained.generate(spoken)
    wanted = (len(spoken.features.values), len(CHANNELS))
    require(result.motion.values.shape == wanted, f"motion of shape {result.motion.values.shape}, required {wanted}")
    require(result.motion.rate_hz == RATE_HZ, f"motion at {result.motion.rate_hz} Hz, required {RATE_HZ}")
    require(result.motion.channels == CHANNELS, f"channels {result.motion.names}, required those trained on")
    _require_numbers(result, wanted)


def motion_is_learned(trained: TrainedEngine) -> None:
    """The opening of a sentence like those of the training moves as the recorded one does."""
    spoken = speech(timeline(SENTENCE))
    recorded = motion(spoken.units, len(spoken.features.values), seed=99)["opening"]
    generated = trained.generate(spoken).motion["opening"]
    require(float(np.ptp(generated)) > 1e-6, "the opening does not move")
    likeness = float(np.corrcoef(generated, recorded)[0, 1])
    require(likeness > MIN_CORRELATION, f"the opening correlates by {likeness:.2f}, required {MIN_CORRELATION}")


def every_frame_has_a_state(trained: TrainedEngine) -> None:
    """The trace names a state for every frame."""
    result = trained.generate(speech(timeline(SENTENCE)))
    frames, states = np.asarray(result.trace.frames), result.trace.states
    require(len(frames) == len(result.motion.values), f"a trace of {len(frames)} frames")
    require(bool(frames.min() >= 0 and frames.max() < len(states)), "the trace points outside its states")
    require(all(states), "a state without a name")


def units_keep_their_times(trained: TrainedEngine) -> None:
    """The units of a result are those of the speech, each with a model unit, and may be passed back."""
    spoken = speech(timeline(SENTENCE))
    result = trained.generate(spoken)
    before, after = ([(s.start_s, s.end_s, s.label.phone) for s in units] for units in (spoken.units, result.units))
    require(before == after, f"units {after}, required {before}")
    require(all(span.label.unit for span in result.units), "a unit without a name")
    _require_same(trained.generate(replace(spoken, units=result.units)), result, "the units passed back")


def pins_are_exact(trained: TrainedEngine) -> None:
    """A pinned value holds in the nearest frame, with variance 0; of two in one frame the last holds."""
    spoken = speech(timeline(("p", "aa", "m")))
    draw = np.random.default_rng(0)
    pins = {int(frame): float(draw.uniform(0, 0.5)) for frame in draw.integers(0, len(spoken.features.values), 8)}
    result = trained.generate(spoken, *(Pin(frame / RATE_HZ, "width", value) for frame, value in pins.items()))
    for frame, value in pins.items():
        found = float(result.motion["width"][frame])
        require(abs(found - value) < 1e-12, f"a pin of {value} gives {found}")
        variance = float(result.variance[frame, result.motion.names.index("width")])
        require(variance == 0, f"the variance at a pin is {variance}")
    _require_numbers(result, result.motion.values.shape)
    result = trained.generate(spoken, Pin(0.7, "width", 0.6), Pin(0.7049, "width", 0.5))
    require(abs(float(result.motion["width"][70]) - 0.5) < 1e-12, "the first of two pins in one frame holds")


def wrong_pins_are_input_errors(trained: TrainedEngine) -> None:
    """A pin of no channel, outside the recording, or without a finite time and value."""
    spoken = speech(timeline(SENTENCE))
    nan, infinite = float("nan"), float("inf")
    for time_s, channel, value in (
        *((0.5, "no such channel", 0.1), (-0.006, "opening", 0.1), (99.0, "opening", 0.1)),
        *((nan, "opening", 0.1), (infinite, "opening", 0.1), (0.5, "opening", nan), (0.5, "opening", -infinite)),
    ):
        pin = Pin(time_s, channel, value)
        require_error(InputError, partial(trained.generate, spoken, pin), f"{pin}")


def the_same_input_gives_the_same_bytes(trained: TrainedEngine) -> None:
    """Generation, and training."""
    spoken = speech(timeline(SENTENCE))
    result = trained.generate(spoken)
    _require_same(trained.generate(spoken), result, "generating twice")
    _require_same(trained.engine.generate(trained.model, spoken), result, "no constraints, and empty ones")
    _require_same(TrainedEngine(trained.engine).generate(spoken), result, "training twice")


def a_model_comes_back_from_arrays(trained: TrainedEngine) -> None:
    """Stored values may be rounded once, to half precision; then they stay what they are."""
    engine, spoken = trained.engine, speech(timeline(SENTENCE))
    arrays = engine.to_arrays(trained.model)
    require(bool(arrays), "no arrays")
    require(all(isinstance(array, np.ndarray) and array.dtype != object for array in arrays.values()), "objects")
    back = engine.from_arrays(arrays)
    result, stored = trained.generate(spoken), engine.generate(back, spoken)
    difference = float(np.abs(stored.motion.values - result.motion.values).max())
    require(difference < 5e-3, f"motion of the stored model differs by {difference:g}")
    require(stored.motion.channels == result.motion.channels, "other channels")
    _require_same(engine.generate(engine.from_arrays(engine.to_arrays(back)), spoken), stored, "storing twice")


def damaged_arrays_are_format_errors(trained: TrainedEngine) -> None:
    """An array is missing, unknown, cut short, lacks a column, or is two values instead of one."""
    engine, arrays = trained.engine, trained.engine.to_arrays(trained.model)
    for name in arrays:
        missing: Mapping[str, Any] = {key: array for key, array in arrays.items() if key != name}
        require_error(ModelFormatError, partial(engine.from_arrays, missing), f"{name!r} missing")
        short = arrays | {name: arrays[name][:-1] if arrays[name].ndim else np.repeat(arrays[name], 2)}
        require_error(ModelFormatError, partial(engine.from_arrays, short), f"{name!r} cut short")
        if arrays[name].ndim > 1:
            narrow = arrays | {name: arrays[name][..., :-1]}
            require_error(ModelFormatError, partial(engine.from_arrays, narrow), f"{name!r} without a column")
    stray = arrays | {"an array of nobody": np.zeros(3)}
    require_error(ModelFormatError, partial(engine.from_arrays, stray), "an unknown array")


def every_phone_can_be_said(trained: TrainedEngine) -> None:
    """All phones of the inventory, in a context that was not trained on."""
    for phone in INVENTORY:
        opening = trained.generate(speech(timeline(("aa", phone, "zh", phone)))).motion["opening"]
        plausible = bool(np.isfinite(opening).all() and -1 < opening.min() <= opening.max() < 2)
        require(plausible, f"the opening in {phone!r} is from {opening.min():g} to {opening.max():g}")


def odd_timelines_are_no_problem(trained: TrainedEngine) -> None:
    """No units, silence alone, gaps, hardly any time, beyond both ends; recordings of one frame."""
    for units in (
        Timeline[Unit](()),
        Timeline((Span(0.0, 0.5, Unit("sil")),)),
        Timeline((Span(0.0, 0.5, Unit("aa")),)),
        Timeline((Span(0.1, 0.1, Unit("p")), Span(0.2, 0.2001, Unit("aa")), Span(0.31, 0.4, Unit("m")))),
        Timeline((Span(-1.0, 0.2, Unit("aa")), Span(0.2, 9.0, Unit("p")))),
    ):
        for frames in (1, 2, 3, 51):
            features = Features(np.zeros((frames, 39), np.float32), (frames - 1) / RATE_HZ)
            _require_numbers(trained.generate(Speech(features, units)), (frames, len(CHANNELS)))


def nothing_to_learn_from_is_a_corpus_error(trained: TrainedEngine) -> None:
    """No example, no valid frame, or examples of different channels."""
    engine, (one, two) = trained.engine, examples(2)
    unseen = [replace(x, valid=np.zeros_like(x.valid)) for x in (one, two)]
    fewer = replace(two.motion, values=two.motion.values[:, :2], channels=two.motion.channels[:2])
    different = [one, replace(two, motion=fewer)]
    for useless, name in (([], "no example"), (unseen, "no valid frame"), (different, "different channels")):
        require_error(CorpusError, partial(engine.fit, useless, silent_monitor), name)


def frames_that_are_not_valid_teach_nothing(trained: TrainedEngine) -> None:
    """Whatever the motion holds where it was not seen, the model is the same."""
    results = []
    for garbage in (0.0, -7.0):
        spoilt = []
        for number, clean in enumerate(examples(6)):
            valid = clean.valid.copy()
            valid[60 + 10 * number : 75 + 10 * number] = False
            values = np.where(valid[:, None], clean.motion.values, garbage)
            spoilt.append(replace(clean, motion=replace(clean.motion, values=values), valid=valid))
        model = trained.engine.fit(spoilt, silent_monitor).model
        results.append(trained.engine.generate(model, speech(timeline(SENTENCE))))
    _require_same(results[0], results[1], "other values in frames that are not valid")


def one_short_example_is_enough(trained: TrainedEngine) -> None:
    """Training on two phones gives finite motion."""
    model = trained.engine.fit([example(("p", "aa"))], silent_monitor).model
    spoken = speech(timeline(SENTENCE))
    _require_numbers(trained.engine.generate(model, spoken), (len(spoken.features.values), len(CHANNELS)))


def optional_members_are_kept(trained: TrainedEngine) -> None:
    """Explanations of every frame, posteriors that sum to 1, closures that can be left out, a description."""
    engine, model, spoken = trained.engine, trained.model, speech(timeline(SENTENCE))
    result = trained.generate(spoken)
    found = engine.explain(model, spoken, [7, 3, 7])
    if found is not None:
        require([one.frame for one in found] == [7, 3, 7], "explanations of other frames")
        values = {name: float(result.motion[name][7]) for name in result.motion.names}
        require({name: one.value for name, one in found[0].motion.items()} == values, "an explanation of other motion")
    for chain in engine.posteriors(model, spoken):
        sums = chain.probability.sum(axis=1)
        require(bool(np.abs(sums - 1).max() < 1e-3), f"posteriors of {chain.name} that do not sum to 1")
    free = engine.without_closures()
    if free != engine:
        lips = (slice(78, 93), slice(98, 113))  # p and m
        closed, opening = result.motion["opening"], free.generate(model, spoken).motion["opening"]
        require(all(closed[span].min() <= opening[span].min() + 1e-9 for span in lips), "wider p and m when forced")
    require(isinstance(engine.describe(model), str), "a description that is no text")


ENGINE_CHECKS: dict[str, Callable[[TrainedEngine], None]] = {
    check.__name__.replace("_", " "): check
    for check in (
        configuration_can_be_stored,
        motion_has_a_row_for_every_frame,
        motion_is_learned,
        every_frame_has_a_state,
        units_keep_their_times,
        pins_are_exact,
        wrong_pins_are_input_errors,
        the_same_input_gives_the_same_bytes,
        a_model_comes_back_from_arrays,
        damaged_arrays_are_format_errors,
        every_phone_can_be_said,
        odd_timelines_are_no_problem,
        nothing_to_learn_from_is_a_corpus_error,
        frames_that_are_not_valid_teach_nothing,
        one_short_example_is_enough,
        optional_members_are_kept,
    )
}
"""All checks by name, for test suites that want a test each."""


def _require_numbers(result: Generation, shape: tuple[int, ...]) -> None:
    values, variance = result.motion.values, result.variance
    require(values.shape == variance.shape == shape, f"shapes {values.shape} and {variance.shape}, required {shape}")
    require(bool(np.isfinite(values).all() and np.isfinite(variance).all()), "values that are not finite")
    require(bool((variance >= 0).all()), "a negative variance")


def _require_same(one: Generation, two: Generation, what: str) -> None:
    same = one.motion.values.tobytes() == two.motion.values.tobytes()
    require(same and one.variance.tobytes() == two.variance.tobytes(), f"{what}: the results differ")
