"""Files and folders that appear whole or not at all.

Everything is written under a temporary name beside its target and renamed at the end.
"""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lipmotion.errors import ExportError, InputError

TEMPORARY = ".part-"
"""Names of unfinished files start with this; a killed run may leave one, the next removes it."""
PLAYLISTS = (b"#EXTM3U", b"ffconcat version", b"<MPD")
PLAYLIST_BYTES = 512
"""Playlists say so within their first bytes. FFmpeg would wait for their addresses, for ever if they are live."""


def check_source(path: Path, kind: str) -> None:
    """Raise InputError unless ``path`` is a file with something in it; ``kind`` says what it should be."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give one {kind}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; give a {kind}")
    with path.open("rb") as file:
        start = file.read(PLAYLIST_BYTES)
    if any(mark in start for mark in PLAYLISTS):
        raise InputError(f"{path}: is a playlist, which names recordings elsewhere; give the {kind} itself")


def open_media(path: Path) -> Any:
    """Return an open PyAV container; close it. Raises what PyAV raises.

    The name is taken as a file's whatever is in it (``12:30.wav`` is no protocol), and nothing that is not a file is
    opened, whatever the content says.
    """
    import av

    return av.open(f"file:{path}", options={"protocol_whitelist": "file"})


def check_target(target: Path, source: str | Path | None = None) -> None:
    """Raise ExportError unless a file can be put there: before work begins, not after it.

    source : a recording that must not be overwritten
    """
    try:
        is_folder = target.is_dir()
    except OSError as error:  # a name too long
        raise ExportError(f"{target}: cannot be written: {error.strerror or error}") from error
    if is_folder:
        raise ExportError(f"{target}: is a folder; give the name of a file in it")
    _check_parent(target)
    if source is not None and target.exists() and Path(source).exists() and target.samefile(source):
        raise ExportError(f"{target}: is the recording itself; give another name")


def as_text(path: str | Path) -> str:
    """Return what can be written as UTF-8: a file's name may be of any bytes."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")


def _check_parent(target: Path) -> None:
    if not target.parent.is_dir():
        raise ExportError(f"{target}: the folder {target.parent} does not exist; create it first")


def _temporary(target: Path) -> Path:
    _check_parent(target)
    return target.with_name(f"{TEMPORARY}{uuid.uuid4().hex[:8]}{target.suffix.lower()}")


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """Give a temporary path to write to, with the target's suffix (lower case); rename it to ``target`` on success.

    Raises ExportError: the folder does not exist, or the file cannot be written (disk full, no permission).
    """
    temporary = _temporary(target)
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise ExportError(f"{target}: cannot be written: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Give a temporary folder to fill; rename it to ``target``, which must not exist, on success.

    Raises ExportError: the parent does not exist, or something cannot be written.
    """
    temporary = _temporary(target)
    try:
        temporary.mkdir()
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise ExportError(f"{target}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def remove_unfinished(folder: Path) -> None:
    """Delete what a killed run left behind in ``folder``."""
    for path in folder.glob(f"{TEMPORARY}*"):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
