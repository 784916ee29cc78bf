"""What the README and the first steps say, done."""

import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from children import HASTY, LIPMOTION, run_child

ROOT = Path(__file__).parent.parent
README, START = ((ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "docs/start.md"))
PAGES = pytest.mark.parametrize("page", [README, START], ids=["README", "start"])


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page, flags=re.DOTALL)


def commands(page: str, first_word: str) -> list[list[str]]:
    lines = [line.split("#")[0] for block in blocks(page, "sh") for line in block.splitlines()]
    return [shlex.split(line) for line in lines if line.startswith(first_word)]


def needs_training(command: list[str]) -> bool:
    """Return whether a command uses recordings, a corpus or a model of one's own."""
    return any(word.startswith(("my-", "me.")) for word in command)


def run(command: list[str], folder: Path) -> str:
    if command[0] == "lipmotion":
        command = [*(HASTY if command[1] == "train" else LIPMOTION), *command[1:]]
    return run_child(command, folder=folder, check=True).stdout


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    return tmp_path


def test_make_targets_exist() -> None:
    targets = [command[1] for command in commands(README, "make")]
    assert targets == ["demo", "test"]
    for target in targets:
        assert "lipmotion" in run(["make", "-n", target], ROOT) or target == "test"


@pytest.mark.long
@pytest.mark.parametrize(
    ("page", "verbs", "written"),
    [
        (README, ["animate", "cues", "explain", "cite"], {"welcome.mp4", "welcome.json", "welcome.tsv"}),
        (START, ["animate", "animate", "info"], {"welcome.mp4", "welcome.json", "welcome.csv"}),
    ],
    ids=["README", "start"],
)
def test_commands_of_use(page: str, verbs: list[str], written: set[str], checkout: Path) -> None:
    used = [command for command in commands(page, "lipmotion") if not needs_training(command)]
    assert [command[1] for command in used] == verbs
    for command in used:
        run(command, checkout)
    assert written <= {path.name for path in checkout.iterdir()}


@pytest.mark.long
@PAGES
def test_python_example(page: str, checkout: Path) -> None:
    (example,) = blocks(page, "python")
    (checkout / "example.py").write_text(example)
    printed = run([sys.executable, "example.py"], checkout)
    assert re.search(r"widest 0\.\d\d at \d\.\d\d s", printed)
    assert ("the model state at 1.00 s is" in printed) == (page is START)
    assert (checkout / "edited.mp4").stat().st_size > 10_000
    assert (checkout / "edited.json").stat().st_size > 10_000


@pytest.mark.long
@pytest.mark.video
def test_training_on_own_recordings(checkout: Path) -> None:
    pytest.importorskip("mediapipe")
    from testing.toy import write_toy_recordings

    (checkout / "my-recordings").mkdir()
    write_toy_recordings(checkout / "my-recordings")
    shutil.copy(checkout / "examples" / "welcome.flac", checkout / "speech.wav")  # the content decides, not the name
    used = [command for command in commands(README, "lipmotion") if needs_training(command)]
    assert [command[1] for command in used] == ["corpus", "train", "animate", "evaluate"]
    outputs = [run(command, checkout) for command in used]
    assert (checkout / "speech.mp4").stat().st_size > 10_000
    assert "audio only" in outputs[-1]
    (measured,) = re.findall(r"`(lipmotion evaluate me[^`]*)`", START)
    first = [command for command in commands(START, "lipmotion") if needs_training(command)]
    assert [*first, shlex.split(measured)] == used
