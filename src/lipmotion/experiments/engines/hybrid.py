"""The hybrid: recorded units, selected by how much they resemble what the trajectory engine generates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from lipmotion.engines import Animator, Fit, Inputs
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.trajectory.engine import TrajectoryEngine
from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Constraints, Example, Generation, Monitor, Speech, Timeline, Unit, sub_monitor


@dataclass(frozen=True, eq=False)
class HybridModel:
    """The models of both engines, trained on the same recordings.

    guiding   : the trajectory engine's
    selecting : the unit selection engine's
    """

    guiding: Any
    selecting: SelectionModel


@final
@dataclass(frozen=True)
class Hybrid(Animator[HybridModel]):
    """Unit selection whose target costs compare recorded motion with the motion that the trajectory engine generates.

    guiding   : the trajectory engine; its motion, without forced closures, takes the place of what the acoustic
                network of the unit selection engine predicts
    selecting : the unit selection engine
    Source: the idea of Wang, Qian, Han & Soong 2010 (trajectory-guided sample selection). Deviation: units of phones
    are selected, not single pictures; costs of context, joins and sound are those of the unit selection engine.
    """

    guiding: TrajectoryEngine
    selecting: SelectionEngine

    def inputs(self, motion_s: float = math.inf) -> Inputs:  # noqa: D102
        guiding, selecting = self.guiding.inputs(motion_s), self.selecting.inputs(motion_s)
        return Inputs(
            guiding.f0 or selecting.f0,
            max(guiding.conditions, selecting.conditions),
            posteriors=guiding.posteriors or selecting.posteriors,
        )

    def recognise(self, model: HybridModel, speech: Speech) -> Timeline[Unit] | None:  # noqa: D102
        return self.guiding.recognise(model.guiding, speech)

    def without_closures(self) -> Hybrid:  # noqa: D102
        return Hybrid(self.guiding.without_closures(), self.selecting.without_closures())

    def fit(  # noqa: D102
        self,
        examples: Sequence[Example],
        monitor: Monitor,
        checkpoint: Checkpoint = NO_CHECKPOINT,  # noqa: ARG002 - stages of both engines have the same names
    ) -> Fit[HybridModel]:
        guiding = self.guiding.fit(examples, sub_monitor(monitor, 0, 0.5, "guide: "))
        selecting = self.selecting.fit(examples, sub_monitor(monitor, 0.5, 1, "units: "))
        return Fit(HybridModel(guiding.model, selecting.model), {**guiding.figures, **selecting.figures})

    def generate(  # noqa: D102
        self, model: HybridModel, speech: Speech, constraints: Constraints | None = None
    ) -> Generation:
        space = model.selecting.motion.space
        generated = self.guiding.without_closures().generate(model.guiding, speech, constraints)
        motion = generated.selected([channel.name for channel in space.channels]).motion
        guide = space.reduce(np.asarray(motion.values, float))
        return self.selecting.generate_guided(model.selecting, speech, guide, constraints)
