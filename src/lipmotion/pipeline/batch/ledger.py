"""The ledger of a batch: one JSON object for every line that was finished, appended in the order of finishing.

A line is finished in three steps: its outputs are written under temporary names, a receipt with their digests is
written, and the outputs are renamed. So whatever is killed at whatever moment, the next run knows of every output
whether it is in place: by the ledger, or by a receipt and the digests in it.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import IO, Any

from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import find_version, load_provided
from lipmotion.formats.base import list_suffixes
from lipmotion.formats.cues import CUE_FORMATS
from lipmotion.formats.label_files import LABEL_SUFFIXES, find_label_files, find_tables
from lipmotion.meshes.model.rig_tables import find_table
from lipmotion.pipeline.batch.lines import CONTROL, OWN_FILES, OWN_FOLDER, BatchLine
from lipmotion.pipeline.job import Job
from lipmotion.pipeline.model import find_shipped
from lipmotion.pipeline.outputs.cues import SHEET
from lipmotion.speech.recognition.network.posteriors import find_installed_recogniser
from lipmotion.storage.files import TEMPORARY, atomic_file, check_own, confine, make_folder, open_own, remove
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.storage.locks import lock_folder
from lipmotion.storage.sources import check_source, hash_file, is_file
from lipmotion.types.values import any_members, items, members, number, one_of, optional, text, whole

CUES = SHEET.removeprefix(".")  # prefix of the kinds of outputs that are cue sheets: ``cues.tsv`` is Rhubarb's table


def check_job(job: Job) -> None:
    """Raise ExportError for a kind of output that a batch cannot write, one that is given twice, or none at all.

    Raises InputError: the job names what belongs to one recording.
    """
    kinds = job.outputs.kinds
    plain = (*list_suffixes(), *LABEL_SUFFIXES, *load_provided("video_suffixes"), *load_provided("scene_suffixes"))
    known = (*(suffix.removeprefix(".") for suffix in plain), *(f"{CUES}{name}" for name in CUE_FORMATS))
    unknown = [kind for kind in kinds if kind not in known]
    if unknown or not kinds:
        kind = repr(unknown[0]) if unknown else "nothing"
        raise ExportError(f"the outputs are to be {kind}; required some of: {', '.join(known)}, with commas")
    if len(set(kinds)) < len(kinds):
        raise ExportError(f"the outputs are {', '.join(kinds)}: one is given twice; give every kind once")
    alone = {name: getattr(job.request, name) for name in ("recording", "transcript", "units", "edits")}
    alone |= {name: getattr(job.outputs, name) for name in ("files", "overlay")}
    if used := next((name for name, value in alone.items() if value), None):
        raise InputError(f"the job of a batch has {used!r}, which belongs to one recording; leave it out")
    for name in ("lexicon", "onto"):
        if not isinstance(getattr(job.request, name), Path | None):
            raise InputError(f"the job of a batch has a value as {name!r}, required a file: its content is compared")


def fingerprint_job(job: Job) -> str:
    """Return a digest of a job, with the content of the files that it names, and of what is installed: the version of
    lipmotion, and the recogniser of phones."""

    def describe(value: Any) -> Any:
        if isinstance(value, str | Path) and is_file(Path(value)):
            return hash_file(Path(value))
        return str(value) if isinstance(value, Path) else value

    request = replace(job.request, model=job.request.model or find_shipped())
    parts = [{name: describe(value) for name, value in part.as_mapping().items()} for part in (request, job.outputs)]
    parts += [job.delivery.as_mapping(), job.staging.as_mapping()]
    if load_provided("is_drawings")(job.outputs.face):
        parts.append({path.name: hash_file(path) for path in load_provided("picture_files")(Path(job.outputs.face))})
    table = find_table(job.outputs.character) if job.outputs.character else None
    if table and is_file(table):
        parts.append({"table": hash_file(table)})
    return _digest(as_json([*parts, find_version(), find_installed_recogniser()]))


def fingerprint_line(line: BatchLine, of_settings: str) -> str:
    """Return a digest of what a line's row says, and of the settings; not of the content of its files."""
    return _digest(as_json([of_settings, line.name, line.recording, line.transcript, line.speaker]))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@dataclass(frozen=True)
class InputFile:
    """A file that was read for a line: its size and time of change, and the digest of its content."""

    path: str
    size: int
    changed_ns: int
    sha256: str

    def is_unchanged(self) -> bool:
        """Return whether the file has the same content: by size and time of change, else by its digest."""
        try:
            size, changed_ns = _read_status(Path(self.path))
            is_same = size == self.size and changed_ns == self.changed_ns
            return is_same or (size == self.size and hash_file(Path(self.path)) == self.sha256)
        except (OSError, InputError):
            return False


def _read_status(path: Path) -> tuple[int, int]:
    """Return size and time of change of a file: copying another one to its place may keep the time of its content."""
    status = path.stat()
    return status.st_size, max(status.st_mtime_ns, status.st_ctime_ns)


def list_input_paths(line: BatchLine) -> list[Path]:
    """Return the files that are read for a line: its recording and, if the row has no words, its label files."""
    recording = Path(line.recording)
    return [recording] + ([] if line.transcript else find_label_files(recording) or find_tables(recording))


def list_input_files(line: BatchLine) -> list[InputFile]:
    """Return the files of ``list_input_paths`` as they are now.

    Raises InputError: the recording is missing, empty, a folder, a pipe or a device. OSError: one cannot be read.
    """
    check_source(Path(line.recording), "recording")
    return [InputFile(str(path), *_read_status(path), hash_file(path)) for path in list_input_paths(line)]


Record = dict[str, Any]  # what is known of one line; its fields are listed in docs/batch.md
DONE, FAILED = "done", "failed"
LARGEST_RECORD_BYTES = 1 << 20  # most bytes of a record; one has about a thousand
LARGEST_NUMBER = 1e12  # no duration, level or count of a recording is larger
TOGETHER = (("words", "confidence"), ("closures_heard", "closures_made"))
"""Fields of which the second is there wherever the first is."""


_TEXT, _NUMBER = text(LARGEST_RECORD_BYTES), number(-LARGEST_NUMBER, LARGEST_NUMBER)
_INPUT = {"path": _TEXT, "size": whole(0, 1 << 63), "changed_ns": whole(-(1 << 63), 1 << 63), "sha256": _TEXT}
_CHECKED = members(
    {
        **dict.fromkeys(("name", "recording", "run", "fingerprint", "words", "heard", "error", "redone"), _TEXT),
        **dict.fromkeys(("warnings", "advice"), items(_TEXT)),
        **dict.fromkeys(("duration_s", "seconds", "confidence", "range_db", "widest", "motion"), _NUMBER),
        **dict.fromkeys(("closures_heard", "closures_made", "least_sure_s", "width"), _NUMBER),
        "voice": optional(_NUMBER),
        "outcome": one_of((DONE, FAILED)),
        "inputs": items(members(_INPUT, _INPUT, alone=True)),
        "outputs": any_members(_TEXT),
    },
    ("name", "recording", "run", "fingerprint", "outcome", "inputs", "outputs"),
)
"""What every known field must hold; a field of a later version may hold anything."""


def read_record(content: bytes) -> Record | None:
    """Return the record in a row of a ledger, or in a receipt; None: it is damaged."""
    try:
        record: Record = from_json(content)
        _CHECKED(record)
    except ValueError:
        return None
    if any(first in record and second not in record for first, second in TOGETHER):
        return None
    names = [record["name"], *record["outputs"]]
    belong = all(output.startswith(f"{record['name']}.") for output in record["outputs"])
    return record if belong and not any(map(CONTROL.search, names)) else None


LOG = logging.getLogger("lipmotion")
LEDGER, RECEIPTS, WORK, RUN = "batch.jsonl", "receipts", "work", "run"
STAGED = f"{TEMPORARY}batch-"  # prefix of the names of outputs that are being written
NAME = re.compile(rb'\{"name": ("(?:[^"\\]|\\.)*")')  # how every row begins


@dataclass(frozen=True)
class Place:
    """Where a run of a batch works.

    out : absolute path of the folder of the outputs
    run : name of this run, another one each time
    """

    out: str
    run: str

    @property
    def own(self) -> Path:
        """The folder of unfinished work."""
        return Path(self.out) / OWN_FOLDER

    def receipt(self, name: str) -> Path:
        """Return the path of the receipt of the line ``name``."""
        return self.own / RECEIPTS / f"{_key(name)}.json"

    def work(self, name: str) -> Path:
        """Return the folder that exists while the line ``name`` is being done in this run."""
        return self.own / WORK / self.run / _key(name)

    def staged(self, name: str, kind: str) -> Path:
        """Return the path at which an output is written, beside its own, before it is renamed.

        Beside it, because some formats refer to the sound by its path from their folder.
        """
        return (Path(self.out) / name).parent / f"{STAGED}{self.run[:8]}-{_key(name)[:16]}.{kind}"

    def is_current(self) -> bool:
        """Return whether no later run has begun in this folder."""
        try:
            return (self.own / RUN).read_text(encoding="ascii") == self.run
        except OSError:
            return False


def _key(name: str) -> str:
    return hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:32]


def read_receipt(path: Path) -> Record | None:
    """Return the record in a receipt; None: there is none, or it is damaged."""
    try:
        is_one = path.is_file() and path.stat().st_size <= LARGEST_RECORD_BYTES
        return read_record(path.read_bytes()) if is_one else None
    except OSError:
        return None


def write_receipt(path: Path, record: Mapping[str, Any]) -> None:
    """Write the receipt of a line. Raises ExportError: it cannot be written."""
    with atomic_file(path) as temporary:
        temporary.write_text(as_json(record), encoding="utf-8")


def is_in_place(path: Path, digest: str) -> bool:
    """Return whether a file exists and has a digest."""
    try:
        return hash_file(path) == digest
    except (OSError, InputError):  # there is none, or a folder or a pipe in its place
        return False


def are_in_place(out: Path, record: Record) -> bool:
    """Return whether all outputs of a record have the content that it states."""
    return all(is_in_place(out / name, digest) for name, digest in record["outputs"].items())


class Ledger:
    """The ledger of a folder of outputs, open for appending; of every line, where its last record is.

    Only the fingerprint and the position of each record are kept in memory, and only of the lines of this batch.
    Rows that are damaged count as if they were not there; a warning says how many they are.
    """

    def __init__(self, path: Path, file: IO[bytes], lines: Iterable[BatchLine]) -> None:
        self._path, self._file = path, file
        ours = {_key(line.name) for line in lines}
        places: dict[str, int] = {}
        start, damaged = file.seek(0), 0
        while row := file.readline(LARGEST_RECORD_BYTES):
            is_long = not row.endswith(b"\n")
            while row and not row.endswith(b"\n"):
                row = file.readline(LARGEST_RECORD_BYTES)
            if not row:
                break
            match, name = NAME.match(b"" if is_long else row), None
            with suppress(ValueError):
                name = str(json.loads(match[1])) if match else None
            damaged += name is None
            if name is not None and _key(name) in ours:
                places[_key(name)] = start
            start = file.tell()
        file.seek(start)
        file.truncate()  # a row that was being written when the run was killed
        self._last: dict[str, tuple[str, int]] = {}
        for key, place in places.items():
            record = self._record_at(place)
            damaged += record is None
            if record is not None:
                self._last[key] = record["fingerprint"], place
        if damaged:
            LOG.warning("%s: %d damaged rows are passed over; what they say was done is done again", path, damaged)

    def record_of(self, name: str) -> Record | None:
        """Return the last record of a line; None: it has none."""
        return self._record_at(self._last[_key(name)][1]) if _key(name) in self._last else None

    def _record_at(self, start: int) -> Record | None:
        self._file.seek(start)
        return read_record(self._file.readline(LARGEST_RECORD_BYTES))

    def append(self, record: Record) -> None:
        """Append a record. Raises ExportError: it cannot be written."""
        content = as_json(record).encode() + b"\n"
        try:
            start = self._file.seek(0, os.SEEK_END)
            self._file.write(content)
            self._file.flush()
        except OSError as error:
            why = error.strerror or error
            raise ExportError(f"{self._path}: cannot be written: {why}; make room, then run it again") from error
        self._last[_key(record["name"])] = record["fingerprint"], start

    def find_same(self, line: BatchLine, of_settings: str, out: Path) -> Record | None:
        """Return the record of a line that need not be done again; None: it must be done.

        It need not if it was done with the same settings from the same files, and all its outputs exist.
        """
        if self._last.get(_key(line.name), ("", 0))[0] != fingerprint_line(line, of_settings):
            return None
        record = self.find_finished(line, out)
        return record if record is not None and are_same_inputs(line, record) else None

    def find_finished(self, line: BatchLine, out: Path) -> Record | None:
        """Return the record of a line that was done, whatever the settings; None: it was not, or lacks an output."""
        record = self.record_of(line.name)
        if record is None or record["outcome"] != DONE:
            return None
        return record if all((out / name).is_file() for name in record["outputs"]) else None


def are_same_inputs(line: BatchLine, record: Record) -> bool:
    """Return whether the files of a line are those of its record, with the same content."""
    inputs = [InputFile(**each) for each in record["inputs"]]
    same = [each.path for each in inputs] == list(map(str, list_input_paths(line)))
    return same and all(each.is_unchanged() for each in inputs)


@contextmanager
def open_ledger(place: Place, lines: Sequence[BatchLine]) -> Iterator[Ledger]:
    """Open the ledger of a folder of outputs for a new run, and end what an earlier one left undone.

    lines : those of the batch: what earlier runs did of others stays in the ledger and is not looked at
    Receipts whose outputs are in place are entered into the ledger; other unfinished work is deleted.
    The folder is confined, as it is in workers. Raises ExportError: another process is at work on it, or it cannot be
    written.
    """
    for path in (place.own / RUN, *(Path(place.out) / name for name in OWN_FILES)):
        check_own(path)
    with confine(Path(place.out)), lock_folder(place.own):
        for folder in (place.own / RECEIPTS, place.own / WORK):
            make_folder(folder)
        with atomic_file(place.own / RUN) as temporary:  # from now on, workers of earlier runs finish nothing
            temporary.write_text(place.run, encoding="ascii")
        path = Path(place.out) / LEDGER
        try:
            file = open_own(path)
        except OSError as error:
            raise ExportError(f"{path}: cannot be written: {error.strerror or error}") from error
        with file:
            ledger = Ledger(path, file, lines)
            for receipt in sorted((place.own / RECEIPTS).iterdir()):
                record = read_receipt(receipt) if receipt.suffix == ".json" else None
                is_done = record is not None and are_in_place(Path(place.out), record)
                if record is not None and is_done and ledger.record_of(record["name"]) != record:
                    ledger.append(record)
                remove(receipt)
            for folder in (place.own / WORK).iterdir():
                if folder.name != place.run:
                    remove(folder)
            _sweep(place, lines)
            yield ledger
        _sweep(place, lines)  # what a worker had begun that died
        for name in (WORK, RUN):
            remove(place.own / name)
    for folder in (place.own / RECEIPTS, place.own):
        with suppress(OSError):  # it holds something
            folder.rmdir()


def _sweep(place: Place, lines: Iterable[BatchLine]) -> None:
    """Delete outputs that were never finished, beside those that were."""
    for inner in {PurePosixPath(line.name).parent for line in lines}:
        for path in (Path(place.out) / inner).glob(f"{STAGED}*"):
            remove(path)
