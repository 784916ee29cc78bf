"""Folders on which one process works at a time: locked, temporary, of unfinished work."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

from lipmotion.errors import ExportError
from lipmotion.storage import files

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

LOCK = f"{files.TEMPORARY}lock"  # the file that a process locks while it works on a folder
FOLDER_PREFIX = "lipmotion-"  # prefix of folders in the system's place for temporary files
UNFINISHED = ".unfinished"  # suffix of a folder of unfinished work, after the name of the file that the work is for


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Lock a folder, created if needed, for this process, and confine it (``confine``).

    The system releases the lock when the process ends in any way: no lock is left behind.
    Raises ExportError: another process has locked it, it cannot be created, or its lock is a link.
    """
    path = folder / LOCK
    file = None
    try:
        try:
            with files.confine(folder):
                files.make_folder(folder)
                try:
                    file = _open_lock(folder / LOCK)
                except OSError as error:
                    raise files.write_error(folder, error) from error
                yield
        finally:
            _release(path, file)
    except BaseException:  # an interrupt may have come during the release; a second one does not follow at once
        _release(path, file)
        raise


def _release(path: Path, file: IO[bytes] | None) -> None:
    """Delete a lock: that of ``file``, or one that no process holds (after an interrupt while it was created)."""
    with suppress(OSError, ExportError):  # there is none, it is no lock, or another process has it
        is_held = file is not None and not file.closed
        with file if file is not None and is_held else files.open_own(path, buffering=0) as lock:
            if not is_held:
                _lock(lock)
            if sys.platform == "win32":
                lock.close()
            path.unlink()


def _open_lock(path: Path) -> IO[bytes]:
    """Return the lock file, open and locked. Raises ExportError: another process has locked it."""
    while True:
        file = None
        try:
            file = files.open_own(path, buffering=0)
            _lock(file)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(file.fileno()), path.stat()):  # it is still the one of that name
                    with suppress(OSError):  # a full disk
                        file.truncate(0)
                        file.write(str(os.getpid()).encode())
                    return file
            file.close()  # the process that held it has just deleted it
        except BlockingIOError as error:
            owner = b""
            if file is not None:
                with file:
                    file.seek(0)
                    owner = file.read()
            who = owner.decode(errors="replace") or "unknown"
            what = f"{path.parent}: another lipmotion (process {who}) is at work on it; wait for it,"
            raise ExportError(f"{what} or stop it") from error
        except BaseException:
            if file is not None:
                file.close()
            raise


if sys.platform == "win32":

    def _lock(file: IO[bytes]) -> None:
        file.seek(1 << 30)  # locked bytes cannot be read, and the owner's number must be readable
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError as error:
            raise BlockingIOError from error

else:

    def _lock(file: IO[bytes]) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:  # some network file systems have no locks
            pass


@contextmanager
def open_temporary() -> Iterator[Path]:
    """Give a temporary folder, removed at the end; those that killed runs left, whose locks nobody holds, go first."""
    place = Path(tempfile.gettempdir())
    for left in place.glob(f"{FOLDER_PREFIX}*/{LOCK}"):
        with suppress(ExportError, OSError), files.confine(place):  # it is in use, or another user's
            with lock_folder(left.parent):
                remove_unfinished(left.parent, "*")
            left.parent.rmdir()
    with ExitStack() as stack:
        for is_last in (False, False, True):
            folder = Path(tempfile.mkdtemp(prefix=FOLDER_PREFIX))
            stack.callback(shutil.rmtree, folder, ignore_errors=True)
            try:
                stack.enter_context(lock_folder(folder))
                break
            except ExportError:  # another process took it for one that was left, before it was locked
                if is_last:
                    raise
        yield folder


@contextmanager
def keep_unfinished(target: Path) -> Iterator[Path]:
    """Give a locked folder beside ``target`` for the finished parts of the work on it.

    The folder is deleted when the block ends without an error; after an error, or when the process is killed, a later
    run finds the finished parts in it.
    Raises ExportError: the target could not be written, or another process is at work on it.
    """
    files.check_target(target)
    target = files.find_place(target)
    folder = name_work_folder(target)
    if files.is_link(folder):
        raise ExportError(f"{folder}: is a link, required a folder of unfinished work; remove it")
    try:
        with lock_folder(folder):
            remove_unfinished(folder)
            files.remove_left_files(target)
            try:
                yield folder
            except ExportError as error:
                raise ExportError(f"{error}; what is finished is kept in {folder}") from error
            remove_unfinished(folder, "*")
    finally:
        with suppress(OSError):  # it contains finished parts
            folder.rmdir()


def name_work_folder(target: Path) -> Path:
    """Return the path of the folder that ``keep_unfinished`` gives."""
    target = files.find_place(target)
    return target.with_name(target.name + UNFINISHED)


def remove_unfinished(folder: Path, names: str = f"{files.TEMPORARY}*") -> None:
    """Delete the unfinished files that a killed run left in ``folder``, or those of other names, but for its lock."""
    for path in folder.glob(names):
        if path.name != LOCK:
            files.remove(path)
