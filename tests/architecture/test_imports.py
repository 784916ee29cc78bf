"""The import contracts of pyproject.toml hold, and each of them fails for a forbidden import."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import pytest

from children import Done, environment, run_child

ROOT = Path(__file__).parents[2]
FORBIDDEN = [
    # the contract, a module, and an import that the contract forbids there
    ("Imports only go down", "errors.py", "import lipmotion.types"),
    ("Imports only go down", "units/phones.py", "from lipmotion.speech import audio_files"),
    ("Imports only go down", "types/audio.py", "import lipmotion.storage.files"),
    ("Imports only go down", "storage/files.py", "import lipmotion.units"),
    ("Imports only go down", "hmm/model.py", "from lipmotion.motion import space"),
    ("Imports only go down", "appearance/eigenlips.py", "from lipmotion.motion import space"),
    ("Imports only go down", "speech/audio_files.py", "def late():\n    from lipmotion.vision import track"),
    ("Imports only go down", "faces/portrait/mouth.py", "from lipmotion.vision import mouth"),
    ("Imports only go down", "pipeline/training/train.py", "from lipmotion.testing import toy"),
    ("Imports only go down", "testing/toy.py", "from lipmotion.experiments import folds"),
    ("Imports only go down", "utils.py", "'a module on no floor'"),
    (
        "Engines never import one another; only the registry knows them",
        "engines/coupled/config.py",
        "from lipmotion.engines.trajectory import model",
    ),
    (
        "Engines never import one another; only the registry knows them",
        "engines/trajectory/model.py",
        "from lipmotion.engines.joint import engine",
    ),
    (
        "Engines never import one another; only the registry knows them",
        "engines/base.py",
        "from lipmotion.engines import registry",
    ),
    (
        "Faces never import one another; only the registry knows them",
        "faces/portrait/mouth.py",
        "from lipmotion.faces import registry",
    ),
    ("Exporters never import one another", "export/cues/sheet.py", "from lipmotion.export.motion import rounded"),
    (
        "Formats of one kind never import one another",
        "export/motion/motion_csv.py",
        "import lipmotion.export.motion.motion_npz",
    ),
    ("Only corpora and vision may import OpenCV and MediaPipe", "pipeline/training/train.py", "import cv2"),
    ("Only corpora and vision may import OpenCV and MediaPipe", "speech/audio_files.py", "import mediapipe"),
    ("Only kernels may import numba", "stats/mixture.py", "def late():\n    import numba"),
    ("Only kernels may import numba", "engines/base.py", "from llvmlite import ir"),
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


@pytest.mark.parametrize(("contract", "module", "line"), FORBIDDEN)
def test_a_forbidden_import_breaks_its_contract(contract: str, module: str, line: str, tmp_path: Path) -> None:
    package = tmp_path / "src" / "lipmotion"
    shutil.copytree(ROOT / "src" / "lipmotion", package, ignore=shutil.ignore_patterns("__pycache__", "models"))
    with (package / module).open("a", encoding="utf-8") as file:
        file.write(f"\n\n{line}\n")
    done = lint(tmp_path / "src", tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert broken(done.stdout) == [contract]
