from __future__ import annotations

import json
from pathlib import Path

import pytest

from cli.conftest import RunCommand, is_one_error
from lipmotion.corpora.store import Corpus
from lipmotion.measures.report import figures_table
from lipmotion.pipeline.evaluation.evaluate import evaluate
from lipmotion.pipeline.model import VERSION, load_model


def test_the_figures_are_those_of_the_function(
    run: RunCommand, toy_corpus: Corpus, toy_model_file: Path, here: Path
) -> None:
    done = run("evaluate", toy_model_file, toy_corpus.path, "-o", "figures.json")
    assert (done.code, done.err) == (0, [])
    figures = evaluate(load_model(toy_model_file), toy_corpus)
    assert "\n".join(done.out) == figures_table(figures)
    assert json.loads((here / "figures.json").read_text()) == json.loads(json.dumps(figures))
    assert [path.name for path in here.iterdir()] == ["figures.json"]


def test_other_lists(run: RunCommand, toy_corpus: Corpus, toy_model_file: Path) -> None:
    assert run("evaluate", toy_model_file, toy_corpus.path, "--split", "val").out[0].startswith("split val: 2 clips")
    assert run("evaluate", toy_model_file, toy_corpus.path, "--split", "all").out[0].startswith("split all: 12 clips")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["missing", "CORPUS"], 3, "missing: no such model"),
        (["text", "CORPUS"], 6, "text: not a lipmotion model"),
        (["NEWER", "CORPUS"], 6, f"model version {VERSION + 1}"),
        (["MODEL", "missing"], 4, "missing: no such corpus"),
        (["MODEL", "CORPUS", "--split", "tset"], 4, "no utterances of split 'tset'"),
        (["MODEL", "CORPUS", "-o", "missing/a.json"], 7, "the folder missing does not exist"),
        (["MODEL", "CORPUS", "-o", "a.json", "--lexicon", "missing"], 3, "missing: no such lexicon file"),
    ],
)
def test_what_cannot_be_used(
    run: RunCommand,
    toy_corpus: Corpus,
    toy_model_file: Path,
    newer_model: Path,
    here: Path,
    arguments: list[str],
    code: int,
    words: str,
) -> None:
    (here / "text").write_text("words")
    names = {"CORPUS": toy_corpus.path, "MODEL": toy_model_file, "NEWER": newer_model}
    done = run("evaluate", *[names.get(argument, argument) for argument in arguments])
    assert is_one_error(done, code)
    assert words in done.err[0]
    assert [path.name for path in here.iterdir()] == ["text"]
