from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest

from cli.conftest import Run, is_one_error
from lipmotion.corpora.store import Corpus
from lipmotion.experiment import unit_sets
from lipmotion.measures.bootstrap import interval
from lipmotion.pipeline import evaluate


@pytest.fixture(autouse=True)
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the first two unit sets of the paper beside the one that they are compared with."""
    for module in (unit_sets, evaluate):
        monkeypatch.setattr(module, "interval", partial(interval, draws=20))
    monkeypatch.setattr(unit_sets, "PAPER", {name: unit_sets.PAPER[name] for name in ("2vis", "pbVis", "phone")})


def test_the_table_is_that_of_the_figures(run: Run, toy_corpus: Corpus, here: Path) -> None:
    done = run("experiment", "unit-sets", toy_corpus.path, "-o", "a.json", "--split", "all", "--workers", "1")
    assert (done.code, done.err) == (0, [])
    figures = json.loads((here / "a.json").read_text())
    assert "\n".join(done.out) == unit_sets.table(figures)
    assert (figures["split"], figures["clips"], figures["closures"]) == ("all", 12, False)
    assert [path.name for path in here.iterdir()] == ["a.json"]


def test_a_program_reads_the_figures(run: Run, toy_corpus: Corpus) -> None:
    done = run("experiment", "unit-sets", toy_corpus.path, "--closures", "--machine-readable")
    assert (done.code, done.err) == (0, [])
    last = json.loads(done.out[-1])
    assert last["type"] == "success"
    assert last["figures"]["closures"] is True
    assert {"type", "stage", "step", "steps", "value"} == set(json.loads(done.out[1]))


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["missing"], 4, "missing: no such corpus; make one"),
        (["CORPUS", "--split", "tset"], 4, "no utterances of split 'tset'"),
        (["CORPUS", "-o", "missing/a.json"], 7, "the folder missing does not exist"),
        (["CORPUS", "--lexicon", "missing"], 3, "missing: no such lexicon file"),
    ],
)
def test_what_cannot_be_used(
    run: Run, toy_corpus: Corpus, here: Path, arguments: list[str], code: int, words: str
) -> None:
    names = [toy_corpus.path if argument == "CORPUS" else argument for argument in arguments]
    done = run("experiment", "unit-sets", *names)
    assert is_one_error(done, code)
    assert words in done.err[0]
    assert list(here.iterdir()) == []
