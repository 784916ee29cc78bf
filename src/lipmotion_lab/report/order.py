"""What held of the order that a paper prints, in words that follow from the figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lipmotion_lab.comparison import sign_of_difference

CHANCE = 0.05
"""Share of 95 % intervals that leave out 0 where nothing differs."""


@dataclass(frozen=True)
class PaperPair:
    """Two systems, of which the paper has the first as the better one.

    difference : here, in the figure's unit, positive as in the paper; None: not defined
    interval   : its 95 % interval on the same recordings
    """

    better: str
    worse: str
    difference: float | None
    interval: Sequence[float | None]

    @property
    def sign(self) -> int:
        """1: it holds here; -1: it is reversed; 0: the interval contains 0, so these recordings leave it open."""
        return sign_of_difference(self.interval)


@dataclass(frozen=True)
class PaperOrder:
    """The order of some systems by a figure, in a paper and here.

    figure   : its name, in words
    paper    : the paper's values
    here     : the values here; None: not defined
    pairs    : every two systems
    form     : how a difference is written
    is_error : whether the smallest value is the best
    """

    figure: str
    paper: Mapping[str, float]
    here: Mapping[str, float | None]
    pairs: Sequence[PaperPair]
    form: str
    is_error: bool = False

    def verdict(self) -> str:
        """Return in two sentences whether the paper's order held, and which system is best."""
        held, reverse, left_open = (len(self._with(sign)) for sign in (1, -1, 0))
        told = (
            f"{self.figure}: of the paper's {len(self.pairs)} pairs {held} held, {reverse} reversed, {left_open} open"
        )
        if held or reverse:
            outcomes = ("as many held as reversed", "more held than reversed", "more reversed than held")
            outcome = outcomes[(held > reverse) - (held < reverse)]
            told += f": {'all held' if held == len(self.pairs) else outcome}"
        else:
            told += ": these recordings say nothing of its order"
        here = ", ".join(_best(self.here, self.is_error)) or "none"
        return f"{told}. Best in print: {_best(self.paper, self.is_error)[0]}; here: {here}."

    def sentences(self) -> list[str]:
        """Return what held and what did not, sentence by sentence."""
        found = [f"In print: {self._listed(self.paper)}.", f"Here: {self._listed(self.here)}.", *self._of_the_best()]
        for sign, what in (
            (1, "Held: the interval of the difference is on the paper's side of 0"),
            (-1, "Reversed: it is on the other side"),
            (0, "Open: it contains 0"),
        ):
            if pairs := self._with(sign):
                found.append(f"{what} ({len(pairs)} of {len(self.pairs)} pairs): {self._named(pairs)}.")
        agreeing = sum((pair.difference or 0) > 0 for pair in self.pairs)
        found.append(
            f"Intervals aside, {agreeing} of {len(self.pairs)} differences have the paper's sign. Of {len(self.pairs)} "
            f"intervals about {CHANCE * len(self.pairs):.1f} would leave out 0 by chance if nothing differed."
        )
        return found

    def _with(self, sign: int) -> list[PaperPair]:
        return [pair for pair in self.pairs if pair.sign == sign]

    def _named(self, pairs: Sequence[PaperPair]) -> str:
        """Return pairs in words, those of the same first system together; the better one here stands first."""
        grouped: dict[str, list[str]] = {}
        for pair in pairs:
            first, second = (pair.worse, pair.better) if pair.sign < 0 else (pair.better, pair.worse)
            grouped.setdefault(first, []).append(second)
        joint = "and" if not pairs[0].sign else "over"
        return "; ".join(f"{first} {joint} {', '.join(others)}" for first, others in grouped.items())

    def _of_the_best(self) -> list[str]:
        """Return how far the paper's best system is from the best one here; nothing where it is the best."""
        best, here = _best(self.paper, self.is_error)[0], _best(self.here, self.is_error)
        pair = next((each for each in self.pairs if here and {each.better, each.worse} == {best, here[0]}), None)
        if best in here or pair is None or pair.difference is None:
            return []
        low, high = pair.interval
        lies = "" if low is None or high is None else f", 95 % interval {low:{self.form}} to {high:{self.form}}"
        return [
            f"The paper's best is {-pair.difference:{self.form.replace('+', '')}} behind the best here: {best} against "
            f"{here[0]} {pair.difference:{self.form}}{lies}, where print has it above 0."
        ]

    def _listed(self, values: Mapping[str, float | None]) -> str:
        """Return names with their values, from the best to the worst; those without a value are left out."""
        known = [(name, value) for name, value in values.items() if value is not None]
        form = self.form.replace("+", "")
        known.sort(key=lambda pair: pair[1], reverse=not self.is_error)
        return ", ".join(f"{name} {value:{form}}" for name, value in known)


def _best(values: Mapping[str, float | None], is_error: bool) -> list[str]:
    """Return the names of the best value; none where none is defined."""
    known = {name: value for name, value in values.items() if value is not None}
    best = (min if is_error else max)(known.values(), default=None)
    return [name for name, value in known.items() if value == best]
