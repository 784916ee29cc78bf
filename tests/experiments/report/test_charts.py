from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from lipmotion_lab.report.charts import Dot, curve, dots, rising


def test_figures_intervals_and_the_papers_stand_on_one_axis() -> None:
    rows = [Dot("a", 0.5, (0.4, 0.6), 0.9), Dot("<b>", 0.7, (None, None)), Dot("c", None)]
    drawing = ElementTree.fromstring(dots("ACC", "ACC", rows)).find("svg")  # noqa: S314 (our own)
    first, second = (float(each.attrib["cx"]) for each in drawing.findall("circle"))
    (interval,) = (each for each in drawing.findall("line") if each.attrib["class"] == "interval")
    low, high = float(interval.attrib["x1"]), float(interval.attrib["x2"])
    (paper,) = drawing.findall("path")
    assert high - low == pytest.approx(second - first, abs=0.3)
    assert (low + high) / 2 == pytest.approx(first, abs=0.3)
    assert float(paper.attrib["d"][1:].split()[0]) - first == pytest.approx(2 * (second - first), abs=0.3)
    assert "<b> 0.7" in drawing.attrib["aria-label"]


def test_a_curve_has_both_motions_and_what_is_marked() -> None:
    time_s = np.arange(5) / 25
    made = ElementTree.fromstring(curve("x", time_s, np.zeros(5), np.arange(5.0), [(-0.1, 0.04, "p")])).find("svg")  # noqa: S314 (our own)
    assert [line.attrib["class"] for line in made.findall("polyline")] == ["recorded", "generated"]
    assert float(made.find("rect").attrib["x"]) == 34


def test_a_still_motion_is_drawn() -> None:
    assert "polyline" in curve("x", np.arange(3.0), np.zeros(3), np.zeros(3), [])
    assert "nan" not in dots("a", "b", [Dot("still", 0.0, (0.0, 0.0))])


def test_a_curve_over_numbers_rises_with_them() -> None:
    lines = {"a": [(10.0, Dot("10", 0.1, (0.0, 0.2))), (100.0, Dot("100", 0.3, (0.2, 0.4)))]}
    drawing = ElementTree.fromstring(rising("t", "n", lines)).find("svg")  # noqa: S314 (our own)
    (x1, y1), (x2, y2) = (map(float, p.split(",")) for p in drawing.find("polyline").attrib["points"].split())
    assert x2 > x1
    assert y2 < y1
