"""The inputs of a call: reading them, what a file is by its content, recordings, and that no output overwrites one."""

from __future__ import annotations

import codecs
import csv
import ctypes
import hashlib
import logging
import os
import re
import stat
import zlib
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from lipmotion.errors import ExportError, InputError
from lipmotion.types.values import parse_clock

LOG = logging.getLogger("lipmotion")
AUDIO_SUFFIXES = frozenset(f".{name}" for name in "aac aif aiff flac m4a mp3 oga ogg opus wav wma".split())
VIDEO_SUFFIXES = frozenset(
    f".{name}" for name in "3gp avi flv m2ts m4v mkv mov mp4 mpeg mpg mts mxf ogv ts vob webm wmv".split()
)


@dataclass(frozen=True)
class Source:
    """A file or a folder that a call reads.

    kind        : what it is, in a word: ``recording``, ``corpus``
    replaceable : whether it is a file that is read whole before anything is written, so an output may replace it
    """

    path: Path
    kind: str
    replaceable: bool = False


def check_apart(
    targets: Iterable[Path], sources: Iterable[Source], *, folders: Iterable[Path] = (), force: bool = False
) -> None:
    """Raise ExportError if writing would overwrite what the same call reads.

    folders : folders to be filled or emptied
    Files are compared by device and inode, whatever their names, through links of both kinds. No output may lie in a
    folder that is read, and no input in a folder that is written.
    """
    files, folders = list(targets), list(folders)
    for source in sources:
        for target in [*files, *folders]:
            clash = _find_clash(target, source.path, holds=target in folders)
            if clash == "is" and source.replaceable and force:
                continue
            if clash:
                itself = " itself" if clash == "is" else f" {source.path}"
                way_out = ", or add --force to replace it" if clash == "is" and source.replaceable else ""
                raise ExportError(f"{target}: {clash} the {source.kind}{itself}; give another name{way_out}")


def _find_clash(target: Path, source: Path, *, holds: bool) -> str:
    """Return how an output and an input clash: ``is``, ``lies in``, ``belongs to``, ``holds``; "": they do not."""
    place = Path(os.path.realpath(target))
    if is_same(place, source):
        return "is"
    if is_folder(source):
        if any(is_same(folder, source) for folder in place.parents):
            return "lies in"
        inside = (Path(root) / name for root, _, names in os.walk(source) for name in names)  # or a link to it
        if _status(place) and not is_folder(place) and any(is_same(file, place) for file in inside):
            return "belongs to"
    parents = Path(os.path.realpath(source)).parents if holds and _status(source) else ()
    return "holds" if any(is_same(place, parent) for parent in parents) else ""


def is_folder(path: Path) -> bool:
    """Return whether a folder exists; False also for names that are not valid."""
    status = _status(path)
    return status is not None and stat.S_ISDIR(status.st_mode)


def is_file(path: Path) -> bool:
    """Return whether a file exists; False also for names that are not valid, as empty ones and those too long."""
    status = _status(path)
    return status is not None and stat.S_ISREG(status.st_mode)


def is_recording(path: Path) -> bool:
    """Return whether a file is a recording, by its name."""
    return path.suffix.lower() in AUDIO_SUFFIXES | VIDEO_SUFFIXES


def is_same(path: str | Path, other: str | Path) -> bool:
    """Return whether two names, links followed, are of one existing file or folder."""
    one, two = _status(path), _status(other)
    return one is not None and two is not None and os.path.samestat(one, two)


def _status(path: str | Path) -> os.stat_result | None:
    """Return the status of a file or folder; None: there is none, or the name is not valid."""
    try:
        return Path(path).stat()
    except (OSError, ValueError):
        return None


LARGEST_TEXT_BYTES = 1 << 26  # most bytes of a text file: more than the words that a person speaks in a year
MARKS_OF_TEXT = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
CONTROL = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f\ufffd]")  # characters that no text has


def read_text_file(path: Path, kind: str, largest: int = LARGEST_TEXT_BYTES, *, western: bool = False) -> str:
    """Return the text of a file in UTF-8, UTF-16 or UTF-32, without a byte order mark.

    UTF-16 may be without its mark, where every other byte of most letters is 0.
    western : what is none of these is in the code page of Windows in western Europe and America; a warning says so
    Raises InputError: no such file, not a file, larger than ``largest`` bytes, or no such text.
    """
    check_regular(path, f"{kind} file")
    try:
        size = path.stat().st_size
        if size > largest:
            raise InputError(f"{path}: {size} bytes, required at most {largest}: is it a {kind}?")
        check_kind(path, "text", kind)
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such {kind} file") from error
    except OSError as error:
        raise InputError(f"{path}: not a readable {kind} ({error.strerror or error})") from error
    encoding = next((name for mark, name in MARKS_OF_TEXT.items() if content.startswith(mark)), "utf-8")
    odd, even = content[1::2].count(0), content[::2].count(0)
    if encoding == "utf-8" and max(odd, even) > len(content) // 4 > 4 * min(odd, even):
        encoding = "utf-16-le" if odd > even else "utf-16-be"
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", "replace") if western and encoding == "utf-8" else "\0"
        if CONTROL.search(text):
            what = f"{path}: not a readable {encoding.upper()} {kind} ({error});"
            raise InputError(f"{what} save it as UTF-8 text") from error
    LOG.warning("%s: not UTF-8; read as Windows-1252 (western Europe); save it as UTF-8 if letters are wrong", path)
    return text


@cache
def read_shipped_table(package: str, name: str) -> list[dict[str, str]]:
    """Return the rows of a table that is a file of a package: fields by the names of their columns."""
    return list(csv.DictReader(resources.files(package).joinpath(name).read_text(encoding="ascii").splitlines()))


def check_source(path: Path, kind: str) -> None:
    """Raise InputError unless ``path`` is a file that is not empty; ``kind`` is what it should be, for the message."""
    check_regular(path, kind)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; give a {kind}")
    check_kind(path, kind)


def hash_file(path: Path) -> str:
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


HEAD, TAIL = 4096, 1 << 16
"""Bytes of the beginning and of the end of a file, that say what it is; a .zip has its names at the end."""
_NO_MISTAKE = {
    "recording": {"sound"},
    "video": {"sound", "picture", "archive"},
    "text": set[str](),
    "motion file": {"archive", "picture"},
}
"""Groups that may be what is wanted; of anything else: archives, pictures and sound."""


@cache
def _read_kinds() -> list[tuple[str, str, str, int, bytes]]:
    """Return group, name, next step, place (-1: anywhere in the tail, -2: in the head) and mark of kinds of files."""
    steps = {row["group"]: row["next"] for row in read_shipped_table("lipmotion.storage", "next_steps.csv")}
    rows = read_shipped_table("lipmotion.storage", "file_kinds.csv")
    marks = (row["mark"].encode().decode("unicode_escape").encode("latin-1") for row in rows)
    kinds = ((row["group"], row["name"], steps[row["group"]], int(row["at"])) for row in rows)
    return [(*kind, mark) for kind, mark in zip(kinds, marks, strict=True)]


def check_kind(path: Path, wanted: str, kind: str = "") -> None:
    """Raise InputError for a file that is known to be no ``wanted`` (in words: ``kind``), with the next step."""
    if not is_file(path):
        return
    with suppress(OSError), path.open("rb") as file:
        head = file.read(HEAD)
        file.seek(max(path.stat().st_size - TAIL, 0))
        tail = file.read(TAIL) if head.startswith(b"PK") else b""
        unpacked = b"" if head.startswith(b"\x1f\x8b") else head  # of gzip
        with suppress(zlib.error):
            unpacked = unpacked or zlib.decompressobj(31).decompress(head, HEAD)
        fine = _NO_MISTAKE.get(wanted, {"archive", "picture", "sound"})
        for group, name, next_step, at, mark in _read_kinds():
            beginnings = (head[at : at + len(mark)], unpacked[at : at + len(mark)])
            is_there = mark in (tail if at == -1 else unpacked) if at < 0 else mark in beginnings
            if is_there and group not in fine:
                raise InputError(f"{path}: is {name}, required a {kind or wanted}; {next_step}")


def is_text(path: Path) -> bool:
    """Return whether a file begins as text does."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    with suppress(UnicodeDecodeError):
        text = head.decode(
            "utf-16" if head[:2] in {b"\xff\xfe", b"\xfe\xff"} else "utf-8", "strict" if len(head) < HEAD else "ignore"
        )
        printable = all(letter.isprintable() or letter in "\t\n\r\f\ufeff" for letter in text)
        return printable and 2 * len(text) > len(head) // 2
    return False


_MEDIA = read_shipped_table("lipmotion.storage", "media_formats.csv")
MEDIA_FORMATS = [name for row in _MEDIA for name in row["formats"].split()]
"""FFmpeg's names of the container formats whose content is in the file itself. All others are refused before they
open anything: playlists (hls, concat, dash, imf), indexes (vobsub), numbered pictures (image2), addresses (sdp, rtsp),
devices."""
LARGEST_BLOCK_BYTES = 1 << 28
"""Most bytes that FFmpeg may allocate at a time: three pictures of ``MAX_PIXELS`` with four channels of 16 bits."""
MAX_PIXELS = 4096 * 2304  # most pixels of a picture: slightly more than 4K. A decoder may keep sixteen pictures.


def open_media(path: Path, *, content: Any = None) -> Any:
    """Return an open PyAV container, which the caller closes.

    content : an open file to read in its place, with its ``name``
    The name is always that of a file (in ``12:30.wav`` there is no protocol), and no other file is opened, whatever the
    content: FFmpeg itself refuses all other protocols, and all formats but ``MEDIA_FORMATS``.
    Raises ValueError: another format, or damaged. Raises the errors of PyAV.
    """
    import av

    bound_allocations()
    options = {
        "protocol_whitelist": "file",
        "format_whitelist": ",".join(MEDIA_FORMATS),
        "enable_drefs": "0",
        "max_pixels": str(MAX_PIXELS),
    }
    try:
        return av.open(f"file:{path}" if content is None else content, options=options)
    except av.ArgumentError as error:
        what = "damaged, or of a format that is not read;"
        raise ValueError(f"{what} playlists and indexes of other files are not followed") from error


@cache
def bound_allocations() -> None:
    """Limit FFmpeg's allocations to ``LARGEST_BLOCK_BYTES``, in the whole process: it trusts the sizes in headers."""
    import av._core

    with suppress(OSError, AttributeError):  # on systems where the module does not export the libraries' functions
        ctypes.CDLL(av._core.__file__).av_max_alloc(ctypes.c_size_t(LARGEST_BLOCK_BYTES))


def list_video(container: Any) -> list[Any]:
    """Return the video streams of an open container, without album covers."""
    import av

    cover = av.stream.Disposition.attached_pic
    return [stream for stream in container.streams.video if not stream.disposition & cover]


def has_video(path: Path) -> bool:
    """Return whether a file can be opened and has a video stream."""
    import av

    try:
        with open_media(path) as container:
            return bool(list_video(container))
    except (av.FFmpegError, ValueError, OSError):
        return False


def read_duration(container: Any, stream: Any) -> float:
    """Return the duration of a stream that an open container states, in seconds; 0 if it states none.

    A stream without a duration of its own has that of the container, but where subtitles may last longer. Matroska
    states when things end, of a stream as a text.
    """
    if stream.duration:
        return float(stream.duration * stream.time_base)
    own_s = max(0.0, parse_clock(stream.metadata.get("DURATION", "")))
    late_s = (container.start_time or 0) / 1e6 if container.format.name == "matroska,webm" else 0.0
    longest_s = 0.0 if container.streams.subtitles else (container.duration or 0) / 1e6
    return max((own_s or longest_s) - late_s, 0.0)
