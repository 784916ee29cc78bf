from __future__ import annotations

import os

from cli.conftest import RunCommand, is_one_error
from lipmotion.cli.terminal.status import outcome
from lipmotion.errors import InputError


def test_a_bug_is_none() -> None:
    assert outcome(RuntimeError("oh")) is None


def test_a_message_that_repeats_a_file_is_cut_in_its_middle() -> None:
    for error in (InputError, OSError):
        told = outcome(error(f"a.csv: found {'x' * 100_000}; give numbers"))
        assert told is not None
        assert told[0] == InputError.exit_code
        assert len(told[1]) < 1100
        assert told[1].startswith("a.csv: found xxx")
        assert told[1].endswith("x; give numbers")
        assert " ... " in told[1]


def test_a_current_folder_that_is_gone_is_said() -> None:
    told = outcome(FileNotFoundError(2, os.strerror(2)))
    assert told is not None
    assert "the current folder has been deleted" in told[1]
    other = outcome(FileNotFoundError(2, os.strerror(2), "a.wav"))
    assert other is not None
    assert "a.wav" in other[1]


def test_a_message_of_usual_length_is_whole() -> None:
    told = outcome(InputError("word " * 199))
    assert told is not None
    assert " ... " not in told[1]


def test_a_wrong_command_line_is_one_line_of_limited_length(run: RunCommand) -> None:
    done = run("cues", *["a.wav"] * 10_000)
    assert is_one_error(done, 2)
    assert len(done.err[0]) < 1100
