import json
from functools import partial

import pytest

from cli.conftest import check_refused
from lipmotion import evaluate, load_model
from lipmotion.measures.curves import bootstrap_interval
from lipmotion.measures.evaluation_table import figures_table
from lipmotion.pipeline.model import VERSION
from lipmotion_lab.evaluation import evaluate as evaluation_figures


@pytest.fixture(autouse=True)
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few draws of the bootstrap intervals."""
    monkeypatch.setattr(evaluation_figures, "bootstrap_interval", partial(bootstrap_interval, draws=20))


def test_the_figures_are_those_of_the_function(run, toy_corpus, toy_model_file, here):
    done = run("evaluate", toy_model_file, toy_corpus.path, "-o", "figures.json")
    assert (done.code, done.err) == (0, [])
    figures = evaluate(load_model(toy_model_file), toy_corpus)
    assert "\n".join(done.out) == figures_table(figures)
    assert json.loads((here / "figures.json").read_text()) == json.loads(json.dumps(figures))
    assert [path.name for path in here.iterdir()] == ["figures.json"]


def test_what_cannot_be_used(run, toy_corpus, toy_model_file, newer_model, here):
    corpus, model = toy_corpus.path, toy_model_file
    for arguments, code, words in (
        (["missing", corpus], 3, "missing: no such model"),
        ([newer_model, corpus], 6, f"model version {VERSION + 1}"),
        ([model, "missing"], 4, "missing: no such corpus"),
        ([model, corpus, "--split", "tset"], 4, "no utterances of split 'tset'"),
        ([model, corpus, "-o", "missing/a.json"], 7, "the folder missing does not exist"),
        ([model, corpus, "-o", "a.json", "--lexicon", "missing"], 3, "missing: no such lexicon file"),
    ):
        check_refused(run("evaluate", *arguments), code, words)
    assert list(here.iterdir()) == []
