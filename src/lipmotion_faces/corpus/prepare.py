"""Preparation: ``prepare(recordings) → corpus``."""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.corpora import UTTERANCES, Corpus, quantise, read_entry, write_utterance
from lipmotion.errors import AlignmentError, CorpusError, ExportError, InputError, MissingDependencyError, shorten_list
from lipmotion.extensions import find_version
from lipmotion.pipeline.workers import open_workers, process_count
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.storage.files import confine, make_portable
from lipmotion.storage.locks import lock_folder, remove_unfinished
from lipmotion.storage.sources import VIDEO_SUFFIXES, Source, check_apart, hash_file, is_folder
from lipmotion.types import Item, Monitor, Progress, Track, Utterance, silent_monitor
from lipmotion.units import check_words
from lipmotion_faces.corpus import supplied
from lipmotion_faces.corpus.folder import discover
from lipmotion_faces.corpus.long_videos import DIVIDING_SHARE, VideoPart, divide_long_videos, wrap_video
from lipmotion_faces.corpus.source_recordings import RecordingFolder, SourceRecording, add_separate_sounds
from lipmotion_faces.tracking.damaged_pictures import describe_damage, find_damaged
from lipmotion_faces.tracking.frames import VideoSpan
from lipmotion_faces.tracking.track import UNSEEN_LIMIT, track
from lipmotion_faces.tracking.trackers import MEDIAPIPE, make_tracker

LOG = logging.getLogger("lipmotion")
RECIPE = "5"
"""Version of the preparation, increased when the same video gives other values; older utterances are then replaced."""
_STAGE = "preparing recordings"


@dataclass(frozen=True)
class PrepareReport:
    """Report of a preparation.

    kind     : layout in which the recordings were read
    kept     : names of the utterances that were prepared before, from the same source with the same settings
    failed   : reason for every recording that cannot be used, by name
    unseen   : number of frames without a face of every utterance that has any, by name
    notes    : remarks on videos (cuts, damage and its times, a covered mouth), by name
    """

    corpus: Path
    kind: str
    prepared: tuple[str, ...]
    kept: tuple[str, ...]
    failed: dict[str, str]
    unseen: dict[str, int]
    seconds: float
    notes: dict[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def counts(self) -> dict[str, int]:
        """How many recordings were prepared, kept and skipped."""
        return {"prepared": len(self.prepared), "kept": len(self.kept), "skipped": len(self.failed)}

    def __str__(self) -> str:
        counts = ", ".join(f"{count} {outcome}" for outcome, count in self.counts.items())
        return f"{self.corpus}: {counts} ({self.kind})"


@dataclass(frozen=True)
class _Job:
    """One recording, its utterance's folder, source and settings; the part of a long video that it is, or None."""

    recording: SourceRecording
    folder: Path
    source: dict[str, str]
    settings: dict[str, str]
    tracker: str
    part: VideoPart | None = None


@dataclass(frozen=True)
class _Outcome:
    """Outcome of the preparation of one recording; ``problem`` is empty if it succeeded."""

    name: str
    kept: bool = False
    unseen: int = 0
    problem: str = ""
    notes: tuple[str, ...] = ()


def prepare(
    directory: str | Path,
    output: str | Path,
    *,
    workers: int | None = None,
    crops: bool = True,
    offset_ms: float | None = None,
    tracker: str = MEDIAPIPE,
    monitor: Monitor = silent_monitor,
) -> PrepareReport:
    """Create a corpus from recordings, or add the recordings to a corpus; return a report.

    directory : folder in the layout of a published corpus (recipes/), or any folder of videos, or of sounds with
                motion (docs/corpora.md); or one video. Videos of more than half a minute are divided into utterances
    output    : folder of the corpus; utterances that are up to date are kept, so that a stopped preparation continues
    workers   : number of processes; None: one for each core. With more than one, a script must be guarded by
                ``if __name__ == "__main__":``
    crops     : store the mouth pictures, which eigenlips need
    offset_ms : by how much the sound of every recording is late against its motion; None: it is in step, or a
                recorder's sound beside it (``take.recorder.wav``) says it. ``offsets.csv`` in the folder goes before
    tracker   : name of the tracker that finds faces in videos (docs/corpora.md)
    Unusable recordings are reported and left out. The corpus depends neither on ``workers`` nor on interruptions.
    Raises InputError, CorpusError: no usable recordings; ``output`` is not a corpus; no tracker of that name.
    Raises MissingDependencyError: there are videos, and MediaPipe, or what another tracker needs, is not installed.
    Raises ExportError: the disk is full, or another process is preparing the same corpus.

    >>> import lipmotion
    >>> lipmotion.prepare("my-recordings", "my-corpus").counts  # doctest: +SKIP
    {'prepared': 12, 'kept': 0, 'skipped': 0}
    """
    directory, output = Path(directory), Path(output)
    start_s = time.monotonic()
    processes = process_count(workers)
    check_apart((), [Source(directory, "folder of recordings")], folders=[output])
    if directory.is_file() and directory.suffix.lower() in VIDEO_SUFFIXES:
        folder, place = wrap_video(directory), directory.parent
    else:
        folder, place = discover(directory), directory
    offset_s = None if offset_ms is None else offset_ms / 1000
    folder = add_separate_sounds(folder, place, offset_s, is_whole=directory.is_dir())
    chosen = make_tracker(tracker)
    packages = chosen.list_versions() if any(item.motion_file is None for item in folder.recordings) else {}
    is_new = not is_folder(output)
    with lock_folder(output):
        corpus = Corpus.create(output)
        folder, parts = divide_long_videos(folder, place, monitor, tracker)
        collection = "/".join(place.resolve().parts[-2:]).strip("/")
        jobs = [
            _make_job(item, collection, corpus, tracker, packages, crops, parts.get(item.name))
            for item in folder.recordings
        ]
        with _refresh_at_end(corpus), open_workers(min(processes, len(jobs))) as team:
            results = team.unordered_map(_process, jobs)
            outcomes = _collect(folder, results, len(jobs), monitor, DIVIDING_SHARE if parts else 0.0)
        outcomes = _leave_out_damaged(corpus, outcomes, monitor)
        _warn_of_older(corpus, collection, outcomes)
    report = _make_report(corpus, folder, outcomes, time.monotonic() - start_s)
    if not report.prepared and not report.kept:
        if is_new:
            shutil.rmtree(output)
        name, reason = next(iter(report.failed.items()))
        failed = f"none of {len(report.failed)} recordings is usable"
        raise CorpusError(f"{directory}: {failed}; the first, {name}: {reason}")
    return report


def _make_report(corpus: Corpus, folder: RecordingFolder, outcomes: list[_Outcome], seconds: float) -> PrepareReport:
    outcomes = sorted(outcomes, key=lambda outcome: outcome.name)
    good = [outcome for outcome in outcomes if not outcome.problem]
    problems = folder.problems | {outcome.name: outcome.problem for outcome in outcomes if outcome.problem}
    return PrepareReport(
        corpus=corpus.path,
        kind=folder.kind,
        prepared=tuple(outcome.name for outcome in good if not outcome.kept),
        kept=tuple(outcome.name for outcome in good if outcome.kept),
        failed=dict(sorted(problems.items())),
        unseen={outcome.name: outcome.unseen for outcome in good if outcome.unseen},
        seconds=seconds,
        notes={outcome.name: outcome.notes for outcome in good if outcome.notes},
    )


def _make_job(
    recording: SourceRecording,
    collection: str,
    corpus: Corpus,
    tracker: str,
    packages: dict[str, str],
    crops: bool,
    part: VideoPart | None,
) -> _Job:
    name = make_portable(recording.name)
    stored = _read_source(corpus.folder(name))
    if (  # speakers of GRID share file names
        stored is not None
        and stored.get("collection") != collection
        and stored.get("sha256") != _digest(recording.file)
    ):
        name = f"{collection.replace('/', '-')}-{name}"
    if recording.motion_file is None:
        settings = {"tracker": f"{tracker} {packages[tracker]}", "crops": "yes" if crops else "no"}
    else:
        settings, packages = {"tracker": "none: motion was given"}, {"av": metadata.version("av")}
    settings["recipe"] = "6" if recording.file.suffix.lower() == ".avi" else RECIPE  # times were guessed
    if recording.offset_s is not None:
        settings["sound"] = f"{recording.offset_s * 1000:.3f} ms late, as given"
    source = {
        "collection": collection,
        "file": recording.file.name,
        "lipmotion": find_version(),
        **packages,
        **recording.rights,
    }
    if recording.end_s is not None:
        source |= {"start_s": f"{recording.start_s:.3f}", "end_s": f"{recording.end_s:.3f}"}
        settings["part"] = f"{recording.start_s:.3f} to {recording.end_s:.3f} s"
    return _Job(replace(recording, name=name), corpus.folder(name), source, settings, tracker, part)


def _warn_of_older(corpus: Corpus, collection: str, outcomes: list[_Outcome]) -> None:
    """Log a warning if the corpus holds utterances of recordings that are gone, or that cannot be used any longer."""
    good = {outcome.name for outcome in outcomes if not outcome.problem}
    others = [name for name in corpus.names() if name not in good]
    older = [name for name in others if (_read_source(corpus.folder(name)) or {}).get("collection") == collection]
    if older:
        wish = "to do without them, delete their folders and prepare again"
        what = "utterances are from recordings that are no longer there, or cannot be used any longer"
        LOG.warning("%s: %d %s: %s; %s", corpus.path / UTTERANCES, len(older), what, shorten_list(older), wish)


def _read_source(folder: Path) -> dict[str, Any] | None:
    """Return the source of the utterance in a folder; None if there is none."""
    with suppress(CorpusError):
        return dict(read_entry(folder).get("source", {}))
    return None


def _process(job: _Job) -> _Outcome:
    """Prepare one recording, unless its utterance is up to date; return the outcome."""
    name = job.recording.name
    try:
        sound = job.recording.file
        source = job.source | {"sha256": _digest(sound), "bytes": str(sound.stat().st_size)}
        source |= supplied.digest_sources(job.recording)
        entry = _read_if_current(job, source)
        if entry is not None:
            return _Outcome(name, kept=True, unseen=int(entry["unseen_frames"]), notes=tuple(entry.get("notes", ())))
        utterance = _make_utterance(job, source)
        with confine(job.folder.parent.parent):  # the corpus, in this worker
            write_utterance(job.folder, utterance, job.settings)
    except (MissingDependencyError, ExportError):
        raise  # all other recordings would fail in the same way
    except (InputError, AlignmentError) as error:
        return _Outcome(name, problem=str(error))
    except Exception as error:  # one damaged file must not stop the others
        return _Outcome(name, problem=f"{job.recording.file}: {type(error).__name__}: {error}")
    return _Outcome(name, unseen=int((~utterance.track.seen).sum()), notes=utterance.track.notes)


def _digest(path: Path) -> str:
    """Return the SHA-256 digest of a file; the parts of a long video share one, which is computed once a process."""
    status = path.stat()
    return _digest_of_content(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=16)
def _digest_of_content(path: Path, _size: int, _changed_ns: int) -> str:
    return hash_file(path)


def _read_if_current(job: _Job, source: dict[str, str]) -> dict[str, Any] | None:
    """Return the description of the utterance if it is up to date, or None."""
    try:
        entry = read_entry(job.folder)
    except CorpusError:
        return None
    words = None if job.recording.words is None else list(job.recording.words)
    digests = [source.get(key) for key in supplied.DIGESTS]
    required = (digests, words, job.recording.split, job.recording.speaker, job.settings)
    stored_digests = [entry["source"].get(key) for key in supplied.DIGESTS]
    stored = (stored_digests, entry["words"], entry["split"], entry.get("speaker", ""), entry["settings"])
    return entry if stored == required else None


def _make_utterance(job: _Job, source: dict[str, str]) -> Utterance:
    recording = job.recording
    separate = None if job.part else supplied.separate_sound(recording)
    if separate is None:
        audio = job.part.sound if job.part else read_audio(recording.file)
        motion = _track(job, audio.duration_s)
    else:
        camera_s = None if recording.recorder is None else read_audio(recording.file, warn=False).duration_s
        audio, motion, begin_s = supplied.trim_to_shared(separate, _track(job, camera_s))
        labelled_s = begin_s if recording.recorder is not None else begin_s + separate.late_s
        recording = replace(recording, phones=supplied.shift_phones(recording.phones, labelled_s))
        source = source | {"sound_late_ms": f"{separate.late_s * 1000:.3f}", "sound_found_by": separate.how}
    audio = quantise(audio)
    motion = replace(motion, notes=(*motion.notes, *supplied.doubt_recording(audio, motion)))
    check_words(recording.words or (), audio.duration_s)
    return Utterance(
        name=recording.name,
        audio=audio,
        features=analysed(audio).mfcc(),
        track=motion,
        words=recording.words,
        split=recording.split,
        source=source,
        speaker=recording.speaker,
        phones=supplied.read_supplied_phones(recording, audio.duration_s),
    )


def _track(job: _Job, duration_s: float | None) -> Track:
    if job.recording.motion_file is not None:
        return supplied.read_supplied_track(job.recording.motion_file, duration_s)
    recording, crops = job.recording, job.settings["crops"] == "yes"
    if job.part is None or recording.end_s is None:
        return track(recording.file, crops=crops, tracker=job.tracker)
    span = VideoSpan(recording.start_s, recording.end_s)
    return track(recording.file, crops=crops, span=span, person=job.part.person, tracker=job.tracker)


def _collect(
    folder: RecordingFolder, outcomes: Iterator[_Outcome], count: int, monitor: Monitor, done: float
) -> list[_Outcome]:
    """Return all outcomes; each is reported as soon as it is known. ``done``: share of the work done before."""
    for name, problem in folder.problems.items():
        monitor(Item(name, "skipped", problem))
    collected: list[_Outcome] = []
    monitor(Progress(_STAGE, 0, count, done))
    for outcome in outcomes:
        collected.append(outcome)
        kind = "skipped" if outcome.problem else "kept" if outcome.kept else "prepared"
        unseen = (f"no face in {outcome.unseen} frames, interpolated",) if outcome.unseen else ()
        monitor(Item(outcome.name, kind, outcome.problem or "; ".join((*outcome.notes, *unseen))))
        monitor(Progress(_STAGE, len(collected), count, done + (1 - done) * len(collected) / count))
    return collected


def _leave_out_damaged(corpus: Corpus, outcomes: list[_Outcome], monitor: Monitor) -> list[_Outcome]:
    """Return the outcomes without damaged pictures, found beside all others of a speaker: these are interpolated."""
    if all(outcome.kept or outcome.problem for outcome in outcomes):
        return outcomes
    changed = {outcome.name: outcome for outcome in outcomes}
    for speaker in corpus.speakers:
        utterances = [corpus.utterance(name) for name in corpus.names(speakers=(speaker,))]
        utterances = [each for each in utterances if each.track.crops is not None]
        clips = [partial(np.asarray, each.track.crops) for each in utterances]
        rates = [each.track.motion.rate_hz for each in utterances]
        seen = [each.track.seen for each in utterances]
        for each, damage in zip(utterances, find_damaged(clips, seen, rates, is_one=bool(speaker)), strict=True):
            motion, wrong = each.track.motion, np.any(list(damage.values()), axis=0)
            if not wrong.any():
                continue
            notes = describe_damage(damage, np.arange(len(wrong)) / motion.rate_hz)
            right, folder = each.track.seen & ~wrong, corpus.folder(each.name)
            before = changed.get(each.name, _Outcome(each.name))
            if wrong.mean() > UNSEEN_LIMIT:
                shutil.rmtree(folder)
                problem = f"{'; '.join(notes)}; required: at least {1 - UNSEEN_LIMIT:.0%} of the pictures undamaged"
                changed[each.name] = _Outcome(each.name, problem=problem)
                monitor(Item(each.name, "skipped", problem))
                continue
            known, frames = np.flatnonzero(right), np.arange(len(right))
            curves = np.stack([np.interp(frames, known, curve[known]) for curve in motion.values.T], axis=1)
            track = replace(
                each.track, motion=replace(motion, values=curves), seen=right, notes=(*each.track.notes, *notes)
            )
            write_utterance(folder, replace(each, track=track), read_entry(folder)["settings"])
            changed[each.name] = replace(before, unseen=int((~right).sum()), notes=track.notes)
            monitor(Item(each.name, "prepared", "; ".join((*notes, "interpolated"))))
    corpus.refresh()
    return list(changed.values())


@contextmanager
def _refresh_at_end(corpus: Corpus) -> Iterator[None]:
    """At the end of the block, also after an error, list the finished utterances and remove unfinished ones."""
    try:
        yield
    except ExportError as error:
        with suppress(ExportError):
            corpus.refresh()
        raise ExportError(f"{error}; {len(corpus)} utterances are finished and kept") from error
    except BaseException:
        corpus.refresh()
        raise
    else:
        corpus.refresh()
    finally:
        remove_unfinished(corpus.path / UTTERANCES)
