"""Makes Python on Linux like that on Windows, for lipmotion; used where this folder is on ``PYTHONPATH``.

lipmotion takes its branches for Windows, and finds neither POSIX's modules nor handles of folders; a locked byte is
locked for all; no file that is open or mapped can be removed, renamed or replaced. Other packages stay as they are.
"""

import fcntl
import os
import signal
import struct
import sys
from collections.abc import Callable
from importlib.machinery import SourceFileLoader
from multiprocessing import util  # noqa: F401 # stays as it is
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

WRITE_LOCK_OF_HANDLE = 37
"""``F_OFD_SETLK``, which has a name from Python 3.13 on: the lock is of the open file, as on Windows."""
get_code = SourceFileLoader.get_code


def get_windows_code(loader: SourceFileLoader, name: str) -> CodeType | None:
    """Return the code of a module; one of lipmotion's sees Windows."""
    if not name.startswith("lipmotion"):
        return get_code(loader, name)
    path = loader.get_filename(name)
    source = loader.get_data(path).decode().replace("sys.platform", "'win32'").replace("os.name", "'nt'")
    return compile(source, path, "exec", dont_inherit=True)


def refuse_in_use(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function on files that this process may neither have open nor mapped."""

    def refuse(*paths: Any, **places: Any) -> Any:
        used = {os.path.realpath(handle) for handle in Path("/proc/self/fd").iterdir()}
        with open("/proc/self/maps", encoding="utf-8", errors="surrogateescape") as maps:  # noqa: PTH123
            used.update("/" + line.rstrip().partition(" /")[2] for line in maps)
        for path in paths:
            if os.path.realpath(path) in used:
                raise PermissionError(13, "The process cannot access the file because it is being used", str(path))
        return function(*paths, **places)

    return refuse


def lock_bytes(handle: int, _: int, size: int) -> None:
    """Lock bytes from where a file stands on. Raises OSError: they are locked."""
    fcntl.fcntl(handle, WRITE_LOCK_OF_HANDLE, struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_CUR, 0, size, 0))


SourceFileLoader.get_code = get_windows_code  # type: ignore[method-assign]
for name in ("unlink", "remove", "rename", "replace"):
    setattr(os, name, refuse_in_use(getattr(os, name)))
for name in (
    "fork",
    "forkpty",
    "O_NOFOLLOW",
    "O_DIRECTORY",
    "O_PATH",
    "statvfs",
    "sysconf",
    "pread",
    "chown",
    "fchown",
):
    delattr(os, name)
os.supports_dir_fd.clear()
del signal.pthread_sigmask, signal.SIGHUP
msvcrt = ModuleType("msvcrt")
vars(msvcrt).update(LK_NBLCK=2, locking=lock_bytes)
sys.modules |= {"msvcrt": msvcrt, "pwd": None, "grp": None, "termios": None, "readline": None}  # type: ignore[dict-item]
