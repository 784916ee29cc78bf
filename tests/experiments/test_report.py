"""Figures that are stored in docs/results: sections of the report, and pages, say of them what follows from them."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from experiments.conftest import SETTINGS, few_sets, renamed
from lipmotion import errors, units
from lipmotion.corpora import SPLITS
from lipmotion_lab import hofer2008, minnis2000, runner
from lipmotion_lab.report import report
from lipmotion_lab.report.section import Column, PaperOrder, PaperPair, Section, Table
from lipmotion_lab.xie_liu2007.systems import PAPER_FIGURES
from study.browser import BROWSER, DRIVER, MISSING, browser, check_screen

TWO = ("hofer2008", "folds")
SCREENS = ((1280, 900, "light"), (1280, 900, "dark"), (320, 640, "light"), (320, 640, "dark"))


class Links(HTMLParser):
    """The files that a page leads to, and the texts in it."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.files: list[str] = []
        self.text = ""
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002
        self.files += [value or "" for name, value in attrs if name in ("src", "href") and not value.startswith("#")]

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace every experiment by one that returns the figures of GRID at once; return the names of those that ran."""
    names: list[str] = []

    def run(name: str, given: report.PartRun) -> dict[str, Any]:
        names.append(name)
        (given.work / "half").write_text("finished")
        given.models.mkdir(parents=True, exist_ok=True)
        return figures_of(name)

    stand_ins = {name: replace(part, run=partial(run, name), draws=False) for name, part in report.PARTS.items()}
    monkeypatch.setattr(report, "PARTS", stand_ins)
    return names


def state(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Return time and content of every file in a folder."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path): (path.stat().st_mtime_ns, path.read_bytes()) for path in files}


def test_what_is_finished_is_not_run_again_and_no_byte_changes(ran, toy_corpus, tmp_path):
    folder = tmp_path / "a" / "report"
    found = report.write_report(toy_corpus, folder)
    assert (ran, list(found.made), found.left_out) == (list(report.PARTS), list(report.PARTS), {})
    assert "of the paper's 10 pairs" in found.verdicts["hofer2008"]
    assert sorted(path.name for path in folder.iterdir()) == sorted([report.PAGE, "models", *report.PARTS])
    before = state(folder)
    again = report.write_report(toy_corpus, folder)
    assert (len(ran), list(again.made), again.verdicts) == (len(report.PARTS), [], found.verdicts)
    assert state(folder) == before
    links = Links(folder / report.PAGE)
    assert all((folder / file).is_file() for file in links.files)
    assert len(links.files) == len(set(links.files)) >= 2 * len(report.PARTS)
    stamp = json.loads((folder / "folds" / "figures.json").read_text())["stamp"]
    assert (stamp["seed"], stamp["corpus"]["train"], stamp["machine"]["cores"] > 0) == (0, 8, True)
    assert len(stamp["corpus"]["SHA-256"]) == 64
    assert stamp["versions"]["numpy"] in links.text
    assert stamp["command"].endswith("-o report --only folds")


def test_a_run_that_was_stopped_goes_on(ran, toy_corpus, tmp_path, monkeypatch):
    def stopped(given: report.PartRun) -> dict[str, Any]:
        (given.work / "half").write_text("finished")
        raise KeyboardInterrupt

    stand_ins: dict[str, report.ReportPart] = vars(report)["PARTS"]
    whole = stand_ins["folds"]
    monkeypatch.setitem(stand_ins, "folds", replace(whole, run=stopped))
    with pytest.raises(KeyboardInterrupt):
        report.write_report(toy_corpus, tmp_path / "r", only=TWO)
    text = Links(tmp_path / "r" / report.PAGE).text
    assert "the same command goes on with it" in text
    assert "Hofer, Yamagishi" in text
    assert (tmp_path / "r" / "folds.json.unfinished" / "half").is_file()
    monkeypatch.setitem(stand_ins, "folds", whole)
    assert report.write_report(toy_corpus, tmp_path / "r", only=TWO).made == ["folds"]
    assert ran == ["hofer2008", "folds"]
    assert not list((tmp_path / "r").glob("*.unfinished"))
    assert "not chosen" in Links(tmp_path / "r" / report.PAGE).text


def test_what_fails_is_told_and_stops_nothing_else(ran, toy_corpus, tmp_path, monkeypatch):
    """An experiment with an error of its own, and one whose figures cannot be told."""

    def broken(_: object) -> Any:
        raise KeyError("no such figure")

    stand_ins: dict[str, report.ReportPart] = vars(report)["PARTS"]
    whole = dict(stand_ins)
    monkeypatch.setitem(stand_ins, "hofer2008", replace(whole["hofer2008"], run=broken))
    reports: list[tuple[str, str]] = []
    settings = runner.ExperimentSettings(monitor=lambda event: reports.append((event.name, event.outcome)))
    found = report.write_report(toy_corpus, tmp_path / "r", only=TWO, settings=settings)
    assert (list(found.failed), list(found.made), reports) == (["hofer2008"], ["folds"], [("hofer2008", "failed")])
    monkeypatch.setitem(stand_ins, "hofer2008", whole["hofer2008"])
    monkeypatch.setitem(stand_ins, "folds", replace(whole["folds"], section=broken))
    found = report.write_report(toy_corpus, tmp_path / "r", only=TWO)
    assert (list(found.failed), list(found.verdicts), list(found.made)) == (["folds"], ["hofer2008"], ["hofer2008"])
    text = Links(tmp_path / "r" / report.PAGE).text
    assert "foldsfailed: KeyError: 'no such figure'; mend that" in text
    assert "not finished" not in text
    monkeypatch.setitem(stand_ins, "folds", whole["folds"])
    assert not report.write_report(toy_corpus, tmp_path / "r", only=TWO).failed
    assert ran == ["folds", "hofer2008"]


@pytest.mark.long
def test_other_recordings_or_settings_are_run_again(ran, toy_corpus, tmp_path):
    run: Callable[..., report.WrittenReport] = partial(report.write_report, folder=tmp_path / "r", only=["folds"])
    lists = {split: toy_corpus.names(split) for split in SPLITS}
    run(toy_corpus)
    assert run(toy_corpus, quick=True).made == ["folds"]
    assert "quick run" in Links(tmp_path / "r" / report.PAGE).text
    assert run(toy_corpus.divided(lists | {"train": lists["train"][1:]}), quick=True).made == ["folds"]
    assert run(toy_corpus, quick=True, settings=replace(SETTINGS, seed=1)).made == ["folds"]
    assert run(toy_corpus, settings=replace(SETTINGS, lexicon=units.Lexicon({"a": (("ax",),)}))).made == ["folds"]
    assert "-o r --only folds --lexicon FILE" in Links(tmp_path / "r" / report.PAGE).text
    assert len(ran) == len(list((tmp_path / "r" / "models").iterdir())) == 5


@pytest.mark.long
@pytest.mark.usefixtures("ran")
def test_a_corpus_without_a_list_has_what_can_be_run(toy_corpus, tmp_path):
    train, val, test = (toy_corpus.divided({split: toy_corpus.names(split)}) for split in SPLITS)
    without_val = toy_corpus.divided({"train": train.names(), "test": test.names()})
    found = report.write_report(without_val, tmp_path / "r")
    assert set(found.left_out) == {"hofer2008"}
    assert "left out: the corpus has no recordings of the list val" in Links(tmp_path / "r" / report.PAGE).text
    with pytest.raises(errors.CorpusError, match="hofer2008 is left out: the corpus has no recordings of the list val"):
        report.write_report(without_val, tmp_path / "other", only=["hofer2008"])
    assert set(report.write_report(train, tmp_path / "s").verdicts) == {"folds"}
    with pytest.raises(errors.CorpusError, match="the list train"):
        report.write_report(val, tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_what_cannot_be_used_is_refused_before_the_work(ran, toy_corpus, tmp_path):
    file, full = tmp_path / "file", tmp_path / "full"
    file.write_text("x")
    (full / "inner").mkdir(parents=True)
    for folder, words in (
        (file / "r", "cannot be"),
        (full, "holds something that is no report; give a new or an empty folder"),
        (toy_corpus.path, "is the corpus itself"),
    ):
        with pytest.raises(errors.ExportError, match=words):
            report.write_report(toy_corpus, folder)
    with pytest.raises(errors.CorpusError, match="'opening', which is not in it"):
        report.write_report(renamed(toy_corpus, tmp_path / "b", "shape 0", "shape 1", "shape 2"), tmp_path / "r")
    assert (ran, sorted(path.name for path in tmp_path.iterdir())) == ([], ["b", "file", "full"])


@pytest.mark.long
@pytest.mark.skipif(BROWSER is None or DRIVER is None, reason=MISSING)
def test_a_browser_shows_a_real_experiment_and_nobody_is_kept_out(toy_corpus, tmp_path):
    with few_sets():
        written = report.write_report(toy_corpus, tmp_path / "r", only=["hofer2008"], quick=True, settings=SETTINGS)
    links = Links(written.page)
    record = json.loads((written.page.parent / "hofer2008" / "figures.json").read_text())
    systems = ["eVis, 5 states", "phone, 5 states"]
    assert [each["caption"] for each in record["videos"]][-3:] == ["a drawn face, recorded motion", *systems]
    assert all((written.page.parent / file).stat().st_size for file in links.files)

    with browser(tmp_path) as window:
        for width, height, scheme in SCREENS:
            window.show_as(width, height, scheme, mobile=width < 400)
            window.open(written.page.as_uri())
            window.run("document.querySelectorAll('details').forEach(each => { each.open = true; })")
            check_screen(window, "report", width, scheme)
        assert window.problems() == []


RESULTS = Path(__file__).parents[2] / "docs" / "results"


def stored(name: str) -> Any:
    """Return what an experiment on GRID stored, or a sheet of a page."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def figures_of(name: str) -> Any:
    return stored({"engines": "engines-test"}.get(name, name))


def section_of(name: str) -> Section:
    return report.PARTS[name].section(figures_of(name))


@pytest.mark.parametrize("name", report.PARTS)
def test_every_table_and_chart_is_whole(name):
    section = section_of(name)
    names = [table.name for table in section.tables]
    assert len(names) == len(set(names))
    for table in section.tables:
        records = table.list_records()
        assert all(record[column.key] is not None for record in records[:1] for column in table.columns[:1])
        keys = {tuple(record) for record in records}
        assert len(keys) == 1
    assert section.verdict
    assert all(sentences for sentences in section.words.values())


def test_hofers_pairs_are_counted_from_their_intervals():
    section, figures = section_of("hofer2008"), figures_of("hofer2008")
    (block,) = [
        each
        for each in figures["tables"]
        if (each["states"], each["condition"], each["pins"]) == (5, "audio only", "as printed")
    ]
    held = sum(pair["score_gain_95"][0] > 0 for pair in block["paper_order"])
    against = sum(pair["score_gain_95"][1] < 0 for pair in block["paper_order"])
    assert f"of the paper's 10 pairs {held} held, {against} reversed" in section.verdict
    assert {name: row["paper"] for name, row in section.table.rows.items()} == hofer2008.PAPER_SCORES
    assert len(section.more) == len(figures["tables"]) - 1


def test_xie_and_lius_figures_stand_beside_ours():
    section, figures = section_of("xieliu2007"), figures_of("xieliu2007")
    ours = figures["rows"][-1]["conditions"]["audio only"]
    for record in section.table.list_records():
        assert record["acc"] == ours[record["system"]]["acc"]
        printed = PAPER_FIGURES.get(record["system"].removesuffix(", K on val"), (None, None))
        assert (record["paper_amse"], record["paper_acc"]) == printed
    pairs = [pair for pair in figures["rows"][-1]["pairs"] if {pair["better"], pair["worse"]} <= {*PAPER_FIGURES}]
    held = sum(pair["amse_95"][1] < 0 for pair in pairs)
    assert f"Systems as printed: AMSE: of the paper's {len(pairs)} pairs {held} held" in section.words["By AMSE"][0]


def test_an_addition_that_helps_is_named_so():
    section, figures = section_of("minnis2000"), figures_of("minnis2000")
    rows = figures["lists"]["test"]["conditions"]["audio only"]
    raised, lowered, left_open = section.words["Each addition alone"]
    assert ("guide from the sound" in raised) == (rows["guide from the sound"]["acc_gain_95"][0] > 0)
    named = sum(text.count("(") for text in (raised, lowered, left_open))
    assert named == len(minnis2000.ADDITIONS.keys() & rows.keys()) > 5
    assert section.table.caption == "Unit selection, test, audio only"


@pytest.mark.parametrize("name", report.PARTS)
def test_figures_that_are_not_defined_end_no_run(name):
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

    section = report.PARTS[name].section(undefined(figures_of(name)))
    assert section.verdict
    assert "nan" not in section.as_text()


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
        ((0, 0, 0), "0 held, 0 reversed, 3 open: these recordings say nothing of its order"),
    ],
)
def test_the_verdict_counts_pairs(signs, outcome):
    found = order({"a": 0.3, "b": 0.2, "c": 0.1}, dict(zip(("ab", "ac", "bc"), signs, strict=True)))
    assert found.judge() == f"ACC: of the paper's 3 pairs {outcome}. Best in print: a; here: a."


ROWS = {
    "a, <b>": {"acc": 0.5, "acc_95": (0.4, 0.6), "acc_gain_95": (0.1, 0.2), "kind": "x"},
    "c": {"acc": None, "acc_95": (None, None), "acc_gain_95": None, "kind": None},
}
TABLE = Table("t", "All & some", (Column("acc", "ACC", ".2f", "a note"), Column("kind", "kind")), ROWS, "c")


def test_every_figure_has_its_interval_and_difference_in_the_files():
    first, second = csv.DictReader(io.StringIO(TABLE.as_csv()))
    assert first["system"] == "a, <b>"
    assert [float(first[key]) for key in ("acc", "acc_low", "acc_high")] == [0.5, 0.4, 0.6]
    assert [float(first[key]) for key in ("acc_difference_low", "acc_difference_high")] == [0.1, 0.2]
    assert set(second.values()) == {"c", ""}


def test_the_page_shows_the_interval_and_a_star():
    html = TABLE.as_html("folder")
    assert '<th scope="row">a, &lt;b&gt;</th><td class="number">0.50* <small>0.40–0.60</small></td><td>x</td>' in html
    assert '<th scope="row">c</th><td class="number">–</td><td>–</td>' in html
    assert 'href="folder/tables/t.csv"' in html
    assert "difference from c leaves out 0" in html
