"""The ledger of a batch: one JSON object for every line that was finished, appended in the order of finishing.

A line is finished in three steps: its outputs are written under temporary names, a receipt with their digests is
written, and the outputs are renamed. So whatever is killed at whatever moment, the next run knows of every output
whether it is in place: by the ledger, or by a receipt and the digests in it.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from lipmotion.errors import ExportError
from lipmotion.pipeline.batch.lines import OWN_FOLDER, BatchLine
from lipmotion.pipeline.batch.settings import InputFile, input_paths, line_fingerprint
from lipmotion.storage.files import TEMPORARY, locked, sha256_of, whole_file
from lipmotion.storage.json_text import as_json, from_json

LEDGER, RECEIPTS, WORK, RUN = "batch.jsonl", "receipts", "work", "run"
DONE, FAILED = "done", "failed"
STAGED = f"{TEMPORARY}batch-"
"""Prefix of the names of outputs that are being written."""
Record = dict[str, Any]
"""What the ledger holds of one line; its fields are listed in docs/batch.md."""


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
        return _record(path.read_bytes())
    except OSError:
        return None


def write_receipt(path: Path, record: Mapping[str, Any]) -> None:
    """Write the receipt of a line. Raises ExportError: it cannot be written."""
    with whole_file(path) as temporary:
        temporary.write_text(as_json(record), encoding="utf-8")


def are_in_place(out: Path, record: Record) -> bool:
    """Return whether all outputs of a record have the content that it states."""
    return all(is_in_place(out / name, digest) for name, digest in record["outputs"].items())


def is_in_place(path: Path, digest: str) -> bool:
    """Return whether a file exists and has a digest."""
    try:
        return sha256_of(path) == digest
    except OSError:
        return False


class Ledger:
    """The ledger of a folder of outputs, open for appending; of every line, where its last record is.

    Only the digest and the position of each record are kept in memory.
    """

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self._path, self._file = path, file
        self._last: dict[str, tuple[str, int]] = {}
        whole = 0
        for start, content in _whole_lines(file):
            whole = start + len(content)
            record = _record(content)
            if record is not None:
                self._last[_key(record["name"])] = record["fingerprint"], start
        file.seek(whole)
        file.truncate()  # a line that was being written when the run was killed

    def record_of(self, name: str) -> Record | None:
        """Return the last record of a line; None: it has none."""
        if _key(name) not in self._last:
            return None
        self._file.seek(self._last[_key(name)][1])
        return _record(self._file.readline())

    def append(self, record: Record) -> None:
        """Append a record. Raises ExportError: it cannot be written."""
        content = as_json(record).encode() + b"\n"
        try:
            start = self._file.seek(0, os.SEEK_END)
            self._file.write(content)
            self._file.flush()
        except OSError as error:
            raise ExportError(
                f"{self._path}: cannot be written: {error.strerror or error}; make room, then run it again"
            ) from error
        self._last[_key(record["name"])] = record["fingerprint"], start

    def kept(self, line: BatchLine, of_settings: str, out: Path) -> Record | None:
        """Return the record of a line that need not be done again; None: it must be done.

        It need not if it was done with the same settings from the same files, and all its outputs exist.
        """
        fingerprint = line_fingerprint(line, of_settings)
        if self._last.get(_key(line.name), ("", 0))[0] != fingerprint:
            return None
        record = self.record_of(line.name)
        if record is None or record["outcome"] != DONE:
            return None
        inputs = [InputFile(**each) for each in record["inputs"]]
        same = [each.path for each in inputs] == list(map(str, input_paths(line)))
        there = all((out / name).is_file() for name in record["outputs"])
        return record if same and there and all(each.is_unchanged() for each in inputs) else None


def _whole_lines(file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield position and content of every line that has an end."""
    start = file.seek(0)
    for content in file:
        if content.endswith(b"\n"):
            yield start, content
            start += len(content)


def _record(content: bytes) -> Record | None:
    """Return the record in a line of a ledger; None: it is damaged."""
    try:
        record = from_json(content)
    except ValueError:
        return None
    is_whole = isinstance(record, dict) and {"name", "fingerprint", "outcome", "inputs", "outputs"} <= record.keys()
    return record if is_whole else None


@contextmanager
def opened_ledger(place: Place, lines: Iterable[BatchLine] = ()) -> Iterator[Ledger]:
    """Open the ledger of a folder of outputs for a new run, and end what an earlier one left undone.

    lines : those in whose folders unfinished outputs are searched

    Receipts whose outputs are in place are entered into the ledger; other unfinished work is deleted.
    Raises ExportError: another process is at work on the folder, or it cannot be written.
    """
    with locked(place.own):
        for folder in (place.own / RECEIPTS, place.own / WORK):
            folder.mkdir(exist_ok=True)
        with whole_file(place.own / RUN) as temporary:  # from now on, workers of earlier runs finish nothing
            temporary.write_text(place.run, encoding="ascii")
        path = Path(place.out) / LEDGER
        try:
            file = path.open("a+b")
        except OSError as error:
            raise ExportError(f"{path}: cannot be written: {error.strerror or error}") from error
        with file:
            ledger = Ledger(path, file)
            _settle(place, ledger)
            for folder in {(Path(place.out) / line.name).parent for line in lines}:
                for path in folder.glob(f"{STAGED}*"):
                    _remove(path)
            yield ledger
        shutil.rmtree(place.own / WORK, ignore_errors=True)
        for name in (RECEIPTS, RUN):
            _remove(place.own / name)
    with suppress(OSError):
        place.own.rmdir()


def _settle(place: Place, ledger: Ledger) -> None:
    """Enter the receipts of earlier runs into the ledger, and delete these runs' unfinished work."""
    for path in sorted((place.own / RECEIPTS).iterdir()):
        record = read_receipt(path) if path.suffix == ".json" else None
        if record is not None and are_in_place(Path(place.out), record) and ledger.record_of(record["name"]) != record:
            ledger.append(record)
        _remove(path)
    for path in (place.own / WORK).iterdir():
        if path.name != place.run:
            shutil.rmtree(path, ignore_errors=True)


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.rmdir() if path.is_dir() else path.unlink()
