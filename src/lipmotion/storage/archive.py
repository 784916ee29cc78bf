"""Archives of arrays with a JSON header: zip files without pickle, with equal bytes for equal content."""

from __future__ import annotations

import io
import logging
import math
import struct
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lipmotion.errors import ModelFormatError, shorten
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.types import ParallelMap

HEADER, ARRAY = "header.json", ".npy"
OLDEST_DATE = (1980, 1, 1, 0, 0, 0)  # the date of all members of an archive
ZIP64_BYTES = 1 << 30  # arrays from so many bytes on are written with the zip64 extension
UNREADABLE = (
    *(OSError, EOFError, KeyError, ValueError, TypeError, RuntimeError),
    *(zlib.error, struct.error, zipfile.BadZipFile),
)
"""The errors that reading a damaged zip, or one of other content, may raise."""
LAST_LETTER = 0x10FFFF  # the last code point of Unicode
SMALL_ARCHIVE_BYTES, LARGEST_RATIO = 1 << 26, 20
"""An archive may have so many bytes uncompressed, or so many times its own size: our arrays are compressed to half
their size, zip bombs to a thousandth."""


def write_archive(
    path: Path, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], *, compressed: bool = True
) -> None:
    """Write an archive, whole or not at all. Raises ExportError: it cannot be written."""
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with atomic_file(path) as unfinished, zipfile.ZipFile(unfinished, "w") as file:
        file.writestr(_member(HEADER, method), as_json(header, indent=1, ensure_ascii=False).encode())
        for name, array in sorted(arrays.items()):
            with file.open(_member(f"{name}{ARRAY}", method), "w", force_zip64=array.nbytes >= ZIP64_BYTES) as member:
                np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)


def read_archive_header(path: Path) -> Any:
    """Return the header of an archive. Raises one of ``UNREADABLE``: it is damaged, or no archive."""
    with zipfile.ZipFile(path) as file:
        check_archive(file)
        return from_json(file.read(HEADER))


def read_header_of(path: Path, form: str, version: int, what: str, remedy: str) -> dict[str, Any]:
    """Return the header of an archive of a format. Raises ModelFormatError: of another one or version, or damaged.

    what, remedy : the name of such an archive, as ``face``, and what its user can do
    """
    try:
        header = read_archive_header(path)
    except UNREADABLE as error:
        raise ModelFormatError(f"{path}: not a {what} ({shorten(str(error))}); {remedy}") from error
    if not isinstance(header, dict) or header.get("format") != form:
        raise ModelFormatError(f"{path}: not a {what}; {remedy}")
    if header.get("version") != version:
        stated = f"{path}: {what.rsplit(maxsplit=1)[-1]} version {shorten(str(header.get('version')))}"
        raise ModelFormatError(f"{stated}, this lipmotion reads version {version}; upgrade lipmotion, or {remedy}")
    return header


def read_archive(path: Path) -> dict[str, NDArray[Any]]:
    """Return all arrays of an archive, by name. Raises one of ``UNREADABLE``: any byte of it is wrong."""
    with zipfile.ZipFile(path) as file:
        check_archive(file)
        members = {name: file.read(name) for name in file.namelist() if name != HEADER}  # whole: checksums come first
    unknown = next((name for name in members if not name.endswith(ARRAY)), None)
    if unknown is not None:
        raise ValueError(f"undeclared {unknown!r}, which is no array")
    return {name.removesuffix(ARRAY): take_array(content) for name, content in members.items()}


def read_shipped_arrays(name: str) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file of the package's models."""
    path = resources.files("lipmotion") / "models" / name
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        return dict(stored)


def check_archive(file: zipfile.ZipFile) -> None:
    """Raise ValueError if members of a zip share a name, may fill the memory, or have an unknown compression."""
    members, names = file.infolist(), file.namelist()
    if len(set(names)) < len(names):
        raise ValueError(f"the part {next(name for name in names if names.count(name) > 1)!r} is in it twice")
    size = sum(member.file_size for member in members)
    largest = max(SMALL_ARCHIVE_BYTES, LARGEST_RATIO * Path(str(file.filename)).stat().st_size)
    if size > largest:
        raise ValueError(f"its parts would grow to {size} bytes, required at most {largest}")
    if any(member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for member in members):
        raise ValueError("its parts are compressed in an unknown way, required: deflated or stored")


def take_array(content: bytes) -> NDArray[Any]:
    """Return the array of a ``.npy`` file's content.

    Raises ValueError: no array, pickled objects, or more or fewer bytes than the header declares; sizes are compared
    before memory is allocated.
    """
    stream = io.BytesIO(content)
    try:
        read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[npy.read_magic(stream)]
        shape, _, dtype = read_header(stream)
    except Exception as error:  # the header is parsed as Python, which raises many kinds of errors
        raise ValueError(f"not an array ({type(error).__name__}: {error})") from error
    required, size = math.prod(shape) * dtype.itemsize, len(content) - stream.tell()
    if dtype.hasobject or not dtype.itemsize or required != size:
        raise ValueError(f"an array of {dtype} of shape {shape} in {size} bytes, required {required} bytes of numbers")
    if dtype.kind == "U" and size and np.frombuffer(content[-size:], dtype.byteorder + "u4").max() > LAST_LETTER:
        raise ValueError("texts with characters that do not exist")
    stream.seek(0)
    return npy.read_array(stream, allow_pickle=False)


def _member(name: str, method: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, OLDEST_DATE)
    info.compress_type = method
    return info


LOG = logging.getLogger("lipmotion")
CHECKPOINT, CHECKPOINT_FORMAT = ".checkpoint", "lipmotion.checkpoint"


@dataclass(frozen=True)
class Checkpoint:
    """A folder with one file for each stage of a job; without a folder, nothing is stored and nothing found.

    folder       : an existing one
    fingerprint  : of everything that the result depends on; a checkpoint with another fingerprint is not used
    parallel_map : distributes the work of the job; the result does not depend on it
    """

    folder: Path | None = None
    fingerprint: str = ""
    parallel_map: ParallelMap = map

    def load(self, stage: str) -> dict[str, NDArray[Any]] | None:
        """Return the arrays stored for a stage; None: there are none, or they are damaged or of another job."""
        if self.folder is None or not (path := self.folder / f"{stage}{CHECKPOINT}").is_file():
            return None
        try:
            if read_archive_header(path) != self._header():
                LOG.info("%s: of another corpus, configuration or version; not used", path)
                return None
            return read_archive(path)
        except UNREADABLE as error:
            LOG.info("%s: damaged (%s); not used", path, error)
            return None

    def save(self, stage: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Store the state of a stage, replacing an earlier one. Raises ExportError: it cannot be written."""
        if self.folder is not None:
            write_archive(self.folder / f"{stage}{CHECKPOINT}", self._header(), arrays, compressed=False)

    def _header(self) -> dict[str, str]:
        return {"format": CHECKPOINT_FORMAT, "fingerprint": self.fingerprint}


NO_CHECKPOINT = Checkpoint()  # checkpointing disabled: nothing is stored and nothing found
