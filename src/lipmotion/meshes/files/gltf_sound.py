"""The sound that a glTF file names: ``extras`` of its scene, which other programs pass on."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from lipmotion.meshes.files.gltf_container import read_gltf_document
from lipmotion.storage.files import as_text

AUDIO = "audio"
SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:|//")
"""With this a URI begins that is no path from the folder of the file."""
LATEST_S = 86_400.0


def sound_extras(sound: str, start_s: float) -> dict[str, Any]:
    """Return what a scene says of its sound: a URI, as those of buffers and pictures, and when the sound begins.

    sound   : a path from the folder of the file, with slashes
    start_s : where the sound begins, in seconds of the animation
    """
    return {AUDIO: {"uri": quote(as_text(sound), safe="/"), "start_s": start_s}}


def named_sound(path: Path) -> tuple[Path, float] | None:
    """Return the path of the sound that a glTF file names, and where it begins, in seconds; None: it names none.

    Only paths from the folder of the file count; whether the sound is there is not looked at.
    Raises InputError: the file is no glTF.
    """
    json: Any = read_gltf_document(path).json
    json = json["scenes"][json.get("scene", 0)] if json.get("scenes") else json
    for key in ("extras", AUDIO):
        json = json.get(key) if isinstance(json, dict) else None
    given = json if isinstance(json, dict) else {}
    uri, start_s = given.get("uri"), given.get("start_s", 0.0)
    if not isinstance(uri, str) or not uri or not isinstance(start_s, int | float) or not abs(start_s) <= LATEST_S:
        return None
    name = unquote(uri)
    if "\0" in name or SCHEME.match(uri) or Path(name).is_absolute():
        return None
    return path.parent / name, float(start_s)
