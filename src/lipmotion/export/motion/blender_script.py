"""``.blender.py``: a script that keys shape keys, bones and custom properties when it is run in Blender."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from lipmotion.export.base import MotionFormat
from lipmotion.types import Generation

MODULES = ("takes.py", "curves.py", "keying.py", "script.py")
"""The modules of the add-on that a script holds, one after another."""
COPIED = "# -- what follows is copied into scripts\n"
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
    folder = resources.files("lipmotion.addons.blender")
    texts = [folder.joinpath(name).read_text(encoding="utf-8") for name in MODULES]
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
