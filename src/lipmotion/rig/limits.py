"""The largest meshes that files may hold: a hostile or mistaken file must not fill the memory."""

from __future__ import annotations

from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.storage.files import check_source

LARGEST_FILE = 1 << 28
"""Most bytes of a file: 256 MiB."""
MOST_VERTICES = 2_000_000
MOST_TRIANGLES = 4_000_000
MOST_SHAPES = 1_000
MOST_DISPLACEMENTS = 60_000_000
"""Vertices times blendshapes of a file: a head of 200,000 vertices may have 300."""


def file_bytes(path: Path, kind: str) -> bytes:
    """Return the content of a file of at most ``LARGEST_FILE`` bytes.

    kind : what it should be, for messages
    Raises InputError: no such file, not a file, empty, larger, or not readable.
    """
    check_source(path, kind)
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise InputError(f"{path}: {size} bytes, required at most {LARGEST_FILE}; reduce the mesh, or its textures")
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def check_count(what: str, found: int, most: int) -> None:
    """Raise InputError if there are more of something than a mesh may have."""
    if found > most:
        raise InputError(f"{found} {what}, required at most {most}; reduce the mesh")
