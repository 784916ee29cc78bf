"""Files and folders that are written whole or not at all, checks of paths, and locks.

Everything is written under a temporary name beside its target, and renamed at the end.
"""

from __future__ import annotations

import codecs
import errno
import hashlib
import os
import platform
import re
import shutil
import sys
import uuid
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from lipmotion.errors import ExportError, InputError
from lipmotion.storage.sources import Source, check_apart, is_same

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

TEMPORARY = ".part-"
"""Prefix of unfinished files' names; a killed run may leave such a file, which the next run removes."""
LOCK = f"{TEMPORARY}lock"
"""The file that a process locks while it works on a folder."""
UNFINISHED = ".unfinished"
"""Suffix of a folder of unfinished work, after the name of the file that the work is for."""


LARGEST_TEXT_BYTES = 1 << 26
"""Most bytes of a text file: more than the words that a person speaks in a year."""


def check_source(path: Path, kind: str) -> None:
    """Raise InputError unless ``path`` is a file that is not empty; ``kind`` is what it should be, for the message."""
    check_regular(path, kind)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; give a {kind}")


def sha256_of(path: Path) -> str:
    """Return the SHA-256 digest of a file's content, in hexadecimal. Raises InputError: it is no file."""
    check_regular(path, "file")
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def check_regular(path: Path, kind: str) -> None:
    """Raise InputError for a folder, a pipe or a device, which may never end; a missing file is accepted."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give one {kind}")
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is a pipe or a device, required a file; save the {kind} first")


def check_listable(folder: Path) -> None:
    """Raise InputError if a folder may not be listed: a search for files in it would find none, without an error."""
    try:
        os.scandir(folder).close()
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror or error}; ask its owner, or copy it") from error


PACKED = {b"\x1f\x8b": "a file packed with gzip", b"PK\x03\x04": "a ZIP archive (as Word's files are)"}
MARKS_OF_TEXT = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
CONTROL = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
"""Characters that no text has."""


def read_text_file(path: Path, kind: str, largest: int = LARGEST_TEXT_BYTES) -> str:
    """Return the text of a UTF-8 file, without a byte order mark.

    kind : what it should be, for messages
    Raises InputError: no such file, not a file, larger than ``largest`` bytes, or not UTF-8.
    """
    check_regular(path, f"{kind} file")
    try:
        size = path.stat().st_size
        if size > largest:
            raise InputError(f"{path}: {size} bytes, required at most {largest}: is it a {kind}?")
        return decoded_text(path.read_bytes(), str(path), kind, western=False)[0]
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such {kind} file") from error
    except OSError as error:
        raise InputError(f"{path}: not a readable UTF-8 {kind} ({error}); save it as UTF-8 text") from error


def decoded_text(content: bytes, where: str, kind: str, *, western: bool = True) -> tuple[str, bool]:
    """Return the text of a file's bytes, and whether its encoding is sure.

    It is UTF-8, UTF-16 or UTF-32, with their marks; UTF-16 without one, where every other byte of most letters is 0; or
    else, not surely, the code page of Windows in western Europe and America.
    where, kind : the file, and what it should be, for messages
    western     : whether such a code page is read
    Raises InputError: it is none of these, or holds control characters.
    """
    packed = next((name for start, name in PACKED.items() if content.startswith(start)), None)
    if packed:
        raise InputError(f"{where}: is {packed}, required a {kind} as text; unpack it, or save it as text")
    marked = next((name for mark, name in MARKS_OF_TEXT.items() if content.startswith(mark)), None)
    odd, even = content[1::2].count(0), content[::2].count(0)
    if marked is None and len(content) > 3 and max(odd, even) > len(content) // 4 > 4 * min(odd, even):
        marked = "utf-16-le" if odd > even else "utf-16-be"
    try:
        return content.decode(marked or "utf-8"), True
    except UnicodeDecodeError as error:
        try:
            text = content.decode("cp1252") if western and marked is None else "\0"
        except UnicodeDecodeError:
            text = "\0"
        if CONTROL.search(text):
            raise InputError(
                f"{where}: not a readable {marked or 'UTF-8'} {kind} ({error}); save it as UTF-8"
            ) from error
        return text, False


def check_target(target: Path, source: str | Path | None = None) -> None:
    """Raise ExportError unless a file can be written at ``target``; called before the work that leads to it.

    source : a recording that must not be overwritten
    """
    try:
        is_folder = target.is_dir()
        _check_parent(_place(target))
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


def as_text(path: str | Path) -> str:
    """Return a path as text that UTF-8 can encode: names of files may have any bytes."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")


def _check_parent(target: Path) -> None:
    if not target.parent.is_dir():
        raise ExportError(f"{target}: the folder {target.parent} does not exist; create it first")


def _temporary(target: Path, suffix: str) -> Path:
    _check_parent(target)
    return target.with_name(f"{_prefix(target)}{os.getpid()}-{uuid.uuid4().hex[:8]}{suffix.lower()}")


def _prefix(target: Path) -> str:
    """Return the prefix of temporary names for a target on this machine; for a temporary target, its own name first.

    Who sweeps up a temporary target by its name then also finds what was written towards it.
    """
    name = f"{platform.node()}/{target.name}".encode(errors="surrogatepass")
    first = f"{target.stem}-" if target.name.startswith(TEMPORARY) else TEMPORARY
    return f"{first}{hashlib.sha256(name).hexdigest()[:8]}-"


def _sweep(target: Path) -> None:
    """Remove the unfinished files that killed runs on this machine left beside a target."""
    prefix = _prefix(target)
    with suppress(OSError):  # a folder that may be written to, but not listed
        for left in target.parent.glob(f"{prefix}*"):
            if not _is_alive(left.name[len(prefix) :].split("-")[0]):
                _remove(left)


def _is_alive(process: str) -> bool:
    """Return whether a process may still be running; on Windows False, as it deletes no file that is open."""
    if sys.platform == "win32" or not process.isdigit():
        return sys.platform != "win32"
    try:
        os.kill(int(process), 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True  # a process of another user
    return True


def _place(target: Path) -> Path:
    """Return the path that an output is written to; for a link, that of its target, so that the link remains."""
    try:
        place = Path(os.path.realpath(target)) if target.is_symlink() else target
        endless = place.is_symlink()
    except OSError as error:
        raise _refused(target, error) from error
    if endless:
        raise ExportError(f"{target}: is a link that leads back to itself; give the name of a file")
    return place


@contextmanager
def whole_file(target: Path, *, follow: bool = True) -> Iterator[Path]:
    """Give a temporary path to write to, with the target's suffix (lower case); rename it to ``target`` on success.

    follow : where ``target`` is a link, write the file that it points to; otherwise the file replaces the link
    Raises ExportError: the folder does not exist, or the file cannot be written (disk full, no permission).
    """
    place = _place(target) if follow else target
    temporary = _temporary(place, target.suffix)
    try:
        _sweep(place)
        yield temporary
        temporary.replace(place)
    except OSError as error:
        raise _refused(target, error) from error
    finally:
        with suppress(OSError):
            temporary.unlink()


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Give a temporary folder to fill; rename it to ``target``, which must not exist, on success.

    Raises ExportError: the parent does not exist, or something cannot be written.
    """
    temporary = _temporary(target, target.suffix)
    try:
        temporary.mkdir()
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise _refused(target, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def made_folders(folders: Iterable[Path]) -> Iterator[None]:
    """Create folders, with those that hold them; if the block fails, remove those that were not there before.

    Raises ExportError: a folder cannot be created.
    """
    made: list[Path] = []
    try:
        for folder in sorted(folders):
            missing = [each for each in (folder, *folder.parents) if not each.exists()]
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise _refused(folder, error) from error
            finally:
                made += reversed(missing)
        yield
    except BaseException:
        for folder in reversed(made):
            with suppress(OSError):  # it was not made, or something else is in it by now
                folder.rmdir()
        raise


def _refused(target: Path, error: OSError) -> ExportError:
    full = (
        error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) or error.errno is None
    )  # None: NumPy, on a short write
    reason = error.strerror or ("No space left on device" if full else str(error))
    return ExportError(f"{target}: cannot be written: {reason}{'; make room, then run it again' if full else ''}")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder, created if needed, for this process.

    The system releases the lock when the process ends in any way: no lock is left behind.
    Raises ExportError: another process has locked it, or it cannot be created.
    """
    path = folder / LOCK
    file = None
    try:
        try:
            file = _lock_in(folder)
            yield
        finally:
            _release(path, file)
    except BaseException:  # an interrupt may have come during the release; a second one does not follow at once
        _release(path, file)
        raise


def _lock_in(folder: Path) -> IO[bytes]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return _open_lock(folder / LOCK)
    except FileExistsError as error:
        raise ExportError(f"{folder}: is a file; give the name of a new or an empty folder") from error
    except OSError as error:
        raise _refused(folder, error) from error


def _release(path: Path, file: IO[bytes] | None) -> None:
    """Delete a lock: that of ``file``, or one that no process holds (after an interrupt while it was created)."""
    with suppress(OSError):  # there is none, or another process has it
        is_held = file is not None and not file.closed
        with file if file is not None and is_held else path.open("r+b", buffering=0) as lock:
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
            file = path.open("a+b", buffering=0)
            _lock(file)
            if _is_there(path, file):
                with suppress(OSError):  # a full disk
                    file.truncate(0)
                    file.write(str(os.getpid()).encode())
                return file
            file.close()  # the process that held it has just deleted it
        except BlockingIOError as error:
            raise _busy(path, file) from error
        except BaseException:
            if file is not None:
                file.close()
            raise


def _is_there(path: Path, file: IO[bytes]) -> bool:
    """Return whether the open file is still the one at a path."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _busy(path: Path, file: IO[bytes] | None) -> ExportError:
    owner = b""
    if file is not None:
        with file:
            file.seek(0)
            owner = file.read()
    who = owner.decode(errors="replace") or "unknown"
    return ExportError(f"{path.parent}: another lipmotion (process {who}) is at work on it; wait for it, or stop it")


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
def unfinished_work(target: Path) -> Iterator[Path]:
    """Give a locked folder beside ``target`` for the finished parts of the work on it.

    The folder is deleted when the block ends without an error; after an error, or when the process is killed, a later
    run finds the finished parts in it.
    Raises ExportError: the target could not be written, or another process is at work on it.
    """
    check_target(target)
    target = _place(target)
    folder = work_folder(target)
    try:
        with locked(folder):
            remove_unfinished(folder)
            _sweep(target)
            try:
                yield folder
            except ExportError as error:
                raise ExportError(f"{error}; what is finished is kept in {folder}") from error
            for path in folder.iterdir():
                if path.name != LOCK:
                    _remove(path)
    finally:
        with suppress(OSError):  # it contains finished parts
            folder.rmdir()


def work_folder(target: Path) -> Path:
    """Return the path of the folder that ``unfinished_work`` gives."""
    target = _place(target)
    return target.with_name(target.name + UNFINISHED)


def remove_unfinished(folder: Path) -> None:
    """Delete the unfinished files that a killed run left in ``folder``."""
    for path in folder.glob(f"{TEMPORARY}*"):
        if path.name != LOCK:
            _remove(path)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()
