"""Files for Blender: a script with motion in it, and the add-on that reads motion files.

``.blender.py``: a script that keys shape keys, bones and custom properties when it is run in Blender.
``.zip``: the add-on (``extras/lipmotion_blender``; a wheel holds it as data), as Blender 4.2 and later installs it.

The script is made of the modules of the add-on, one after another, the curves, and a call that keys them.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from lipmotion.errors import ExportError
from lipmotion.extensions import find_version
from lipmotion.formats.base import MotionFormat
from lipmotion.storage.files import atomic_file, check_target
from lipmotion.types import Generation

SCRIPT_MODULES = ("takes.py", "curves.py", "keying.py", "script.py")
"""The modules of the add-on that a script holds, one after another."""
COPIED = "# -- what follows is copied into scripts\n"
PROGRAMS = ("blender",)
FOLDER = "lipmotion_blender"
ADDON_PLACES = (Path(__file__).parents[1] / "addons", Path(__file__).parents[3] / "extras")
"""Where the add-on's folder is: in an installed package; in a copy of the repository."""
MODULES = ("__init__.py", "curves.py", "keying.py", "panel.py", "takes.py")
OLDEST = (1980, 1, 1, 0, 0, 0)  # the time of every file in an archive: the same version gives the same bytes
NO_VERSION = "0.0.0"  # the version where lipmotion is not installed; Blender takes three numbers
MANIFEST = """schema_version = "1.0.0"
id = "lipmotion"
version = "{version}"
name = "lipmotion"
tagline = "Keys shape keys and bones from files of lip motion"
maintainer = "lipmotion"
type = "add-on"
blender_version_min = "4.2.0"
license = ["SPDX:MIT"]

[permissions]
files = "Reads the motion file and the sound that you choose"
"""
"""What makes the archive an extension; as an add-on of the older kind, Blender reads ``bl_info``."""
DECIMALS = 5
_BEGINNING = re.compile(r'\A""".*?"""\n', re.DOTALL)
_IMPORT = re.compile(r"^from (\.\w*|__future__) import .*\n", re.MULTILINE)

_HEAD = '''"""Lip motion for Blender, written by lipmotion.

Select the face or the rig and run this script: in the text editor (Alt P), or
    blender FILE.blend --python THIS_FILE
It keys shape keys by their names (as ARKit's, in any spelling), bones (Bone.rotation.x, degrees) and custom
properties (Bone[name]), from the start frame of the scene, and adds the sound to the sequencer.
"""

from __future__ import annotations

'''


def write(path: Path, generation: Generation, source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write the code of the add-on, the curves, and a call that keys them; names are literals of Python in ASCII."""
    motion = generation.motion
    texts = read_addon(SCRIPT_MODULES).values()
    *code, main = (_IMPORT.sub("", _BEGINNING.sub("", text)) for text in texts)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(_HEAD + "".join(each.strip() + "\n\n\n" for each in code))
        file.write(f"RATE_HZ = {motion.rate_hz!r}\nSOUND = {source.get('path', '')!a}\n")
        file.write(f"SOUND_S = {float(source.get('start_s', 0.0))!r}\n")
        stepped = "".join(f"{name!a}, " for name in motion.names if name in generation.stepped)
        file.write(f"STEPPED = ({stepped})\nMOTION = {{\n")
        for name in motion.names:
            values = ", ".join(f"{value + 0.0:.{DECIMALS}g}" for value in motion[name].tolist())
            file.write(f"    {name!a}: [{values}],\n")
        file.write("}\n" + main.split(COPIED)[1] + '\n\nif __name__ == "__main__":\n    main()\n')


MOTION_FORMAT = MotionFormat(write, curves="face", other_curves=True, names_sound=True)


def read_addon(names: Iterable[str]) -> dict[str, str]:
    """Return the text of modules of the add-on, by name. Raises ExportError: this installation lacks the add-on."""
    folder = next((place / FOLDER for place in ADDON_PLACES if (place / FOLDER).is_dir()), None)
    if folder is None:
        raise ExportError("this installation of lipmotion lacks its add-on for Blender; install lipmotion again")
    return {name: (folder / name).read_text(encoding="utf-8") for name in names}


def write_addon(program: str, path: str | Path) -> None:
    """Write the add-on for Blender 4.2 and later to a ``.zip``. Raises ExportError: another program or suffix."""
    path = Path(path)
    if program not in PROGRAMS:
        raise ExportError(f"there is no add-on for {program!r}, required one of {', '.join(PROGRAMS)}")
    if path.suffix.lower() != ".zip":
        raise ExportError(f"{path}: unknown format {path.suffix!r}; Blender installs a .zip")
    check_target(path)
    texts = read_addon(MODULES)
    version = re.match(r"\d+\.\d+\.\d+", find_version())
    texts["blender_manifest.toml"] = MANIFEST.format(version=version[0] if version else NO_VERSION)
    with atomic_file(path) as unfinished, zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in texts.items():
            archive.writestr(zipfile.ZipInfo(f"{FOLDER}/{name}", OLDEST), text.encode(), zipfile.ZIP_DEFLATED)
