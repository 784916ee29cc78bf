import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

from children import LIPMOTION, environment, run_child
from lipmotion.cli import main
from lipmotion.cli.verbs import about


class Done(NamedTuple):
    """The outcome of a command: its exit code, and the lines that it printed."""

    code: int
    out: list[str]
    err: list[str]


RunCommand = Callable[..., Done]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> RunCommand:
    """Runs a command in this process."""

    def run(*arguments: object) -> Done:
        capsys.readouterr()
        try:
            code = main.main([str(argument) for argument in arguments])
        except SystemExit as stop:  # argparse: help, version, wrong command line
            code = int(str(stop.code))
        out, err = capsys.readouterr()
        return Done(code, out.splitlines(), err.splitlines())

    return run


@pytest.fixture
def make_info(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Gives ``lipmotion info`` something else to do."""
    return partial(monkeypatch.setattr, about, "run_info")


@pytest.fixture
def run_outside() -> RunCommand:
    """Runs a command in a process of its own, as a shell does."""

    def run(*arguments: object, program: tuple[str, ...] = LIPMOTION, encoding: str = "utf-8") -> Done:
        done = run_child([*program, *arguments], variables=environment(PYTHONIOENCODING=encoding))
        return Done(done.returncode, done.stdout.splitlines(), done.stderr.splitlines())

    return run


@pytest.fixture
def takes(here: Path, toy_speech: Path) -> Path:
    """A folder of two recordings."""
    folder = here / "takes"
    folder.mkdir()
    for name in ("a.wav", "b.wav"):
        shutil.copy(toy_speech, folder / name)
    return folder


@pytest.fixture
def basics(toy_speech: Path, toy_model_file: Path) -> tuple[object, ...]:
    return ("animate", toy_speech, "--model", toy_model_file)


def is_one_error(done: Done, code: int) -> bool:
    """Return whether a command printed one error line, and nothing else."""
    return done.code == code and done.out == [] and len(done.err) == 1 and done.err[0].startswith("lipmotion: error: ")


def check_refused(done: Done, code: int, words: str) -> None:
    """Raise AssertionError unless a command printed one error line with some words, and nothing else."""
    assert is_one_error(done, code), done
    assert words in done.err[0]
