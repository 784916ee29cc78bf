"""Source recordings: what every reader of a folder returns, and the lists train.txt, val.txt and test.txt of splits."""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from lipmotion.corpora import SPLITS
from lipmotion.errors import CorpusError, InputError, shorten
from lipmotion.storage.sources import AUDIO_SUFFIXES, VIDEO_SUFFIXES, read_text_file
from lipmotion.storage.text_table import parse_text_table
from lipmotion.types import Channel, Timeline, Unit


@dataclass(frozen=True)
class MotionFile:
    """A file with the motion that goes with a sound."""

    file: Path  # as ``animate`` writes it (.csv .json .npz), a bare array of numbers (.npy), or the first mesh (.ply)
    rate_hz: float | None = None  # frame rate of a bare array, or of meshes; None: the file states it
    channels: tuple[Channel, ...] = ()  # of a bare array; empty: the file states them


@dataclass(frozen=True)
class SourceRecording:
    """One recorded sentence: sound with motion, or video.

    name        : unique in its folder, usable as a folder's name
    file        : the video, or the sound that goes with the motion file
    words       : the transcript, or None where it is not known
    split       : ``train``, ``val`` or ``test``
    rights      : licence and attribution, where known
    speaker     : name of the speaker, empty where it is not known
    phones      : labelled phones in time, or None
    motion_file : the motion; None: the face in ``file`` is to be tracked
    start_s     : where in the file the sentence begins, s
    end_s       : where it ends; None: the file is this one sentence
    recorder    : its sound as a recorder of its own made it, not in step; None: the sound of ``file`` is used
    offset_s    : by how much the sound that is used is late, where that is given
    """

    name: str
    file: Path
    words: tuple[str, ...] | None
    split: str = "train"
    rights: dict[str, str] = field(default_factory=dict)
    speaker: str = ""
    phones: Timeline[Unit] | None = None
    motion_file: MotionFile | None = None
    start_s: float = 0.0
    end_s: float | None = None
    recorder: Path | None = None
    offset_s: float | None = None


@dataclass(frozen=True)
class RecordingFolder:
    """The recordings in a folder."""

    kind: str  # the kind of folder, in words
    recordings: tuple[SourceRecording, ...]  # those that can be used, sorted by name
    problems: dict[str, str] = field(default_factory=dict)  # those that cannot be used, name to reason


def filter_videos(paths: Iterable[Path]) -> list[Path]:
    """Return the files with the suffix of a video, sorted."""
    return sorted(path for path in paths if path.suffix.lower() in VIDEO_SUFFIXES and path.is_file())


LISTS = tuple(f"{split}.txt" for split in SPLITS)
LARGEST_LIST_BYTES = 1 << 24  # most bytes of a list of names
MAX_MISSING_NAMES = 20_000
"""Names without a recording that are reported one by one; more of them mean a list of another folder."""


def assign_splits(folder: RecordingFolder, directory: Path) -> RecordingFolder:
    """Return the recordings with the splits of the lists in ``directory``.

    Without lists all stay what their layout says, ``train`` as a rule. With a train.txt, recordings that are in no
    list become problems, because they are not meant for training; so do names without a recording.
    A list may name files (``take08.mkv``), or have remarks after a name: where no recording has that name, they are
    left out.
    Raises CorpusError: a name is in two lists, or more than ``MAX_MISSING_NAMES`` names have no recording.
    """
    known = {recording.name for recording in folder.recordings} | folder.problems.keys()
    split_of: dict[str, str] = {}
    for split in SPLITS:
        path = directory / f"{split}.txt"
        for listed in read_names(path) if path.is_file() else ():
            shorter = (listed.rpartition(".")[0], listed.split()[0])  # without a suffix, or the remarks of LRS2's lists
            name = listed if listed in known else next((each for each in shorter if each in known), listed)
            if split_of.setdefault(name, split) != split:
                raise CorpusError(f"{name} is in {split_of[name]}.txt and in {split}.txt of {directory}; keep one")
    has_list = (directory / "train.txt").is_file()
    problems = {
        name: f"listed in {split}.txt, but there is no such recording"
        for name, split in split_of.items()
        if name not in known
    }
    if len(problems) > MAX_MISSING_NAMES:
        raise CorpusError(
            f"{directory}: its lists name {len(problems)} recordings that are not in it, at most {MAX_MISSING_NAMES} "
            "may be missing; are they those of another folder?"
        )
    recordings = []
    for recording in folder.recordings:
        assigned = split_of.get(recording.name, None if has_list else recording.split)
        if assigned is None:
            problems[recording.name] = f"in none of the lists of {directory} ({', '.join(LISTS)}); add it to one"
        else:
            recordings.append(replace(recording, split=assigned))
    return RecordingFolder(folder.kind, tuple(recordings), folder.problems | problems)


def read_names(path: Path) -> list[str]:
    """Return the names of utterances that a text file lists, one a line.

    Raises CorpusError: no such file, or not UTF-8 text.
    """
    try:
        lines = read_text_file(path, "list", LARGEST_LIST_BYTES).splitlines()
    except InputError as error:
        raise CorpusError(f"{error}; required: one name a line") from error
    return [line.strip().replace("/", "-") for line in lines if line.strip()]


RECORDER = ".recorder"
"""``take.recorder.wav`` is the sound that a recorder of its own made of ``take.mp4``, or of ``take.wav``: it is no
recording of its own."""
OFFSETS = "offsets.csv"
COLUMNS = ["name", "offset_ms"]
LARGEST_TABLE_BYTES = 1 << 22
LARGEST_OFFSET_S = 6 * 3600.0


def add_separate_sounds(
    folder: RecordingFolder, directory: Path, offset_s: float | None = None, *, is_whole: bool = True
) -> RecordingFolder:
    """Return the recordings with the sounds of their recorders, and with the offsets of the table ``offsets.csv``.

    offset_s : by how much the sound of each recording that is not in the table is late; None: that is not known
    is_whole : whether these are all recordings of the folder: names of the table without one then become problems
    Raises CorpusError: the table is damaged. Raises InputError: an offset that no recording has.
    """
    if offset_s is not None:
        _check(offset_s)
    table = read_offsets(directory / OFFSETS) if (directory / OFFSETS).is_file() else {}
    recordings, problems = [], dict(folder.problems)
    for recording in folder.recordings:
        stem = recording.file.with_suffix(RECORDER)
        sounds = [path for suffix in sorted(AUDIO_SUFFIXES) if (path := stem.with_name(stem.name + suffix)).is_file()]
        if len(sounds) > 1:
            what = f"{len(sounds)} recorders' sounds beside it: {', '.join(path.name for path in sounds)}"
            problems[recording.name] = f"{recording.file}: {what}; keep one"
            continue
        sound = sounds[0] if sounds else None
        recordings.append(replace(recording, recorder=sound, offset_s=table.get(recording.name, offset_s)))
    known = {recording.name for recording in folder.recordings} | problems.keys()
    problems |= {
        name: f"in {OFFSETS}, but there is no such recording" for name in table if is_whole and name not in known
    }
    return RecordingFolder(folder.kind, tuple(recordings), problems)


def read_offsets(path: Path) -> dict[str, float]:
    """Return by how many seconds the sound of each recording is late, from a table ``name,offset_ms``.

    Raises CorpusError: other columns, a row that is damaged, or a name twice.
    """
    try:
        table = parse_text_table(io.StringIO(read_text_file(path, "table of offsets", LARGEST_TABLE_BYTES), newline=""))
        if table.names != COLUMNS:
            raise InputError(f"{path}: the columns are {shorten(','.join(table.names))!r}, required name,offset_ms")
        offsets: dict[str, float] = {}
        for number, row in table.rows:
            name = row[0].strip().replace("/", "-")
            try:
                if len(row) != len(COLUMNS):
                    raise ValueError(f"{len(row)} fields")
                offset_s = float(row[1].replace(",", ".")) / 1000
            except ValueError as error:
                what = f"{path}: line {number}: {shorten(str(error))}"
                raise InputError(f"{what}, required a name and milliseconds") from error
            _check(offset_s)
            if offsets.setdefault(name, offset_s) != offset_s:
                raise InputError(f"{path}: line {number}: {shorten(name)!r} has another offset above; keep one")
    except ValueError as error:
        raise CorpusError(str(error)) from error
    return offsets


def _check(offset_s: float) -> None:
    if not abs(offset_s) <= LARGEST_OFFSET_S:
        raise InputError(f"the offset is {offset_s * 1000:g} ms, required within ±{LARGEST_OFFSET_S * 1000:.0f}")
