"""What held of the order that a paper prints, in words that follow from the figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lipmotion.experiments.comparison import sign_of_difference

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
        """Return one sentence: whether the paper's order held."""
        held, reverse, left_open = (self._with(sign) for sign in (1, -1, 0))
        counts = f"{len(held)} of {len(self.pairs)} pairs hold, {len(reverse)} are reversed, {len(left_open)} open"
        if not held and not reverse:
            return f"Open: these recordings cannot tell any two systems apart by {self.figure} ({counts})."
        if not reverse:
            whole = "the paper's order by" if not left_open else "as far as can be told, the paper's order by"
            return f"Held: {whole} {self.figure} ({counts})."
        if not held:
            return f"Did not hold: the paper's order by {self.figure} ({counts})."
        most = (
            "mostly held" if len(held) > 2 * len(reverse) else "mostly reversed" if len(reverse) > 2 * len(held) else ""
        )
        return f"{most.capitalize() or 'Mixed'}: the paper's order by {self.figure} ({counts})."

    def sentences(self) -> list[str]:
        """Return what held and what did not, sentence by sentence."""
        held, reverse, left_open = (self._with(sign) for sign in (1, -1, 0))
        found = [
            f"By {self.figure}, the paper: {_listed(self.paper, self.is_error)}. Here: "
            f"{_listed(self.here, self.is_error)}.",
            self._of_the_best(),
        ]
        for pairs, what in (
            (held, "Held: the interval of the difference is on the paper's side of 0"),
            (reverse, "Reversed: it is on the other side"),
            (left_open, "Open: it contains 0"),
        ):
            if pairs:
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

    def _of_the_best(self) -> str:
        best = _best(self.paper, self.is_error)[0]
        here = _best(self.here, self.is_error)
        if not here:
            return f"Best in the paper: {best}. Here no figure is defined."
        if here == [best]:
            return f"{best}, the paper's best, is the best here, too."
        if best in here:
            others = ", ".join(name for name in here if name != best)
            return f"{best}, the paper's best, has the best figure here, too, as have {others}."
        pair = next((each for each in self.pairs if {each.better, each.worse} == {best, here[0]}), None)
        by = ""
        if pair is not None and pair.difference is not None:
            low, high = pair.interval
            lies = "" if low is None or high is None else f" (95 % interval {low:{self.form}} to {high:{self.form}})"
            by = f"; {pair.better} minus {pair.worse}: {pair.difference:{self.form}}{lies}, above 0 as in print"
        return f"Best in the paper: {best}; here: {', '.join(here)}{by}."


def _best(values: Mapping[str, float | None], is_error: bool) -> list[str]:
    """Return the names of the best value; none where none is defined."""
    known = {name: value for name, value in values.items() if value is not None}
    best = (min if is_error else max)(known.values(), default=None)
    return [name for name, value in known.items() if value == best]


def _listed(values: Mapping[str, float | None], is_error: bool) -> str:
    """Return names from the best to the worst; equal ones with ``=``; those without a value are left out."""
    remaining, groups = dict(values), list[str]()
    while group := _best(remaining, is_error):
        groups.append(" = ".join(group))
        remaining = {name: value for name, value in remaining.items() if name not in group}
    return ", then ".join(groups)
