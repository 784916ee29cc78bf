"""Arrays and a JSON header in one file: a zip, without pickle, the same bytes for the same content."""

from __future__ import annotations

import io
import math
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lipmotion.storage.files import whole_file
from lipmotion.storage.json_text import as_json, from_json

HEADER, ARRAY = "header.json", ".npy"
OLDEST_DATE = (1980, 1, 1, 0, 0, 0)
"""The date of everything in the file."""
LARGE = 1 << 30
"""Arrays of so many bytes need the zip format's large sizes."""
UNREADABLE = (
    *(OSError, EOFError, KeyError, ValueError, TypeError, RuntimeError),
    *(zlib.error, struct.error, zipfile.BadZipFile),
)
"""What reading a damaged zip, or one of something else, may raise."""
LAST_LETTER = 0x10FFFF
"""The last one of Unicode."""
SMALL_ARCHIVE, LARGEST_RATIO = 1 << 26, 20
"""Bytes that a zip may always grow to, and how many times its own size; our arrays shrink to half, bombs to a
thousandth."""


def write_archive(
    path: Path, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], *, compressed: bool = True
) -> None:
    """Write a file, whole or not at all. Raises ExportError: it cannot be written."""
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with whole_file(path) as unfinished, zipfile.ZipFile(unfinished, "w") as file:
        file.writestr(_member(HEADER, method), as_json(header, indent=1, ensure_ascii=False).encode())
        for name, array in sorted(arrays.items()):
            with file.open(_member(f"{name}{ARRAY}", method), "w", force_zip64=array.nbytes >= LARGE) as member:
                np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)


def read_archive_header(path: Path) -> Any:
    """Return what a file says of itself. Raises one of ``UNREADABLE``."""
    with zipfile.ZipFile(path) as file:
        check_archive(file)
        return from_json(file.read(HEADER))


def read_archive(path: Path) -> dict[str, NDArray[Any]]:
    """Return all arrays of a file by name. Raises one of ``UNREADABLE``: any byte of it is wrong."""
    with zipfile.ZipFile(path) as file:
        check_archive(file)
        members = {name: file.read(name) for name in file.namelist() if name != HEADER}  # whole: checksums come first
    strange = next((name for name in members if not name.endswith(ARRAY)), None)
    if strange is not None:
        raise ValueError(f"undeclared {strange!r}, which is no array")
    return {name.removesuffix(ARRAY): array_in(content) for name, content in members.items()}


def check_archive(file: zipfile.ZipFile) -> None:
    """Raise ValueError if members of a zip share a name, could fill the memory, or are compressed in another way."""
    members, names = file.infolist(), file.namelist()
    if len(set(names)) < len(names):
        raise ValueError(f"the part {next(name for name in names if names.count(name) > 1)!r} is in it twice")
    size = sum(member.file_size for member in members)
    largest = max(SMALL_ARCHIVE, LARGEST_RATIO * Path(str(file.filename)).stat().st_size)
    if size > largest:
        raise ValueError(f"its parts would grow to {size} bytes, required at most {largest}")
    if any(member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for member in members):
        raise ValueError("its parts are compressed in an unknown way, required: deflated or stored")


def array_in(content: bytes) -> NDArray[Any]:
    """Return the array that the content of a ``.npy`` file describes.

    Raises ValueError: not one, pickled objects, or more or less bytes than its header declares: they are compared
    before anything is allocated.
    """
    stream = io.BytesIO(content)
    try:
        read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[npy.read_magic(stream)]
        shape, _, dtype = read_header(stream)
    except Exception as error:  # the header is read as a piece of Python, which fails in many ways
        raise ValueError(f"not an array ({type(error).__name__}: {error})") from error
    wanted, found = math.prod(shape) * dtype.itemsize, len(content) - stream.tell()
    if dtype.hasobject or not dtype.itemsize or wanted != found:
        raise ValueError(f"an array of {dtype} of shape {shape} in {found} bytes, required {wanted} bytes of numbers")
    if dtype.kind == "U" and found and np.frombuffer(content[-found:], dtype.byteorder + "u4").max() > LAST_LETTER:
        raise ValueError("texts of letters that there are not")
    stream.seek(0)
    array: NDArray[Any] = npy.read_array(stream, allow_pickle=False)
    return array


def _member(name: str, method: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, OLDEST_DATE)
    info.compress_type = method
    return info
