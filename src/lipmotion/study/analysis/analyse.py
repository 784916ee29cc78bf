"""The analysis of a study: all its figures, with and without screening of raters."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lipmotion.errors import InputError, shortened
from lipmotion.study.analysis.paired import pair_table, paired_figures, share_components
from lipmotion.study.analysis.power import USUAL_POWER, rating_power, share_power
from lipmotion.study.analysis.ratings import difference_components, rating_figures, rating_table
from lipmotion.study.analysis.screening import counts, screen
from lipmotion.study.answers import ANCHOR, PAIRED, Answer, read_answers

Figures = dict[str, Any]


def analyse_study(
    answers: Sequence[Answer] | Path | str,
    *,
    baseline: str | None = None,
    power: float = USUAL_POWER,
    sentences: int | None = None,
) -> Figures:
    """Return the figures of a study (docs/study-analysis.md).

    answers   : of ``read_answers``, or the path of their table
    baseline  : condition to which improvement is relative; None: that with the lowest mean
    power     : with which planned studies shall tell a difference
    sentences : of planned studies; None: as many as in this one
    Returns ``screening``; ``screened``, a list of parts without the raters that are left out; and ``all``, with all
    raters. A part is what was asked in one question of one kind. ``screened`` is None if no rater is left.
    Raises InputError: no answer counts; the baseline is not a condition; a value that is not allowed.

    >>> import lipmotion
    >>> from lipmotion.study.answers import Answer
    >>> answers = [
    ...     Answer(rater, "mos", 0, sentence, "overall", condition, "", value, 9.0, 1, False, "")
    ...     for rater in ("r001", "r002")
    ...     for sentence in ("bin blue", "place red")
    ...     for condition, value in (("trajectory", "4"), ("coupled", "2"))
    ... ]
    >>> (part,) = lipmotion.analyse_study(answers)["all"]
    >>> [(row["condition"], row["mean"]) for row in part["conditions"]]
    [('trajectory', 4.0), ('coupled', 2.0)]
    """
    given = read_answers(Path(answers)) if isinstance(answers, str | Path) else list(answers)
    counted = counts(given)
    _check(counted, len(given), baseline, power, sentences)
    screening = screen(given)
    kept = screening.kept(counted)
    plan = (baseline, power, sentences)
    everybody = _parts(counted, *plan)
    screened = everybody if len(kept) == len(counted) else _parts(kept, *plan)
    return {
        "answers": len(counted),
        "left_aside": len(given) - len(counted),
        "power": power,
        "screening": screening.figures(),
        "screened": screened or None,
        "all": everybody,
    }


def _check(counted: Sequence[Answer], given: int, baseline: str | None, power: float, sentences: int | None) -> None:
    """Raise InputError for what cannot be analysed."""
    if not counted:
        raise InputError(f"{given} answers, none of which counts: required some that are neither practice nor checks")
    conditions = sorted({each.condition for each in counted if each.kind != PAIRED})
    if baseline is not None and baseline not in conditions:
        known = ", ".join(conditions) or "no condition, as nothing was rated"
        raise InputError(f"the baseline {shortened(baseline)!r}, required one of: {known}")
    if not 0.05 < power < 1:
        raise InputError(f"a power of {power:g}, required between 0.05 and 1, such as {USUAL_POWER}")
    if sentences is not None and sentences < 2:
        raise InputError(f"{sentences} sentences of planned studies, required at least 2")


def _parts(answers: Sequence[Answer], baseline: str | None, power: float, sentences: int | None) -> list[Figures]:
    """Return the figures of each question of each kind."""
    parts = []
    for kind, question in dict.fromkeys((each.kind, each.question) for each in answers):
        mine = [each for each in answers if (each.kind, each.question) == (kind, question)]
        found = _compared(mine, power, sentences) if kind == PAIRED else _rated(mine, baseline, power, sentences)
        asked: Figures = {"kind": kind, "question": question, "answers": len(mine)}
        asked |= {"raters": len({each.rater for each in mine}), "sentences": len({each.sentence for each in mine})}
        parts.append(asked | found)
    return parts


def _rated(answers: Sequence[Answer], baseline: str | None, power: float, sentences: int | None) -> Figures:
    table = rating_table(answers)
    components = difference_components(table)
    planned = sentences or table.values.shape[2]
    return rating_figures(table, baseline) | {
        "variance": components._asdict() if components else None,
        "planned_sentences": planned,
        "raters_needed": rating_power(components, answers[0].kind, planned, power),
    }


def _compared(answers: Sequence[Answer], power: float, sentences: int | None) -> Figures:
    """Return the figures of paired comparisons but those with the anchor, which only screen."""
    mine = [each for each in answers if ANCHOR not in (each.condition, each.other)]
    if not mine:
        return {"missing": "all comparisons are with the anchor"}
    table = pair_table(mine)
    components = share_components(table)
    planned = sentences or len(table.sentences)
    return paired_figures(table) | {
        "variance": components._asdict() if components else None,
        "planned_sentences": planned,
        "raters_needed": share_power(components, planned, power),
    }
