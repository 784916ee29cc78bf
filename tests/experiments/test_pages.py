"""Pages of results show what the verbs print for the figures that are stored beside them."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lipmotion_lab import engine_comparison, folds, hofer2008, learning_curve, minnis2000
from lipmotion_lab.xie_liu2007 import six_systems
from lipmotion_lab.xie_liu2007.systems import REFERENCE_SYSTEM, TUNED

RESULTS = Path(__file__).parents[2] / "docs" / "results"
CONDITIONS = ("audio only", "with transcript")
LISTS = [f"{part}, {condition}" for part in ("val, 22 clips", "test, 50 clips") for condition in CONDITIONS]
SIZES = [4, 10, *learning_curve.SIZES, 452]
SIX = six_systems.table, lambda *keys: [("audio only, 452 ", f"{key}  ") for key in keys if key]
TABLES: dict[str, tuple[str, Callable[[Any], str], Callable[..., list[tuple[str, str]]]]] = {
    "engines.test": ("engines-test", engine_comparison.table, lambda title, name: [(title, name)]),
    "folds.folds": (
        "folds",
        folds.table,
        lambda title: [(title, each) for each in ("p b m:", "closings:", "opening:")],
    ),
    "learning-curve.earlier": (
        *("learning-curve", learning_curve.table),
        lambda number: [(title, f"{SIZES[int(number)]} ") for title in CONDITIONS],
    ),
    "hofer2008.all": ("hofer2008", hofer2008.table, lambda name: [("5 states; audio only; as printed", f"{name}  ")]),
    "xieliu2007.all": ("xieliu2007", *SIX),
    "xieliu2007.eigenlips": ("xieliu2007-eigenlips-452", *SIX),
    "selection.printed": ("minnis2000", minnis2000.table, lambda name: [(title, f"{name}  ") for title in LISTS]),
}
"""By region: the stored figures, what prints them, and, by the keys of a row, the titles and starts of its lines."""


def stored(name: str) -> Any:
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def line_of(printed: str, title: str, start: str) -> str:
    """Return what a line says after its start in the part below a title. Raises ValueError: there is not one."""
    part = f"{printed}\n\n".partition(f"\n{title}")[2].partition("\n\n")[0]
    (line,) = (line for line in map(str.strip, part.splitlines()) if line.startswith(start))
    return line.removeprefix(start)


def numbers(text: str) -> Counter[str]:
    """Return the numbers of a text, with signs and marks of significance."""
    plain = re.sub(r"(?<=\d),(?=\d{3})", "", text.replace("−", "-"))
    return Counter(re.findall(r"(?<![\w.])[+-]?\d+(?:\.\d+)?\*?", plain))


@pytest.mark.parametrize("region", TABLES)
def test_a_table_on_a_page_has_what_the_verb_prints(region: str) -> None:
    """Formats in a sheet make its cells, so they are compared with the verb's own text."""
    name, table, lines = TABLES[region]
    sheet = stored(f"figures/{region.partition('.')[0]}")
    source, page = (
        sheet["tables"][region.partition(".")[2]],
        (RESULTS.parent / sheet["page"]).read_text(encoding="utf-8"),
    )
    assert source["from"] == f"{name}.json"
    shown = page.partition(f"<!--figures:{region}-->\n")[2].partition("\n\n")[0]
    typed, printed = len(source["columns"]) - len(source["cells"]), table(stored(name))
    for row, keys in zip(shown.splitlines()[2:], source["rows"], strict=True):
        found = numbers(row.split("|", 2)[2])
        assert found
        assert found <= numbers(" ".join(line_of(printed, *each) for each in lines(*keys[typed:])))


def test_numbers_are_compared_with_signs_and_marks() -> None:
    assert numbers("−0.059* (1,234–0.5) p2") == Counter(["-0.059*", "1234", "0.5"])
    assert not numbers("0.894* | 22,088") <= numbers("0.894  22088")
    assert not numbers("0.894 | 0.894") <= numbers("0.894  0.895")


def test_stored_figures_are_of_the_whole_corpus() -> None:
    for split, clips in (("val", 22), ("test", 50)):
        figures = stored(f"engines-{split}")
        assert (figures["split"], figures["clips"]) == (split, clips)
    assert (stored("folds")["folds"], stored("folds")["clips"]) == (5, 452)
    assert stored("hofer2008")["trained_on"] == 452
    assert [row["names"] for row in stored("learning-curve")["rows"]] == SIZES
    assert REFERENCE_SYSTEM + TUNED in stored("xieliu2007")["rows"][0]["training"]
