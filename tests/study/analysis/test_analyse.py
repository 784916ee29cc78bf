import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.storage.json_text import as_json, replace_nan
from lipmotion_studio.study.analysis.analyse import RULES, analyse_study, format_analysis, screen, select_counting
from lipmotion_studio.study.answers import Answer, write_answers
from study.simulated import Effects, comparisons, pair_answer, paired_answers, rated_answers, rating, ratings

NAMES = {"c0": "ph-HMM", "c1": "ph-vi-CHMM", "c2": "recording", "c3": "anchor", "": ""}


def study() -> list[Answer]:
    """Return a study of twelve raters, of whom one always prefers the first."""
    draw = np.random.default_rng(3)
    answers = rated_answers(ratings(draw, np.array([3.1, 3.9, 4.7, 1.5]), (12, 6), Effects()))
    answers += paired_answers(comparisons(draw, np.array([-0.5, 0, 0.8]), (12, 6), Effects()))
    answers = [replace(each, condition=NAMES[each.condition], other=NAMES[each.other]) for each in answers]
    return [replace(each, value="first") if each.rater == "r3" and each.other else each for each in answers]


def test_figures_come_with_and_without_screening(tmp_path):
    write_answers(tmp_path / "answers.csv", study())
    figures = analyse_study(tmp_path / "answers.csv", baseline="ph-HMM")
    assert [row["rater"] for row in figures["screening"]["left_out"]] == ["r3"]
    assert [(part["kind"], part["raters"]) for part in figures["all"]] == [("mos", 12), ("paired", 12)]
    assert [(part["kind"], part["raters"]) for part in figures["screened"]] == [("mos", 11), ("paired", 11)]
    assert figures["screened"] == analyse_study([each for each in study() if each.rater != "r3"])["all"]
    as_json(replace_nan(figures))


def test_the_table_has_all_figures():
    figures = analyse_study(study(), baseline="ph-HMM")
    text = format_analysis(figures)
    assert "recording - anchor" not in text
    for part in figures["screened"]:
        for row in part["conditions"]:
            number = f"{row['share']:.1%}" if "share" in row else f"{row['mean']:.2f}"
            assert any(row["condition"] in line and number in line for line in text.splitlines())
    assert "all raters" in text
    assert "all raters" not in format_analysis(analyse_study([each for each in study() if each.rater != "r3"]))


def test_more_sentences_need_fewer_raters():
    few, many = (
        {row["difference"]: row["raters"] for row in analyse_study(study(), sentences=count)["all"][0]["raters_needed"]}
        for count in (6, 40)
    )
    assert many[0.5] < few[0.5]
    assert few[0.1] is None


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"baseline": "a"}, "the baseline is 'a', required one of: anchor, ph-HMM, ph-vi-CHMM, recording"),
        ({"power": 1.0}, "a power of 1, required between"),
        ({"power": float("nan")}, "a power of nan, required between"),
        ({"sentences": 1}, "1 sentences of planned studies, required at least 2"),
    ],
)
def test_options_that_are_refused(options, error):
    with pytest.raises(InputError, match=error):
        analyse_study(study(), **options)  # type: ignore[arg-type]


def test_a_study_without_answers_is_refused():
    with pytest.raises(InputError, match="1 answers, none of which counts"):
        analyse_study([replace(rating(("r", "s"), "a", 3), practice=True)])
    with pytest.raises(InputError, match="no opinion scores; leave --baseline out"):
        analyse_study([replace(rating(("r", "s"), "a", 3), kind="paired", other="b", value="first")], baseline="a")


def test_no_rater_left():
    answers = [replace(rating(("r", "s"), "a", 3), expected="4"), rating(("r", "s"), "a", 3)]
    figures = analyse_study(answers)
    assert figures["screened"] is None
    assert "no rater is left after screening: figures of all raters" in format_analysis(figures)


DEGENERATE = {
    "one answer": [rating(("r", "s"), "a", 3)],
    "one rater": [rating(("r", f"s{s}"), name, 1 + (s + len(name)) % 5) for s in range(6) for name in ("a", "bb")],
    "one sentence": [rating((f"r{r}", "s"), name, 1 + (r + len(name)) % 5) for r in range(6) for name in ("a", "bb")],
    "all equal": [rating((f"r{r}", f"s{s}"), name, 5) for r in range(3) for s in range(2) for name in "ab"],
    "one pair": [pair_answer(("r", "s"), ("a", "b"), True)],
    "one always wins": [pair_answer((f"r{r}", f"s{s}"), ("a", "b"), True) for r in range(4) for s in range(4)],
    "nothing links": [pair_answer((f"r{r}", "s"), p, r > 1) for r in range(4) for p in (("a", "b"), ("c", "d"))],
    "anchor alone": [pair_answer((f"r{r}", "s"), ("a", "anchor"), True) for r in range(4)],
    "anchor alone rated": [rating(("r", "s"), "anchor", 3)],
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate_studies_have_figures_without_numbers_that_are_none(name):
    """No division warns, and what is unknown is a dash and null."""
    figures = analyse_study(DEGENERATE[name])
    text = format_analysis(figures)
    assert not re.search(r"\b(nan|inf)\b", text)
    as_json(replace_nan(figures))


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
    return answers


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
]


def left_out(answers: list[Answer]) -> dict[str, dict[str, str]]:
    """Return what was found of each rater that is left out, by rule."""
    found: dict[str, dict[str, str]] = {}
    for row in screen(answers)["left_out"]:
        found.setdefault(row["rater"], {})[row["rule"]] = row["found"]
    return found


def test_an_attentive_panel_stays():
    """Also where all conditions look alike, so that answers to both orders agree by chance alone."""
    assert screen(panel()) == {"rules": RULES, "raters": 10, "kept": 10, "left_out": []}
    assert screen([])["raters"] == 0
    assert len(select_counting(panel())) == len(panel()) - 30  # practice and checks do not count


@pytest.mark.parametrize(("rule", "change", "text"), CASES, ids=[case[0] for case in CASES])
def test_a_rule_finds_its_rater(rule, change, text):
    answers = changed(change)
    found = left_out(answers)
    assert set(found) == {"r3"}
    assert re.search(text, found["r3"][rule])
    assert screen(answers)["kept"] == 9


def test_an_anchor_that_is_preferred():
    draw, nothing = np.random.default_rng(1), Effects(0, 0, 0, 0, 0)
    table = comparisons(draw, np.array([5.0, -5, -5]), (6, 6), nothing)
    answers = paired_answers(replace(table, conditions=("anchor", *table.conditions[1:])))
    assert set(left_out(answers)) == {f"r{rater}" for rater in range(6)}
