"""XMP metadata in ``.mp4`` files: a packet of XML in a box of its own at the end of the file."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from lipmotion.errors import ExportError, InputError

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
    size = path.stat().st_size
    ends = [start + length for start, length, _, _ in _boxes(path)]
    if not ends or ends[-1] != size:
        raise ExportError(f"{path}: {size} bytes that are not whole boxes of an mp4 file; write the video again")
    with path.open("ab") as file:
        file.write(struct.pack(">I4s", 24 + len(content), b"uuid") + XMP_UUID + content)


def read_xmp(path: Path) -> str | None:
    """Return the XMP packet of an mp4 file, the first if there are several; None: it has none.

    Raises InputError: the packet is longer than ``LARGEST_PACKET`` bytes, or not UTF-8.
    """
    for start, length, kind, content in _boxes(path):
        with path.open("rb") as file:
            file.seek(content)
            if kind != b"uuid" or file.read(16) != XMP_UUID:
                continue
            if length > LARGEST_PACKET + 24:
                raise InputError(f"{path}: XMP metadata of {length} bytes, at most {LARGEST_PACKET} are read")
            try:
                return file.read(start + length - file.tell()).decode()
            except UnicodeDecodeError as error:
                raise InputError(f"{path}: XMP metadata that is not UTF-8 ({error}); write it again") from error
    return None


def _boxes(path: Path) -> Iterator[tuple[int, int, bytes, int]]:
    """Yield start, length, type and start of the content of the outermost boxes, in bytes."""
    size, start = path.stat().st_size, 0
    with path.open("rb") as file:
        while start + 8 <= size:
            file.seek(start)
            length, kind = struct.unpack(">I4s", file.read(8))
            if length == 1 and start + 16 <= size:
                length = struct.unpack(">Q", file.read(8))[0]
            if length < file.tell() - start:  # 0: until the end of the file, so nothing may follow; others: damaged
                return
            yield start, length, kind, file.tell()
            start += length
