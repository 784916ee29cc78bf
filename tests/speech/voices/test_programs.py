"""Programs that print, write or take too much, and what is left of them."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from lipmotion.errors import InputError
from lipmotion.speech.voices import programs
from lipmotion.speech.voices.programs import program_output

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the programs are scripts")


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small bounds."""
    for name, value in {
        "LARGEST_OUTPUT_BYTES": 1000,
        "LARGEST_SOUND_BYTES": 1000,
        "STILL_S": 0.15,
        "POLL_S": 0.01,
    }.items():
        monkeypatch.setattr(programs, name, value)


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("exec yes", "prints more than 1000 bytes"),
        ("exec yes >&2", "prints more than 1000 bytes"),
        ("echo; printf '%2000s' x", "prints more than 1000 bytes"),
        ("exec yes > $0.d/endless", "writes more than 1000 bytes"),
        ("truncate -s 20G $0.d/sparse", "writes more than 1000 bytes"),
        ("sleep 30 & wait", "did not end within 0 s"),
        ("kill -9 $$", "failed with -9"),
        ("printf '\\377'", "cannot be run .*utf-8"),
    ],
)
def test_a_program_is_stopped(script: str, message: str, tmp_path: Path) -> None:
    program = _program(tmp_path, script)
    with pytest.raises(InputError, match=message):
        program_output([str(program)], "a-package", folder=tmp_path / "say.d")


def test_what_a_program_started_ends_with_it(tmp_path: Path) -> None:
    child = int(program_output([str(_program(tmp_path, "sleep 30 & echo $!"))], "a-package"))
    for _ in range(100):
        if not _is_running(child):
            return
        time.sleep(0.01)
    os.kill(child, 9)
    pytest.fail("it is still running")


def test_a_program_reads_what_it_is_given(tmp_path: Path) -> None:
    assert program_output([str(_program(tmp_path, "exec cat"))], "a-package", given="Helló\n") == "Helló\n"


def _program(folder: Path, script: str) -> Path:
    path = folder / "say"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    path.with_name("say.d").mkdir()
    return path


def _is_running(process: int) -> bool:
    """Return whether a process is there and no zombie."""
    try:
        os.kill(process, 0)
        status = Path(f"/proc/{process}/stat")
        return not status.exists() or status.read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
