"""How the coupled engine is set up."""

from __future__ import annotations

from dataclasses import dataclass, fields

from lipmotion.engines.coupled.chains.structures import STRUCTURES
from lipmotion.engines.coupled.conversion.em import EXACT, SOFT, STARTS, UPDATES, Conversion
from lipmotion.errors import InputError

TRAJECTORY, FRAMES, PATH = "trajectory", "em", "viterbi"
CONVERSIONS = (TRAJECTORY, FRAMES, PATH)


@dataclass(frozen=True)
class CoupledConfig:
    """How the coupled engine models speech and lips (chosen on the validation list; see docs/decisions/0010).

    structure  : ``hmm``, ``multistream``, ``factorial`` or ``coupled`` (``systems.SYSTEMS`` has the paper's six)
    chains     : the unit set of each chain, separated by blanks: names or table files; speech is on the first
    states     : states per unit, left to right, no skips
    asynchrony : how many states chains may be apart; -1: any number
    crosses    : let chains leave a unit at different times
    mixtures, visual_mixtures : Gaussians per state of speech, and of what is seen (powers of two); of ``hmm`` the first
                 counts for both
    more_mixtures, more_steps, more_weight : of the second stage of training, on speech without motion: Gaussians per
                 state of speech, steps of EM for each number of them, and how much a frame of it counts beside one of
                 speech with motion
    audio_weight, visual_weight, eigenlips_weight : exponents of the densities of speech, of geometry, and of eigenlips
    conversion : ``trajectory``: parameter generation from expected precisions and means of value, slope and curvature;
                 ``em``: the paper's, frame by frame;  ``viterbi``: means along the best path
    start, update, steps : of the EM of conversion (``conversion.Conversion``); ``trajectory`` takes no steps after its
                 soft start unless they are asked for
    follows    : let visual means follow the sound, and what the chains believe, around the frame (``trajectory`` only)
    components : dimensions that all point channels are reduced to
    full_range : make movements as large as the original's
    closures   : make the lips meet in every p, b and m
    """

    structure: str = "coupled"
    chains: str = "phone viseme"
    states: int = 3
    asynchrony: int = 1
    crosses: bool = True
    mixtures: int = 8
    visual_mixtures: int = 1
    more_mixtures: int = 8
    more_steps: int = 8
    more_weight: float = 0.3
    audio_weight: float = 1.0
    visual_weight: float = 1.0
    eigenlips_weight: float = 1.0
    conversion: str = TRAJECTORY
    start: str = SOFT
    update: str = EXACT
    steps: int = 0
    follows: bool = True
    components: int = 16
    full_range: bool = True
    closures: bool = True

    def __post_init__(self) -> None:
        least = {"steps": 0, "asynchrony": -1}
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type == "int" and (type(value) is not int or value < least.get(field.name, 1)):
                wanted = f"a whole number from {least.get(field.name, 1)}"
                raise InputError(f"{field.name} is {value!r}, required {wanted}")
            if field.type == "float" and not (isinstance(value, int | float) and 0 <= value < float("inf")):
                raise InputError(f"{field.name} is {value!r}, required a number from 0")
            if field.type == "str" and not isinstance(value, str):
                raise InputError(f"{field.name} is {value!r}, required text")
        for name in ("mixtures", "visual_mixtures", "more_mixtures"):
            if getattr(self, name) & (getattr(self, name) - 1):
                raise InputError(f"{name} is {getattr(self, name)}, required a power of two")
        choices = {"structure": STRUCTURES, "conversion": CONVERSIONS, "start": STARTS, "update": UPDATES}
        for name, known in choices.items():
            if getattr(self, name) not in known:
                raise InputError(f"{name} is {getattr(self, name)!r}, required one of: {', '.join(known)}")

    @property
    def dynamic(self) -> bool:
        """Whether slope and curvature are modelled."""
        return self.conversion == TRAJECTORY

    @property
    def em(self) -> Conversion:
        """The conversion by EM."""
        return Conversion(self.start, self.update, self.steps)
