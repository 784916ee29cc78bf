"""The trajectory engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit, frame_of
from lipmotion.engines.trajectory.contexts import LEVELS, places, with_neighbours
from lipmotion.engines.trajectory.model import TrajectoryModel, model_arrays, model_from_arrays
from lipmotion.engines.trajectory.train import fit_trajectory
from lipmotion.errors import InputError
from lipmotion.kernels.banded import Bands, normal_equations, pin, solve
from lipmotion.stats.em import Monitor
from lipmotion.types import FRAME_RATE_HZ, Constraints, Example, Generation, Motion, Pin, Speech, Timeline, Trace, Unit


@dataclass(frozen=True)
class TrajectoryConfig:
    """How the trajectory engine models motion (chosen on the validation list; see docs/results).

    parts      : parts a phone is cut into, an odd number
    edge_s     : most seconds that a part before or after the middle one lasts
    components : dimensions that all point channels are reduced to
    shrinkage, variance_shrinkage : frames that a more general context counts for
    """

    parts: int = 5
    edge_s: float = 0.08
    components: int = 16
    shrinkage: float = 5.0
    variance_shrinkage: float = 20.0

    def __post_init__(self) -> None:
        if self.parts < 1 or self.parts % 2 == 0:
            raise InputError(f"parts is {self.parts}, required an odd number from 1")
        if min(self.edge_s, self.components, self.shrinkage, self.variance_shrinkage) <= 0:
            raise InputError(f"all numbers of the configuration must be more than 0: {self}")


@final
@dataclass(frozen=True)
class TrajectoryEngine(Engine[TrajectoryModel]):
    """Statistics of context-dependent units, made a smooth trajectory by parameter generation.

    Source: Hofer 2008, §5.  Deviation: one Gaussian a unit part, estimated along forced alignments and backed
    off from phones between phones to viseme classes, instead of joint audio–visual HMMs.
    """

    config: TrajectoryConfig
    name: ClassVar[str] = "trajectory"

    def fit(self, examples: Sequence[Example], monitor: Monitor) -> Fit[TrajectoryModel]:  # noqa: D102
        model = fit_trajectory(examples, **asdict(self.config), monitor=monitor)
        frames = sum(int(example.valid.sum()) for example in examples)
        return Fit(model, {"frames": frames, "contexts": len(model.levels[-1].rows)})

    def generate(self, model: TrajectoryModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        frames = len(speech.features.values)
        where = places(speech.units, frames, self.config.parts, self.config.edge_s)
        distinct = list(dict.fromkeys(where))
        mean, precision, sources = zip(*(model.statistics(place) for place in distinct), strict=True)
        index = {place: number for number, place in enumerate(distinct)}
        path = np.array([index[place] for place in where], np.intp)
        bands = normal_equations(np.array(mean)[path], np.array(precision)[path])
        pins = constraints.pins if constraints else ()
        pinned = [_apply(pin_, bands, model, frames) for pin_ in pins]
        values, variance = solve(bands)
        for frame, channel in pinned:
            variance[frame, channel] = 0
        motion, spread = model.to_motion(values, variance)
        return Generation(
            Motion(motion, FRAME_RATE_HZ, model.channels),
            spread,
            _named(speech.units),
            Trace(sources, path),
        )

    def to_arrays(self, model: TrajectoryModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        return model_arrays(model)

    def from_arrays(self, arrays: Arrays) -> TrajectoryModel:  # noqa: D102
        return model_from_arrays(arrays, LEVELS)


def _apply(wanted: Pin, bands: Bands, model: TrajectoryModel, frames: int) -> tuple[int, int]:
    """Pin one value; return its frame and its column in the model's space."""
    names = [model.channels[channel].name for channel in model.direct]
    if wanted.channel not in names:
        raise InputError(f"cannot pin {wanted.channel!r}; channels that can be pinned: {', '.join(names)}")
    frame = frame_of(wanted.time_s, frames, FRAME_RATE_HZ)
    if frame is None:
        last_s = (frames - 1) / FRAME_RATE_HZ
        raise InputError(f"pin at {wanted.time_s} s lies outside the recording (0 to {last_s:.2f} s)")
    if not np.isfinite(wanted.value):
        raise InputError(f"pin at {wanted.time_s} s has the value {wanted.value}, required a finite number")
    channel = names.index(wanted.channel)
    pin(bands, frame, channel, wanted.value)
    return frame, channel


def _named(units: Timeline[Unit]) -> Timeline[Unit]:
    """Return the timeline with each phone between its neighbours as its unit."""
    named = [
        replace(span, label=replace(span.label, unit=f"{left}-{span.label.phone}+{right}"))
        for left, span, right in with_neighbours(units)
    ]
    return Timeline(tuple(named))
