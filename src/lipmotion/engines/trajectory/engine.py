"""The trajectory engine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit, frame_of
from lipmotion.engines.trajectory.closure import OPENING, Closure, closing_frames, closing_spans
from lipmotion.engines.trajectory.contexts import Cut, places, with_neighbours
from lipmotion.engines.trajectory.dynamic_range import widened
from lipmotion.engines.trajectory.learning import Learning
from lipmotion.engines.trajectory.model import TrajectoryModel, model_arrays, model_from_arrays
from lipmotion.engines.trajectory.train import fit_trajectory
from lipmotion.errors import InputError
from lipmotion.kernels.banded import generate
from lipmotion.stats.checkpoint import NOTHING_KEPT, Checkpoint
from lipmotion.types import (
    FRAME_RATE_HZ,
    WEIGHT,
    Constraints,
    Example,
    Generation,
    Monitor,
    Motion,
    Speech,
    Timeline,
    Trace,
    Unit,
)
from lipmotion.units import UnitSet, unit_set


@dataclass(frozen=True)
class TrajectoryConfig:
    """How the trajectory engine models motion (chosen on the validation list; see docs/decisions/0009).

    parts, silent_parts : parts that a phone, and a silence, is cut into; odd numbers
    edge_s     : most seconds that a part before or after the middle one lasts
    components : dimensions that all point channels are reduced to
    tree_factor: what a split of a decision tree must gain, in units of its description length
    least_frames : frames that a leaf of a tree must have
    shrinkage, variance_shrinkage : frames that the mean, and the variance, of the node above count for
    listens    : let the means follow the sound around the frame (False: the paper's plain Gaussians)
    axes       : numbers that the sound around a frame is reduced to
    ridge, shared_ridge : how strongly a regression on the sound is drawn towards that of the node above, and the one
                 that all share towards none
    ridge_frames : frames that a node must have for a regression of its own (``hearing.MOST`` asks for more)
    trajectory_steps : steps of training for the least error of the generated trajectory (0: none)
    full_range : make movements as large as the original's
    closures   : make the lips meet in every p, b and m, whatever their units are
    units      : what is modelled: a unit set's name, or a table's (docs/unit-sets.md); training reads the table
    """

    parts: int = 5
    silent_parts: int = 13
    edge_s: float = 0.08
    components: int = 16
    tree_factor: float = 0.2
    least_frames: float = 8.0
    shrinkage: float = 10.0
    variance_shrinkage: float = 20.0
    listens: bool = True
    axes: int = 150
    ridge: float = 2000.0
    shared_ridge: float = 100.0
    ridge_frames: float = 100.0
    trajectory_steps: int = 0
    full_range: bool = True
    closures: bool = True
    units: str = "phone"

    def __post_init__(self) -> None:
        for name in ("parts", "silent_parts"):
            if getattr(self, name) < 1 or getattr(self, name) % 2 != 1:
                raise InputError(f"{name} is {getattr(self, name)}, required an odd number from 1")
        if not isinstance(self.units, str):
            raise InputError(f"units is {self.units!r}, required the name of a unit set or a table")
        numbers = [
            getattr(self, field.name)
            for field in fields(self)
            if field.type not in ("bool", "str") and field.name != "trajectory_steps"
        ]
        if not all(0 < number < float("inf") for number in numbers):
            raise InputError(f"all numbers of the configuration must be more than 0 and finite: {self}")

        if self.trajectory_steps < 0:
            raise InputError(f"trajectory_steps is {self.trajectory_steps}, required 0 or more")

    def cut(self, units: UnitSet) -> Cut:
        """Return how units are cut into parts."""
        return Cut(self.parts, self.silent_parts, self.edge_s, units)

    @property
    def learning(self) -> Learning:
        """What training needs of it. Raises InputError: no such unit set, or a table that is wrong."""
        names = {field.name for field in fields(Learning)} - {"cut"}
        return Learning(self.cut(unit_set(self.units)), **{name: getattr(self, name) for name in names})


@final
@dataclass(frozen=True)
class TrajectoryEngine(Engine[TrajectoryModel]):
    """Hidden Markov models of context-dependent units, made a smooth trajectory by parameter generation.

    Source: Hofer 2008, §5.  Deviation: the state of a frame is its part of the phone, whose times are known from
    recognition or alignment; means follow the sound around the frame.
    """

    config: TrajectoryConfig
    name: ClassVar[str] = "trajectory"

    def fit(  # noqa: D102
        self,
        examples: Sequence[Example],
        monitor: Monitor,
        checkpoint: Checkpoint = NOTHING_KEPT,  # noqa: ARG002 - a matter of seconds
    ) -> Fit[TrajectoryModel]:
        model = fit_trajectory(examples, self.config.learning, monitor)
        frames = sum(int(example.valid.sum()) for example in examples)
        return Fit(model, {"frames": frames, "leaves": len(model.emission.means)})

    def generate(self, model: TrajectoryModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        features = np.asarray(speech.features.values)
        frames, cut = len(features), self.config.cut(model.units)
        where = places(speech.units, frames, cut)
        distinct = {place: number for number, place in enumerate(dict.fromkeys(where))}
        path = np.array([distinct[place] for place in where], np.intp)
        rows = np.array([model.emission.row(place, cut) for place in distinct], np.intp)
        closing = closing_spans(speech.units, frames) if self.config.closures else []
        pins = _resolved(constraints, model, frames)
        precise = np.float64 if frames <= DOUBLE_FRAMES else np.float32
        motion, spread = (np.empty((frames, len(model.space.channels)), precise) for _ in range(2))
        for inner, outer in _stretches(frames):
            statistics = model.emission.statistics(rows[path[outer]], features, outer)
            if self.config.full_range:
                statistics = widened(*statistics, model.gain, model.emission.means[-1, 0])
            inside = {
                (frame - outer.start, c): v for (frame, c), v in pins.items() if outer.start <= frame < outer.stop
            }
            spans = [
                slice(span.start - outer.start, span.stop - outer.start)
                for span in closing
                if outer.start <= span.start and span.stop <= outer.stop
            ]
            result = _generated(model, statistics, inside, spans)
            kept = slice(inner.start - outer.start, inner.stop - outer.start)
            motion[inner], spread[inner] = model.space.restore(*(values[kept] for values in result))
        weights = [channel.unit == WEIGHT for channel in model.space.channels]
        motion[:, weights] = np.maximum(motion[:, weights], 0)
        return Generation(
            Motion(motion, FRAME_RATE_HZ, model.space.channels),
            spread,
            _named(speech.units, model.units),
            Trace(tuple(model.emission.source(place, cut) for place in distinct), path),
        )

    def to_arrays(self, model: TrajectoryModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        return model_arrays(model)

    def from_arrays(self, arrays: Arrays) -> TrajectoryModel:  # noqa: D102
        return model_from_arrays(arrays, self.config.cut, self.config.units)


STRETCH, MARGIN = 6000, 500
"""Frames generated at a time, and those around them that are generated again and thrown away: what lies seconds off
changes nothing, and the memory does not grow with the recording."""
DOUBLE_FRAMES = 60_000
"""The motion of recordings beyond ten minutes is kept in single precision."""

_Pins = dict[tuple[int, int], float]
"""Frame and column in the model's space, to the value there."""
_Array = NDArray[np.float64]


def _resolved(constraints: Constraints | None, model: TrajectoryModel, frames: int) -> _Pins:
    names = model.space.direct_names
    pins: _Pins = {}
    for wanted in constraints.pins if constraints else ():
        if wanted.channel not in names:
            raise InputError(f"cannot pin {wanted.channel!r}; channels that can be pinned: {', '.join(names)}")
        frame = frame_of(wanted.time_s, frames, FRAME_RATE_HZ)
        if frame is None:
            last_s = (frames - 1) / FRAME_RATE_HZ
            raise InputError(f"pin at {wanted.time_s} s lies outside the recording (0 to {last_s:.2f} s)")
        if not np.isfinite(wanted.value):
            raise InputError(f"pin at {wanted.time_s} s has the value {wanted.value}, required a finite number")
        column = names.index(wanted.channel)
        never_negative = wanted.channel == OPENING or model.space.channels[model.space.direct[column]].unit == WEIGHT
        if never_negative and wanted.value < 0:
            raise InputError(f"pin at {wanted.time_s} s sets {wanted.channel} to {wanted.value}, required at least 0")
        pins[frame, column] = wanted.value
    return pins


def _stretches(frames: int) -> Iterator[tuple[slice, slice]]:
    """Give the frames of each stretch, and those with what lies around it; a shorter recording is one stretch."""
    for start in range(0, frames, STRETCH):
        stop = min(start + STRETCH, frames)
        yield slice(start, stop), slice(max(start - MARGIN, 0), min(stop + MARGIN, frames))


def _generated(
    model: TrajectoryModel, statistics: tuple[_Array, _Array], pins: _Pins, closing: Sequence[slice]
) -> tuple[_Array, _Array]:
    """Return trajectory and variance in the model's space [shape=(T, Q)], lips closed where they must."""
    result = generate(*statistics, pins)
    if model.closure is not None:
        _close_lips(model.closure, closing, statistics, pins, result)
        opening = result[0][:, model.closure.column]
        np.maximum(opening, 0, out=opening)  # a smooth curve through a closure may overshoot
    return result


def _close_lips(
    closure: Closure,
    spans: Sequence[slice],
    statistics: tuple[_Array, _Array],
    pins: _Pins,
    result: tuple[_Array, _Array],
) -> None:
    """Make the lips meet in every p, b and m (in place); what the user did not pin follows the opening."""
    values, variance = result
    column = closure.column
    taken = [frame for frame, pinned in pins if pinned == column]
    frames = closing_frames(closure, values[:, column], spans, taken)
    if not frames:
        return
    wanted = {(frame, 0): closure.closed for frame in frames}
    wanted |= {(frame, 0): pins[frame, column] for frame in taken}
    opening = slice(column, column + 1)
    closing, spread = generate(statistics[0][:, :, opening], statistics[1][:, :, opening], wanted)
    follow = closure.follow.copy()
    follow[[pinned for _, pinned in pins]] = 0
    values += (closing - values[:, opening]) * follow
    values[:, opening], variance[:, opening] = closing, spread


def _named(spans: Timeline[Unit], units: UnitSet) -> Timeline[Unit]:
    """Return the timeline with the unit of each phone named, between its neighbours."""
    named = []
    for left, span, right in with_neighbours(spans):
        before, unit, after = map(units.unit, (left, span.label.phone, right))
        named.append(replace(span, label=replace(span.label, unit=f"{before}-{unit}+{after}")))
    return Timeline(tuple(named))
