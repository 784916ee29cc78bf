import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from cli.conftest import is_one_error
from lipmotion import Corpus
from lipmotion.hmm.model import HmmConfig
from lipmotion.measures.curves import bootstrap_interval
from lipmotion_lab import hofer2008 as table1
from lipmotion_lab import minnis2000 as minnis_2000
from lipmotion_lab import runner
from lipmotion_lab.evaluation import evaluate as evaluation_figures
from lipmotion_lab.report import sections
from lipmotion_lab.report.report import PARTS
from lipmotion_lab.xie_liu2007 import six_systems


@pytest.fixture(autouse=True)
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few draws of the bootstrap intervals, small phone models, and only two of the paper's unit sets."""
    for module in (runner, table1, six_systems):
        monkeypatch.setattr(module, "HmmConfig", partial(HmmConfig, mixtures=1, iterations=1))
    monkeypatch.setattr(evaluation_figures, "bootstrap_interval", partial(bootstrap_interval, draws=20))
    monkeypatch.setattr(table1, "PAPER_SCORES", {name: table1.PAPER_SCORES[name] for name in ("2vis", "phone")})


@pytest.fixture
def figures_of(run, here):
    """Runs an experiment that prints the section of its figures, and returns these."""

    def figures_of(section: Callable[[Any], Any], *words: object) -> Any:
        done = run("experiment", *words, "-o", "a.json", "--workers", "1")
        assert (done.code, done.err) == (0, [])
        figures = json.loads((here / "a.json").read_text())
        assert "\n".join(done.out) == section(figures).as_text()
        return figures

    return figures_of


@pytest.mark.long
def test_the_table_is_that_of_the_figures(figures_of, toy_corpus, here):
    figures = figures_of(sections.hofer_section, "hofer2008", toy_corpus.path, "--split", "val", "--quick")
    assert (figures["split"], figures["clips"], figures["mixtures"]) == ("val", 2, [1, 2])
    assert [path.name for path in here.iterdir()] == ["a.json"]


def test_quick_runs_of_all_experiments_are_of_the_same_recordings(run, toy_corpus, here, monkeypatch):
    taken: list[tuple[str, ...]] = []

    def taking(corpus: Corpus, *_: object, **__: object) -> dict[str, Any]:
        taken.append(corpus.names())
        return {"rows": []}

    def command(figures: Any) -> Any:
        return SimpleNamespace(as_text=lambda: figures["stamp"]["command"])

    monkeypatch.setattr(runner, "QUICK_CLIPS", {"train": 3, "val": 1, "test": 1})
    for module, name in ((table1, "hofer2008"), (six_systems, "xieliu2007"), (minnis_2000, "minnis2000")):
        monkeypatch.setattr(module, name, taking)
    for name in ("hofer2008", "xieliu2007", "minnis2000"):
        monkeypatch.setitem(PARTS, name, replace(PARTS[name], section=command))
    monkeypatch.setitem(PARTS, "folds", replace(PARTS["folds"], run=lambda given: taking(given.corpus)))
    for name in ("hofer2008", "xieliu2007", "minnis2000"):
        done = run("experiment", name, toy_corpus.path, "--quick", "-o", "a.json")
        assert (done.code, done.out) == (0, [f"lipmotion experiment {name} {toy_corpus.path.name} --quick -o a.json"])
        stamp = json.loads((here / "a.json").read_text())["stamp"]
        assert (stamp["corpus"]["train"], sorted(stamp["engines"])[:1]) == (3, ["coupled"])
    with pytest.raises(KeyError):  # which is a bug: Python then ends with 1
        run("experiment", "all", toy_corpus.path, "-o", "r", "--quick", "--only", "folds")
    assert len(taken) == 4
    assert len(set(taken)) == 1
    assert len(taken[0]) == 5


@pytest.mark.long
def test_the_learning_curve_of_a_list(figures_of, toy_corpus, here):
    (here / "order.txt").write_text("\n".join(toy_corpus.names("train")) + "\n\n")
    chosen = ("--order", "order.txt", "--sizes", "3", "--split", "val")
    figures = figures_of(sections.learning_section, "learning-curve", toy_corpus.path, *chosen)
    assert (figures["split"], figures["order"], figures["workers"]) == ("val", "given", 1)
    assert [row["names"] for row in figures["rows"]] == [3]


@pytest.mark.long
def test_folds_of_the_training_list(figures_of, toy_corpus):
    figures = figures_of(sections.folds_section, "folds", toy_corpus.path, "--folds", "2")
    assert (figures["folds"], figures["trained_on"]) == (2, [4, 4])


@pytest.mark.long
def test_xieliu2007_of_some_systems(figures_of, toy_corpus, here):
    (here / "order.txt").write_text("\n".join(toy_corpus.names("train")))
    few = ("--systems", "ph-MSHMM;mean pose", "--order", "order.txt")
    chosen = (*few, "--sizes", "3", "--plots", "pictures")
    figures = figures_of(sections.xie_liu_section, "xieliu2007", toy_corpus.path, *chosen)
    assert [row["names"] for row in figures["rows"]] == [3]
    assert (figures["order"], figures["validation"]) == ("given", 0)
    assert len(list((here / "pictures").iterdir())) == 3
    assert sorted(path.name for path in here.iterdir()) == ["a.json", "order.txt", "pictures"]


@pytest.mark.long
def test_all_engines(figures_of, run, toy_corpus, here):
    chosen = ("engines", toy_corpus.path, "--split", "test", "--models", "models")
    figures = figures_of(sections.engines_section, *chosen)
    assert (figures["split"], figures["clips"]) == ("test", 2)
    kept = sorted(path.name for path in (here / "models").iterdir())
    assert kept == ["coupled.lipmotion", "selection.lipmotion", "trajectory.lipmotion"]
    assert sections.engines_section(figures_of(sections.engines_section, *chosen)) == sections.engines_section(figures)
    (here / "models" / "coupled.lipmotion").write_bytes(b"no model")
    assert is_one_error(run("experiment", *chosen, "-o", "a.json", "--workers", "1"), 6)
