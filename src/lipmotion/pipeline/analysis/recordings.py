"""Several recordings in one call: which they are, and where the outputs of each go."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from lipmotion.corpora.source_recordings import AUDIO_SUFFIXES, VIDEO_SUFFIXES
from lipmotion.errors import ExportError, InputError
from lipmotion.storage.files import check_listable, portable_name

NAME = "{name}"
"""In the path of an output, the name of the recording without its suffix."""


def list_recordings(given: Sequence[Path]) -> list[Path]:
    """Return recordings: files as they are given, and of folders the sounds and videos in them, sorted by name.

    Raises InputError: a folder without recordings, or one that cannot be read.
    """
    found: list[Path] = []
    for path in given:
        if not path.is_dir():
            found.append(path)
            continue
        check_listable(path)
        inside = sorted(each for each in path.iterdir() if each.suffix.lower() in AUDIO_SUFFIXES | VIDEO_SUFFIXES)
        if not inside:
            raise InputError(f"{path}: no sounds and no videos in it; give a folder of recordings")
        found += inside
    return found


def is_for_several(output: str) -> bool:
    """Return whether an output is a place for many files: a path with ``{name}``, or a folder.

    A folder that is called as a file is, as ``a.json``, is one only if the path ends with a slash.
    """
    is_folder = os.path.isdir(output)  # noqa: PTH112 (a name that is too long is no folder, and no error here)
    return NAME in output or output.endswith(("/", os.sep)) or (is_folder and not Path(output).suffix)


def plan_outputs(recordings: Sequence[Path], outputs: Sequence[str], kinds: Sequence[str]) -> list[list[str]]:
    """Return the outputs of each recording.

    outputs : folders, for which every kind is written, and paths with ``{name}``; of one recording, files, too
    kinds   : suffixes without the dot, as ``json``
    Raises ExportError: an output is none of these, or two recordings would be written to one file.
    """
    templates: list[str] = []
    for output in outputs:
        is_file = not is_for_several(output)
        if is_file and (len(recordings) > 1 or output == "-"):
            several = f"there are {len(recordings)} recordings" if len(recordings) > 1 else "no folder"
            raise ExportError(
                f"{output}: is one file, and {several}; give a folder, with a slash at its end, or {NAME} in the name "
                f"of the file: 'out/{NAME}{Path(output).suffix or '.json'}'"
            )
        templates += [output] if is_file or NAME in output else [str(Path(output) / f"{NAME}.{kind}") for kind in kinds]
    planned = [[each.replace(NAME, recording.stem) for each in templates] for recording in recordings]
    named = [part for template in templates for part in Path(template).parts if NAME in part]
    for recording in recordings:
        for name in (part.replace(NAME, recording.stem) for part in named):
            if portable_name(name) != name:
                raise ExportError(f"{name}: no name of a file on Windows; rename {recording}, or name the output")
    seen: dict[str, Path] = {}
    for recording, files in zip(recordings, planned, strict=True):
        for file in files:
            other = seen.setdefault(os.path.realpath(file), recording)
            if other != recording:
                raise ExportError(f"{file}: would be written for {other} and for {recording}; rename one of them")
    return planned
