"""FBX (Autodesk; no public specification, and no open library writes it): Blender makes it of a ``.glb``.

Blender 4.2 or later does it, the program or the package ``bpy``. Its FBX has the meshes, their shape keys and joints,
and one animation in whole frames. It holds no sound.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

from lipmotion.errors import ExportError, MissingDependencyError
from lipmotion.storage.files import atomic_file

LONGEST_S = 1800  # half an hour is far more than an hour of speech takes
SCRIPT = resources.files(__package__).joinpath("fbx_script.txt").read_text(encoding="ascii")
"""What Blender runs with three arguments: the ``.glb``, the ``.fbx``, and the frames a second."""


def find_blender() -> list[str]:
    """Return a command that runs ``SCRIPT`` in Blender, without the script's arguments.

    Raises MissingDependencyError: there is no Blender.
    """
    program = shutil.which("blender")
    if program is not None:
        return [program, "--background", "--factory-startup", "--python-exit-code", "1", "--python-expr", SCRIPT, "--"]
    if find_spec("bpy") is not None:
        return [sys.executable, "-c", SCRIPT]
    raise MissingDependencyError(
        "an .fbx is made by Blender, which is not here; install it, so that 'blender' runs, or: pip install bpy; or "
        "write a .glb, which game engines read too"
    )


def convert_to_fbx(source: Path, target: Path, rate_hz: int) -> None:
    """Write a moving ``.glb`` as ``.fbx``, at a whole number of frames a second.

    Raises MissingDependencyError: there is no Blender. Raises ExportError: Blender cannot do it.
    """
    command = find_blender()
    with atomic_file(target) as path:
        arguments = [str(source.resolve()), str(path.resolve()), str(rate_hz)]
        try:
            done = subprocess.run(
                command + arguments, stdin=subprocess.DEVNULL, capture_output=True, timeout=LONGEST_S, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise ExportError(f"{target}: Blender does not write it: {error}") from error
        if done.returncode or not path.is_file() or not path.stat().st_size:
            message = (done.stderr or done.stdout).decode(errors="replace").strip().rpartition("\n")[2]
            raise ExportError(f"{target}: Blender does not write it (exit code {done.returncode}): {message[:300]}")
