"""Sections of the figures that stand in docs/results: what the page says of them follows from them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from lipmotion_lab.hofer2008.table1 import PAPER_SCORES
from lipmotion_lab.report.parts import PARTS
from lipmotion_lab.report.section import FEW_CLIPS, Section, warning_of
from lipmotion_lab.xie_liu2007.systems import PAPER_FIGURES

RESULTS = Path(__file__).parents[3] / "docs" / "results"
FILES = {
    "hofer2008": "hofer2008",
    "xieliu2007": "xieliu2007",
    "minnis2000": "minnis2000",
    "engines": "engines-test",
    "learning-curve": "learning-curve",
    "folds": "folds",
}


def figures_of(name: str) -> dict[str, Any]:
    """Return the figures of an experiment on GRID."""
    content: dict[str, Any] = json.loads((RESULTS / f"{FILES[name]}.json").read_text(encoding="utf-8"))
    return content


def section_of(name: str) -> Section:
    return PARTS[name].section(figures_of(name))


@pytest.mark.parametrize("name", PARTS)
def test_every_table_and_chart_is_whole(name: str) -> None:
    section = section_of(name)
    names = [table.name for table in section.tables]
    assert len(names) == len(set(names))
    for table in section.tables:
        assert all(record[column.key] is not None for record in table.records()[:1] for column in table.columns[:1])
        keys = {tuple(record) for record in table.records()}
        assert len(keys) == 1
    for chart in section.charts:
        assert ElementTree.fromstring(chart).find("svg").attrib["role"] == "img"  # noqa: S314 (our own)
    assert section.verdict
    assert all(sentences for sentences in section.words.values())


def test_hofers_pairs_are_counted_from_their_intervals() -> None:
    section, figures = section_of("hofer2008"), figures_of("hofer2008")
    (block,) = [
        each
        for each in figures["tables"]
        if (each["states"], each["condition"], each["pins"]) == (5, "audio only", "as printed")
    ]
    held = sum(pair["score_gain_95"][0] > 0 for pair in block["paper_order"])
    against = sum(pair["score_gain_95"][1] < 0 for pair in block["paper_order"])
    assert f"of the paper's 10 pairs {held} held, {against} reversed" in section.verdict
    assert {name: row["paper"] for name, row in section.table.rows.items()} == PAPER_SCORES
    assert len(section.more) == len(figures["tables"]) - 1


def test_xie_and_lius_figures_stand_beside_ours() -> None:
    section, figures = section_of("xieliu2007"), figures_of("xieliu2007")
    ours = figures["rows"][-1]["conditions"]["audio only"]
    for record in section.table.records():
        assert record["acc"] == ours[record["system"]]["acc"]
        printed = PAPER_FIGURES.get(record["system"].removesuffix(", tuned"), (None, None))
        assert (record["paper_amse"], record["paper_acc"]) == printed
    pairs = [pair for pair in figures["rows"][-1]["pairs"] if not pair["better"].endswith("tuned")]
    held = sum(pair["amse_95"][1] < 0 for pair in pairs)
    assert f"Systems as printed: AMSE: of the paper's {len(pairs)} pairs {held} held" in section.words["By AMSE"][0]


def test_an_addition_that_helps_is_named_so() -> None:
    section, figures = section_of("minnis2000"), figures_of("minnis2000")
    rows = figures["lists"]["test"]["conditions"]["audio only"]
    raised, lowered, left_open = section.words["Each addition alone"]
    assert ("guide from the sound" in raised) == (rows["guide from the sound"]["acc_gain_95"][0] > 0)
    named = sum(text.count("(") for text in (raised, lowered, left_open))
    assert named == 9
    assert section.table.caption == "Unit selection, test, audio only"


def test_few_recordings_are_warned_of() -> None:
    assert warning_of(FEW_CLIPS) == {}
    assert "Only 2 recordings" in warning_of(2)["Beware"][0]


def test_a_share_that_is_not_defined_is_not_told_as_0() -> None:
    figures = figures_of("folds")
    figures["conditions"]["audio only"]["recall_p_b_m"] = None
    (sentence,) = PARTS["folds"].section(figures).words["More closings than a test list has"]
    assert "the lips close in – %" in sentence


@pytest.mark.parametrize("name", PARTS)
def test_figures_that_are_not_defined_end_no_run(name: str) -> None:
    def undefined(content: Any) -> Any:
        """Return figures whose correlations, scores and their intervals are not defined."""
        if isinstance(content, list):
            return [undefined(each) for each in content]
        if not isinstance(content, dict):
            return content
        gone = {"acc", "score", "recall_p_b_m", "acc_95", "score_95", "acc_gain_95", "score_gain_95"}
        return {
            key: undefined(each)
            if key not in gone or isinstance(each, dict)
            else [None, None]
            if isinstance(each, list)
            else None
            for key, each in content.items()
        }

    section = PARTS[name].section(undefined(figures_of(name)))
    assert section.verdict
    assert "nan" not in "".join(map(str, section.charts))
