"""One line of a batch, from its recording to its outputs and its record; this runs in worker processes."""

from __future__ import annotations

import errno
import logging
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.errors import ExportError, LipMotionError
from lipmotion.extensions import describe_failed_extension, load_provided
from lipmotion.formats.base import motion_suffix
from lipmotion.measures.closures import CLOSED_SHARE
from lipmotion.motion.closure import OPENING, find_closable_ranges
from lipmotion.motion.rest import list_speech_intervals
from lipmotion.motion.speaker_maps import SpeakerMap
from lipmotion.pipeline.analysis.read_request import read_lexicon, read_request
from lipmotion.pipeline.batch.ledger import (
    CUES,
    DONE,
    FAILED,
    Place,
    Record,
    are_in_place,
    fingerprint_line,
    input_files,
    is_in_place,
    read_receipt,
    write_receipt,
)
from lipmotion.pipeline.batch.lines import BatchLine
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.job import Job, check_outputs, open_face, run, write_outputs
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outputs.output import ShownFace
from lipmotion.pipeline.request import Request
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.storage.files import check_target, confine, make_folder, put_in_place, remove
from lipmotion.storage.locks import temporary_folder
from lipmotion.storage.sources import sha256_of
from lipmotion.types import Audio, Generation, Span, Timeline, Unit
from lipmotion.units import Lexicon
from lipmotion.units.phone_timelines import group_words

LOG = logging.getLogger("lipmotion")
MAX_WARNINGS = 10
SILENCE_S = 0.5
"""Seconds of silence with which the settings are tried out."""


@dataclass(frozen=True)
class LineWork:
    """What a worker needs to know of a line.

    of_settings : from ``fingerprint_job``
    """

    line: BatchLine
    job: Job
    of_settings: str
    place: Place


class RunReplacedError(ExportError):
    """A later run has begun in the same folder."""


def finish_line(work: LineWork) -> Record:
    """Return the record of a line, whose outputs are in place; or that of an error, without outputs.

    A line whose receipt is there, because another worker died after it had finished it, is not done again.
    Raises ExportError: the disk is full, or a later run has begun in the same folder.
    """
    receipt = read_receipt(work.place.receipt(work.line.name))
    if receipt is not None and receipt["run"] == work.place.run and are_in_place(Path(work.place.out), receipt):
        return receipt
    folder = work.place.work(work.line.name)
    with confine(Path(work.place.out)):
        remove(folder)
        make_folder(folder)
        try:
            return _animate_line(work)
        finally:
            for kind in work.job.outputs.kinds:
                remove(work.place.staged(work.line.name, kind))
            remove(folder)


def _animate_line(work: LineWork) -> Record:
    start_s = time.perf_counter()
    line, place, kinds = work.line, work.place, work.job.outputs.kinds
    record: Record = {
        "name": line.name,
        "recording": line.recording,
        "run": place.run,
        "fingerprint": fingerprint_line(line, work.of_settings),
        "outcome": DONE,
        "inputs": [],
        "outputs": {},
    }
    with _capture_warnings() as warnings:
        try:
            record["inputs"] = [asdict(each) for each in input_files(line)]
            record |= _describe_motion(_write_line(work))
            staged = {f"{line.name}.{kind}": place.staged(line.name, kind) for kind in kinds}
            record["outputs"] = {name: sha256_of(path) for name, path in staged.items()}
            record |= _describe_work(start_s, warnings)
            if not place.is_current():
                raise RunReplacedError(f"{place.out}: another run of this batch has begun; this one ends")
            write_receipt(place.receipt(line.name), record)
            for name, path in staged.items():
                target = Path(place.out) / name
                if not is_in_place(target, record["outputs"][name]):  # by an earlier run
                    put_in_place(path, target)
        except (Exception, SystemExit) as error:  # also a bug that one recording meets: the other lines go on
            cause = error if isinstance(error, OSError) else error.__cause__
            is_full = isinstance(cause, OSError) and cause.errno in (errno.ENOSPC, errno.EDQUOT)
            if is_full or isinstance(error, RunReplacedError):  # every line that follows would meet it, too
                raise
            reason = str(error) or type(error).__name__
            if not isinstance(error, LipMotionError | OSError | MemoryError):
                reason = describe_failed_extension(error) or (
                    f"unexpected {type(error).__name__}: {error}; this is a bug of lipmotion: please report it"
                )
            record |= {"outcome": FAILED, "outputs": {}, "error": reason} | _describe_work(start_s, warnings)
    return record


def _describe_work(start_s: float, warnings: list[str]) -> Record:
    return {"warnings": warnings[:MAX_WARNINGS], "seconds": round(time.perf_counter() - start_s, 4)}


def _write_line(work: LineWork) -> Generation:
    """Write the outputs of a line under temporary names; return its motion. Raises as ``animate`` and ``write``."""
    line, kinds, given = work.line, work.job.outputs.kinds, work.job.request
    make_folder((Path(work.place.out) / line.name).parent)
    staged = tuple(str(work.place.staged(line.name, kind)) for kind in kinds)
    for kind in kinds:
        check_target(Path(work.place.out) / f"{line.name}.{kind}")
    (model, face, lexicon), speaker = _share(work.job, work.place.run), line.speaker or given.speaker
    request = replace(given, recording=Path(line.recording), speaker=speaker, lexicon=lexicon)
    request = read_request(request, words_beside=not line.transcript)
    request = replace(request, transcript=line.transcript or request.transcript)
    other = face.other_person(model, speaker) if given.onto is None else None
    if other is not None:
        request = replace(request, onto=_map_onto(model, other, speaker))
    job = replace(work.job.of(None, staged), request=request)
    return run(job, face=face, model=model, is_typed=False)


def _describe_motion(generation: Generation) -> Record:
    """Return what the report says of generated motion."""
    outlook, motion, confidence = generation.outlook, generation.motion, generation.confidence
    record: Record = {"duration_s": round(max(len(motion.values) - 1, 0) / motion.rate_hz, 3)}
    record["heard"] = " ".join(word.label for word in group_words(generation.units) if word.label)
    if outlook is not None:
        record |= {
            "words": outlook.words,
            "confidence": round(float(outlook.confidence), 3),
            "voice": None if outlook.voice is None else round(float(outlook.voice), 3),
            "range_db": round(float(outlook.range_db), 1),
            "advice": list(outlook.advice),
        }
    spoken = np.zeros(len(motion.values), bool)
    for start_s, end_s in list_speech_intervals(generation.units):
        spoken[round(start_s * motion.rate_hz) : round(end_s * motion.rate_hz)] = True
    if confidence is not None and spoken.any():
        record["motion"] = round(float(confidence[spoken].mean()), 3)
        second = np.flatnonzero(spoken) // round(motion.rate_hz)
        means = np.bincount(second, confidence[spoken]) / np.maximum(np.bincount(second), 1)
        means[np.bincount(second) < motion.rate_hz / 2] = np.inf
        if np.isfinite(means).any():
            record["least_sure_s"] = int(means.argmin())
    if OPENING in motion.names and len(motion.values):
        opening = motion[OPENING]
        closed = CLOSED_SHARE * float(np.percentile(opening, 95))
        ranges = find_closable_ranges(generation.units, len(opening))
        record |= {
            "widest": round(float(opening.max()), 4),
            **({"width": round(float(motion["width"][opening.argmax()]), 4)} if "width" in motion.names else {}),
            "closures_heard": len(ranges),
            "closures_made": sum(bool(opening[frames].min() <= closed) for frames in ranges),
        }
    return record


_WARNINGS: ContextVar[list[str] | None] = ContextVar("warnings of the line that this thread works on", default=None)


@contextmanager
def _capture_warnings() -> Iterator[list[str]]:
    """Give a list that receives this thread's warnings of the package inside the block, instead of the terminal."""
    warnings: list[str] = []
    LOG.addFilter(_capture)  # which a logger has once, however often it is added
    before = _WARNINGS.set(warnings)
    try:
        yield warnings
    finally:
        _WARNINGS.reset(before)


def _capture(record: logging.LogRecord) -> bool:
    """Keep a warning of a thread that works on a line; return whether a record goes on to the handlers."""
    warnings = _WARNINGS.get()
    if warnings is None:
        return True
    text = record.getMessage()
    if record.levelno >= logging.WARNING and text not in warnings:
        warnings.append(text)
    return False


@lru_cache(maxsize=1)
def _share(job: Job, of_run: str) -> tuple[Model, ShownFace, Lexicon | None]:  # noqa: ARG001 (files may change between two runs)
    """Return model, face and lexicon, which the lines of a run share."""
    lexicon = None if job.request.lexicon is None else read_lexicon(job.request)
    return load_model(job.request.model), open_face(job.outputs), lexicon


@lru_cache(maxsize=8)
def _map_onto(model: Model, face: Any, speaker: str) -> SpeakerMap:
    """Return the map of the motion of a speaker onto a face: the same for all lines, and slow to make."""
    return load_provided("map_onto")(model, face, speaker=speaker)


def check_line_job(job: Job, of_run: str) -> None:
    """Load what all lines of a run need, so that a mistake in it ends the batch before its first line.

    Motion files of a moment of silence are made and deleted, so that channels, curves and formats are tried out.
    Raises InputError, ModelFormatError, ExportError: as ``load_model``, ``Lexicon.from_file``, ``open_face``.
    """
    (model, face, _), anywhere = _share(job, of_run), Path(tempfile.gettempdir())
    files = tuple(str(anywhere / f"line.{kind}") for kind in job.outputs.kinds)
    check_outputs(job.of(anywhere, files), face)
    kinds = [kind for kind in job.outputs.kinds if motion_suffix(Path(f"line.{kind}")) and not kind.startswith(CUES)]
    if not kinds or face.other_person(model, job.request.speaker) is not None:
        return
    silence = Audio(np.zeros(round(SPEECH_RATE_HZ * SILENCE_S), np.float32), SPEECH_RATE_HZ)
    units = Timeline((Span(0.0, SILENCE_S, Unit("sil")),))
    request = Request(silence, units=units, speaker=job.request.speaker)
    with temporary_folder() as folder:
        files = tuple(str(folder / f"line.{kind}") for kind in kinds)
        early = replace(job, delivery=replace(job.delivery, offset_ms=0.0), outputs=replace(job.outputs, files=files))
        write_outputs(early, face, animate(request, model=model), silence)
