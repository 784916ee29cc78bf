"""Arrays and a JSON header in one file: a zip, without pickle, the same bytes for the same content."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.files import whole_file

HEADER = "header.json"
OLDEST_DATE = (1980, 1, 1, 0, 0, 0)
"""The date of everything in the file."""
LARGE = 1 << 30
"""Arrays of so many bytes need the zip format's large sizes."""
UNREADABLE = (OSError, EOFError, KeyError, ValueError, TypeError, RuntimeError, zlib.error, zipfile.BadZipFile)
"""What reading a damaged zip, or one of something else, may raise."""


def write_archive(
    path: Path, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], *, compressed: bool = True
) -> None:
    """Write a file, whole or not at all. Raises ExportError: it cannot be written."""
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with whole_file(path) as unfinished, zipfile.ZipFile(unfinished, "w") as file:
        file.writestr(_member(HEADER, method), json.dumps(header, indent=1, ensure_ascii=False).encode())
        for name, array in sorted(arrays.items()):
            with file.open(_member(f"{name}.npy", method), "w", force_zip64=array.nbytes >= LARGE) as member:
                np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)


def read_archive_header(path: Path) -> Any:
    """Return what a file says of itself. Raises one of ``UNREADABLE``."""
    with zipfile.ZipFile(path) as file:
        return json.loads(file.read(HEADER))


def read_archive(path: Path) -> dict[str, NDArray[Any]]:
    """Return all arrays of a file by name. Raises one of ``UNREADABLE``: any byte of it is wrong."""
    with zipfile.ZipFile(path) as file:
        members = {name: io.BytesIO(file.read(name)) for name in file.namelist()}  # whole: checksums are compared first
    return {
        name.removesuffix(".npy"): np.lib.format.read_array(member, allow_pickle=False)
        for name, member in members.items()
        if name != HEADER
    }


def _member(name: str, method: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, OLDEST_DATE)
    info.compress_type = method
    return info
