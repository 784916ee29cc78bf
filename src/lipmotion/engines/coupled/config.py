"""The configuration of the coupled engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from lipmotion.engines.coupled.chains.structures import PRESETS, STRUCTURES, UNSEEN_LOSS, Structure, unit_sets
from lipmotion.engines.coupled.chains.visual_streams import EIGENLIPS
from lipmotion.engines.coupled.conversion.em_conversion import EXACT, SOFT, STARTS, UPDATES, ConversionSettings
from lipmotion.motion.modulation_filter import STRENGTH
from lipmotion.types import Configuration, Rule, option
from lipmotion.units import UnitSet

TRAJECTORY, FRAMES, PATH = "trajectory", "em", "viterbi"
CONVERSIONS = (TRAJECTORY, FRAMES, PATH)
COUNT, MIXTURES, WEIGHT = Rule(least=1), Rule(least=1, power_of_two=True), Rule(least=0)


@dataclass(frozen=True)
class CoupledConfig(Configuration):
    """How the coupled engine models speech and lips (chosen on the validation list; see docs/decisions/engines.md).

    structure  : ``hmm``, ``multistream``, ``factorial`` or ``coupled`` (``presets`` has the paper's six systems)
    chains     : the unit set of each chain, separated by blanks: names or table files; the first chain emits speech
    states     : states per unit, left to right, no skips
    asynchrony : number of states that chains may be apart; -1: no limit
    cross_units : let chains leave a unit at different times
    start_asynchrony, unseen_loss : of factorial chains without a limit: how far apart the chains may be while the first
                 densities are learned, and the nats that rare joint states lose (``chains.structures.Structure``)
    mixtures, visual_mixtures : Gaussians per state, of the speech stream and of visual streams (powers of two); the
                 structure ``hmm`` uses the first for both
    speech_only_mixtures, speech_only_steps, speech_only_weight : of the second stage of training, on speech without
                 motion: Gaussians per state of speech, EM steps for each number of Gaussians, and the weight of such a
                 frame relative to one of speech with motion
    audio_weight, visual_weight, eigenlips_weight : stream weights (exponents of the densities) of speech, of geometry,
                 and of eigenlips
    conversion : ``trajectory``: parameter generation from expected precisions and means of static values, Δ and Δ²;
                 ``em``: the paper's, frame by frame;  ``viterbi``: means along the best path
    start, update, steps : of EM conversion (``conversion.em_conversion.ConversionSettings``); ``trajectory`` takes no
                 steps after its soft start unless asked to
    acoustic_regression : regress visual means on the acoustic features and state posteriors around the frame
                 (``trajectory`` only)
    components : principal components that all point channels are reduced to
    variance_scaling : scale movements to the variance of the recorded ones
    closures   : make the lips meet in every p, b and m
    articulation : lean on the table of English articulation in contexts that training saw little of; less where the
                 phones are recognised, words do not confirm them, and training knows the voice
    modulation_filter : how far generated motion is given the modulation spectrum of recorded motion: as of the
                 trajectory engine (``trajectory`` conversion only; docs/results/jerk.md)
    """

    structure: str = option("coupled", Rule(choices=STRUCTURES))
    chains: str = "phone viseme"
    states: int = option(3, COUNT)
    asynchrony: int = option(1, Rule(least=-1))
    cross_units: bool = True
    mixtures: int = option(8, MIXTURES)
    visual_mixtures: int = option(1, MIXTURES)
    speech_only_mixtures: int = option(8, MIXTURES)
    speech_only_steps: int = option(8, COUNT)
    speech_only_weight: float = option(0.3, WEIGHT)
    audio_weight: float = option(1.0, WEIGHT)
    visual_weight: float = option(1.0, WEIGHT)
    eigenlips_weight: float = option(1.0, WEIGHT)
    conversion: str = option(TRAJECTORY, Rule(choices=CONVERSIONS))
    start: str = option(SOFT, Rule(choices=STARTS))
    update: str = option(EXACT, Rule(choices=UPDATES))
    steps: int = option(0, Rule(least=0))
    acoustic_regression: bool = True
    components: int = option(16, COUNT)
    variance_scaling: bool = True
    closures: bool = True
    articulation: bool = True
    start_asynchrony: int = option(1, Rule(least=0), omit_default=True)
    unseen_loss: float = option(UNSEEN_LOSS, Rule(least=0), omit_default=True)
    modulation_filter: float = option(0.0, STRENGTH, omit_default=True)

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = PRESETS
    preset_visual: ClassVar[Mapping[str, str]] = {"xieliu2007": EIGENLIPS}
    aliases: ClassVar[Mapping[str, str]] = {
        "crosses": "cross_units",
        "more_mixtures": "speech_only_mixtures",
        "more_steps": "speech_only_steps",
        "more_weight": "speech_only_weight",
        "follows": "acoustic_regression",
        "full_range": "variance_scaling",
    }
    hints: ClassVar[Mapping[str, str]] = {
        "units": 'there is a unit set for each chain; say --set chains="phone viseme", not --units'
    }

    def check_files(self) -> None:  # noqa: D102
        self.structure_with(unit_sets(self.chains))

    def structure_with(self, chains: tuple[UnitSet, ...]) -> Structure:
        """Return the structure of chains of these unit sets. Raises InputError: as ``Structure``."""
        limit = None if self.asynchrony < 0 else self.asynchrony
        losses = self.start_asynchrony, self.unseen_loss
        return Structure(self.structure, chains, self.states, limit, self.cross_units, *losses)

    @property
    def dynamic(self) -> bool:
        """Whether slope and curvature are modelled."""
        return self.conversion == TRAJECTORY

    @property
    def filtered(self) -> bool:
        """Whether the modulation filter is learned."""
        return self.dynamic and self.modulation_filter > 0

    @property
    def em(self) -> ConversionSettings:
        """The conversion by EM."""
        return ConversionSettings(self.start, self.update, self.steps)
