"""Layouts of known corpora of many people: a row of a table says whose a video is, and where its words are.

A new corpus is a new row of ``LAYOUTS``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lipmotion.corpora.folder import gather_recordings, list_files
from lipmotion.corpora.source_recordings import LISTS, RecordingFolder, SourceRecording, assign_splits, filter_videos
from lipmotion.errors import InputError, shorten
from lipmotion.formats.label_files import find_labels, read_labels
from lipmotion.storage.files import read_text_file
from lipmotion.units import split_words

KIND = "GRID corpus"
RIGHTS = {"licence": "CC BY 4.0", "attribution": "GRID corpus (Cooke, Barker, Cunningham, Shao 2006), CC BY 4.0"}
SILENCES = frozenset({"sil", "sp"})
"""Labels of a word-time file that are not words."""
WORD = re.compile(r"[^\W\d_]+(?:['-][^\W\d_]+)*")
LARGEST_ALIGNMENT_BYTES = 1 << 16
"""Most bytes of a word-time file; GRID's have a hundred."""

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
    recordings, problems, speaker = [], {}, named[1] if named else ""
    for path in files:
        try:
            words = _find_words(path, (directory / "align", path.parent))
            recordings.append(SourceRecording(path.stem, path, words, rights=RIGHTS, speaker=speaker))
        except InputError as error:
            problems[path.stem] = str(error)
    return assign_splits(RecordingFolder(KIND, tuple(recordings), problems), directory)


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
        most = f"required at most {LARGEST_ALIGNMENT_BYTES}"
        raise InputError(f"{path}: {size} bytes, {most}: are they the words of one sentence?")
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


LRS = "LRS"
"""The kind whose clips may be longer than a sentence."""
Words = tuple[str, ...]
CREMA_SENTENCES = {
    "DFA": "don't forget a jacket",
    "IEO": "it's eleven o'clock",
    "IOM": "i'm on my way to the meeting",
    "ITH": "i think i have a doctor's appointment",
    "ITS": "i think i've seen this before",
    "IWL": "i would like a new alarm clock",
    "IWW": "i wonder what this is about",
    "MTI": "maybe tomorrow it will be cold",
    "TAI": "the airplane is almost full",
    "TIE": "that is exactly what happened",
    "TSI": "the surface is slick",
    "WSI": "we'll stop in a couple of minutes",
}
"""What is said in CREMA-D, by the code in a file's name. Source: Cao et al. 2014, Table 1."""
SCRIPT_LINE = re.compile(r"\d+\s+\d+\s+(\S+)")
"""A line of the word times of TCD-TIMIT: start, end, word."""


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
    words: Callable[[Path, Path, Mapping[str, str]], Words | None] | None = None
    only: Mapping[str, str] = field(default_factory=dict)
    rights: Mapping[str, str] = field(default_factory=dict)


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


def _grid_words(directory: Path, video: Path, groups: Mapping[str, str]) -> Words | None:
    """Return the words of a word-time file, of the speaker or of all, or else of the video's name."""
    above = [folder for folder in video.parents if folder == directory or directory in folder.parents]
    folders = [video.parent, *(folder / "align" for folder in above)]
    folders += [folder / inner / groups["speaker"] for folder in above for inner in ("align", "alignments")]
    return _find_words(video, folders)


def _tcd_words(_directory: Path, video: Path, _said: Mapping[str, str]) -> Words | None:
    """Return the words of the script beside a video, ``SA1.txt`` of ``sa1.mp4``: lines of start, end, word; or text."""
    scripts = (video.with_name(f"{stem}.txt") for stem in (video.stem, video.stem.upper()))
    script = next((path for path in scripts if path.is_file()), None)
    if script is None:
        return None
    lines = read_text_file(script, "script", LARGEST_ALIGNMENT_BYTES).splitlines()
    rows = [SCRIPT_LINE.fullmatch(line.strip()) for line in lines if line.strip()]
    if not rows or not all(rows):
        return read_labels(script).words
    spoken = [row[1] for row in rows if row and row[1].lower() not in SILENCES]
    return split_words(" ".join(spoken))


def _research(attribution: str) -> dict[str, str]:
    return {"licence": "research, as agreed with its owners", "attribution": attribution}


LAYOUTS = (
    Layout(
        KIND,
        re.compile(rf"(?i:(?:.*[^a-z0-9])?(?P<speaker>s[1-9]\d?)/(?:.*/)?)(?P<stem>{NAME.pattern})"),
        "{speaker}-{stem}",
        _grid_words,
        rights=RIGHTS,
    ),
    Layout(
        "CREMA-D",
        re.compile(rf".*/(?P<stem>(?P<speaker>1\d{{3}})_(?P<sentence>{'|'.join(CREMA_SENTENCES)})_[A-Z]{{3}}_[A-Z]+)"),
        "{stem}",
        lambda _directory, _video, groups: split_words(CREMA_SENTENCES[groups["sentence"]]),
        rights={"licence": "ODbL 1.0", "attribution": "CREMA-D (Cao, Cooper, Keutmann, Gur, Nenkova, Verma 2014)"},
    ),
    Layout(
        "TCD-TIMIT",
        re.compile(
            r"(?:.*/)?(?P<speaker>\d\d[MFT]|Lipspkr\d)/(?:Clips/)?(?P<camera>straight|30deg)cam/(?P<stem>[^/]+)"
        ),
        "{speaker}-{stem}",
        _tcd_words,
        {"camera": "straight"},
        _research("TCD-TIMIT (Harte, Gillen 2015)"),
    ),
    Layout(
        "MEAD",
        re.compile(
            r"(?:.*/)?(?P<speaker>[MW]\d{3})/video/(?P<view>[^/]+)/(?P<emotion>[^/]+)/(?P<level>level_\d)/(?P<stem>[^/]+)"
        ),
        "{speaker}-{emotion}-{level}-{stem}",
        only={"view": "front"},
        rights=_research("MEAD (Wang, Wu, Song, Yang, Wu, Qian, He, Qiao, Loy 2020)"),
    ),
    Layout(
        LRS,
        re.compile(r"(?:.*/)?(?:main|trainval|(?P<set>pretrain)|(?P<split>test))/(?P<speaker>[^/]+)/(?P<stem>\d{5})"),
        "{set}-{speaker}-{stem}",
    ),
)
