"""Footage of one person: which recordings there are, and which of them are used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path

from lipmotion.corpora.discover import discover
from lipmotion.corpora.entry import read_entry
from lipmotion.corpora.source_recordings import SourceRecording, video_files
from lipmotion.corpora.store import MANIFEST, Corpus
from lipmotion.errors import InputError
from lipmotion.stats.pca import evenly_spaced
from lipmotion.storage.files import check_source
from lipmotion.storage.media import open_media, stated_duration_s, video_streams
from lipmotion.vision.frames import VideoSpan

MOST_FOOTAGE_S = 240.0
"""Seconds of footage that are used, spread evenly over all recordings: of 500 candidates few are new after that."""
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
    """Return recordings of one person, at most ``MOST_FOOTAGE_S`` in all, spread evenly.

    source     : a video, a folder of recordings, or a prepared corpus; of folders and corpora the training list
    recordings : of a corpus, the folder of the videos that it was prepared from
    speaker    : whose, where there are several people
    Raises InputError: no such file, several people, no such person, no videos, or a corpus without ``recordings``.
    """
    if source.is_file():
        check_source(source, "video")
        whole = SourceRecording(source.stem, source, None)
        return [_take(whole, source.parent, seconds=MOST_FOOTAGE_S)]
    if (source / MANIFEST).is_file():
        found = _of_corpus(Corpus.open(source), recordings, speaker)
    else:
        folder = [item for item in discover(source).recordings if item.motion_file is None]
        found = [_take(item, source) for item in _training(_of_person(folder, speaker, str(source)))]
    if not found:
        raise InputError(f"{source}: no videos in it; give a video of the person, or a folder of videos")
    mean_s = max(_duration_s(found[0]), 0.1)
    return [found[index] for index in evenly_spaced(ceil(MOST_FOOTAGE_S / mean_s), len(found))]


def _of_person(items: Sequence[SourceRecording], speaker: str, where: str) -> list[SourceRecording]:
    """Return the recordings of one person. Raises InputError: there are several people, or no such person."""
    people = sorted({item.speaker for item in items})
    if (speaker and speaker not in people) or (not speaker and len(people) > 1):
        found = f"no speaker {speaker!r}" if speaker else f"{len(people)} speakers"
        known = ", ".join(name or "one without a name" for name in people)
        raise InputError(f"{where}: {found}, a face is that of one person; name it (--speaker): {known}")
    return [item for item in items if not speaker or item.speaker == speaker]


def _training(items: list[SourceRecording]) -> list[SourceRecording]:
    """Return the recordings of the training list; all if it is empty."""
    return [item for item in items if item.split == "train"] or items


def _of_corpus(corpus: Corpus, recordings: Path | None, speaker: str) -> list[Take]:
    if recordings is None:
        raise InputError(
            f"{corpus.path}: a corpus holds the pictures of mouths, but not of faces; name the folder of its videos "
            "as well: --recordings FOLDER"
        )
    if not recordings.is_dir():
        raise InputError(f"{recordings}: no such folder; give the one of the videos of the corpus")
    files = {path.name: path for path in video_files(recordings.rglob("*"))}
    items, collections = [], {}
    for name in corpus.names("train") or corpus.names():
        entry = read_entry(corpus.folder(name))
        stated = entry["source"]
        file = files.get(str(stated.get("file", "")))
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


def _take(item: SourceRecording, folder: Path, collection: str | None = None, seconds: float = float("inf")) -> Take:
    end_s = float("inf") if item.end_s is None else item.end_s
    named = "/".join(folder.resolve().parts[-2:]).strip("/") if collection is None else collection
    rights = tuple(sorted((key, value) for key, value in item.rights.items() if key in RIGHTS))
    span = VideoSpan(item.start_s, min(end_s, item.start_s + seconds))
    return Take(item.name, item.file, span, named, item.speaker, rights)


def _duration_s(take: Take) -> float:
    """Return the duration of a take, as the file states it. Raises InputError: it cannot be read."""
    import av

    if take.span.end_s < float("inf"):
        return take.span.end_s - take.span.start_s
    try:
        with open_media(take.file) as container:
            streams = video_streams(container)
            return stated_duration_s(container, streams[0]) if streams else 0.0
    except (av.FFmpegError, ValueError, OSError) as error:
        raise InputError(f"{take.file}: not a readable video ({error}); give a video file") from error
