"""Add-ons for other programs, as files that these install."""

from __future__ import annotations

import re
import zipfile
from importlib import resources
from pathlib import Path

from lipmotion.errors import ExportError
from lipmotion.extensions import installed_version
from lipmotion.storage.files import check_target, whole_file

PROGRAMS = ("blender",)
FOLDER = "lipmotion_blender"
MODULES = ("__init__.py", "curves.py", "keying.py", "panel.py", "takes.py")
OLDEST = (1980, 1, 1, 0, 0, 0)
"""The time of every file in an archive: the same version gives the same bytes."""
NO_VERSION = "0.0.0"
"""The version where lipmotion is not installed; Blender takes three numbers."""
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


def write_addon(program: str, path: str | Path) -> None:
    """Write the add-on for a program to a file.

    program : ``blender``: a ``.zip`` that Blender 4.2 and later installs from disk
    Raises ExportError: no such program, another suffix, or the file cannot be written.
    """
    path = Path(path)
    if program not in PROGRAMS:
        raise ExportError(f"there is no add-on for {program!r}, required one of {', '.join(PROGRAMS)}")
    if path.suffix.lower() != ".zip":
        raise ExportError(f"{path}: unknown format {path.suffix!r}; Blender installs a .zip")
    check_target(path)
    source = resources.files("lipmotion.addons.blender")
    texts = {name: source.joinpath(name).read_text(encoding="utf-8") for name in MODULES}
    version = re.match(r"\d+\.\d+\.\d+", installed_version())
    texts["blender_manifest.toml"] = MANIFEST.format(version=version[0] if version else NO_VERSION)
    with whole_file(path) as unfinished, zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in texts.items():
            archive.writestr(zipfile.ZipInfo(f"{FOLDER}/{name}", OLDEST), text.encode(), zipfile.ZIP_DEFLATED)
