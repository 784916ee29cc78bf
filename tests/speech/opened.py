"""Which files of a folder a piece of code opens, as Linux tells it."""

import ctypes
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

OPENED = 0x20
"""``IN_OPEN`` of ``inotify``."""
HEADER = struct.Struct("iIII")


@contextmanager
def opened_in(folder: Path) -> Iterator[set[str]]:
    """Give a set that holds, at the end of the block, the names of the files in the folder that were opened in it."""
    names: set[str] = set()
    system = ctypes.CDLL(None, use_errno=True)
    watch = system.inotify_init1(os.O_NONBLOCK)
    try:
        assert system.inotify_add_watch(watch, os.fsencode(folder), OPENED) > 0, os.strerror(ctypes.get_errno())
        yield names
        with suppress(BlockingIOError):  # nothing was
            names |= _names(os.read(watch, 1 << 20))
    finally:
        os.close(watch)


def _names(events: bytes) -> set[str]:
    names, start = set(), 0
    while start < len(events):
        length = HEADER.unpack_from(events, start)[3]
        start += HEADER.size + length
        names.add(os.fsdecode(events[start - length : start].rstrip(b"\0")))
    return names
