"""The hybrid: recorded units, selected by how much they resemble what the trajectory engine generates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from lipmotion.engines import Animator, Fit
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

    @property
    def wants_f0(self) -> bool:
        """Whether either engine needs F0."""
        return self.guiding.wants_f0 or self.selecting.wants_f0

    def conditions(self, motion_s: float) -> int:
        """Return the greater number of acoustic conditions that one of both engines hears in training.

        motion_s : seconds of measured motion
        """
        return max(self.guiding.conditions(motion_s), self.selecting.conditions(motion_s))

    def recognise(self, model: HybridModel, speech: Speech) -> Timeline[Unit] | None:
        """Return the phones in time that the trajectory engine's model recognises, or None.

        speech : its ``units`` are empty
        """
        return self.guiding.recognise(model.guiding, speech)

    def without_closures(self) -> Hybrid:
        """Return the hybrid of both engines without forced closures."""
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
