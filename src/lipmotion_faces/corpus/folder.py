"""Finding the recordings in a folder: all readers by kind, and that of any folder of videos, or sounds with motion.

Labels lie beside both where there are any. A video with a table of Live Link Face beside it is not tracked: the table
is its motion.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from lipmotion.errors import CorpusError, InputError, shorten
from lipmotion.extensions import Registry
from lipmotion.formats.label_files import find_labels, read_labels
from lipmotion.formats.tables import is_live_link_file
from lipmotion.storage.sources import AUDIO_SUFFIXES, VIDEO_SUFFIXES, check_listable, read_shipped_table
from lipmotion.units import split_words
from lipmotion_faces.corpus.source_recordings import (
    LISTS,
    RECORDER,
    MotionFile,
    RecordingFolder,
    SourceRecording,
    assign_splits,
    filter_videos,
)

VIDEOS, SOUNDS, BOTH = "folder of videos", "folder of sounds with motion", "folder of videos, and of sounds with motion"
VIDEO_KINDS = (VIDEOS, BOTH)  # kinds of folders whose videos may be longer than a sentence
MOTION_SUFFIXES = (".csv", ".json", ".npz", ".livelink.csv", ".c3d", ".fap")
"""Motion files that ``read_motion`` reads, and that may lie beside a sound."""
CAPTURE_SUFFIXES = (".csv", ".livelink.csv")
"""Tables of Live Link Face, which may also lie beside the video that the app records with them."""


def read_folder(directory: Path) -> RecordingFolder:
    """Return the recordings in a folder and its sub-folders: videos, and sounds with a motion file of the same name.

    Transcripts and labels have the name of the recording: ``take1.txt``, ``take1.TextGrid``, ``take1.lab``. Recordings
    in a sub-folder ``anna`` have the speaker ``anna``, and names as ``anna-take1``.
    """
    by_name: dict[str, list[Path]] = {}
    kinds = set()
    for path in list_files(directory):
        is_sound = path.suffix.lower() in AUDIO_SUFFIXES and not path.stem.lower().endswith(RECORDER)
        has_motion = is_sound and path.is_file() and find_motion_files(path)
        if has_motion or filter_videos([path]):
            by_name.setdefault("-".join(path.relative_to(directory).with_suffix("").parts), []).append(path)
            kinds.add(SOUNDS if has_motion else VIDEOS)
    lists = frozenset(directory / name for name in LISTS)

    def read_recording(name: str, path: Path) -> SourceRecording:
        labels = find_labels(path, ignored=lists)
        if path.suffix.lower() in AUDIO_SUFFIXES:
            siblings = find_motion_files(path)
        else:
            captures = [path.with_suffix(suffix) for suffix in CAPTURE_SUFFIXES]
            siblings = [capture for capture in captures if capture.is_file() and is_live_link_file(capture)]
        if len(siblings) > 1:
            files = ", ".join(map(str, siblings))
            raise InputError(f"{path}: {len(siblings)} motion files beside it: {files}; keep one")
        motion_file = MotionFile(siblings[0]) if siblings else None
        speaker = (*path.relative_to(directory).parts[:-1], "")[0]
        return SourceRecording(name, path, labels.words, speaker=speaker, phones=labels.phones, motion_file=motion_file)

    kind = BOTH if len(kinds) > 1 else next(iter(kinds), VIDEOS)
    return gather_recordings(kind, by_name, read_recording, directory)


def list_files(directory: Path) -> list[Path]:
    """Return what is in a folder and its sub-folders, sorted, without what is hidden."""
    paths = ((path, path.relative_to(directory).parts) for path in directory.rglob("*"))
    return sorted(path for path, parts in paths if not any(part.startswith(".") for part in parts))


def gather_recordings(
    kind: str,
    by_name: Mapping[str, list[Path]],
    read_recording: Callable[[str, Path], SourceRecording],
    directory: Path,
) -> RecordingFolder:
    """Return the recordings of the files with each name; where it has several, or cannot be read, it is a problem.

    read_recording : returns a recording of its name and its file, or raises InputError
    directory : where the lists of the splits may lie
    """
    recordings, problems = [], {}
    for name, paths in by_name.items():
        try:
            if len(paths) > 1:
                files = ", ".join(map(str, paths))
                raise InputError(f"{len(paths)} recordings share this name: {files}; rename all but one")
            recordings.append(read_recording(name, paths[0]))
        except InputError as error:
            problems[name] = str(error)
    recordings.sort(key=lambda recording: recording.name)
    return assign_splits(RecordingFolder(kind, tuple(recordings), problems), directory)


def find_motion_files(sound: Path) -> list[Path]:
    """Return the motion files with the name of a sound, beside it."""
    return [path for suffix in MOTION_SUFFIXES if (path := sound.with_suffix(suffix)).is_file()]


CorpusReader = Callable[[Path], RecordingFolder | None]
"""Returns the recordings in a folder; None where the folder is not of the reader's kind."""
READERS: Registry[CorpusReader] = Registry(
    "corpus reader",
    "lipmotion.corpus_readers",
    {
        "grid": "lipmotion_faces.corpus.folder:read_grid",
        "facegood": "lipmotion_faces.corpus.captured_faces:read_facegood",
        "vocaset": "lipmotion_faces.corpus.captured_faces:read_vocaset",
        "layouts": "lipmotion_faces.corpus.folder:read_layouts",
        "folder": "lipmotion_faces.corpus.folder:read_folder",
    },
)


def discover(directory: Path) -> RecordingFolder:
    """Return the recordings in a folder, from the first reader that recognises its kind.

    GRID of one speaker, FACEGOOD, VOCASET, the table of known corpora (``layouts``), then what installed packages add
    in alphabetical order, then any folder of videos or sounds.

    Raises InputError: no such folder. Raises CorpusError: no recordings in it, or its lists contradict each other.
    """
    if directory.is_file():
        raise InputError(f"{directory}: is a file; give the folder of recordings that it is in")
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; give a folder of recordings")
    check_listable(directory)
    readers = sorted(READERS.names, key=lambda name: name == "folder")  # the one that reads any folder is the last
    folder = next(filter(None, (READERS.load(name)(directory) for name in readers)))
    if not folder.recordings and not folder.problems:
        raise CorpusError(
            f"{directory}: no videos in it, and no sounds with motion beside them; required: files ending in one of "
            f"{' '.join(sorted(VIDEO_SUFFIXES))}, or a sound and a file of the same name in {' '.join(MOTION_SUFFIXES)}"
        )
    return folder


KIND = "GRID corpus"
RIGHTS = {"licence": "CC BY 4.0", "attribution": "GRID corpus (Cooke, Barker, Cunningham, Shao 2006), CC BY 4.0"}
SILENCES = frozenset({"sil", "sp"})  # labels of a word-time file that are not words
WORD = re.compile(r"[^\W\d_]+(?:['-][^\W\d_]+)*")
LARGEST_ALIGNMENT_BYTES = 1 << 16  # most bytes of a word-time file; GRID's have a hundred

COMMANDS = {"b": "bin", "l": "lay", "p": "place", "s": "set"}
COLOURS = {"b": "blue", "g": "green", "r": "red", "w": "white"}
PREPOSITIONS = {"a": "at", "b": "by", "i": "in", "w": "with"}
DIGITS = dict(zip("z123456789", "zero one two three four five six seven eight nine".split(), strict=True))
ADVERBS = {"a": "again", "n": "now", "p": "please", "s": "soon"}
NAME = re.compile(r"[blps][bgrw][abiw][a-vx-z][z1-9][anps]")
"""A letter for each of the six words: command, colour, preposition, letter (there is no w), digit, adverb."""


def read_grid(directory: Path) -> RecordingFolder | None:
    """Return the recordings of one speaker's folder, or None if most videos directly in it are not named like GRID's.

    directory : with clips/ or the videos themselves; align/ or .align files beside the videos; the lists of the splits
    """
    clips = directory / "clips"
    files = filter_videos((clips if clips.is_dir() else directory).iterdir())
    if 2 * sum(spell_name(path.stem) is not None for path in files) <= len(files):
        return None
    named = re.search(r"(?:^|[^a-z0-9])(s[1-9]\d?)$", directory.resolve().name.lower())  # ``s1``, ``grid-s1``
    speaker, by_name = named[1] if named else "", dict[str, list[Path]]()
    for path in files:
        by_name.setdefault(path.stem, []).append(path)

    def read_recording(name: str, path: Path) -> SourceRecording:
        words = _find_words(path, (directory / "align", path.parent))
        return SourceRecording(name, path, words, rights=RIGHTS, speaker=speaker)

    return gather_recordings(KIND, by_name, read_recording, directory)


def spell_name(name: str) -> tuple[str, ...] | None:
    """Return the six words that a GRID file name spells out, or None if it is not one."""
    if not NAME.fullmatch(name):
        return None
    command, colour, preposition, letter, digit, adverb = tuple(name)
    first_words = (COMMANDS[command], COLOURS[colour], PREPOSITIONS[preposition])
    return (*first_words, letter, DIGITS[digit], ADVERBS[adverb])


def _find_words(video: Path, folders: Iterable[Path]) -> tuple[str, ...] | None:
    """Return the words of a video from the first of some folders with its word-time file, else from its name."""
    files = (folder / f"{video.stem}.align" for folder in folders)
    return next((read_aligned_words(path) for path in files if path.is_file()), None) or spell_name(video.stem)


def read_aligned_words(path: Path) -> tuple[str, ...]:
    """Return the words of a word-time file: lines of start, end (unit 1/25000 s) and word.

    Raises InputError: not such a file, or without a word.
    """
    size = path.stat().st_size
    if size > LARGEST_ALIGNMENT_BYTES:
        required = f"required at most {LARGEST_ALIGNMENT_BYTES}"
        raise InputError(f"{path}: {size} bytes, {required}: are they the words of one sentence?")
    rows = [line.split() for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    for number, row in enumerate(rows, 1):
        if len(row) != 3 or not re.fullmatch(r"[0-9]+ [0-9]+", " ".join(row[:2])):
            raise InputError(f"{path}: line {number} is {shorten(' '.join(row))!r}; required: start end word")
        if not WORD.fullmatch(row[2]):
            raise InputError(f"{path}: line {number} has {shorten(row[2])!r} where its word should be")
    words = tuple(row[2].lower() for row in rows if row[2].lower() not in SILENCES)
    if not words:
        raise InputError(f"{path}: holds no word; remove the file if the words are not known")
    return words


LRS = "LRS"  # the kind whose clips may be longer than a sentence
Words = tuple[str, ...]
CREMA_SENTENCES = {row["code"]: row["sentence"] for row in read_shipped_table("lipmotion_faces.corpus", "crema_d.csv")}
"""What is said in CREMA-D, by the code in a file's name. Source: Cao et al. 2014, Table 1."""


@dataclass(frozen=True)
class Layout:
    """How a corpus lies in its folder.

    kind  : the kind of folder, in words
    path  : the path of a video, without its suffix, from the name of the folder that was given on; the groups
            ``speaker``, ``stem`` and ``split`` say whose it is, what it is called, and in which list it is
    name  : of its utterance, with the groups of ``path`` in braces; without the dash of a group that is empty
    words : returns what is said in a video, from the folder that was given, the video and the groups; None: the words,
            or phones in time, are in files beside the video
    only  : what groups must be for a video to be used; the others, from the side for instance, are passed over
    rights : licence and attribution, as in ``SourceRecording``
    """

    kind: str
    path: re.Pattern[str]
    name: str
    words: Callable[[Path, Path, Mapping[str, str]], Words | None] | None
    only: Mapping[str, str]
    rights: Mapping[str, str]


def read_layouts(directory: Path) -> RecordingFolder | None:
    """Return the recordings in a folder whose videos mostly lie as one of ``LAYOUTS`` says, or None."""
    videos, root = filter_videos(list_files(directory)), directory.resolve().name
    paths = {path: f"{root}/{path.relative_to(directory).with_suffix('').as_posix()}" for path in videos}
    for layout in LAYOUTS:
        matches = {path: match for path, text in paths.items() if (match := layout.path.fullmatch(text))}
        if 2 * len(matches) > len(videos):
            break
    else:
        return None
    groups = {path: match.groupdict(default="") for path, match in matches.items()}
    lists = frozenset(directory / name for name in LISTS)
    by_name: dict[str, list[Path]] = {}
    for path, named in groups.items():
        if all(named[group] == wanted for group, wanted in layout.only.items()):
            by_name.setdefault(layout.name.format_map(named).lstrip("-"), []).append(path)

    def read_recording(name: str, video: Path) -> SourceRecording:
        named = groups[video]
        labels = find_labels(video, ignored=lists) if layout.words is None else None
        return SourceRecording(
            name,
            video,
            labels.words if labels else layout.words(directory, video, named) if layout.words else None,
            split=named.get("split") or "train",
            rights=dict(layout.rights),
            speaker=named["speaker"],
            phones=labels.phones if labels else None,
        )

    return gather_recordings(layout.kind, by_name, read_recording, directory)


def _read_grid_words(directory: Path, video: Path, groups: Mapping[str, str]) -> Words | None:
    """Return the words of a word-time file, of the speaker or of all, or else of the video's name."""
    above = [folder for folder in video.parents if folder == directory or directory in folder.parents]
    folders = [video.parent, *(folder / "align" for folder in above)]
    folders += [folder / inner / groups["speaker"] for folder in above for inner in ("align", "alignments")]
    return _find_words(video, folders)


def _read_tcd_words(_directory: Path, video: Path, _groups: Mapping[str, str]) -> Words | None:
    """Return the words of the script beside a video, ``SA1.txt`` of ``sa1.mp4``: lines of start, end, word; or text."""
    scripts = (video.with_name(f"{stem}.txt") for stem in (video.stem, video.stem.upper()))
    return next((read_labels(path).words for path in scripts if path.is_file()), None)


RESEARCH = {"licence": "research, as agreed with its owners"}

_WORDS = {
    "grid": _read_grid_words,
    "crema-d": lambda _directory, _video, groups: split_words(CREMA_SENTENCES[groups["sentence"]]),
    "tcd-timit": _read_tcd_words,
}
_SETS = {"NAME": NAME.pattern, "SENTENCES": "|".join(CREMA_SENTENCES)}  # what the paths in the table stand for
LAYOUTS = tuple(
    Layout(
        row["kind"],
        re.compile(re.sub("NAME|SENTENCES", lambda match: _SETS[match[0]], row["path"])),
        row["name"],
        _WORDS.get(row["words"]),
        dict(part.split("=") for part in row["only"].split()),
        {key: row[key] for key in ("licence", "attribution") if row[key]},
    )
    for row in read_shipped_table("lipmotion_faces.corpus", "layouts.csv")
)
