"""Footage of one person: which recordings there are, and which of them are used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path
from typing import Any

from lipmotion.corpora.discover import discover
from lipmotion.corpora.entry import read_entry
from lipmotion.corpora.source_recordings import SourceRecording, video_files
from lipmotion.corpora.store import MANIFEST, Corpus
from lipmotion.errors import InputError
from lipmotion.stats.pca import choose_evenly
from lipmotion.storage.files import check_source, sha256_of
from lipmotion.storage.media import open_media, stated_duration_s, video_streams
from lipmotion_faces.tracking.frames import VideoSpan

MOST_FOOTAGE_S = 240.0
"""Seconds of footage that are used, spread evenly over all recordings: of 500 candidates few are new after that."""
LONG_S = 10.0
"""Recordings are used whole if they are no longer; of longer ones the beginning, at least so much."""
MOST_MEASURED_RECORDINGS = 240
"""The durations of at most so many recordings are read."""
RIGHTS = ("licence", "attribution")
"""What is kept of the rights of a recording."""


@dataclass(frozen=True)
class Take:
    """One recording of a person.

    name       : of the recording
    file       : the video
    span       : the part of it
    collection : the folder that it is in, by its last two names
    speaker    : name of the person; empty where it is not known
    rights     : licence and attribution, where known
    """

    name: str
    file: Path
    span: VideoSpan
    collection: str
    speaker: str
    rights: tuple[tuple[str, str], ...]


def takes_of(source: Path, recordings: Path | None = None, speaker: str = "") -> list[Take]:
    """Return recordings of one person, about ``MOST_FOOTAGE_S`` in all, spread evenly.

    source     : a video, of which the beginning is used; a folder of recordings, or a prepared corpus: of these the
                 training list
    recordings : of a corpus, the folder of the videos that it was prepared from
    speaker    : whose, where there are several people
    Raises InputError: no such file, several people, no such person, no videos, or a corpus without ``recordings``.
    """
    if not source.exists():
        raise InputError(f"{source}: no such file or folder; give a video of the person, or a folder of videos")
    if source.is_file():
        check_source(source, "video")
        whole = SourceRecording(source.stem, source, None, speaker=speaker)
        return [_take(whole, source.parent, seconds=MOST_FOOTAGE_S)]
    if (source / MANIFEST).is_file():
        found = _of_corpus(Corpus.open(source), recordings, speaker)
    else:
        folder = [item for item in discover(source).recordings if item.motion_file is None]
        items = _of_person(folder, speaker, str(source))
        found = [_take(item, source) for item in [item for item in items if item.split == "train"] or items]
    if not found:
        raise InputError(f"{source}: no videos in it; give a video of the person, or a folder of videos")
    return _evenly_used(found)


def _evenly_used(takes: Sequence[Take]) -> list[Take]:
    """Return takes of about ``MOST_FOOTAGE_S`` in all, spread evenly; long ones are shortened before any is left out.

    A take that cannot be read may be among them: where it is tracked, the reason is reported.
    """
    durations_s = [_duration_s(takes[index]) for index in choose_evenly(MOST_MEASURED_RECORDINGS, len(takes))]
    longest_s = _longest_s(durations_s)
    mean_s = sum(min(duration_s, longest_s) for duration_s in durations_s) / len(durations_s)
    chosen = choose_evenly(ceil(MOST_FOOTAGE_S / max(mean_s, 0.1) - 1e-6), len(takes))
    if max(durations_s) <= longest_s:
        return [takes[index] for index in chosen]
    return [_shortened(takes[index], longest_s) for index in chosen]


def _longest_s(durations_s: Sequence[float]) -> float:
    """Return how long takes may be so that all of them have ``MOST_FOOTAGE_S`` together, but at least ``LONG_S``."""
    left_s = MOST_FOOTAGE_S
    rising = sorted(durations_s)
    for number, duration_s in enumerate(rising):
        share_s = left_s / (len(rising) - number)
        if duration_s > share_s:
            return max(share_s, LONG_S)
        left_s -= duration_s
    return MOST_FOOTAGE_S


def _shortened(take: Take, longest_s: float) -> Take:
    start_s, end_s = take.span.start_s, take.span.end_s
    return replace(take, span=VideoSpan(start_s, min(end_s, start_s + longest_s)))


def _of_person(items: Sequence[SourceRecording], speaker: str, where: str) -> list[SourceRecording]:
    """Return the recordings of one person. Raises InputError: there are several people, or no such person."""
    people = sorted({item.speaker for item in items})
    if (speaker and speaker not in people) or (not speaker and len(people) > 1):
        found = f"no speaker {speaker!r}" if speaker else f"{len(people)} speakers"
        known = ", ".join(name or "one without a name" for name in people)
        raise InputError(f"{where}: {found}, a face is that of one person; name it (--speaker): {known}")
    return [item for item in items if not speaker or item.speaker == speaker]


def _of_corpus(corpus: Corpus, recordings: Path | None, speaker: str) -> list[Take]:
    if recordings is None:
        raise InputError(
            f"{corpus.path}: a corpus holds the pictures of mouths, but not of faces; name the folder of its videos "
            "as well: --recordings FOLDER"
        )
    if not recordings.is_dir():
        raise InputError(f"{recordings}: no such folder; give the one of the videos of the corpus")
    files: dict[str, list[Path]] = {}
    for path in video_files(recordings.rglob("*")):
        files.setdefault(path.name, []).append(path)
    items, collections = [], {}
    for name in corpus.names("train") or corpus.names():
        entry = read_entry(corpus.folder(name))
        stated = entry["source"]
        file = _same_file(files.get(str(stated.get("file", "")), []), stated)
        if file is None:
            continue
        rights = {key: str(stated[key]) for key in RIGHTS if key in stated}
        start_s, end_s = float(stated.get("start_s", 0.0)), stated.get("end_s")
        items.append(
            SourceRecording(
                name,
                file,
                None,
                rights=rights,
                speaker=str(entry.get("speaker", "")),
                start_s=start_s,
                end_s=None if end_s is None else float(end_s),
            )
        )
        collections[name] = str(stated.get("collection", ""))
    if not items:
        raise InputError(f"{recordings}: holds none of the videos of {corpus.path}; give the folder that they are in")
    chosen = _of_person(items, speaker, str(corpus.path))
    return [_take(item, recordings, collections[item.name]) for item in chosen]


def _same_file(files: Sequence[Path], stated: Mapping[str, Any]) -> Path | None:
    """Return the file from which an utterance was prepared, of those of its name; None: it is not among them.

    People of a corpus may share names of files: size and, of several files, content tell which one is meant.
    """
    size = stated.get("bytes")
    same = [file for file in files if size is None or str(file.stat().st_size) == str(size)]
    if len(same) > 1 and "sha256" in stated:
        same = [file for file in same if sha256_of(file) == stated["sha256"]]
    return next(iter(same), None)


def _take(item: SourceRecording, folder: Path, collection: str | None = None, seconds: float = float("inf")) -> Take:
    end_s = float("inf") if item.end_s is None else item.end_s
    named = "/".join(folder.resolve().parts[-2:]).strip("/") if collection is None else collection
    rights = tuple(sorted((key, value) for key, value in item.rights.items() if key in RIGHTS))
    span = VideoSpan(item.start_s, min(end_s, item.start_s + seconds))
    return Take(item.name, item.file, span, named, item.speaker, rights)


def _duration_s(take: Take) -> float:
    """Return the duration of a take, as the file states it; ``LONG_S`` if it states none, or cannot be read."""
    import av

    if take.span.end_s < float("inf"):
        return take.span.end_s - take.span.start_s
    try:
        with open_media(take.file) as container:
            streams = video_streams(container)
            return (stated_duration_s(container, streams[0]) if streams else 0.0) or LONG_S
    except (av.FFmpegError, ValueError, OSError):
        return LONG_S
