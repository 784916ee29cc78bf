"""The benchmark that kills and goes on, in small (``benchmarks/kills.py`` does it a hundred times)."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "kills.py"


@pytest.mark.slow
@pytest.mark.video
@pytest.mark.parametrize("job", ["prepare", "train"])
@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_killed_runs_go_on_to_the_same_bytes(job: str, tmp_path: Path) -> None:
    pytest.importorskip("mediapipe")
    command = [sys.executable, str(SCRIPT), "--job", job, "--kills", "6", "--seed", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "6 same bytes after going on" in done.stdout
