import json
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from cli.conftest import is_one_error
from experiments.conftest import few_sets
from lipmotion.hmm.model import HmmConfig
from lipmotion_lab import runner
from lipmotion_lab.report import sections

pytestmark = pytest.mark.long


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Small phone models, and only two of the paper's unit sets."""
    phones = HmmConfig(mixtures=1, iterations=1)
    monkeypatch.setattr(runner, "ExperimentSettings", partial(runner.ExperimentSettings, recogniser=phones))
    with few_sets():
        yield


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


def test_the_table_is_that_of_the_figures(figures_of, toy_corpus, here):
    figures = figures_of(sections.build_hofer_section, "hofer2008", toy_corpus.path, "--split", "val", "--quick")
    assert (figures["split"], figures["clips"], figures["mixtures"]) == ("val", 2, [1, 2])
    assert [path.name for path in here.iterdir()] == ["a.json"]


def test_all_engines(figures_of, run, toy_corpus, here, toy_model_file, coupled_model_file):
    (here / "models").mkdir()
    for name, file in (("trajectory", toy_model_file), ("coupled", coupled_model_file)):
        shutil.copy(file, here / "models" / f"{name}.lipmotion")  # the third is trained
    chosen = ("engines", toy_corpus.path, "--split", "test", "--models", "models")
    section = sections.build_engines_section
    figures = figures_of(section, *chosen)
    assert (figures["split"], figures["clips"]) == ("test", 2)
    kept = sorted(path.name for path in (here / "models").iterdir())
    assert kept == ["coupled.lipmotion", "selection.lipmotion", "trajectory.lipmotion"]
    assert section(figures_of(section, *chosen)) == section(figures)
    (here / "models" / "coupled.lipmotion").write_bytes(b"no model")
    assert is_one_error(run("experiment", *chosen, "-o", "a.json", "--workers", "1"), 6)
