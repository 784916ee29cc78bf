from __future__ import annotations

import csv
import io

from lipmotion_lab.report.table import Column, Table

ROWS = {
    "a, <b>": {"acc": 0.5, "acc_95": (0.4, 0.6), "acc_gain_95": (0.1, 0.2), "kind": "x"},
    "c": {"acc": None, "acc_95": (None, None), "acc_gain_95": None, "kind": None},
}
TABLE = Table("t", "All & some", (Column("acc", "ACC", ".2f", "a note"), Column("kind", "kind")), ROWS, "c")


def test_every_figure_has_its_interval_and_difference_in_the_files() -> None:
    first, second = csv.DictReader(io.StringIO(TABLE.as_csv()))
    assert first["system"] == "a, <b>"
    assert [float(first[key]) for key in ("acc", "acc_low", "acc_high")] == [0.5, 0.4, 0.6]
    assert [float(first[key]) for key in ("acc_difference_low", "acc_difference_high")] == [0.1, 0.2]
    assert set(second.values()) == {"c", ""}
    content = TABLE.as_content()
    assert content["rows"][0]["acc_difference_low"] == 0.1
    assert (content["reference"], content["columns"]["acc"]) == ("c", "a note")


def test_the_page_shows_the_interval_and_a_star() -> None:
    html = TABLE.as_html("folder")
    assert '<th scope="row">a, &lt;b&gt;</th><td class="number">0.50* <small>0.40–0.60</small></td><td>x</td>' in html
    assert '<th scope="row">c</th><td class="number">–</td><td>–</td>' in html
    assert 'href="folder/tables/t.csv"' in html
    assert "difference from c leaves out 0" in html


def test_a_table_without_rows() -> None:
    empty = Table("t", "none", (Column("acc", "ACC", ".2f"),), {})
    assert (empty.as_csv().strip(), empty.records()) == ("system", [])
