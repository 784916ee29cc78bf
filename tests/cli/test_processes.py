"""Commands in processes of their own: behaviour that calls in this process cannot show."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from cli.conftest import RunCommand, is_one_error


def test_speech_in_motion_out(run_outside: RunCommand, toy_speech: Path, toy_model_file: Path, here: Path) -> None:
    done = run_outside("animate", toy_speech, "--model", toy_model_file, "-o", "ä.json", "a.npz")
    assert done == (0, ["ä.json", "a.npz"], [])
    assert sorted(path.name for path in here.iterdir()) == ["a.npz", "ä.json"]


def test_a_terminal_that_does_not_know_the_letters(
    run_outside: RunCommand, toy_speech: Path, toy_model_file: Path, here: Path
) -> None:
    done = run_outside("animate", toy_speech, "--model", toy_model_file, "-o", "ä.json", encoding="ascii")
    assert done == (0, ["\\xe4.json"], [])
    assert [path.name for path in here.iterdir()] == ["ä.json"]


@pytest.mark.usefixtures("here")
def test_an_unknown_word_is_one_warning(run_outside: RunCommand, toy_speech: Path, toy_model_file: Path) -> None:
    words = "see bimab papa mama"
    done = run_outside("animate", toy_speech, "--model", toy_model_file, "-o", "a.json", "--transcript", words)
    assert (done.code, done.out) == (0, ["a.json"])
    assert done.err == [
        "lipmotion: warning: 'bimab' is not in the dictionary; read as 'b ih m ae b'; a lexicon file can say better"
    ]


@pytest.mark.parametrize("what", ["missing", "text", "mute", "long name"])
def test_bad_speech_is_one_line(
    run_outside: RunCommand, toy_model_file: Path, bad_speech: dict[str, Path], here: Path, what: str
) -> None:
    """FFmpeg's own messages are not printed."""
    assert is_one_error(run_outside("animate", bad_speech[what], "--model", toy_model_file, "-o", "a.json"), 3)
    assert list(here.iterdir()) == []


@pytest.mark.usefixtures("here")
def test_the_exit_code_reaches_the_shell(run_outside: RunCommand, newer_model: Path) -> None:
    assert is_one_error(run_outside("info", newer_model), 6)
    assert is_one_error(run_outside("corpus", "info", "missing"), 4)
    assert is_one_error(run_outside("animate", "a.wav", "-o", "missing/a.json"), 7)
    assert run_outside("animate", "a.wav").code == 2


def test_the_console_script(run_outside: RunCommand) -> None:
    script = shutil.which("lipmotion", path=str(Path(sys.executable).parent))
    if script is None:
        pytest.skip("the package is not installed")
    assert run_outside("info", program=(script,)) == run_outside("info")
    assert is_one_error(run_outside("info", "missing", program=(script,)), 3)
