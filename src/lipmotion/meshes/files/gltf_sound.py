"""The sound that a glTF file names: ``extras`` of its scene, which other programs pass on."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote, urlsplit

from lipmotion.meshes.files.gltf_container import read_gltf_document
from lipmotion.storage.files import as_text

AUDIO = "audio"


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
    json = read_gltf_document(path).json
    scenes, number = json.get("scenes"), json.get("scene", 0)
    shown = scenes[number] if isinstance(scenes, list) and isinstance(number, int) and number < len(scenes) else json
    extras = shown.get("extras") if isinstance(shown, dict) else None
    given = extras.get(AUDIO) if isinstance(extras, dict) else None
    uri, start_s = (given.get("uri"), given.get("start_s", 0.0)) if isinstance(given, dict) else (None, 0.0)
    if not isinstance(uri, str) or not uri or not isinstance(start_s, int | float):
        return None
    name = unquote(uri)
    if "\0" in name or urlsplit(uri).scheme or urlsplit(uri).netloc or Path(name).is_absolute():
        return None
    return path.parent / name, float(start_s)
