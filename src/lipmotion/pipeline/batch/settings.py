"""What a batch does with every line, and the fingerprint that tells whether a line must be done again."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from lipmotion.articulation.delivery import Delivery
from lipmotion.articulation.pauses import REST
from lipmotion.corpora.labels import label_files_beside
from lipmotion.errors import ExportError, InputError
from lipmotion.export.base import motion_suffixes
from lipmotion.export.cues import CUE_FORMATS
from lipmotion.export.timed_labels import LABEL_SUFFIXES
from lipmotion.extensions import installed_version
from lipmotion.faces.base import Staging
from lipmotion.pipeline.batch.lines import BatchLine
from lipmotion.pipeline.model import shipped_path
from lipmotion.pipeline.outputs.cues import SHEET
from lipmotion.pipeline.outputs.drawn_video import VIDEO_SUFFIXES
from lipmotion.pipeline.outputs.scenes import SCENE_SUFFIXES
from lipmotion.storage.files import check_source, sha256_of
from lipmotion.storage.json_text import as_json

CUES = SHEET.removeprefix(".")
"""Prefix of the kinds of outputs that are cue sheets: ``cues.tsv`` is Rhubarb's table."""


@dataclass(frozen=True)
class BatchSettings:
    """What is made of every recording of a batch, and how.

    kinds        : suffixes of the outputs without the first dot: those of ``lipmotion.write`` (``json``, ``csv``,
                   ``livelink.csv``, ``glb``, ``TextGrid``, ``mp4`` …), and ``cues.tsv``, ``cues.xml``, ``cues.json``,
                   ``cues.dat``
    recogniser   : of recordings without a transcript, as of ``SpeechRequest``
    speaker      : of lines that name none
    pauses, asymmetry : as of ``SpeechRequest``
    model        : path of the model file; empty: the shipped model
    lexicon      : path of a file of pronunciations; empty: none
    channels     : of motion files; empty: all of the motion
    curves       : what motion files hold instead of the motion: ``arkit``, ``visemes``, ``fap``, or the path of the
                   table of a rig (``.csv``)
    articulation : whether motion files get the articulatory channels
    rate_hz      : frames per second of motion files; None: 100
    fps          : frames per second of videos and cues; None: 25 and 24
    face         : of videos, a name or the path of a file
    staging      : of that face
    delivery     : intensity, anticipation, offset and held poses of every output

    >>> BatchSettings(kinds=("json", "cues.tsv")).recogniser
    'auto'
    """

    kinds: tuple[str, ...] = ("json",)
    recogniser: str = "auto"
    speaker: str = ""
    pauses: str = REST
    asymmetry: float = 0.0
    model: str = ""
    lexicon: str = ""
    channels: tuple[str, ...] = ()
    curves: str = ""
    articulation: bool = False
    rate_hz: float | None = None
    fps: float | None = None
    face: str = "portrait"
    staging: Staging = field(default_factory=Staging)
    delivery: Delivery = field(default_factory=Delivery)


def possible_kinds() -> tuple[str, ...]:
    """Return the kinds of outputs that a batch can write, without the first dot."""
    plain = (*motion_suffixes(), *LABEL_SUFFIXES, *VIDEO_SUFFIXES, *SCENE_SUFFIXES)
    return (*(suffix.removeprefix(".") for suffix in plain), *(f"{CUES}{name}" for name in CUE_FORMATS))


def check_kinds(kinds: Sequence[str]) -> None:
    """Raise ExportError for a kind of output that a batch cannot write, one that is given twice, or none at all."""
    known = possible_kinds()
    unknown = [kind for kind in kinds if kind not in known]
    if unknown or not kinds:
        found = repr(unknown[0]) if unknown else "nothing"
        raise ExportError(f"the outputs are to be {found}; required some of: {', '.join(known)}, with commas")
    if len(set(kinds)) < len(kinds):
        raise ExportError(f"the outputs are {', '.join(kinds)}: one is given twice; give every kind once")


def fingerprint_of(settings: BatchSettings) -> str:
    """Return a digest of all settings, of the content of their files, and of the version of lipmotion."""
    files = {"model": settings.model or str(shipped_path()), "lexicon": settings.lexicon}
    files |= {"face": settings.face if os.path.isfile(settings.face) else ""}  # noqa: PTH113
    files |= {"curves": settings.curves if os.path.isfile(settings.curves) else ""}  # noqa: PTH113
    digests = {name: sha256_of(Path(path)) if path else "" for name, path in files.items()}
    named: dict[str, Any] = asdict(settings) | {"model": "", "lexicon": ""}
    named["lipmotion"] = installed_version()
    return _digest(as_json([named, digests], sort_keys=True))


def line_fingerprint(line: BatchLine, of_settings: str) -> str:
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
    return [recording] + ([] if line.transcript else label_files_beside(recording))


def input_files(line: BatchLine) -> list[InputFile]:
    """Return the files of ``input_paths`` as they are now.

    Raises InputError: the recording is missing, empty, a folder, a pipe or a device. OSError: one cannot be read.
    """
    check_source(Path(line.recording), "recording")
    found = []
    for path in input_paths(line):
        status = path.stat()
        found.append(InputFile(str(path), status.st_size, _changed_ns(status), sha256_of(path)))
    return found
