"""Who is left out: each rule catches whom it is for, and spares who merely finds conditions alike."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from lipmotion_studio.study.analysis.analyse import RULES, counts, screen
from lipmotion_studio.study.answers import Answer
from study.analysis.simulated import Effects, comparisons, paired_answers, rated_answers, rating, ratings

Change = Callable[[Answer], Answer]


def panel() -> list[Answer]:
    """Return answers of ten raters, with two checks of attention each, and with practice."""
    draw = np.random.default_rng(5)
    scores = ratings(draw, np.array([3.2, 1.5, 4.6]), (10, 6), Effects())
    names = {"c0": "model", "c1": "anchor", "c2": "recording"}
    answers = [replace(each, condition=names[each.condition]) for each in rated_answers(scores)]
    answers += paired_answers(comparisons(draw, np.zeros(3), (10, 6), Effects()))
    for rater in range(10):
        check = rating((f"r{rater}", "s0"), "model", 2)
        answers += [replace(check, expected="2"), replace(check, expected="2"), replace(check, practice=True)]
    return [replace(each, seconds=each.seconds * float(np.exp(0.2 * draw.normal()))) for each in answers]


def changed(change: Change) -> list[Answer]:
    return [change(each) if each.rater == "r3" else each for each in panel()]


def is_rated(each: Answer) -> bool:
    return each.kind == "mos" and not each.expected and not each.practice


CASES: list[tuple[str, Change, str]] = [
    ("attention", lambda each: replace(each, value="5") if each.expected else each, "0 of 2 right"),
    (
        "anchor",
        lambda each: replace(each, value="5") if is_rated(each) and each.condition == "anchor" else each,
        r"rated 5\.00, recording 4\.\d\d",
    ),
    ("sides", lambda each: replace(each, value="first") if each.kind == "paired" else each, "0 of 18 pairs"),
    ("same value", lambda each: replace(each, value="3") if is_rated(each) else each, "3 in all 18"),
    ("time", lambda each: replace(each, seconds=each.seconds / 4), r"2\d% of the usual time"),
]


def test_an_attentive_panel_stays() -> None:
    """Also where all conditions look alike, so that answers to both orders agree by chance alone."""
    screening = screen(panel())
    assert len(screening.raters) == 10
    assert not screening.found
    assert screening.figures() == {"rules": RULES, "raters": 10, "kept": 10, "left_out": []}


@pytest.mark.parametrize(("rule", "change", "text"), CASES, ids=[case[0] for case in CASES])
def test_a_rule_finds_its_rater(rule: str, change: Change, text: str) -> None:
    answers = changed(change)
    screening = screen(answers)
    assert set(screening.found) == {"r3"}
    assert rule in screening.found["r3"]
    assert re.search(text, screening.found["r3"][rule])
    row = next(row for row in screening.figures()["left_out"] if row["rule"] == rule)
    assert row["rater"] == "r3"
    assert {each.rater for each in screening.kept(answers)} == set(screening.raters) - {"r3"}


def test_too_few_answers() -> None:
    answers = [each for each in panel() if each.rater != "r3" or each.sentence == "s1"]
    assert screen(answers).found["r3"]["answers"] == "9 of usually 54"


def test_an_anchor_that_is_preferred() -> None:
    answers = paired_answers(
        comparisons(np.random.default_rng(1), np.array([5.0, -5, -5]), (6, 6), Effects(0, 0, 0, 0, 0))
    )
    answers = [
        replace(each, condition=each.condition.replace("c0", "anchor"), other=each.other.replace("c0", "anchor"))
        for each in answers
    ]
    assert set(screen(answers).found) == {f"r{rater}" for rater in range(6)}


def test_equal_times_exclude_nobody_and_broken_ones_are_passed_over() -> None:
    answers = [replace(each, seconds=4.0) for each in panel()]
    assert not screen(answers).found
    answers = [replace(each, seconds=float("nan") if each.rater == "r1" else 0.0) for each in answers]
    assert not screen(answers).found


def test_four_raters_are_no_panel_for_times() -> None:
    few = [each for each in changed(lambda each: replace(each, seconds=each.seconds / 9)) if each.rater < "r4"]
    assert not screen(few).found


def test_practice_and_checks_do_not_count() -> None:
    assert len(counts(panel())) == len(panel()) - 30
    assert screen([]).raters == ()
