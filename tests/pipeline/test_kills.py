"""The benchmark that kills and goes on, in small (``benchmarks/kills.py`` does it five hundred times)."""

import sys
from pathlib import Path

import pytest

from children import run_child

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "kills.py"
JOBS = ("train-joint", "prepare-sounds", "animate")
"""Training of the engine that learns in a second (the default one is stopped in ``training/test_resume.py``), work in
two processes, and two files that appear together."""


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.video
@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_killed_runs_go_on_to_the_same_bytes(tmp_path):
    pytest.importorskip("mediapipe")
    chosen = [word for job in JOBS for word in ("--job", job)]
    command = [sys.executable, str(SCRIPT), *chosen, "--kills", "4", "--seed", "1", "-o", "kills.txt"]
    done = run_child(command, folder=tmp_path, limit_s=3600, check=True)
    assert done.stdout.startswith("4 kills, 0 problems, 0 inputs changed;")
    assert done.stdout.count("same bytes after going on") == len(JOBS)
    assert (tmp_path / "kills.txt").read_text(encoding="utf-8") == done.stdout
