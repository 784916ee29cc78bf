import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from experiments.copies import SETTINGS, copied, renamed
from experiments.test_sections import figures_of
from lipmotion import Corpus
from lipmotion.errors import CorpusError, ExportError, InputError
from lipmotion.units import Lexicon
from lipmotion_lab import hofer2008 as table1
from lipmotion_lab.hofer2008 import PAPER_SCORES, PhoneticTableOptions
from lipmotion_lab.report import report
from lipmotion_lab.report.report import PAGE, PARTS, PartRun, ReportPart, WrittenReport, experiment_report
from lipmotion_lab.runner import ExperimentSettings
from study.browser import BROWSER, DRIVER, MISSING, browser, check_screen

TWO, SETS = ("hofer2008", "folds"), ("eVis", "phone")
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

    def run(name: str, given: PartRun) -> dict[str, Any]:
        names.append(name)
        (given.work / "half").write_text("finished")
        given.models.mkdir(parents=True, exist_ok=True)
        return figures_of(name)

    stand_ins = {name: replace(part, run=partial(run, name), draws=False) for name, part in PARTS.items()}
    monkeypatch.setattr(report, "PARTS", stand_ins)
    return names


def state(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Return time and content of every file in a folder."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path): (path.stat().st_mtime_ns, path.read_bytes()) for path in files}


def test_what_is_finished_is_not_run_again_and_no_byte_changes(ran, toy_corpus, tmp_path):
    folder = tmp_path / "a" / "report"
    found = experiment_report(toy_corpus, folder)
    assert (ran, list(found.made), found.left_out) == (list(PARTS), list(PARTS), {})
    assert "of the paper's 10 pairs" in found.verdicts["hofer2008"]
    assert sorted(path.name for path in folder.iterdir()) == sorted([PAGE, "models", *PARTS])
    before = state(folder)
    again = experiment_report(toy_corpus, folder)
    assert (len(ran), list(again.made), again.verdicts) == (len(PARTS), [], found.verdicts)
    assert state(folder) == before
    links = Links(folder / PAGE)
    assert all((folder / file).is_file() for file in links.files)
    assert len(links.files) == len(set(links.files)) > 2 * len(PARTS)
    stamp = json.loads((folder / "folds" / "figures.json").read_text())["stamp"]
    assert (stamp["seed"], stamp["corpus"]["train"], stamp["machine"]["cores"] > 0) == (0, 8, True)
    assert len(stamp["corpus"]["SHA-256"]) == 64
    assert stamp["versions"]["numpy"] in links.text
    assert stamp["command"].endswith("-o report --only folds")


def test_a_run_that_was_stopped_goes_on(ran, toy_corpus, tmp_path, monkeypatch):
    def stopped(given: PartRun) -> dict[str, Any]:
        (given.work / "half").write_text("finished")
        raise KeyboardInterrupt

    stand_ins: dict[str, ReportPart] = vars(report)["PARTS"]
    whole = stand_ins["folds"]
    monkeypatch.setitem(stand_ins, "folds", replace(whole, run=stopped))
    with pytest.raises(KeyboardInterrupt):
        experiment_report(toy_corpus, tmp_path / "r", only=TWO)
    text = Links(tmp_path / "r" / PAGE).text
    assert "the same command goes on with it" in text
    assert "Hofer, Yamagishi" in text
    assert (tmp_path / "r" / "folds.json.unfinished" / "half").is_file()
    monkeypatch.setitem(stand_ins, "folds", whole)
    assert experiment_report(toy_corpus, tmp_path / "r", only=TWO).made == ["folds"]
    assert ran == ["hofer2008", "folds"]
    assert not list((tmp_path / "r").glob("*.unfinished"))
    assert "not chosen" in Links(tmp_path / "r" / PAGE).text


def test_what_fails_is_told_and_stops_nothing_else(ran, toy_corpus, tmp_path, monkeypatch):
    """An experiment with an error of its own, and one whose figures cannot be told."""

    def broken(_: object) -> Any:
        raise KeyError("no such figure")

    stand_ins: dict[str, ReportPart] = vars(report)["PARTS"]
    whole = dict(stand_ins)
    monkeypatch.setitem(stand_ins, "hofer2008", replace(whole["hofer2008"], run=broken))
    reports: list[tuple[str, str]] = []
    settings = ExperimentSettings(monitor=lambda event: reports.append((event.name, event.outcome)))
    found = experiment_report(toy_corpus, tmp_path / "r", only=TWO, settings=settings)
    assert (list(found.failed), list(found.made), reports) == (["hofer2008"], ["folds"], [("hofer2008", "failed")])
    monkeypatch.setitem(stand_ins, "hofer2008", whole["hofer2008"])
    monkeypatch.setitem(stand_ins, "folds", replace(whole["folds"], section=broken))
    found = experiment_report(toy_corpus, tmp_path / "r", only=TWO)
    assert (list(found.failed), list(found.verdicts), list(found.made)) == (["folds"], ["hofer2008"], ["hofer2008"])
    text = Links(tmp_path / "r" / PAGE).text
    assert "foldsfailed: KeyError: 'no such figure'; mend that" in text
    assert "not finished" not in text
    monkeypatch.setitem(stand_ins, "folds", whole["folds"])
    assert not experiment_report(toy_corpus, tmp_path / "r", only=TWO).failed
    assert ran == ["folds", "hofer2008"]


@pytest.mark.long
def test_other_recordings_or_settings_are_run_again(ran, toy_corpus, tmp_path):
    run: Callable[..., WrittenReport] = partial(experiment_report, folder=tmp_path / "r", only=["folds"])
    run(toy_corpus)
    assert run(toy_corpus, quick=True).made == ["folds"]
    assert "quick run" in Links(tmp_path / "r" / PAGE).text
    assert run(toy_corpus.part(toy_corpus.names()[1:]), quick=True).made == ["folds"]
    assert run(toy_corpus, quick=True, settings=replace(SETTINGS, seed=1)).made == ["folds"]
    assert run(toy_corpus, settings=replace(SETTINGS, lexicon=Lexicon({"a": (("ax",),)}))).made == ["folds"]
    assert "-o r --only folds --lexicon FILE" in Links(tmp_path / "r" / PAGE).text
    assert len(ran) == len(list((tmp_path / "r" / "models").iterdir())) == 5


@pytest.mark.long
@pytest.mark.usefixtures("ran")
def test_a_corpus_without_a_list_has_what_can_be_run(toy_corpus, tmp_path):
    without_val = toy_corpus.part([*toy_corpus.names("train"), *toy_corpus.names("test")])
    found = experiment_report(without_val, tmp_path / "r")
    assert set(found.left_out) == {"hofer2008"}
    assert "left out: the corpus has no recordings of the list val" in Links(tmp_path / "r" / PAGE).text
    with pytest.raises(CorpusError, match="hofer2008 is left out: the corpus has no recordings of the list val"):
        experiment_report(without_val, tmp_path / "other", only=["hofer2008"])
    train_alone = toy_corpus.part(toy_corpus.names("train"))
    assert set(experiment_report(train_alone, tmp_path / "s").verdicts) == {"folds"}
    with pytest.raises(CorpusError, match="the list train"):
        experiment_report(toy_corpus.part(toy_corpus.names("val")), tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_what_cannot_be_used_is_refused_before_the_work(ran, toy_corpus, tmp_path):
    file, full = tmp_path / "file", tmp_path / "full"
    file.write_text("x")
    (full / "inner").mkdir(parents=True)
    for folder, words in (
        (file, "cannot be used: Not a directory"),
        (file / "r", "cannot be"),
        (full, "holds something that is no report; give a new or an empty folder"),
        (toy_corpus.path, "is the corpus itself"),
        (toy_corpus.path / "r", "lies in the corpus"),
    ):
        with pytest.raises(ExportError, match=words):
            experiment_report(toy_corpus, folder)
    with pytest.raises(InputError, match="no experiment 'hofer'; there are: hofer2008, xieliu2007"):
        experiment_report(toy_corpus, tmp_path / "r", only=["hofer"])
    with pytest.raises(CorpusError, match="'opening', which is not in it"):
        experiment_report(renamed(toy_corpus, tmp_path / "b", "shape 0", "shape 1", "shape 2"), tmp_path / "r")
    assert (ran, sorted(path.name for path in tmp_path.iterdir())) == ([], ["b", "file", "full"])


@pytest.fixture(scope="module")
def written(toy_corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> WrittenReport:
    """A report of one real experiment, on recordings without pictures of the mouth."""
    folder = tmp_path_factory.mktemp("real")
    bare = copied(toy_corpus, folder, lambda each: replace(each, track=replace(each.track, crops=None)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table1, "PAPER_SCORES", {name: PAPER_SCORES[name] for name in SETS})
        patch.setattr(table1, "QUICK", PhoneticTableOptions(states=(3,), mixtures=(1,)))
        return experiment_report(bare, folder / "r", only=["hofer2008"], quick=True, settings=SETTINGS)


@pytest.mark.long
def test_a_real_experiment_has_videos_and_curves(written):
    folder = written.page.parent
    record = json.loads((folder / "hofer2008" / "figures.json").read_text())
    systems = [f"{name}, 3 states" for name in SETS]
    assert [each["caption"] for each in record["videos"]] == ["a drawn face, recorded motion", *systems]
    motion = json.loads((folder / "hofer2008" / "motion.json").read_text())
    assert sorted(motion["systems"]) == sorted(systems)
    assert {len(curve) for curve in motion["systems"].values()} == {len(motion["time_s"])}
    links = Links(written.page)
    assert all((folder / file).stat().st_size for file in links.files)
    assert " ".join(motion["words"]) in links.text


@pytest.mark.long
@pytest.mark.skipif(BROWSER is None or DRIVER is None, reason=MISSING)
def test_a_browser_plays_it_and_nobody_is_kept_out(written, tmp_path):
    with browser(tmp_path) as window:
        for width, height, scheme in SCREENS:
            window.show_as(width, height, scheme, mobile=width < 400)
            window.open(written.page.as_uri())
            window.run("document.querySelectorAll('details').forEach(each => { each.open = true; })")
            check_screen(window, "report", width, scheme)
        window.click("button.together")
        playing = "const done = arguments[0], video = document.querySelector('video');" + (
            "video.addEventListener('timeupdate', () => { if (video.currentTime > 0.1) done(true); });"
        )
        assert window.run_until_done(playing)
        assert window.problems() == []
