"""Files and folders that are written whole or not at all, and without following links in folders of other users.

Everything is written under a temporary name beside its target, and renamed at the end.
"""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import shutil
import stat
import sys
import time
import uuid
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import IO

from lipmotion.errors import ExportError
from lipmotion.storage.sources import Source, check_apart, is_same

TEMPORARY = ".part-"
"""Prefix of unfinished files' names; a killed run may leave such a file, which the next run removes."""


def check_target(target: Path, source: str | Path | None = None) -> None:
    """Raise ExportError unless a file can be written at ``target``; called before the work that leads to it."""
    try:
        is_folder = target.is_dir()
        _check_parent(find_place(target))
    except OSError as error:  # a name too long, a folder that may not be looked into
        raise ExportError(f"{target}: cannot be written: {error.strerror or error}") from error
    if is_folder:
        raise ExportError(f"{target}: is a folder; give the name of a file in it")
    if source is not None:
        check_apart([target], [Source(Path(source), "recording")])


def check_distinct(targets: Sequence[Path]) -> None:
    """Raise ExportError if two outputs are the same file."""
    places = [os.path.realpath(target) for target in targets]
    for number, place in enumerate(places):
        if any(place == other or is_same(place, other) for other in places[:number]):
            raise ExportError(f"{targets[number]}: is given twice; give every output another name")


_DEVICE = re.compile(r"con|prn|aux|nul|conin\$|conout\$|(?:com|lpt)[0-9\u00b9\u00b2\u00b3]", re.IGNORECASE)


def make_portable(name: str) -> str:
    """Return a name of a file or a folder that Windows takes as one, too; as it is, where it does."""
    stem, dot, rest = name.rstrip(" .").partition(".")
    return f"{stem.rstrip()}_{dot}{rest}" if _DEVICE.fullmatch(stem.rstrip()) else name.rstrip(" .")


def as_text(path: str | Path) -> str:
    """Return a path as text that UTF-8 can encode: names of files may have any bytes."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")


_CONFINED: dict[object, str] = {}
"""Folders inside which no link is followed, one entry for each block that confines one."""
_BY_HANDLE = os.open in os.supports_dir_fd and os.mkdir in os.supports_dir_fd and hasattr(os, "O_NOFOLLOW")
_FOLDER = getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_PATH", 0)
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
_BINARY = getattr(os, "O_BINARY", 0)


@contextmanager
def confine(folder: Path) -> Iterator[None]:
    """Follow no link inside a folder that other users may have filled, whatever writes there while the block lasts.

    This holds for all functions of this module, in all threads of the process. The folder itself may be a link, which
    the user gave. Inside it, a link in the place of a file is replaced, and one in the place of a folder is refused.
    Folders are reached by handles, so that they cannot be exchanged on the way. Systems without handles (Windows) look
    at every name first: a process that exchanges a folder at that very moment is not noticed there.
    """
    one, other = object(), object()
    try:
        _CONFINED.update({one: os.path.abspath(folder), other: os.path.realpath(folder)})  # noqa: PTH100 # links stay
        yield
    finally:
        _CONFINED.pop(one, None)
        _CONFINED.pop(other, None)


def _split_confined(path: Path) -> tuple[str, tuple[str, ...]] | None:
    """Return the outermost confined folder that holds a path, and the names from there to it; None: there is none."""
    place = Path(os.path.abspath(path))  # noqa: PTH100 # links are not followed
    for root in sorted(set(_CONFINED.copy().values()), key=len):
        if place.is_relative_to(root) and place != Path(root):
            return root, place.relative_to(root).parts
    return None


def is_link(path: Path) -> bool:
    """Return whether a path is a link, or what Windows calls a junction."""
    try:
        status = path.lstat()
    except OSError:
        return False
    junction = getattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", -1)
    return stat.S_ISLNK(status.st_mode) or getattr(status, "st_reparse_tag", 0) == junction


@contextmanager
def _reached(folder: Path, *, create: bool = False) -> Iterator[int | None]:
    """Give a handle of a folder in a confined one; None: it is in none, or the system has no handles of folders."""
    inside = _split_confined(folder / "name")
    if inside is None:
        if create:
            folder.mkdir(parents=True, exist_ok=True)
        yield None
        return
    root, names = inside
    place = Path(root)
    if create:
        place.mkdir(parents=True, exist_ok=True)
    handle = os.open(root, _FOLDER) if _BY_HANDLE else None
    try:
        for name in names[:-1]:
            place /= name
            if create:
                with suppress(FileExistsError):
                    os.mkdir(place if handle is None else name, dir_fd=handle)
            if is_link(place):
                what = f"{place}: is a link, required a folder: nothing is written outside of {root}; remove the link,"
                raise ExportError(f"{what} or give another name")
            if handle is not None:
                outer, handle = handle, os.open(name, _FOLDER | _NO_LINK, dir_fd=handle)
                os.close(outer)
            elif create and not place.is_dir():
                raise NotADirectoryError(errno.ENOTDIR, "Not a directory", str(place))
        yield handle
    finally:
        if handle is not None:
            os.close(handle)


def make_folder(folder: Path) -> None:
    """Create a folder and its parents. Raises ExportError: it cannot be, or a link is on the way in a confined one."""
    try:
        with _reached(folder, create=True):
            pass
    except OSError as error:
        if isinstance(error, FileExistsError | NotADirectoryError) and os.path.lexists(folder):
            raise ExportError(f"{folder}: is a file; give the name of a new or an empty folder") from error
        raise write_error(folder, error) from error


def put_in_place(temporary: Path, target: Path) -> None:
    """Rename a file, or a folder, to another name in its folder; a file or a link of that name is replaced.

    Raises OSError: it cannot be renamed. ExportError: a link is on the way in a confined folder.
    """
    with _reached(target.parent) as folder:
        if folder is None:
            temporary.replace(target)
        else:
            os.replace(temporary.name, target.name, src_dir_fd=folder, dst_dir_fd=folder)


def remove(path: Path) -> None:
    """Remove a file, a link, or a folder with all that is in it; nothing that a link in a confined folder leads to."""
    with suppress(OSError, ExportError), _reached(path.parent):
        if path.is_dir() and not is_link(path):
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


def check_own(path: Path, opened: IO[bytes] | None = None) -> None:
    """Raise ExportError unless a path is free, or a file of that name alone: what we write into is not another's."""
    with suppress(OSError):  # it is free, or cannot be reached
        status = path.lstat() if opened is None else os.fstat(opened.fileno())
        if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
            what = f"{path}: is a link, a folder, a pipe or a device, or a file that has another name, too;"
            raise ExportError(f"{what} required a file that lipmotion writes itself; remove it, or give another folder")


def open_own(path: Path, buffering: int = -1) -> IO[bytes]:
    """Return a file that we add to, created if needed, open for reading and writing at its end.

    Raises ExportError: it is no file of that name alone, or a link is on the way. OSError: it cannot be opened.
    """
    check_own(path)
    file = None
    try:
        with _reached(path.parent) as folder:
            flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | _NO_LINK | _BINARY
            place = path if folder is None else path.name
            file = os.fdopen(os.open(place, flags, 0o666, dir_fd=folder), "a+b", buffering)
        check_own(path, file)
        return file
    except BaseException:
        if file is not None:
            file.close()
        raise


def _check_parent(target: Path) -> None:
    if not target.parent.is_dir():
        raise ExportError(f"{target}: the folder {target.parent} does not exist; create it first")


def _prefix(target: Path) -> str:
    """Return the prefix of temporary names for a target on this machine; for a temporary target, its own name first."""
    name = f"{platform.node()}/{target.name}".encode(errors="surrogatepass")
    first = f"{target.stem}-" if target.name.startswith(TEMPORARY) else TEMPORARY
    return f"{first}{hashlib.sha256(name).hexdigest()[:8]}-"


def remove_left_files(target: Path) -> None:
    """Remove the unfinished files that killed runs on this machine left beside a target."""
    prefix = _prefix(target)
    with suppress(OSError):  # a folder that may be written to, but not listed
        for left in target.parent.glob(f"{prefix}*"):
            process = left.name[len(prefix) :].split("-")[0]
            try:
                if sys.platform != "win32":
                    os.kill(int(process), 0)
                elif time.time() - left.stat().st_mtime > 3600:  # there signal 0 would end the process
                    remove(left)
            except ProcessLookupError:
                remove(left)
            except (OSError, OverflowError, ValueError):  # a process of another user, or no number of one
                continue


def find_place(target: Path) -> Path:
    """Return the path that an output is written to; for a link, that of its target, so that the link remains.

    Raises ExportError: a pipe or a device, which a file would replace, as ``/dev/null``; an endless link.
    """
    if _split_confined(target):
        return target
    with suppress(OSError):
        if not (stat.S_ISREG(mode := target.stat().st_mode) or stat.S_ISDIR(mode)):
            raise ExportError(f"{target}: is a pipe or a device, required a file; -o - prints motion and cues")
    try:
        place = Path(os.path.realpath(target)) if target.is_symlink() else target
        endless = place.is_symlink()
    except OSError as error:
        raise write_error(target, error) from error
    if endless:
        raise ExportError(f"{target}: is a link that leads back to itself; give the name of a file")
    return place


@contextmanager
def _replace(target: Path, place: Path, *, folder: bool) -> Iterator[Path]:
    _check_parent(place)
    temporary = place.with_name(f"{_prefix(place)}{os.getpid()}-{uuid.uuid4().hex[:8]}{target.suffix.lower()}")
    try:
        with _reached(place.parent):
            temporary.mkdir() if folder else remove_left_files(place)
        yield temporary
        put_in_place(temporary, place)
    except OSError as error:
        raise write_error(target, error) from error
    finally:
        remove(temporary)


def atomic_file(target: Path) -> AbstractContextManager[Path]:
    """Give a temporary path to write to, with the target's suffix (lower case); rename it to ``target`` on success.

    Where ``target`` is a link, the file that it points to is written; in a confined folder the file replaces the link.
    Raises ExportError: the folder does not exist, or the file cannot be written (disk full, no permission).
    """
    return _replace(target, find_place(target), folder=False)


def replace_folder(target: Path) -> AbstractContextManager[Path]:
    """Give a temporary folder, which becomes ``target`` on success. Raises ExportError: it cannot be written."""
    return _replace(target, target, folder=True)


@contextmanager
def create_folders(folders: Iterable[Path]) -> Iterator[None]:
    """Create folders; if the block fails, remove those that are new. Raises ExportError: one cannot be created."""
    made: list[Path] = []
    try:
        for folder in sorted(folders):
            missing = [each for each in (folder, *folder.parents) if not each.exists()]
            try:
                make_folder(folder)
            finally:
                made += reversed(missing)
        yield
    except BaseException:
        for folder in reversed(made):
            with suppress(OSError):  # it was not made, or something else is in it by now
                folder.rmdir()
        raise


def write_error(target: Path, error: OSError) -> ExportError:
    """Return the error that says why something cannot be written."""
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, None)  # None: NumPy, on a short write
    reason = error.strerror or ("No space left on device" if full else str(error))
    return ExportError(f"{target}: cannot be written: {reason}{'; make room, then run it again' if full else ''}")


def sound_reference(sound: Path, path: Path) -> str:
    """Return the path of a sound from the folder of another file, with slashes; on another drive its name alone."""
    try:
        relative = os.path.relpath(sound, path.parent)
    except ValueError:
        relative = sound.name
    return as_text(relative.replace(os.sep, "/"))
