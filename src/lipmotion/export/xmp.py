"""XMP metadata in ``.mp4`` files: a packet of XML in a box of its own at the end of the file."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from lipmotion.errors import ExportError, InputError
from lipmotion.storage.files import check_source

XMP_UUID = bytes.fromhex("be7acfcb97a942e89c71999491e3afac")
"""What says that a box of type ``uuid`` holds XMP (Adobe, XMP Specification Part 3)."""
LARGEST_PACKET = 1 << 24
"""Most bytes of a packet, which is read into the memory as a whole."""


def append_xmp(path: Path, packet: str) -> None:
    """Append a packet to an mp4 file; nothing in the file moves, so all its offsets remain valid.

    Raises ExportError: the file does not consist of whole boxes, or the packet is too large.
    """
    content = packet.encode()
    if len(content) > LARGEST_PACKET:
        raise ExportError(f"{path}: XMP metadata of {len(content)} bytes, at most {LARGEST_PACKET} are possible")
    with path.open("r+b") as file:
        ends = [start + length for start, length, _ in _boxes(file)]
        if not ends or ends[-1] != file.seek(0, os.SEEK_END):
            raise ExportError(
                f"{path}: {file.tell()} bytes that are not whole boxes of an mp4 file; write the video again"
            )
        file.write(struct.pack(">I4s", 24 + len(content), b"uuid") + XMP_UUID + content)


def read_xmp(path: Path) -> str | None:
    """Return the XMP packet of an mp4 file, the first if there are several; None: it has none.

    Raises InputError: no such file, or the packet is longer than ``LARGEST_PACKET`` bytes, or not UTF-8.
    """
    check_source(path, "video")
    with path.open("rb") as file:
        for start, length, kind in _boxes(file):
            if kind != b"uuid" or file.read(16) != XMP_UUID:
                continue
            if length > LARGEST_PACKET + 32:
                raise InputError(f"{path}: XMP metadata of {length} bytes, at most {LARGEST_PACKET} are read")
            try:
                return file.read(max(0, start + length - file.tell())).decode()
            except UnicodeDecodeError as error:
                raise InputError(f"{path}: XMP metadata that is not UTF-8 ({error}); write it again") from error
    return None


def _boxes(file: IO[bytes]) -> Iterator[tuple[int, int, bytes]]:
    """Yield start, length in bytes and type of the outermost boxes, with the file at the start of their content."""
    size, start = file.seek(0, os.SEEK_END), 0
    while start + 8 <= size:
        file.seek(start)
        length, kind = struct.unpack(">I4s", file.read(8))
        if length == 1 and start + 16 <= size:
            length = struct.unpack(">Q", file.read(8))[0]
        if length < file.tell() - start:  # 0: until the end of the file, so nothing may follow; others: damaged
            return
        yield start, length, kind
        start += length
