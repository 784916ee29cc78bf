"""XMP metadata in ``.mp4`` files: a packet of XML in a box of its own at the end of the file."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from lipmotion.errors import ExportError

XMP_UUID = bytes.fromhex("be7acfcb97a942e89c71999491e3afac")
"""What says that a box of type ``uuid`` holds XMP (Adobe, XMP Specification Part 3)."""
LARGEST_PACKET_BYTES = 1 << 24
"""Most bytes of a packet, which programs read into the memory as a whole."""


def append_xmp(path: Path, packet: str) -> None:
    """Append a packet to an mp4 file; nothing in the file moves, so all its offsets remain valid.

    Raises ExportError: the file does not consist of whole boxes, or the packet is too large.
    """
    content = packet.encode()
    if len(content) > LARGEST_PACKET_BYTES:
        raise ExportError(f"{path}: XMP metadata of {len(content)} bytes, at most {LARGEST_PACKET_BYTES} are possible")
    with path.open("r+b") as file:
        ends = list(_ends(file))
        if not ends or ends[-1] != file.seek(0, os.SEEK_END):
            raise ExportError(
                f"{path}: {file.tell()} bytes that are not whole boxes of an mp4 file; write the video again"
            )
        file.write(struct.pack(">I4s", 24 + len(content), b"uuid") + XMP_UUID + content)


def _ends(file: IO[bytes]) -> Iterator[int]:
    """Yield where each of the outermost boxes ends."""
    size, start = file.seek(0, os.SEEK_END), 0
    while start + 8 <= size:
        file.seek(start)
        (length,) = struct.unpack(">I4x", file.read(8))
        if length == 1 and start + 16 <= size:
            length = struct.unpack(">Q", file.read(8))[0]
        if length < file.tell() - start:  # 0: until the end of the file, so nothing may follow; others: damaged
            return
        start += length
        yield start
