"""What the README says, done."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def commands(first_word: str) -> list[list[str]]:
    lines = [line.split("#")[0] for block in blocks("sh") for line in block.splitlines()]
    return [shlex.split(line) for line in lines if line.startswith(first_word)]


def run(command: list[str], folder: Path) -> str:
    if command[0] == "lipmotion":
        command = [sys.executable, "-m", "lipmotion.cli.main", *command[1:]]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    return tmp_path


def test_make_targets_exist() -> None:
    targets = [command[1] for command in commands("make")]
    assert targets == ["demo", "test"]
    for target in targets:
        assert "lipmotion" in run(["make", "-n", target], ROOT) or target == "test"


@pytest.mark.long
def test_commands_of_use(checkout: Path) -> None:
    used = [command for command in commands("lipmotion") if "examples/welcome.flac" in command or command[1] == "info"]
    assert len(used) == 3
    for command in used:
        run(command, checkout)
    assert {"welcome.mp4", "welcome.json", "welcome.csv"} <= {path.name for path in checkout.iterdir()}


def test_python_example(checkout: Path) -> None:
    (example,) = blocks("python")
    (checkout / "example.py").write_text(example)
    said = run([sys.executable, "example.py"], checkout)
    assert re.search(r"\d+ frames, widest 0\.\d\d at \d\.\d\d s", said)
    assert "behind 1.00 s stands" in said
    assert (checkout / "edited.mp4").stat().st_size > 10_000


@pytest.mark.long
@pytest.mark.video
def test_training_on_own_recordings(checkout: Path) -> None:
    pytest.importorskip("mediapipe")
    from lipmotion.testing.toy import write_toy_recordings

    (checkout / "my-recordings").mkdir()
    write_toy_recordings(checkout / "my-recordings")
    shutil.copy(checkout / "examples" / "welcome.flac", checkout / "speech.wav")  # the content decides, not the name
    used = [command for command in commands("lipmotion") if command not in commands("lipmotion")[:3]]
    assert [command[1] for command in used] == ["corpus", "train", "animate"]
    for command in used:
        run(command, checkout)
    assert (checkout / "speech.mp4").stat().st_size > 10_000
    figures = re.search(r"`(lipmotion evaluate me[^`]*)`", README)
    assert figures is not None
    assert "audio only" in run(shlex.split(figures[1]), checkout)
