from __future__ import annotations

import pytest

from lipmotion_lab.report.order import PaperOrder, PaperPair

PAPER = {"a": 3.0, "b": 2.0, "c": 1.0}


def order(here: dict[str, float | None], signs: dict[str, int], is_error: bool = False) -> PaperOrder:
    """Return an order of which the intervals of the pairs have some signs."""
    lies = {1: (0.1, 0.3), -1: (-0.3, -0.1), 0: (-0.1, 0.1)}
    pairs = [PaperPair(pair[0], pair[1], signs[pair] * 0.2, lies[signs[pair]]) for pair in ("ab", "ac", "bc")]
    return PaperOrder("ACC", PAPER, here, pairs, "+.1f", is_error)


@pytest.mark.parametrize(
    ("signs", "outcome"),
    [
        ((1, 1, 1), "3 held, 0 reversed, 0 open: all held"),
        ((1, 1, 0), "2 held, 0 reversed, 1 open: more held than reversed"),
        ((-1, -1, 1), "1 held, 2 reversed, 0 open: more reversed than held"),
        ((1, -1, 0), "1 held, 1 reversed, 1 open: as many held as reversed"),
        ((0, 0, 0), "0 held, 0 reversed, 3 open: these recordings say nothing of its order"),
    ],
)
def test_the_verdict_counts_pairs(signs: tuple[int, ...], outcome: str) -> None:
    found = order({"a": 0.3, "b": 0.2, "c": 0.1}, dict(zip(("ab", "ac", "bc"), signs, strict=True)))
    assert found.verdict() == f"ACC: of the paper's 3 pairs {outcome}. Best in print: a; here: a."


def test_every_pair_is_told_once_the_better_one_here_first() -> None:
    found = order({"a": 0.1, "b": 0.3, "c": 0.1}, {"ab": -1, "ac": 0, "bc": 1})
    said = found.sentences()
    assert said[:2] == ["In print: a 3.0, b 2.0, c 1.0.", "Here: b 0.3, a 0.1, c 0.1."]
    assert said[2].startswith(
        "The paper's best is 0.2 behind the best here: a against b -0.2, 95 % interval -0.3 to -0.1"
    )
    assert [text.partition("): ")[2] for text in said[3:6]] == ["b over c.", "b over a.", "a and c."]
    assert said[6].startswith("Intervals aside, 1 of 3 differences")


def test_the_smallest_error_is_the_best() -> None:
    found = order({"a": 0.1, "b": None, "c": 0.3}, {"ab": 1, "ac": 1, "bc": 1}, is_error=True)
    assert found.verdict().endswith("Best in print: c; here: a.")
    assert found.sentences()[1] == "Here: a 0.1, c 0.3."


def test_equal_and_undefined_figures() -> None:
    signs = {"ab": 0, "ac": 0, "bc": 0}
    assert order({"a": 0.1, "b": 0.1, "c": 0.0}, signs).verdict().endswith("here: a, b.")
    nothing = order({"a": None, "b": None, "c": None}, signs)
    assert nothing.verdict().endswith("here: none.")
    assert nothing.sentences()[1] == "Here: ."
