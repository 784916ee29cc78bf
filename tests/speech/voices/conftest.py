"""A machine with synthesisers that are none, and one without any."""

import os
import sys
import tempfile
from pathlib import Path

import pytest

from lipmotion.speech.voices import espeak

from . import fakes


@pytest.fixture
def bare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine without synthesisers; the folder where programs are looked for."""
    programs, temporary = tmp_path / "programs", tmp_path / "temporary"
    programs.mkdir()
    temporary.mkdir()
    monkeypatch.setenv("PATH", str(programs))
    monkeypatch.setitem(sys.modules, espeak.WHEEL, None)  # is not installed
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    return programs


@pytest.fixture
def faked(bare: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine with fakes of all three; the folder for temporary files."""
    if os.name != "posix":
        pytest.skip("the fakes are scripts")
    fakes.install(bare)
    monkeypatch.delitem(sys.modules, espeak.WHEEL)
    monkeypatch.syspath_prepend(bare.parent / "packages")
    monkeypatch.setattr(espeak, "PROGRAM", [str(bare / "espeak-events")])
    return bare.parent / "temporary"
