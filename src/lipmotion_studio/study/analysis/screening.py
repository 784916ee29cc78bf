"""Which raters did not watch: rules that do not look at what the study asks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lipmotion_studio.study.analysis.paired import order_agreement, pair_table
from lipmotion_studio.study.answers import ANCHOR, FIRST, PAIRED, RECORDING, Answer

MIN_ATTENTION = 2 / 3
"""Share of the checks of attention that must be right."""
MAX_ANCHOR = 0.5
"""Share of the comparisons with the anchor in which it may be preferred."""
MIN_CHANCE = 0.01
"""A rater whose answers to both orders disagree more than by so small a chance presses the same side."""
MIN_ALIKE = 8
"""From so many judgements on, one who always gives the same value does not judge."""
MIN_PANEL = 5
"""With fewer raters nobody is said to be faster than the others."""
FASTEST, DEVIATIONS = 0.5, 3.0
"""A rater is too fast who is below this share of the usual time, and so many deviations of its logarithm below it."""
MIN_ANSWERS = 0.5
"""Share of the usual number of answers below which a rater gave too few."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
Figures = dict[str, Any]
RULES = {
    "attention": f"at least {MIN_ATTENTION:.0%} of the checks of attention right",
    "anchor": f"the anchor rated below the recording (without one: below the mean of the others); preferred in at "
    f"most {MAX_ANCHOR:.0%} of its comparisons",
    "sides": f"not one side whatever is shown: pairs in both orders answered alike not more rarely than by a chance "
    f"of {MIN_CHANCE:.0%}",
    "same value": f"not one value throughout, from {MIN_ALIKE} judgements of a kind on",
    "time": f"median time (relative to the same question's usual time) not below {FASTEST:.0%} and {DEVIATIONS:g} "
    f"robust deviations under the panel's; from {MIN_PANEL} raters on. How long the videos are is not known here",
    "answers": f"at least {MIN_ANSWERS:.0%} of the usual number of answers",
}
"""What is required of a rater."""


@dataclass(frozen=True)
class Screening:
    """All raters, and for each that is left out what was found, by rule."""

    raters: tuple[str, ...]
    found: Mapping[str, Mapping[str, str]]

    def kept(self, answers: Sequence[Answer]) -> list[Answer]:
        """Return the answers of the raters that are kept."""
        return [answer for answer in answers if answer.rater not in self.found]

    def figures(self) -> Figures:
        """Return the rules, and whom they leave out."""
        return {
            "rules": dict(RULES),
            "raters": len(self.raters),
            "kept": len(self.raters) - len(self.found),
            "left_out": [
                {"rater": rater, "rule": rule, "found": text}
                for rater, texts in self.found.items()
                for rule, text in texts.items()
            ],
        }


def counts(answers: Sequence[Answer]) -> list[Answer]:
    """Return the answers that count: neither practice nor checks of attention."""
    return [answer for answer in answers if not answer.practice and not answer.expected]


def screen(answers: Sequence[Answer]) -> Screening:
    """Return which raters of a study are left out."""
    real = [answer for answer in answers if not answer.practice]
    raters = sorted({answer.rater for answer in real})
    judged: dict[str, list[Answer]] = {rater: [] for rater in raters}
    checks: dict[str, list[Answer]] = {rater: [] for rater in raters}
    for answer in real:
        (checks if answer.expected else judged)[answer.rater].append(answer)
    fast = _find_fast(counts(real))
    usual = float(np.median([len(mine) for mine in judged.values()])) if raters else 0.0
    found: dict[str, dict[str, str]] = {}
    for rater, mine in judged.items():
        right, shown = sum(each.value == each.expected for each in checks[rater]), len(checks[rater])
        texts = {
            "attention": f"{right} of {shown} right" if right < MIN_ATTENTION * shown else "",
            "anchor": _check_anchor(mine),
            "sides": _check_sides([each for each in mine if each.kind == PAIRED]),
            "same value": _check_values(mine),
            "time": fast.get(rater, ""),
            "answers": f"{len(mine)} of usually {usual:g}" if len(mine) < MIN_ANSWERS * usual else "",
        }
        if any(texts.values()):
            found[rater] = {rule: text for rule, text in texts.items() if text}
    return Screening(tuple(raters), found)


def _check_values(mine: Sequence[Answer]) -> str:
    for kind in sorted({each.kind for each in mine} - {PAIRED}):
        values = [each.value for each in mine if each.kind == kind]
        if len(values) >= MIN_ALIKE and len(set(values)) == 1:
            return f"{values[0]} in all {len(values)}"
    return ""


def _check_anchor(mine: Sequence[Answer]) -> str:
    compared = [each for each in mine if each.kind == PAIRED and ANCHOR in (each.condition, each.other)]
    chosen = sum((each.condition == ANCHOR) == (each.value == FIRST) for each in compared)
    if chosen > MAX_ANCHOR * len(compared):
        return f"preferred in {chosen} of {len(compared)}"
    for kind in sorted({each.kind for each in mine} - {PAIRED}):
        rated = [(each.condition, int(each.value)) for each in mine if each.kind == kind]
        names = {name for name, _ in rated} - {ANCHOR}
        standard = {RECORDING} & names or names
        values = [value for name, value in rated if name in standard]
        low = [value for name, value in rated if name == ANCHOR]
        if low and values and np.mean(low) >= np.mean(values):
            better = RECORDING if standard == {RECORDING} else "others"
            return f"rated {np.mean(low):.2f}, {better} {np.mean(values):.2f}"
    return ""


def _check_sides(mine: Sequence[Answer]) -> str:
    from scipy.special import bdtr

    if not mine:
        return ""
    alike, pairs = order_agreement(pair_table(mine)).sum(axis=0).tolist()
    if pairs and bdtr(alike, pairs, 0.5) < MIN_CHANCE:
        return f"{alike} of {pairs} pairs answered alike in both orders"
    return ""


def _find_fast(answers: Sequence[Answer]) -> dict[str, str]:
    """Return raters too fast, with their share of the usual time: the median over answers, in logarithms."""
    timed = [each for each in answers if 0 < each.seconds < np.inf]
    logs: dict[tuple[str, str], list[float]] = {}
    for each in timed:
        logs.setdefault((each.kind, each.question), []).append(float(np.log(each.seconds)))
    usual = {question: float(np.median(found)) for question, found in logs.items()}
    by_rater: dict[str, list[float]] = {}
    for each in timed:
        by_rater.setdefault(each.rater, []).append(float(np.log(each.seconds)) - usual[each.kind, each.question])
    if len(by_rater) < MIN_PANEL:
        return {}
    times = {rater: float(np.median(found)) for rater, found in by_rater.items()}
    panel = np.array(list(times.values()))
    middle = float(np.median(panel))
    spread = DEVIATIONS * NORMAL * float(np.median(np.abs(panel - middle)))
    limit = middle - max(spread, -np.log(FASTEST))
    return {rater: f"{np.exp(time - middle):.0%} of the usual time" for rater, time in times.items() if time < limit}
