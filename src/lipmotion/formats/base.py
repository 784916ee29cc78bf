"""Motion files: the format is chosen by the suffix, among the built-in ones and those that installed packages add.

Below the registry: what several formats share, rows of numbers as text, keys, and JSON with many rows.
"""

from __future__ import annotations

import json
import logging
import re
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import Registry
from lipmotion.meshes.model.rig_tables import CONTROL
from lipmotion.meshes.model.shape_names import is_known
from lipmotion.storage.archive import UNREADABLE
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import as_json
from lipmotion.storage.sources import check_kind, check_regular, read_shipped_table
from lipmotion.types import Generation, Motion, Timeline, Unit

LOG = logging.getLogger("lipmotion")
Array = NDArray[np.float64]
About = Mapping[str, str]
LARGEST_MOTION_BYTES = 1 << 31  # most bytes of a motion file: four hours of a hundred channels
LARGEST_UNITS_BYTES = 1 << 28  # most bytes of a file of units alone: phones of a day
LARGEST_WEIGHT = 4.0  # largest weight of a blendshape that is read; captures and sculpted faces go a little over 1
WIDEST_LIPS, NARROWEST_LIPS = 2.5, 0.1  # eye distances of lips at their widest: more, or less, is in another unit
TOLERATED_WEIGHT = 0.1  # by how much weights may go beyond 0 to 1 without a warning
DECIMALS = 5  # a hundred-thousandth of the distance between the eyes is about a micrometre
BLOCK_ROWS = 2000  # rows that are formatted at a time: the text of an hour of all channels would not fit in memory
LARGEST_VALUE = 1e9  # blocks with larger values are formatted number by number: their digits do not fit in 64 bits


@dataclass(frozen=True)
class MotionFormat:
    """How one kind of motion file is written and read.

    write   : writes a generation to a path; the mappings describe the origin of its speech and of its model
    read    : returns motion and units of a file, or raises InputError; None: the format cannot be read
    needs   : names of channels of which the motion must have one; ``WEIGHT``: a weight; empty: any channels
    max_bytes : of a file that is read
    min_frames : so many frames it must have, at least one where it needs channels
    check   : raises ExportError for motion that does not fit into such a file otherwise
    units   : returns the units of a file that holds units alone, and None of other files; None: there are no such files
    curves  : the set of curves that such a file holds, as of ``pipeline.outputs.curve_sets.make_curves``, like
              ``arkit``: the pipeline computes them from the motion; empty: the channels of the motion
    rate_hz : frames per second where the user asks for none; None: those of the motion
    mouth   : whether the file shows how the mouth itself moves: the pipeline keeps the channel ``opening`` for it,
              whatever channels or curves the user asks for
    fixed_rate : whether a file can have no other rate than ``rate_hz``
    other_curves : whether weights and controls that the user asks for take the place of ``curves``
    keyed   : whether the file holds keys of weights with straight lines between, and needs none where a line goes on
    names_sound  : whether the file names the recording: the description of the speech then has ``path``, the path from
                   the folder of the file

    The description of the speech has ``start_s`` where the sound does not begin with the motion: seconds of the motion
    at which it begins, as text; negative: before it.
    """

    write: Callable[[Path, Generation, About, About], None]
    read: Callable[[Path], tuple[Motion, Timeline[Unit]]] | None = None
    check: Callable[[Motion], None] = lambda _: None
    units: Callable[[Path], Timeline[Unit] | None] | None = None
    curves: str = ""
    rate_hz: float | None = None
    fixed_rate: bool = False
    other_curves: bool = False
    names_sound: bool = False
    mouth: bool = False
    keyed: bool = False
    needs: tuple[str, ...] = ()
    min_frames: int = 0
    max_bytes: int = LARGEST_MOTION_BYTES


MOTION_FORMATS: Registry[MotionFormat] = Registry(
    "motion format",
    "lipmotion.exporters",
    {row["suffix"]: row["place"] for row in read_shipped_table("lipmotion.formats", "motion_formats.csv")},
)
"""Motion formats by suffix, without the first dot; a suffix may have several parts, as ``livelink.csv``."""
MOTION_READERS: Registry[Callable[[Path], tuple[Motion, Timeline[Unit]]]] = Registry(
    "motion reader",
    "lipmotion.motion_readers",
    {row["suffix"]: row["place"] for row in read_shipped_table("lipmotion.formats", "motion_readers.csv")},
)
"""Readers of files that hold motion, but are not written as motion formats, by suffix as ``MOTION_FORMATS``."""
OTHER_JSON = {row["mark"].encode(): row["suffix"] for row in read_shipped_table("lipmotion.formats", "json_marks.csv")}
"""What the beginnings of ``.json`` files hold, and the suffix of files that are read alike; the first counts."""
JSON_HEAD = 1 << 16  # how many bytes of a ``.json`` are searched for them
CUE_LINE = re.compile(
    rb'^"?[0-9][0-9:.,]{0,20}"?(?:[;,]\s?"?[0-9:.,]{1,20}"?)?[;,]\s?"?([A-Za-z_0-9]{0,19}[A-Za-z])"?\s*$', re.M
)
"""A line of a ``.csv`` of cues: one or two times, and the name of a shape."""
SHAPE_COLUMN = re.compile(rb"\b(?:mouth\w*|shape|viseme|phoneme|value|name|cue)\W*$", re.IGNORECASE)


def list_suffixes() -> tuple[str, ...]:
    """Return the suffixes of all motion formats, with the dot."""
    return tuple(f".{name}" for name in MOTION_FORMATS.names)


def list_read_suffixes() -> tuple[str, ...]:
    """Return the suffixes of all files that ``read_motion`` reads, with the dot."""
    suffixes = []
    for suffix in list_suffixes():
        with suppress(InputError):  # of what a package adds
            suffixes += [suffix] if _format_of(Path(f"a{suffix}")).read is not None else []
    return (*suffixes, *(f".{name}" for name in MOTION_READERS.names))


def find_suffix(path: Path, known: Collection[str] | None = None) -> str:
    """Return the suffix that chooses the motion format of a file, in lower case, with the dot; empty: there is none.

    The longest known suffix counts: ``take.livelink.csv`` has ``.livelink.csv``, ``take.1.csv`` ``.csv``.
    known : suffixes; None: those of all motion formats
    """
    suffixes, known = [suffix.lower() for suffix in path.suffixes], list_suffixes() if known is None else known
    endings = ("".join(suffixes[first:]) for first in range(len(suffixes)))
    return next((ending for ending in endings if ending in known), "")


def find_motion_format(path: Path) -> MotionFormat:
    """Return the motion format that the suffix of a file chooses. Raises ExportError: the suffix is unknown."""
    try:
        return _format_of(path)
    except InputError as error:
        what = f"{path}: cannot write motion as {_suffix(path)};"
        raise ExportError(f"{what} use one of {', '.join(list_suffixes())}") from error


def write_motion(path: Path, generation: Generation, *, source: dict[str, str], model: dict[str, str]) -> None:
    """Write motion and units to a file in the format of its suffix; after a failure there is no partial file.

    source, model : description of the speech and of the model (``.csv`` stores neither these nor units)
    Raises ExportError: unknown suffix, values that are not finite, or the file cannot be written.
    """
    check_motion(path, generation.motion)
    with atomic_file(path) as temporary:
        _format_of(path).write(temporary, generation, source, model)


def check_motion(path: Path, motion: Motion) -> None:
    """Raise ExportError if motion cannot be written to a file of that name: unknown suffix, or unsuitable motion."""
    chosen = find_motion_format(path)
    if motion.values.size and not np.isfinite([motion.values.min(), motion.values.max()]).all():  # no mask of an hour
        raise ExportError(f"{path}: the motion has values that are not finite; interpolate them before writing")
    known = {*motion.names, *(channel.unit for channel in motion.channels)}
    lacking = bool(chosen.needs) and not known & {*chosen.needs}
    if lacking or len(motion.values) < max(chosen.min_frames, bool(chosen.needs)):
        what = f"{path}: the motion has {len(motion.values)} frames of {', '.join(motion.names[:4]) or 'no channel'}"
        needed = f"{max(chosen.min_frames, 1)} or more of {' or '.join(chosen.needs) or 'any channel'}"
        raise ExportError(f"{what}, required {needed}; write .json or .csv")
    chosen.check(motion)


def read_motion(path: str | Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the motion and the units of a motion file; a ``.csv`` has no units, so its timeline is empty.

    Raises InputError: unknown suffix, no such file, or not a motion file.

    >>> from pathlib import Path
    >>> _ = Path("take.csv").write_text("time,jawOpen\\n0,0.1\\n0.04,0.2")
    >>> read_motion("take.csv")[0].rate_hz
    25.0
    """
    path = Path(path)
    check_kind(path, "motion file")
    named, read, max_bytes = _name_by_content(path), None, LARGEST_MOTION_BYTES
    if find_suffix(named):
        read, max_bytes = _format_of(named).read, _format_of(named).max_bytes
    elif other := find_suffix(named, [f".{name}" for name in MOTION_READERS.names]):
        read = MOTION_READERS.load(other.removeprefix("."))
    if read is None:
        known = ", ".join(list_read_suffixes())
        raise InputError(f"{path}: cannot read motion from {_suffix(path)}; use one of {known}")
    check_regular(path, "motion file")
    with _name_errors(path):
        size = path.stat().st_size
        if size > max_bytes:
            raise InputError(f"{size} bytes, required at most {max_bytes}: is it a motion file? divide long takes")
        motion, units = read(path)
        if not (finite := np.isfinite(motion.values)).all():
            frame, column = np.argwhere(~finite)[0].tolist()
            first = f"the first is {motion.names[column]!r} in frame {frame}"
            raise InputError(f"{(~finite).sum()} values that are not finite, {first}; interpolate them first")
        beyond = []
        lips = {"opening", "width", "outer"} & {*motion.names}
        widest = max((float(motion[name].max(initial=0.0)) for name in lips), default=0.0)
        if widest > WIDEST_LIPS or ("width" in lips and widest < NARROWEST_LIPS):
            raise InputError(f"the lips are {widest:g} apart, required eye distances; divide millimetres by 90")
        for channel, curve in zip(motion.channels, motion.values.T, strict=True):
            if channel.unit != CONTROL and is_known(channel.name):
                low, high = float(curve.min(initial=0.0)), float(curve.max(initial=0.0))
                if (worst := max(low, high, key=abs)) and abs(worst) > LARGEST_WEIGHT:
                    wrong = f"the weight {channel.name} goes {'up' if worst > 0 else 'down'} to {worst:g}"
                    raise InputError(f"{wrong}, required 0 to 1; divide percent by 100")
                if not -TOLERATED_WEIGHT <= low <= high <= 1 + TOLERATED_WEIGHT:
                    beyond.append(f"{channel.name} from {low:.2f} to {high:.2f}")
    if beyond:
        what = f"{len(beyond)} weights go beyond 0 to 1, where faces are drawn as at 0 or 1"
        LOG.warning("%s: %s: %s", path, what, ", ".join(beyond[:8]))
    return motion, units


@contextmanager
def _name_errors(path: Path) -> Iterator[None]:
    """Put a file's name before the message of an error of reading it, once; errors of damage become InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from error
    except (*UNREADABLE, IndexError, OverflowError, RecursionError) as error:
        raise InputError(f"{path}: damaged, or of another program ({str(error)[:300]}); export it again") from error


def read_motion_units(path: Path) -> Timeline[Unit]:
    """Return the units of a motion file, or of a ``.json`` of units alone. Raises InputError: as ``read_motion``."""
    read = _format_of(path).units if find_suffix(path) else None
    if read is not None and path.is_file() and path.stat().st_size <= LARGEST_UNITS_BYTES:
        with _name_errors(path):
            units = read(path)
        if units is not None:
            return units
    return read_motion(path)[1]


def _name_by_content(path: Path) -> Path:
    """Return a path, or for ``.json`` of another program, and cues, the name that such a file would have otherwise."""
    if (find_suffix(path) or path.suffix.lower()) not in (".json", ".csv", ".tsv") or not path.is_file():
        return path
    try:
        with path.open("rb") as file:
            head = file.read(JSON_HEAD)
    except OSError:  # reported when it is read
        return path
    if find_suffix(path) != ".json":
        from lipmotion.articulation.cue_sheets import is_shape

        names, *rows = [*head.splitlines()[:2], b""]
        cue = CUE_LINE.match(rows[0] if SHAPE_COLUMN.search(names) else names)
        if cue and is_shape(cue[1].decode()):
            return Path("a.tsv")
        return Path("a.csv") if names.count(b"\t") > 1 else path  # cues have two columns
    return next((Path(f"a{suffix}") for mark, suffix in OTHER_JSON.items() if mark in head), path)


def _format_of(path: Path) -> MotionFormat:
    """Return the format of a file's suffix. Raises InputError: none, or what a package adds is no format."""
    chosen = MOTION_FORMATS.load((find_suffix(path) or path.suffix.lower()).removeprefix("."))
    if not isinstance(chosen, MotionFormat):
        raise InputError(f"what an installed package adds as {_suffix(path)} is {chosen!r}, required a MotionFormat")
    return chosen


def _suffix(path: Path) -> str:
    return repr(find_suffix(path) or path.suffix) if path.suffix else "a file without a suffix"


def format_rows(values: NDArray[np.floating[Any]]) -> Iterator[str]:
    """Yield each row of values [shape=(T, P)] as text: numbers with commas between them, rounded to ``DECIMALS``.

    Raises ExportError: a value is not finite.
    Cost: a twentieth of a microsecond per number; a fifth of the time of ``json.dumps``.
    """
    for start in range(0, len(values), BLOCK_ROWS):
        with np.errstate(over="ignore"):
            rounded = np.round(values[start : start + BLOCK_ROWS].astype(float), DECIMALS) + 0.0
        if not np.isfinite(rounded).all():
            raise ExportError("the motion has values that are not finite, or too large to be rounded")
        if not rounded.shape[1] or np.abs(rounded).max() >= LARGEST_VALUE:
            form = ",".join([f"%.{DECIMALS}f"] * values.shape[1])
            yield from (form % tuple(row) for row in rounded.tolist())
            continue
        numbers = np.rint(rounded * 10**DECIMALS).astype(np.int64)
        sizes = np.abs(numbers)
        digits = max(len(str(sizes.max())), DECIMALS + 1)
        if digits < 10:
            sizes = sizes.astype(np.int32)
        text = np.empty((*numbers.shape, digits + 3), np.uint8)  # sign, digits, point, comma
        used = np.ones(text.shape, bool)
        text[..., 0], used[..., 0] = ord("-"), numbers < 0
        text[..., -2 - DECIMALS], text[..., -1] = ord("."), ord(",")
        text[:, -1, -1] = ord("\n")
        for place in range(digits):
            if place > DECIMALS:
                used[..., -3 - place] = sizes > 0
            sizes, digit = np.divmod(sizes, 10)
            text[..., -(2 if place < DECIMALS else 3) - place] = ord("0") + digit
        yield from text[used].tobytes().decode("ascii").splitlines()


def write_json(path: Path, before: Mapping[str, Any], key: str, values: NDArray[Any], after: Mapping[str, Any]) -> None:
    """Write one JSON object: members ``before``, one called ``key`` with a row a line, members ``after``."""
    start, end = as_json(before, ensure_ascii=False)[:-1], as_json(after, ensure_ascii=False)[1:]
    with path.open("w", encoding="utf-8") as file:
        file.write(f'{start}, "{key}": [\n')
        for number, row in enumerate(format_rows(values)):
            file.write(f",\n[{row}]" if number else f"[{row}]")
        file.write(f"\n]{', ' if after else ''}{end}\n")


def list_key_frames(time_s: Array, values: Array, tolerance: float, *, stepped: bool) -> list[int]:
    """Return the frames of a curve that are keys in files with straight lines between keys, the first and last of them.

    Held values (``stepped``) have a key where they change; others where a line would be further off than a tolerance.
    """
    if stepped:
        return sorted({0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values) - 1})
    return Thinning(tolerance).choose(time_s, values[:, None]).tolist()


MAX_ITEMS = 1 << 20  # most items of a list that has not one item a frame
MAX_ROWS = 1 << 22  # most rows of numbers: eleven hours of frames of 10 ms
_BLANK = re.compile(r"\s*")
_DECODER = json.JSONDecoder()


def read_members(text: str, rows_of: str, numbers_of: str = "") -> dict[str, Any]:
    """Return the members of a JSON object; the list called ``rows_of`` becomes an array of numbers [shape=(T, P)].

    It is read item by item: rows of numbers need no more memory than an array.
    numbers_of : name of a list that may have an item for every row
    Raises json.JSONDecodeError, RecursionError: not one object.
    Raises ValueError, TypeError, OverflowError: a list that is too long, or rows that are uneven or no numbers.
    """
    members: dict[str, Any] = {}

    def take(at: int) -> int:
        name, at = _DECODER.raw_decode(text, at)
        at = find_next_at(text, _pass(text, find_next_at(text, at), ":"))
        if text[at : at + 1] != "[":
            members[name], at = _DECODER.raw_decode(text, at)
            return at
        items, numbers, widths = list[Any](), array("d"), array("q")
        limit = MAX_ROWS if name in (rows_of, numbers_of) else MAX_ITEMS

        def take_item(at: int) -> int:
            value, at = _DECODER.raw_decode(text, at)
            if name != rows_of:
                items.append(value)
            elif not value or not isinstance(value, list) or len(value) != (widths[0] if widths else len(value)):
                row = f"row {len(widths) + 1} of the values"
                raise ValueError(f"{row} is not a list of as many numbers as the first: no shape")
            else:
                numbers.extend(value)
                widths.append(len(value))
            if max(len(items), len(widths)) > limit:
                raise ValueError(f"a list of more than {limit} items")
            return at

        at = _read_each(text, at, "[]", take_item)
        table = np.array(numbers, np.float64).reshape(len(widths), widths[0] if widths else 0)
        members[name] = table if name == rows_of else items
        return at

    end = find_next_at(text, _read_each(text, find_next_at(text, 0), "{}", take))
    if end < len(text):
        raise json.JSONDecodeError("Extra data", text, end)
    return members


def _read_each(text: str, at: int, brackets: str, take: Callable[[int], int]) -> int:
    """Let ``take`` read each item between brackets; return the position after the closing bracket."""
    at = find_next_at(text, _pass(text, at, brackets[0]))
    if text[at : at + 1] == brackets[1]:
        return at + 1
    while True:
        at = find_next_at(text, take(at))
        if text[at : at + 1] == brackets[1]:
            return at + 1
        at = find_next_at(text, _pass(text, at, ","))


def iterate_json(text: str, decoder: json.JSONDecoder | None = None) -> Iterator[tuple[int, Any]]:
    """Yield the values of a text, one after another, each with its place. Raises JSONDecodeError: one is damaged."""
    at = find_next_at(text, 0)
    while at < len(text):
        value, end = (decoder or json.JSONDecoder()).raw_decode(text, at)
        yield at, value
        at = find_next_at(text, end)


def find_next_at(text: str, at: int) -> int:
    """Return the position of the next character that is not blank."""
    match = _BLANK.match(text, at)
    return match.end() if match else at


def _pass(text: str, at: int, character: str) -> int:
    """Return the position after a required character. Raises JSONDecodeError: another character is there."""
    if text[at : at + 1] != character:
        raise json.JSONDecodeError(f"Expecting {character!r}", text, at)
    return at + 1


@dataclass(frozen=True)
class Thinning:
    """Which keys may be left out.

    tolerance : of every curve, between the keys that are kept, in the curves' own unit; 0: none is left out
    closed_s  : seconds at which the lips close: the keys there are kept, and those beside them
    """

    tolerance: float = 0.0
    closed_s: tuple[float, ...] = ()

    def choose(self, time_s: Array, rows: Array) -> NDArray[np.intp]:
        """Return the numbers of the keys that stay, rising, the first and the last among them.

        time_s : seconds, rising [shape=(K,)]; rows : of curves [shape=(K, N)]
        Source: Ramer 1972; Douglas & Peucker 1973. Deviations: the distance is that of the values, not of the points;
        all curves have the same keys, so the largest distance of any counts.
        """
        if not self.tolerance or len(rows) < 3:
            return np.arange(len(rows))
        is_kept = np.zeros(len(rows), bool)
        is_kept[[0, -1]] = True
        for each_s in self.closed_s:
            nearest = int(np.abs(time_s - each_s).argmin())
            is_kept[max(nearest - 1, 0) : nearest + 2] = True
        open_ends = list(pairwise(np.flatnonzero(is_kept).tolist()))
        while open_ends:
            first, last = open_ends.pop()
            if last - first < 2:
                continue
            those_s, those = time_s[first : last + 1], rows[first : last + 1]
            share = (those_s - those_s[0]) / (those_s[-1] - those_s[0])
            errors = np.abs(those - those[0] - share[:, None] * (those[-1] - those[0])).max(axis=1, initial=0.0)
            errors[[0, -1]] = 0.0
            if errors.max() > self.tolerance:
                middle = first + int(errors.argmax())
                is_kept[middle] = True
                open_ends += [(first, middle), (middle, last)]
        return np.flatnonzero(is_kept)
