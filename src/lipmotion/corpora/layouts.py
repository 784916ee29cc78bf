"""Layouts of known corpora of many people: a row of a table says whose a video is, and where its words are.

A new corpus is a new row of ``LAYOUTS``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lipmotion.corpora import grid
from lipmotion.corpora.folder import files_in, gathered
from lipmotion.corpora.labels import labels_beside, read_labels
from lipmotion.corpora.source_recordings import RecordingFolder, SourceRecording, video_files
from lipmotion.corpora.splits import LISTS
from lipmotion.storage.files import read_text_file
from lipmotion.units import words_of

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
    videos, root = video_files(files_in(directory)), directory.resolve().name
    for layout in LAYOUTS:
        found = {
            path: said
            for path in videos
            if (said := layout.path.fullmatch(f"{root}/{path.relative_to(directory).with_suffix('').as_posix()}"))
        }
        if 2 * len(found) > len(videos):
            return _read(layout, directory, {path: said.groupdict(default="") for path, said in found.items()})
    return None


def _read(layout: Layout, directory: Path, groups: Mapping[Path, Mapping[str, str]]) -> RecordingFolder:
    """Return the recordings of a layout; ``groups``: of the path of each video."""
    lists = frozenset(directory / name for name in LISTS)
    by_name: dict[str, list[Path]] = {}
    for path, said in groups.items():
        if all(said[group] == wanted for group, wanted in layout.only.items()):
            by_name.setdefault(layout.name.format_map(said).lstrip("-"), []).append(path)

    def recording_of(name: str, video: Path) -> SourceRecording:
        said = groups[video]
        beside = labels_beside(video, ignored=lists) if layout.words is None else None
        return SourceRecording(
            name,
            video,
            beside.words if beside else layout.words(directory, video, said) if layout.words else None,
            split=said.get("split") or "train",
            rights=dict(layout.rights),
            speaker=said["speaker"],
            phones=beside.phones if beside else None,
        )

    return gathered(layout.kind, by_name, recording_of, directory)


def _grid_words(directory: Path, video: Path, said: Mapping[str, str]) -> Words | None:
    """Return the words of a word-time file, of the speaker or of all, or else of the video's name."""
    above = [folder for folder in video.parents if folder == directory or directory in folder.parents]
    folders = [video.parent, *(folder / "align" for folder in above)]
    folders += [folder / inner / said["speaker"] for folder in above for inner in ("align", "alignments")]
    return grid.aligned_words(video, folders) or grid.words_of_name(video.stem)


def _crema_words(_directory: Path, _video: Path, said: Mapping[str, str]) -> Words | None:
    return words_of(CREMA_SENTENCES[said["sentence"]])


def _tcd_words(_directory: Path, video: Path, _said: Mapping[str, str]) -> Words | None:
    """Return the words of the script beside a video, ``SA1.txt`` of ``sa1.mp4``: lines of start, end, word; or text."""
    scripts = (video.with_name(f"{stem}.txt") for stem in (video.stem, video.stem.upper()))
    script = next((path for path in scripts if path.is_file()), None)
    if script is None:
        return None
    lines = read_text_file(script, "script", grid.LARGEST_ALIGNMENT_BYTES).splitlines()
    rows = [SCRIPT_LINE.fullmatch(line.strip()) for line in lines if line.strip()]
    if not rows or not all(rows):
        return read_labels(script).words
    spoken = [row[1] for row in rows if row and row[1].lower() not in grid.SILENCES]
    return words_of(" ".join(spoken))


def _research(attribution: str) -> dict[str, str]:
    return {"licence": "research, as agreed with its owners", "attribution": attribution}


LAYOUTS = (
    Layout(
        grid.KIND,
        re.compile(rf"(?i:(?:.*[^a-z0-9])?(?P<speaker>s[1-9]\d?)/(?:.*/)?)(?P<stem>{grid.NAME.pattern})"),
        "{speaker}-{stem}",
        _grid_words,
        rights=grid.RIGHTS,
    ),
    Layout(
        "CREMA-D",
        re.compile(rf".*/(?P<stem>(?P<speaker>1\d{{3}})_(?P<sentence>{'|'.join(CREMA_SENTENCES)})_[A-Z]{{3}}_[A-Z]+)"),
        "{stem}",
        _crema_words,
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
