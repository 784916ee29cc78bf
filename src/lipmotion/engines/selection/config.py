"""The configuration of the unit selection engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from lipmotion.engines.selection.windows import OVERLAPS, parsed_invisible
from lipmotion.errors import InputError
from lipmotion.motion.modulation_filter import STRENGTH
from lipmotion.motion.predictors import AUTOMATIC, check_predictor
from lipmotion.types import Configuration, Rule, option

NOT_NEGATIVE = Rule(least=0)
MINNIS_2000: Mapping[str, Any] = {
    "candidates": 1,
    "suppressed": True,
    "overlap": "printed",
    "duration": 0.0,
    "guide": 0.0,
    "join": 0.0,
    "joint_recogniser": False,
    "closures": False,
    "articulation": False,
}
"""The system of Minnis & Breen 2000, as far as it is printed (docs/papers/minnis2000.md)."""


@dataclass(frozen=True)
class SelectionConfig(Configuration):
    """Options of the unit selection engine; the default values were chosen on the validation list (docs/selection.md).

    window     : phones of a window, N: odd, 3 to 11
    candidates : units that are looked up for each phone and each bias
    beam       : of all these, so many of the least target costs are candidates in the search
    invisible  : phones without a lip shape of their own, those of the print by default (add ``l`` for faces without a
                 tongue): they count as one phone, and their neighbours choose the unit; empty: none
    suppressed : leave invisible phones out: the vowel that follows gives the shape, and no recorded one is played
    overlap    : how units overlap in a phone that they share: ``learned``, ``printed`` (Table 1),
                 ``symmetric``, ``middle``
    context    : target cost of another phone beside the phone, ``farther`` times as much for each phone further away;
                 half as much where both are of one viseme
    farther    : see ``context``
    word       : target cost of another edge of a word, at either end
    stress     : target cost of another stress
    duration   : target cost of another duration, for each unit of its natural logarithm
    guide      : target cost of motion that differs from what the guide predicts from the sound, for each tenth of a
                 second and squared deviation; 0: no guide, the phones alone choose
    trust      : deviations between the predictions for two sounds from which on they count as different: a unit that
                 sounds the same as the target need not agree with the guide
    join       : join cost for each squared deviation between two units where they are joined
    velocity   : seconds; weight of velocities in these deviations
    hard       : join cost where units have no phone in common
    protected  : join cost beside or inside a phone whose lip shape must be preserved
    cluster    : join cost where units abut between two consonants of one word
    most       : no join costs more than this; so candidates can be left out without a change of the result
    components : principal components that all point channels are reduced to
    conditions, epochs : of the acoustic network that is the guide, as of the trajectory engine
    joint_recogniser : train the joint model as well, where there is enough speech: it recognises phones of this speaker
    closures   : make the lips meet in every p, b and m
    articulation : lean on the table of English articulation in contexts that training saw little of
    modulation_filter : how far generated motion is given the modulation spectrum of recorded motion: as of the
                 trajectory engine (docs/results/jerk.md)
    predictor  : name of the predictor that is the guide (docs/extend/predictor.md); ``auto``: as suits the recordings
    """

    window: int = option(5, Rule(least=3, odd=True))
    candidates: int = option(300, Rule(least=1))
    beam: int = option(25, Rule(least=1))
    invisible: str = "t d g k"
    overlap: str = option("printed", Rule(choices=tuple(OVERLAPS)))
    context: float = option(0.3, NOT_NEGATIVE)
    farther: float = option(0.3, NOT_NEGATIVE)
    word: float = option(0.05, NOT_NEGATIVE)
    stress: float = option(0.05, NOT_NEGATIVE)
    duration: float = option(0.3, NOT_NEGATIVE)
    guide: float = option(20.0, NOT_NEGATIVE)
    trust: float = option(0.1, NOT_NEGATIVE)
    join: float = option(0.1, NOT_NEGATIVE)
    velocity: float = option(0.05, NOT_NEGATIVE)
    hard: float = option(0.15, NOT_NEGATIVE)
    protected: float = option(1.0, NOT_NEGATIVE)
    cluster: float = option(0.1, NOT_NEGATIVE)
    most: float = option(3.0, Rule(above=0))
    components: int = option(16, Rule(least=1))
    conditions: int = option(15, Rule(least=0))
    epochs: int = option(100, Rule(least=1))
    joint_recogniser: bool = True
    closures: bool = True
    articulation: bool = True
    predictor: str = option(AUTOMATIC, omit_default=True)
    suppressed: bool = option(False, omit_default=True)
    modulation_filter: float = option(0.0, STRENGTH, omit_default=True)

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {"minnis2000": MINNIS_2000}

    def __post_init__(self) -> None:
        super().__post_init__()
        parsed_invisible(self.invisible)
        if self.window > LARGEST_WINDOW:
            raise InputError(f"window is {self.window}, required an odd number from 3 to {LARGEST_WINDOW}")

    def check_files(self) -> None:  # noqa: D102
        check_predictor(self.predictor)

    @property
    def invisible_phones(self) -> frozenset[str]:
        """The phones of ``invisible``."""
        return parsed_invisible(self.invisible)

    @property
    def suppressed_phones(self) -> frozenset[str]:
        """The phones that are left out: none, or those of ``invisible``."""
        return self.invisible_phones if self.suppressed else frozenset()


LARGEST_WINDOW = 11
"""Keys of larger windows do not fit into 64 bits."""
