"""The options of the trajectory engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from lipmotion.motion.frame_labels import StateLayout
from lipmotion.motion.modulation_filter import STRENGTH
from lipmotion.motion.predictors import AUTOMATIC, check_predictor
from lipmotion.types import Configuration, Rule, option
from lipmotion.units import UnitSet, load_unit_set

POSITIVE, ODD = Rule(above=0), Rule(least=1, odd=True)


@dataclass(frozen=True)
class TrajectoryConfig(Configuration):
    """Options of the trajectory engine; defaults were chosen on the validation list (docs/decisions/motion.md).

    states, silent_states : states of a phone, and of a silence; odd numbers
    edge_s     : longest duration of a state before or after the middle one, seconds
    components : principal components that all point channels are reduced to
    tree_factor : gain that a split of a decision tree must have, in units of its description length
    least_frames : smallest number of frames of a leaf of a tree
    shrinkage, variance_shrinkage : weights, in frames, of the mean and of the variance of the parent node
    acoustic_regression : regress the means on the acoustic features around the frame (False: plain Gaussians)
    acoustic_components : principal components that the acoustic features around a frame are reduced to
    ridge, shared_ridge : ridge parameters: of a regression towards that of the parent node, and of the regression that
                 all nodes share towards zero
    ridge_frames : smallest number of frames of a node with a regression of its own
    variance_scaling : scale generated movements to the variance of recorded ones
    closures   : make the lips meet in every p, b and m, whatever their units are
    joint_recogniser : train the joint model as well, where there is enough speech: it recognises the phones of
                 speakers that it was trained on
    conditions : acoustic conditions in which each recording is used in the training of the acoustic network; 0: no
                 network
    epochs     : how often the training of the network uses each recording
    predictor  : name of the predictor beside the states (docs/extend/predictor.md); ``auto``: an acoustic network, or,
                 where the model stands on another one, a regression on what that makes of the speech
    articulation : lean on the table of English articulation in contexts that training saw little of
    units      : name of a unit set, or path of a table of units (docs/unit-sets.md), which training reads
    modulation_filter : how far generated motion is given the modulation spectrum of recorded motion: 0 not at all, 1
                 wholly; more goes beyond it (docs/results/jerk.md)
    """

    states: int = option(5, ODD)
    silent_states: int = option(13, ODD)
    edge_s: float = option(0.08, POSITIVE)
    components: int = option(16, Rule(least=1))
    tree_factor: float = option(0.2, POSITIVE)
    least_frames: float = option(8.0, POSITIVE)
    shrinkage: float = option(10.0, POSITIVE)
    variance_shrinkage: float = option(20.0, POSITIVE)
    acoustic_regression: bool = True
    acoustic_components: int = option(150, Rule(least=1))
    ridge: float = option(2000.0, POSITIVE)
    shared_ridge: float = option(100.0, POSITIVE)
    ridge_frames: float = option(100.0, POSITIVE)
    variance_scaling: bool = True
    closures: bool = True
    joint_recogniser: bool = True
    conditions: int = option(15, Rule(least=0))
    epochs: int = option(100, Rule(least=1))
    articulation: bool = True
    units: str = "phone"
    predictor: str = option(AUTOMATIC, omit_default=True)
    modulation_filter: float = option(1.0, STRENGTH)

    aliases: ClassVar[Mapping[str, str]] = {
        "parts": "states",
        "silent_parts": "silent_states",
        "listens": "acoustic_regression",
        "axes": "acoustic_components",
        "full_range": "variance_scaling",
        "joint": "joint_recogniser",
    }
    removed: ClassVar[Mapping[str, Any]] = {"trajectory_steps": 0}
    default_if_missing: ClassVar[Mapping[str, Any]] = {"modulation_filter": 0.0}

    def check_files(self) -> None:  # noqa: D102
        load_unit_set(self.units)
        check_predictor(self.predictor)

    def layout(self, units: UnitSet) -> StateLayout:
        """Return the states of phones and silences, for a unit set."""
        return StateLayout(self.states, self.silent_states, self.edge_s, units)

    @property
    def training_layout(self) -> StateLayout:
        """The states of the unit set that training reads. Raises InputError: no such unit set, or errors in a table."""
        return self.layout(load_unit_set(self.units))
