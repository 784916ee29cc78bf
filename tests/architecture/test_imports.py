"""The import contracts of pyproject.toml hold, and each of them fails for a forbidden import."""

import re
import shutil
import sys
from pathlib import Path

import pytest

from children import Done, environment, run_child

ROOT = Path(__file__).parents[2]
DOWN = "Imports only go down"
ENGINES = "Engines never import one another; only the registry knows them"
FACES = "Faces never import one another; only the registry knows them"
CORE = "The core names no other package; studio and lab stand on faces"
FORMATS = "Formats never import one another; only the registries know them"
TRACKING = "Only tracking may import OpenCV and MediaPipe"
ROOMS = "The pipeline's rooms only import those below"
CIRCLES = "No circle of imports, also not within a room"
NUMBA = "Only kernels may import numba"
PREDICTORS = "Engines know predictors by their interface alone"
TRACKERS = "Tracking knows trackers by their interface alone"
FORBIDDEN = [
    # the contract, a module, and an import that the contract forbids there
    (CORE, "lipmotion/motion/space.py", "def late():\n    from lipmotion_faces import base"),
    (CORE, "lipmotion_studio/workspace.py", "from lipmotion_lab import runner"),
    (DOWN, "lipmotion/errors.py", "import lipmotion.types"),
    (ROOMS, "lipmotion/pipeline/model.py", "def late():\n    from lipmotion.pipeline import session"),
    (CIRCLES, "lipmotion/pipeline/outputs/output.py", "def late():\n    from lipmotion.pipeline.outputs import cues"),
    (CIRCLES, "lipmotion/speech/features/mfcc.py", "def late():\n    from lipmotion.speech.sound import audio_files"),
    (ENGINES, "lipmotion/engines/trajectory/model.py", "from lipmotion.engines.joint import engine"),
    (FACES, "lipmotion_faces/portrait/mouth_painting.py", "from lipmotion_faces import registry"),
    (FORMATS, "lipmotion/formats/fap.py", "from lipmotion.formats import vmd"),
    (PREDICTORS, "lipmotion/engines/selection/engine.py", "from lipmotion.motion import acoustic_network"),
    (TRACKERS, "lipmotion_faces/tracking/track.py", "from lipmotion_faces.tracking import mediapipe"),
    (TRACKING, "lipmotion/pipeline/training/train.py", "import cv2"),
    (NUMBA, "lipmotion/stats/mixture.py", "def late():\n    import numba"),
]


def lint(source: Path, folder: Path) -> Done:
    """Check the contracts on the package in ``source``."""
    script = shutil.which("lint-imports", path=str(Path(sys.executable).parent)) or shutil.which("lint-imports")
    if script is None:
        pytest.skip("import-linter is not installed")
    command = [script, "--config", str(ROOT / "pyproject.toml"), "--no-cache"]
    return run_child(command, folder=folder, variables=environment(PYTHONPATH=str(source), COLUMNS="200"))


def broken(output: str) -> list[str]:
    return re.findall(r"^(.+) BROKEN$", output, flags=re.MULTILINE)


def test_the_contracts_hold(tmp_path: Path) -> None:
    done = lint(ROOT / "src", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert broken(done.stdout) == []


def test_every_contract_is_seen_failing_below() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    contracts = re.findall(r'^\[\[tool\.importlinter\.contracts\]\]\nname = "(.+)"$', text, flags=re.MULTILINE)
    assert contracts
    assert set(contracts) == {contract for contract, _, _ in FORBIDDEN}


def test_a_forbidden_import_breaks_its_contract(tmp_path: Path) -> None:
    """All of them are planted at once, and each is named."""
    source_folder = tmp_path / "src"
    shutil.copytree(ROOT / "src", source_folder, ignore=shutil.ignore_patterns("__pycache__", "models"))
    for _, module, line in FORBIDDEN:
        with (source_folder / module).open("a", encoding="utf-8") as file:
            file.write(f"\n\n{line}\n")
    done = lint(source_folder, tmp_path)
    assert (done.returncode, set(broken(done.stdout))) == (1, {contract for contract, *_ in FORBIDDEN}), done.stderr
    said = " ".join(done.stdout.split())
    for contract, module, line in FORBIDDEN:
        names = re.search(r"(?:from (\S+) )?import (\S+)", line)
        planted = f"{module.removesuffix('.py').replace('/', '.')} -> {'.'.join(filter(None, names.groups()))}"
        assert contract == CIRCLES or planted in said, planted
    for circle in ("lipmotion.pipeline.outputs", "lipmotion.speech"):
        assert f"No cycles are allowed in {circle}." in said


def test_a_module_on_no_floor_stops_everything(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__", "models"))
    (tmp_path / "src" / "lipmotion" / "utils.py").write_text('"""A module on no floor."""\n')
    assert lint(tmp_path / "src", tmp_path).returncode == 1
