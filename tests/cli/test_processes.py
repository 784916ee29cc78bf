import shutil
import sys
from pathlib import Path

import pytest

from cli.conftest import is_one_error


def test_a_terminal_that_does_not_know_the_letters(run_outside, toy_speech, toy_model_file, here):
    line = ("animate", toy_speech, "--model", toy_model_file, "-o", "ä.json", "--transcript", "see bimab papa mama")
    done = run_outside(*line, encoding="ascii")
    (warning,) = done.err
    assert warning.startswith("lipmotion: warning: 'bimab' is not in the dictionary; read as 'b ")
    assert (done.code, done.out) == (0, ["\\xe4.json"])
    assert [path.name for path in here.iterdir()] == ["ä.json"]


@pytest.mark.usefixtures("here")
def test_what_is_wrong_is_one_line_and_an_exit_code(run_outside, bad_speech):
    """FFmpeg's own messages are not printed."""
    assert is_one_error(run_outside("animate", bad_speech["text"], "-o", "a.json"), 3)
    assert is_one_error(run_outside("animate", "a.wav", "-o", "missing/a.json"), 7)
    assert run_outside("animate", "a.wav").code == 2


def test_the_console_script(run_outside):
    script = shutil.which("lipmotion", path=str(Path(sys.executable).parent))
    if script is None:
        pytest.skip("the package is not installed")
    assert is_one_error(run_outside("info", "missing", program=(script,)), 3)
