"""The inputs of a call, and checks that its outputs do not overwrite them."""

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

    kind        : what it is, in a word: ``recording``, ``corpus``
    replaceable : whether it is a file that is read whole before anything is written, so an output may replace it
    """

    path: Path
    kind: str
    replaceable: bool = False


def check_apart(
    targets: Iterable[Path], sources: Iterable[Source], *, folders: Iterable[Path] = (), force: bool = False
) -> None:
    """Raise ExportError if writing would overwrite what the same call reads.

    targets : files to be written
    folders : folders to be filled or emptied
    force   : allow a file to replace a replaceable source
    Files are compared by device and inode, whatever their names, through links of both kinds. No output may lie in a
    folder that is read, and no input in a folder that is written.
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
                raise ExportError(f"{target}: {clash} the {source.kind}{itself}; give another name{way_out}")


def _clash(target: Path, source: Path, *, holds: bool) -> str:
    """Return how an output and an input clash: ``is``, ``lies in``, ``belongs to`` or ``holds``; "" where they do not.

    holds : whether the output is a folder, which may contain the input
    """
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
        and any(is_same(place, parent) for parent in Path(os.path.realpath(source)).parents)
        else ""
    )


def is_folder(path: Path) -> bool:
    """Return whether a folder exists; False also for names that are not valid."""
    status = _status(path)
    return status is not None and stat.S_ISDIR(status.st_mode)


def is_file(path: Path) -> bool:
    """Return whether a file exists; False also for names that are not valid, as empty ones and those too long."""
    status = _status(path)
    return status is not None and stat.S_ISREG(status.st_mode)


def is_same(path: str | Path, other: str | Path) -> bool:
    """Return whether two names, links followed, are of one existing file or folder."""
    one, two = _status(path), _status(other)
    return one is not None and two is not None and os.path.samestat(one, two)


def _is_in(folder: Path, file: Path) -> bool:
    """Return whether a file lies in a folder or its subfolders, or a link there points to it."""
    return any(is_same(Path(root) / name, file) for root, _, names in os.walk(folder) for name in names)


def _status(path: str | Path) -> os.stat_result | None:
    """Return the status of a file or folder; None: there is none, or the name is not valid."""
    try:
        return Path(path).stat()
    except (OSError, ValueError):
        return None
