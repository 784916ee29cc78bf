"""The trajectory engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit
from lipmotion.engines.trajectory.model import TrajectoryModel, model_arrays, model_from_arrays
from lipmotion.engines.trajectory.train import fit_trajectory
from lipmotion.engines.trajectory.training_data import TrainingOptions
from lipmotion.errors import InputError
from lipmotion.motion.closure import closing_spans
from lipmotion.motion.frame_labels import StateLayout, full_context_states, with_unit_names
from lipmotion.motion.generation import Statistics, generated_motion, resolved_pins
from lipmotion.motion.variance_scaling import scaled
from lipmotion.printable import printable
from lipmotion.storage.checkpoint import NOTHING_KEPT, Checkpoint
from lipmotion.types import (
    FRAME_RATE_HZ,
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
    listens    : let the means follow the sound around the frame (False: plain Gaussians, at the same fixed times)
    axes       : numbers that the sound around a frame is reduced to
    ridge, shared_ridge : how strongly a regression on the sound is drawn towards that of the node above, and the one
                 that all share towards none
    ridge_frames : frames that a node must have for a regression of its own (``hearing.MOST`` asks for more)
    trajectory_steps : steps of training for the least error of the generated trajectory (0: none)
    full_range : make movements as large as the original's
    closures   : make the lips meet in every p, b and m, whatever their units are
    joint      : train the joint model of speech, F0 and motion as well, if there is speech enough: it finds the
                 phones of voices that it knows (``listening``)
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
    joint: bool = True
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

    def cut(self, units: UnitSet) -> StateLayout:
        """Return how units are cut into parts."""
        return StateLayout(self.parts, self.silent_parts, self.edge_s, units)

    @property
    def learning(self) -> TrainingOptions:
        """What training needs of it. Raises InputError: no such unit set, or a table that is wrong."""
        names = {field.name for field in fields(TrainingOptions)} - {"cut"}
        return TrainingOptions(self.cut(unit_set(self.units)), **{name: getattr(self, name) for name in names})


@final
@dataclass(frozen=True)
class TrajectoryEngine(Engine[TrajectoryModel]):
    """Hidden Markov models of context-dependent units, made a smooth trajectory by parameter generation.

    Source: Hofer 2008, §5.  Deviation: the state of a frame is its part of the phone, whose times are known from
    recognition or alignment; means follow the sound around the frame.
    """

    config: TrajectoryConfig
    name: ClassVar[str] = "trajectory"

    @property
    def hears_f0(self) -> bool:
        """Whether it wants ``Speech.log_f0``."""
        return self.config.joint

    def fit(  # noqa: D102
        self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NOTHING_KEPT
    ) -> Fit[TrajectoryModel]:
        model = fit_trajectory(examples, self.config.learning, monitor, checkpoint)
        frames = sum(int(example.valid.sum()) for example in examples)
        return Fit(model, {"frames": frames, "leaves": len(model.emission.means)})

    def listen(self, model: TrajectoryModel, speech: Speech) -> Timeline[Unit] | None:  # noqa: D102
        return model.listener.phones(speech) if model.listener is not None else None

    def unpinned(self) -> TrajectoryEngine:  # noqa: D102
        return replace(self, config=replace(self.config, closures=False))

    def generate(self, model: TrajectoryModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        features = np.asarray(speech.features.values)
        frames, cut = len(features), self.config.cut(model.units)
        where = full_context_states(speech.units, frames, cut)
        distinct = {place: number for number, place in enumerate(dict.fromkeys(where))}
        path = np.array([distinct[place] for place in where], np.intp)
        rows = np.array([model.emission.row(place, cut) for place in distinct], np.intp)

        def statistics(wanted: slice) -> Statistics:
            found = model.emission.statistics(rows[path[wanted]], features, wanted)
            if not self.config.full_range:
                return found
            return scaled(*found, model.gain, model.emission.means[-1, 0])

        motion, spread = generated_motion(
            statistics,
            frames,
            model.space,
            model.reach,
            closure=model.closure,
            closing=closing_spans(speech.units, frames) if self.config.closures else [],
            pins=resolved_pins(constraints, model.space, frames),
        )
        return Generation(
            Motion(motion, FRAME_RATE_HZ, model.space.channels),
            spread,
            with_unit_names(speech.units, model.units),
            Trace(tuple(model.emission.source(place, cut) for place in distinct), path),
        )

    def trees(self, model: TrajectoryModel) -> str:  # noqa: D102
        return "\n\n".join(f"{printable(name)}\n{tree.text()}" for name, tree in model.emission.forest.items())

    def to_arrays(self, model: TrajectoryModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        return model_arrays(model)

    def from_arrays(self, arrays: Arrays) -> TrajectoryModel:  # noqa: D102
        return model_from_arrays(arrays, self.config.cut, self.config.units)
