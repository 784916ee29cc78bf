"""What a call reads, and that nothing it writes destroys it."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from lipmotion.errors import ExportError


@dataclass(frozen=True)
class Source:
    """A file or a folder that a call reads.

    what        : what it is, in a word: ``recording``, ``corpus``
    replaceable : a file that is read whole before anything is written, so that an output may take its place
    """

    path: Path
    what: str
    replaceable: bool = False


def check_apart(
    targets: Iterable[Path], sources: Iterable[Source], *, folders: Iterable[Path] = (), force: bool = False
) -> None:
    """Raise ExportError if writing would destroy what the same call reads.

    targets : files to be written
    folders : folders to be filled or emptied
    force   : allow a file to take the place of a replaceable source
    A file is known by its device and number, whatever its name, through links of both kinds. No output may lie in a
    folder that is read, and no such file or folder in a folder that is written.
    """
    files, folders = list(targets), list(folders)
    for source in sources:
        for target in [*files, *folders]:
            clash = _clash(target, source.path, holds=target in folders)
            if clash == "is" and source.replaceable and force:
                continue
            if clash:
                itself = " itself" if clash == "is" else f" {source.path}"
                way_out = ", or add --force to replace it" if clash == "is" and source.replaceable else ""
                raise ExportError(f"{target}: {clash} the {source.what}{itself}; give another name{way_out}")


def _clash(target: Path, source: Path, *, holds: bool) -> str:
    """Return how an output meets an input: ``is``, ``lies in``, ``belongs to`` or ``holds``; "" where it does not."""
    place = Path(os.path.realpath(target))
    if is_same(place, source):
        return "is"
    if is_folder(source):
        if any(is_same(folder, source) for folder in place.parents):
            return "lies in"
        if _status(place) and not is_folder(place) and _is_in(source, place):
            return "belongs to"
    return (
        "holds"
        if holds
        and _status(source)
        and any(is_same(place, around) for around in Path(os.path.realpath(source)).parents)
        else ""
    )


def is_folder(path: Path) -> bool:
    """Whether a folder of that name is there, however long the name."""
    found = _status(path)
    return found is not None and stat.S_ISDIR(found.st_mode)


def is_same(path: str | Path, other: str | Path) -> bool:
    """Whether two names, links followed, are one file or folder that is there."""
    found, wanted = _status(path), _status(other)
    return found is not None and wanted is not None and os.path.samestat(found, wanted)


def _is_in(folder: Path, file: Path) -> bool:
    """Whether a file in a folder, or one that a link in it points to, is this one."""
    return any(is_same(Path(root) / name, file) for root, _, names in os.walk(folder) for name in names)


def _status(path: str | Path) -> os.stat_result | None:
    """Return what the system knows of a file or folder; None where there is none, or the text can be no name."""
    try:
        return Path(path).stat()
    except (OSError, ValueError):
        return None
