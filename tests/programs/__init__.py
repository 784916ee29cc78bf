"""Programs that files are made for, as oracles: Blender, OpenUSD, Khronos' validator. Absent ones are None.

They are found in this Python, or in the one that LIPMOTION_BPY_PYTHON (Blender as the package ``bpy``) and
LIPMOTION_PXR_PYTHON (``usd-core``) name; packages of npm in the folder LIPMOTION_NODE_MODULES: ``gltf-validator``,
``mmd-parser`` (with which three.js reads MikuMikuDance's files), ``@pixiv/three-vrm-animation`` beside ``three``,
``@esotericsoftware/spine-core`` of version 4.2, ``@met4citizen/talkinghead`` beside ``three``.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from children import environment, run_child

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
    with tempfile.TemporaryDirectory() as temporary:  # for the caches of Blender
        own = environment(PYTHONPATH="", BLENDER_USER_RESOURCES=str(folder or temporary))
        return _json_of([python, str(FOLDER / script), *map(str, arguments)], own)


@cache
def node_package(name: str) -> str | None:
    """Return the folder of a package of npm, where Node is installed."""
    folder = Path(os.environ.get("LIPMOTION_NODE_MODULES", "node_modules")) / name
    return str(folder) if folder.is_dir() and shutil.which("node") else None


def gltf_validator() -> str | None:
    """Return the folder of Khronos' validator for Node."""
    return node_package("gltf-validator")


def run_node(script: str, package: str, path: Path) -> Any:
    """Run a script of this folder with a package of npm and a file; return the JSON of its last line."""
    return _json_of(["node", str(FOLDER / script), str(node_package(package)), str(path)], environment())


def gltf_report(path: Path) -> Any:
    """Return the validator's report of a glTF file."""
    return run_node("gltf_issues.cjs", "gltf-validator", path)


def _json_of(command: list[str], variables: dict[str, str]) -> Any:
    done = run_child(command, variables=variables, limit_s=LONGEST_S, check=True)
    return json.loads(done.stdout.strip().splitlines()[-1])
