"""Programs that files are made for, as oracles: Blender, OpenUSD, Khronos' validator. Absent ones are None.

They are found in this Python, or in the one that LIPMOTION_BPY_PYTHON (Blender as the package ``bpy``) and
LIPMOTION_PXR_PYTHON (``usd-core``) name; ``gltf-validator`` of npm in the folder LIPMOTION_NODE_MODULES.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent
LONGEST_S = 280


@cache
def python_with(module: str) -> str | None:
    """Return the interpreter that has a module, ``bpy`` or ``pxr``."""
    given = os.environ.get(f"LIPMOTION_{module.upper()}_PYTHON")
    if given:
        return given
    return sys.executable if importlib.util.find_spec(module) else None


def run_with(module: str, script: str, *arguments: object, folder: Path | None = None) -> Any:
    """Run a script of this folder in the interpreter that has a module; return the JSON of its last line."""
    python = python_with(module)
    assert python is not None, f"no Python with {module}"
    with (
        tempfile.TemporaryDirectory() as temporary
    ):  # for the caches of Blender
        own = {"PYTHONPATH": "", "BLENDER_USER_RESOURCES": str(folder or temporary)}
        return _json_of([python, str(FOLDER / script), *map(str, arguments)], {**os.environ, **own})


@cache
def gltf_validator() -> str | None:
    """Return the folder of Khronos' validator for Node."""
    folder = Path(os.environ.get("LIPMOTION_NODE_MODULES", "node_modules")) / "gltf-validator"
    return str(folder) if folder.is_dir() and shutil.which("node") else None


def gltf_report(path: Path) -> Any:
    """Return the validator's report of a glTF file."""
    return _json_of(["node", str(FOLDER / "gltf_issues.cjs"), str(gltf_validator()), str(path)], dict(os.environ))


def _json_of(command: list[str], environment: dict[str, str]) -> Any:
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, env=environment, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return json.loads(done.stdout.strip().splitlines()[-1])
