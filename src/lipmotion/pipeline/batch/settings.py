"""What the job of a batch may be, and the fingerprint that tells whether a line must be done again."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import installed_version, load_provided
from lipmotion.formats.base import motion_suffixes
from lipmotion.formats.cues import CUE_FORMATS
from lipmotion.formats.label_files import LABEL_SUFFIXES, find_label_files
from lipmotion.meshes.files.rig_tables import table_path
from lipmotion.pipeline.batch.lines import BatchLine
from lipmotion.pipeline.job import Job
from lipmotion.pipeline.model import shipped_path
from lipmotion.pipeline.outputs.cues import SHEET
from lipmotion.speech.recognition.network.posteriors import installed_phone_recogniser
from lipmotion.storage.files import check_source, sha256_of
from lipmotion.storage.json_text import as_json
from lipmotion.storage.sources import is_file

CUES = SHEET.removeprefix(".")
"""Prefix of the kinds of outputs that are cue sheets: ``cues.tsv`` is Rhubarb's table."""


def check_job(job: Job) -> None:
    """Raise ExportError for kinds of outputs that a batch cannot write.

    Raises InputError: the job names what belongs to one recording.
    """
    check_kinds(job.outputs.kinds)
    alone = {name: getattr(job.request, name) for name in ("recording", "transcript", "units", "edits")}
    alone |= {name: getattr(job.outputs, name) for name in ("files", "overlay", "posteriors")}
    if used := next((name for name, value in alone.items() if value), None):
        raise InputError(f"the job of a batch has {used!r}, which belongs to one recording; leave it out")
    for name in ("lexicon", "onto"):
        if not isinstance(getattr(job.request, name), Path | None):
            raise InputError(
                f"the job of a batch has a value as {name!r}, required a file, whose content can be compared"
            )


def check_kinds(kinds: Sequence[str]) -> None:
    """Raise ExportError for a kind of output that a batch cannot write, one that is given twice, or none at all."""
    plain = (*motion_suffixes(), *LABEL_SUFFIXES, *load_provided("video_suffixes"), *load_provided("scene_suffixes"))
    known = (*(suffix.removeprefix(".") for suffix in plain), *(f"{CUES}{name}" for name in CUE_FORMATS))
    unknown = [kind for kind in kinds if kind not in known]
    if unknown or not kinds:
        given = repr(unknown[0]) if unknown else "nothing"
        raise ExportError(f"the outputs are to be {given}; required some of: {', '.join(known)}, with commas")
    if len(set(kinds)) < len(kinds):
        raise ExportError(f"the outputs are {', '.join(kinds)}: one is given twice; give every kind once")


def fingerprint_job(job: Job) -> str:
    """Return a digest of a job, with the content of the files that it names, and of what is installed: the version of
    lipmotion, and the recogniser of phones."""

    def describe(value: Any) -> Any:
        if isinstance(value, str | Path) and is_file(Path(value)):
            return sha256_of(Path(value))
        return str(value) if isinstance(value, Path) else value

    request = replace(job.request, model=job.request.model or shipped_path())
    parts = [{name: describe(value) for name, value in part.as_mapping().items()} for part in (request, job.outputs)]
    parts += [job.delivery.as_mapping(), job.staging.as_mapping()]
    if load_provided("is_drawings")(job.outputs.face):
        parts.append({path.name: sha256_of(path) for path in load_provided("picture_files")(Path(job.outputs.face))})
    table = table_path(job.outputs.character) if job.outputs.character else None
    if table and is_file(table):
        parts.append({"table": sha256_of(table)})
    return _digest(as_json([*parts, installed_version(), installed_phone_recogniser()]))


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
            status = Path(self.path).stat()
            if (status.st_size, _changed_ns(status)) == (self.size, self.changed_ns):
                return True
            return status.st_size == self.size and sha256_of(Path(self.path)) == self.sha256
        except (OSError, InputError):
            return False


def _changed_ns(status: os.stat_result) -> int:
    """Return when a file was changed: copying another file to its place may keep the time of its content."""
    return max(status.st_mtime_ns, status.st_ctime_ns)


def input_paths(line: BatchLine) -> list[Path]:
    """Return the files that are read for a line: its recording and, if the row has no words, its label files."""
    recording = Path(line.recording)
    return [recording] + ([] if line.transcript else find_label_files(recording))


def input_files(line: BatchLine) -> list[InputFile]:
    """Return the files of ``input_paths`` as they are now.

    Raises InputError: the recording is missing, empty, a folder, a pipe or a device. OSError: one cannot be read.
    """
    check_source(Path(line.recording), "recording")
    status = [(path, path.stat()) for path in input_paths(line)]
    return [InputFile(str(path), each.st_size, _changed_ns(each), sha256_of(path)) for path, each in status]
