"""Every output of every verb is kept apart from every input of the same call."""

import argparse
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from cli.conftest import check_refused, is_one_error
from lipmotion import Corpus, Request, Run, animate, cues, prepare, train, write, write_cues
from lipmotion.cli.command_line import parser
from lipmotion.errors import ExportError
from lipmotion.pipeline.model import find_shipped

TALKING = "a.wav --transcript t.txt --lexicon l.txt --units u.json --model m.lipmotion"


@pytest.fixture
def laid(here: Path, toy_corpus: Corpus) -> Path:
    """One file of each kind, a corpus, and a folder of recordings; the contents of the files do not matter."""
    for name in ("a.wav", "b.wav", "t.txt", "l.txt", "u.json", "m.lipmotion"):
        (here / name).write_text(f"what is in {name}")
    shutil.copytree(toy_corpus.path, here / "c")
    shutil.copytree(toy_corpus.path, here / "d.unfinished")
    for folder in (here / "r", here / "d.unfinished" / "r"):
        folder.mkdir()
        (folder / "a.wav").write_text("sound")
    return here


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.long
def test_an_output_that_is_an_input(run, laid):
    before = content(laid)
    rows = Path(__file__).with_name("refused_paths.tsv").read_text("utf-8").splitlines()[1:]
    for what, line in (row.split("\t") for row in rows):
        check_refused(run(*line.split()), 7, f" {what}; give another name")
        assert content(laid) == before


def test_however_it_is_spelled(run, laid):
    (laid / "soft").symlink_to("t.txt")
    os.link(laid / "t.txt", laid / "hard")
    before = content(laid)
    for spelled in ("./t.txt", "../here/t.txt", "soft", "hard"):
        check_refused(run("animate", *TALKING.split(), "-o", spelled), 7, "the transcript itself; give another name")
        assert content(laid) == before
    os.mkfifo(laid / "pipe")
    check_refused(run("cues", "a.wav", "-o", "pipe"), 7, "is a pipe or a device")  # no file replaces it
    assert (laid / "pipe").is_fifo()


def test_the_model_that_ships_is_an_input_too(run, laid):
    before = find_shipped().read_bytes()
    done = run("adapt", laid / "a.wav", "-o", find_shipped())
    check_refused(done, 7, "is the model itself")
    assert find_shipped().read_bytes() == before
    done = run("train", "c", "-o", "c/corpus.json", "--machine-readable", "--force")
    assert (done.code, '"exit_code": 7' in done.out[-1]) == (7, True)  # so a program is told


def test_units_are_replaced_where_that_is_meant(run, here, toy_speech, toy_model_file):
    line = ["animate", toy_speech, "--model", toy_model_file, "--recogniser", "own", "-o", "u.json"]
    assert run(*line).code == 0
    before = (here / "u.json").read_bytes()
    assert run(*line, "--units", "u.json").code == 7
    assert run(*line, "--units", "u.json", "--rate", "50", "--force") == (0, ["u.json"], [])
    assert (here / "u.json").read_bytes() != before


def test_a_recording_is_never_replaced(run, laid):
    for line in ("animate a.wav -o a.wav --force", "adapt a.wav -o a.wav --force"):
        done = run(*line.split())
        assert is_one_error(done, 7)
        assert "--force" not in done.err[0]
        assert (laid / "a.wav").read_text() == "what is in a.wav"


@pytest.mark.usefixtures("here")
def test_a_transcript_may_have_the_name_of_a_folder(run, here, toy_speech, toy_model_file):
    (here / "papa").mkdir()
    line = ["animate", toy_speech, "--model", toy_model_file, "--recogniser", "own", "--transcript", "papa"]
    assert run(*line, "-o", "papa/a.json").code == 0


def test_a_link_is_written_through(run, here, toy_speech, toy_model_file):
    (here / "there").mkdir()
    (here / "a.json").symlink_to("there/b.json")
    line = ["animate", toy_speech, "--model", toy_model_file, "--recogniser", "own", "-o", "a.json"]
    for _ in range(2):
        assert run(*line) == (0, ["a.json"], [])
        assert (here / "a.json").is_symlink()
        assert (here / "there" / "b.json").is_file()
    assert is_one_error(run(*line, "there/b.json"), 7)


def test_every_path_is_declared():
    """Every argument of the type Path is declared as input or as output."""
    seen = 0
    for verb in _verbs(parser()):
        declared = {one.name for kind in ("reads", "writes") for one in verb.get_default(kind) or ()}
        paths = {action.dest for action in verb._actions if action.type is Path}
        assert paths <= declared, verb.prog
        assert {action.dest for action in verb._actions if action.dest == "output"} <= declared
        seen += len(paths)
    assert seen > 25


def _verbs(found: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    yield found
    for action in found._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from _verbs(inner)


def test_from_python(laid, toy_speech, toy_model_file):
    speech = laid / "speech.json"
    shutil.copy(toy_speech, speech)
    made = animate(Request(toy_speech, recogniser="own"), model=toy_model_file)
    corpus = Corpus.open(laid / "c")
    calls: list[Callable[[], object]] = [
        lambda: write(made, speech, speech=speech),
        lambda: write_cues(cues(made), speech, speech=speech, form="json"),
        lambda: prepare(laid / "r", laid / "r" / "corpus"),
        lambda: prepare(laid / "r", laid),
        lambda: train(corpus, run=Run(work=corpus.path)),
        lambda: train(corpus, run=Run(work=laid)),
    ]
    before = content(laid)
    for call in calls:
        with pytest.raises(ExportError, match=r"(is|lies in|holds) the (recording|folder of recordings|corpus)"):
            call()
    assert content(laid) == before
