"""The configuration of the joint engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.model import JointConfig
from lipmotion.hmm.multistream.streams import StreamWeights
from lipmotion.motion.modulation_filter import STRENGTH
from lipmotion.types import Configuration, Rule, option
from lipmotion.units import load_unit_set

COUNT = Rule(least=1)
WEIGHT = Rule(least=0)
HOFER_2008: Mapping[str, Any] = {
    "units": "eVis",
    "states": 5,
    "mixtures": 8,
    "recognise_units": True,
    "own_alignment": True,
    "both_neighbours": True,
    "closures": False,
    "articulation": False,
}
"""The system of Hofer 2008, as printed; docs/papers/hofer2008.md says what the print leaves open."""


@dataclass(frozen=True)
class JointEngineConfig(Configuration):
    """Options of the joint engine.

    units      : name of a unit set, or path of a table of units (docs/unit-sets.md)
    states     : states per unit, left to right, without skips
    mixtures, motion_mixtures : Gaussians per state of speech, and of motion (powers of two)
    components : principal components that all point channels are reduced to
    f0         : model the three streams of F0 (False: their weights are 0 everywhere)
    motion_in_training : the motion stream takes part when states are aligned in training (False: its weight is 0)
    speech_weight, f0_weight, motion_weight : of the streams when states are aligned in training
    recognition_speech_weight, recognition_f0_weight : of the streams in recognition and in alignment
    bigram_weight, insertion : scale of the log bigram, and log insertion penalty of every unit, in recognition
    both_neighbours : trees of speech and F0 ask about both neighbours in every state (False: states before a unit's
                 middle about the left one, those after it about the right one, and the middle about none)
    flat_start : training starts from states of equal length (False: from the phones in time)
    recognise_units : where neither words nor units are given, recognise the units of the model by its own bigram
                 (False: use the phones of the shared recogniser)
    own_alignment : the model itself times the phones of given words (False: they have the times of the shared
                 aligner). Times that are given with the units stay as they are
    paths      : number of state sequences, sampled from their posterior, from which motion is generated where units are
                 recognised; 1: the best sequence. More than 1 needs ``recognise_units``
    seed       : of the sampling
    closures   : make the lips meet in every p, b and m, and in every recognised unit that has no other phones
    articulation : lean on the table of English articulation in contexts that training saw little of
    modulation_filter : how far generated motion is given the modulation spectrum of recorded motion: as of the
                 trajectory engine; movements are then scaled to the recorded variance, too (docs/results/jerk.md)
    """

    units: str = "phone"
    states: int = option(3, COUNT)
    mixtures: int = option(4, COUNT)
    motion_mixtures: int = option(1, COUNT)
    components: int = option(16, COUNT)
    f0: bool = True
    motion_in_training: bool = True
    recognise_units: bool = False
    own_alignment: bool = option(False, omit_default=True)
    paths: int = option(1, COUNT)
    seed: int = option(0, Rule(least=0))
    closures: bool = True
    articulation: bool = True
    speech_weight: float = option(1.0, WEIGHT, omit_default=True)
    f0_weight: float = option(1.0, WEIGHT, omit_default=True)
    motion_weight: float = option(1.0, WEIGHT, omit_default=True)
    recognition_speech_weight: float = option(1.0, WEIGHT, omit_default=True)
    recognition_f0_weight: float = option(1.0, WEIGHT, omit_default=True)
    bigram_weight: float = option(4.0, WEIGHT, omit_default=True)
    insertion: float = option(-4.0, omit_default=True)
    both_neighbours: bool = option(False, omit_default=True)
    flat_start: bool = option(False, omit_default=True)
    modulation_filter: float = option(0.0, STRENGTH, omit_default=True)

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {"hofer2008": HOFER_2008}
    aliases: ClassVar[Mapping[str, str]] = {"sees": "motion_in_training", "recognises": "recognise_units"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.paths > 1 and not self.recognise_units:
            raise InputError(
                f"paths is {self.paths}: several are sampled only where units are recognised (recognise_units)"
            )

        if not self.hmm.recognition.active:
            raise InputError("no stream takes part in recognition; give speech or F0 a weight")

    def check_files(self) -> None:  # noqa: D102
        load_unit_set(self.units)

    @property
    def hmm(self) -> JointConfig:
        """Configuration of the joint model: its states and mixtures, and the stream weights."""
        training, recognition = (weight if self.f0 else 0.0 for weight in (self.f0_weight, self.recognition_f0_weight))
        motion = self.motion_weight if self.motion_in_training else 0.0
        return JointConfig(
            states=self.states,
            mixtures=self.mixtures,
            motion_mixtures=self.motion_mixtures,
            both_neighbours=self.both_neighbours,
            bigram_weight=self.bigram_weight,
            insertion=self.insertion,
            training=StreamWeights(self.speech_weight, training, training, training, motion),
            recognition=StreamWeights(self.recognition_speech_weight, recognition, recognition, recognition, 0.0),
        )
