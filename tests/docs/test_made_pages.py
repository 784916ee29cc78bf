"""Figures of pages are those of their sheets, and tables of the reference are those of the code."""

import json
import re

import numpy as np
import pytest

from docs.site_pages import ROOT, module_at
from lipmotion.meshes.model.rig_tables import read_rig_table
from lipmotion.pipeline.outputs.curve_sets import make_curves
from meshes.speech import motion, units

RESULTS = ROOT / "docs" / "results"
PAGE = RESULTS / "mouth.md"
TABLE = {"commit": "abc1234", "date": "2026-11-23", "model": "shipped 00000000", "command": "make bench"}
TABLES = {"gap": {**TABLE, "columns": ["", "now"], "rows": [["opening", "0.256"]]}}
SHEET = {"page": "results/mouth.md", "tables": TABLES, "stated": ["the aim was 3.5 %"]}
FIGURES, REFERENCE = module_at("scripts/figures_page.py"), module_at("scripts/reference_pages.py")


def test_pages_show_what_their_sheets_hold():
    """Run ``python scripts/figures_page.py``; a figure that it names belongs into the sheet of its page."""
    found, current = FIGURES.sheets(), FIGURES.current_models()
    assert FIGURES.overview(found, current) == FIGURES.OVERVIEW.read_text(encoding="utf-8")
    for page in FIGURES.pages():
        text = page.read_text(encoding="utf-8")
        assert FIGURES.written(text, found, current) == text, page
        assert page == FIGURES.OVERVIEW or FIGURES.not_held(page, text, found) == [], page


def test_sheets_are_stamped_and_shown():
    shown, current = "".join(page.read_text(encoding="utf-8") for page in FIGURES.pages()), FIGURES.current_models()
    for name, sheet in FIGURES.sheets().items():
        assert (ROOT / "docs" / sheet["page"]).is_file(), name
        assert not sheet["stated"] or not sheet["tables"]["text"]["columns"], name
        for key, table in sheet["tables"].items():
            assert all(table[part] for part in ("commit", "date", "model")), (name, key)
            assert (
                name == "glance" or f"<!--figures:{name}.{key}-->" in shown or not FIGURES.rendered(table, current)
            ), (name, key)


def test_a_figure_that_no_sheet_holds_is_found():
    text = "The gap is 0.256, not 0.257; `0.9`; the aim of 3.5 % was missed by 12 MB ([x](a0.77.md)).\n"
    assert FIGURES.not_held(PAGE, text, {"mouth": SHEET}) == ["0.257", "12"]
    assert FIGURES.not_held(ROOT / "docs" / "faces.md", text, {"mouth": SHEET}) == ["0.257"]


def test_a_figure_of_another_model_says_so():
    page = "<!--figures:mouth.gap-->\n<!--end-->\n"
    now = FIGURES.written(page, {"mouth": SHEET}, frozenset({"shipped 00000000"}))
    assert "| opening | 0.256 |\n\n*shipped 00000000 · `make bench`*\n" in now
    later = FIGURES.written(now, {"mouth": SHEET}, frozenset({"shipped 11111111"}))
    assert "*Earlier model (shipped 00000000) · `make bench`*\n" in later
    with pytest.raises(KeyError):
        FIGURES.written(page, {}, frozenset())


def test_stored_figures_are_shown_as_they_are() -> None:
    """A figure that changes where it is stored changes the page, and so the first test here fails until it is made."""
    table = {
        "columns": ["{clips:,} clips", "ACC", "gain", "found", "other"],
        "where": {"r": "rows[0][@0]"},
        "cells": [
            "{r[acc]:.3f}{r[gain]:*} ({r[95]:.2f})",
            "{r[gain]:+.1f}",
            "{r[found]:.0%}",
            "{rows[0][@1][acc]:.1f}",
        ],
        "rows": [["first", "a: b", ""], ["{split}", "c", "a: b"]],
    }
    first = {"acc": 0.8764, "95": [0.8, 0.91], "gain": [-0.2, 0.1], "found": 0.5}
    rows = [{"a: b": first, "c": {**first, "acc": None, "gain": [0.1, 0.2]}}]
    made = FIGURES.filled(table, stored := {"clips": 1234, "split": "test", "rows": rows})
    assert made["columns"] == ["1,234 clips", "ACC", "gain", "found", "other"]
    assert made["rows"][0] == ["first", "0.876 (0.80–0.91)", "−0.2 to +0.1", "50 %", ""]
    assert made["rows"][1] == ["test", "–* (0.80–0.91)", "+0.1 to +0.2", "50 %", "0.9"]
    first["acc"] = 0.8784
    assert FIGURES.filled(table, stored)["rows"][0][1] == "0.878 (0.80–0.91)"
    del first["acc"]
    with pytest.raises(KeyError, match="acc"):
        FIGURES.filled(table, stored)


def test_what_experiments_stored_is_not_copied_but_shown() -> None:
    """A sheet takes what its command stored from there, and nothing is stored that no page or test names."""
    read = [*FIGURES.pages(), *(ROOT / "docs" / "decisions").glob("*.md"), *(ROOT / "tests").rglob("*.py")]
    named, found = "".join(path.read_text(encoding="utf-8") for path in read), set(RESULTS.rglob("*.json"))
    assert [path.name for path in found - set(FIGURES.SHEETS.iterdir()) if path.name not in named] == []
    sheets = [json.loads(path.read_text(encoding="utf-8")) for path in FIGURES.SHEETS.iterdir()]
    for table in (table for sheet in sheets for table in sheet["tables"].values()):
        if match := re.search(r"-o docs/results/(\S+)", table.get("command", "")):
            assert table["from"] == match[1]
            assert table["cells"]


def test_current_models_are_the_shipped_one_and_all_engines() -> None:
    current = FIGURES.current_models()
    assert {"trajectory", "coupled", "selection", "joint", "shipped"} <= {name.split()[0] for name in current}


def test_tables_of_the_reference_are_those_of_the_code():
    """Run ``python scripts/reference_pages.py``."""
    pages = {page: page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md")}
    assert [page for page, text in pages.items() if REFERENCE.written(text) != text] == []
    made = "".join(pages.values())
    assert [name for name in REFERENCE.TABLES if f"<!--made:{name}-->" not in made] == []


def test_every_verb_is_listed_with_pages():
    rows = REFERENCE.verb_list().splitlines()
    verbs = {name.split()[0] for name, _, _ in REFERENCE.verbs(REFERENCE.whole_parser())}
    assert {row.split("`")[1].split()[0] for row in rows} == verbs == set(REFERENCE.SEE)


PROGRAM_PAGES = sorted((ROOT / "docs" / "for").glob("*.md"))
RIGS = sorted((ROOT / "examples" / "rigs").glob("*.csv"))
MAX_LINES = 60


def test_a_jaw_opens_and_closes():
    jaw = make_curves(motion(), units(), ROOT / "examples" / "rigs" / "jaw-bone.csv")["jaw.rotation.x"]
    assert jaw.max() == pytest.approx(65 * 0.2 - 0.8, abs=0.5)
    assert jaw[[20, 55, 95]] == pytest.approx(0.0)


def test_pages_are_short():
    assert [page for page in PROGRAM_PAGES if len(page.read_text(encoding="utf-8").splitlines()) > MAX_LINES] == []


def test_every_table_moves_its_rig_and_is_on_a_page():
    text = "".join(page.read_text(encoding="utf-8") for page in PROGRAM_PAGES)
    assert RIGS
    for table in RIGS:
        rows = read_rig_table(table)
        said = make_curves(motion(), units(), table)
        assert said.names == tuple(dict.fromkeys(row.control for row in rows))
        assert np.ptp(said.values, axis=0).max() > 0
        first = {row.control: row for row in reversed(rows)}
        for name in said.names:
            assert first[name].low <= said[name].min() <= said[name].max() <= first[name].high
        assert table.name in text
