"""One line of a batch, from its recording to its outputs and its record; this runs in worker processes."""

from __future__ import annotations

import errno
import logging
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from lipmotion.corpora.labels import labels_beside
from lipmotion.errors import ExportError, LipMotionError
from lipmotion.export.base import motion_suffix
from lipmotion.extensions import failed_extension
from lipmotion.faces.filmed.face import FilmedFace
from lipmotion.measures.closures import CLOSED_SHARE
from lipmotion.motion.closure import OPENING, closable_ranges
from lipmotion.motion.speakers import SpeakerMap
from lipmotion.pipeline.batch.ledger import (
    Place,
    are_in_place,
    is_in_place,
    read_receipt,
    write_receipt,
)
from lipmotion.pipeline.batch.lines import BatchLine
from lipmotion.pipeline.batch.record import DONE, FAILED, Record
from lipmotion.pipeline.batch.settings import CUES, BatchSettings, input_files, line_fingerprint
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.generate.transfer import map_onto
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outputs.curve_sets import check_curve_set
from lipmotion.pipeline.outputs.motion_files import with_articulation
from lipmotion.pipeline.outputs.output import OutputSettings, checked_outputs
from lipmotion.pipeline.outputs.shown_faces import ShownFace, shown_face
from lipmotion.pipeline.outputs.write import write
from lipmotion.pipeline.understand.request import SpeechRequest
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.storage.files import check_target, sha256_of
from lipmotion.types import Audio, Generation, Span, Timeline, Unit
from lipmotion.units import Lexicon

LOG = logging.getLogger("lipmotion")
ONE_AT_A_TIME = threading.Lock()
"""A worker of a cluster may have several threads: warnings and the threads of matrix products belong to a process."""
MOST_WARNINGS = 10
SILENCE_S = 0.5
"""Seconds of silence with which the settings are tried out."""


@dataclass(frozen=True)
class LineWork:
    """What a worker needs to know of a line.

    of_settings : from ``fingerprint_of``
    """

    line: BatchLine
    settings: BatchSettings
    of_settings: str
    place: Place


class RunReplacedError(ExportError):
    """A later run has begun in the same folder."""


def finished_line(work: LineWork) -> Record:
    """Return the record of a line, whose outputs are in place; or that of an error, without outputs.

    A line whose receipt is there, because another worker died after it had finished it, is not done again.
    Raises ExportError: the disk is full, or a later run has begun in the same folder.
    """
    with ONE_AT_A_TIME:
        receipt = read_receipt(work.place.receipt(work.line.name))
        if receipt is not None and receipt["run"] == work.place.run and are_in_place(Path(work.place.out), receipt):
            return receipt
        folder = work.place.work(work.line.name)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        try:
            return _finished(work)
        finally:
            for kind in work.settings.kinds:
                with suppress(OSError):  # there is none, or its folder is none
                    work.place.staged(work.line.name, kind).unlink()
            shutil.rmtree(folder, ignore_errors=True)


def _finished(work: LineWork) -> Record:
    start_s = time.perf_counter()
    record: Record = {
        "name": work.line.name,
        "recording": work.line.recording,
        "run": work.place.run,
        "fingerprint": line_fingerprint(work.line, work.of_settings),
        "outcome": DONE,
        "inputs": [],
        "outputs": {},
    }
    with _kept_warnings() as warnings:
        try:
            record["inputs"] = [asdict(each) for each in input_files(work.line)]
            generation = _written(work)
            record |= _findings(generation) | _taken(start_s, warnings)
            _put_in_place(work, record)
        except (Exception, SystemExit) as error:  # also a bug that one recording meets: the other lines go on
            if _is_final(error):
                raise
            record |= {"outcome": FAILED, "outputs": {}, "error": _reason(error)} | _taken(start_s, warnings)
    return record


def _taken(start_s: float, warnings: list[str]) -> Record:
    return {"warnings": warnings[:MOST_WARNINGS], "seconds": round(time.perf_counter() - start_s, 4)}


def _reason(error: BaseException) -> str:
    if isinstance(error, LipMotionError | OSError | MemoryError):
        return str(error) or type(error).__name__
    unexpected = f"unexpected {type(error).__name__}: {error}; this is a bug of lipmotion: please report it"
    return failed_extension(error) or unexpected


def _is_final(error: BaseException) -> bool:
    """Return whether an error would befall every line that follows: a full disk, or the end of the run."""
    if isinstance(error, RunReplacedError):
        return True
    cause = error if isinstance(error, OSError) else error.__cause__
    return isinstance(cause, OSError) and cause.errno in (errno.ENOSPC, errno.EDQUOT)


def _put_in_place(work: LineWork, record: Record) -> None:
    """Write the receipt, and rename the outputs; one that is in place from an earlier run is left alone."""
    out = Path(work.place.out)
    staged = {f"{work.line.name}.{kind}": work.place.staged(work.line.name, kind) for kind in work.settings.kinds}
    record["outputs"] = {name: sha256_of(path) for name, path in staged.items()}
    if not work.place.is_current():
        raise RunReplacedError(f"{out}: another run of this batch has begun; this one ends")
    write_receipt(work.place.receipt(work.line.name), record)
    for name, path in staged.items():
        target = out / name
        if not is_in_place(target, record["outputs"][name]):
            path.replace(target)


def _written(work: LineWork) -> Generation:
    """Write the outputs of a line under temporary names; return its motion. Raises as ``animate`` and ``write``."""
    line, settings = work.line, work.settings
    work.place.made_folder(line.name)
    staged = {kind: work.place.staged(line.name, kind) for kind in settings.kinds}
    for kind in settings.kinds:
        check_target(Path(work.place.out) / f"{line.name}.{kind}")
    model = _model(settings.model, _stamp(settings.model))
    generation = animate(_request(line, settings, model), model=model)
    write(
        with_articulation(generation) if settings.articulation else generation,
        list(staged.values()),
        speech=line.recording,
        model=model,
        channels=settings.channels or None,
        rate_hz=settings.rate_hz,
        fps=settings.fps,
        face=_face(settings.face, _stamp(settings.face)),
        staging=settings.staging,
        delivery=settings.delivery,
        curves=settings.curves or None,
    )
    return generation


def _request(line: BatchLine, settings: BatchSettings, model: Model) -> SpeechRequest:
    """Return the request of a line, with the labels beside its recording where the row has no words.

    Where a filmed face of another person is shown, the motion is mapped onto it, as ``lipmotion animate`` does.
    """
    speaker = line.speaker or settings.speaker
    face = _face(settings.face, _stamp(settings.face)).other_person(model, speaker)
    labels = None if line.transcript else labels_beside(Path(line.recording))
    transcript = line.transcript or (labels.transcript if labels else None)
    return SpeechRequest(
        line.recording,
        transcript=transcript,
        units=labels.phones if labels and transcript is None else None,
        lexicon=_lexicon(settings.lexicon, _stamp(settings.lexicon)),
        recogniser=settings.recogniser,
        speaker=speaker,
        pauses=settings.pauses,
        asymmetry=settings.asymmetry,
        onto=None if face is None else _map_onto(model, face, speaker),
    )


def _findings(generation: Generation) -> Record:
    """Return what the report says of generated motion."""
    outlook, motion = generation.outlook, generation.motion
    found: Record = {"duration_s": round(max(len(motion.values) - 1, 0) / motion.rate_hz, 3)}
    if outlook is not None:
        found |= {
            "words": outlook.words,
            "confidence": round(float(outlook.confidence), 3),
            "voice": None if outlook.voice is None else round(float(outlook.voice), 3),
            "range_db": round(float(outlook.range_db), 1),
            "advice": list(outlook.advice),
        }
    if OPENING in motion.names and len(motion.values):
        opening = motion[OPENING]
        closed = CLOSED_SHARE * float(np.percentile(opening, 95))
        ranges = closable_ranges(generation.units, len(opening))
        found |= {
            "widest": round(float(opening.max()), 4),
            "closures_heard": len(ranges),
            "closures_made": sum(bool(opening[frames].min() <= closed) for frames in ranges),
        }
    return found


@contextmanager
def _kept_warnings() -> Iterator[list[str]]:
    """Give a list that receives the package's warnings inside the block, instead of the terminal; each once."""
    kept: list[str] = []

    class Keeper(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            text = record.getMessage()
            if text not in kept:
                kept.append(text)

    handler, others, goes_up = Keeper(logging.WARNING), LOG.handlers[:], LOG.propagate
    LOG.handlers[:], LOG.propagate = [handler], False
    try:
        yield kept
    finally:
        LOG.handlers[:], LOG.propagate = others, goes_up


def _stamp(path: str) -> int:
    """Return the time of change of a file, so that what is kept of it is renewed; 0: there is no such file."""
    try:
        return os.stat(path).st_mtime_ns if path else 0  # noqa: PTH116
    except OSError:
        return 0


@lru_cache(maxsize=1)
def _model(path: str, _: int) -> Model:
    return load_model(path or None)


@lru_cache(maxsize=1)
def _lexicon(path: str, _: int) -> Lexicon | None:
    return Lexicon.from_file(Path(path)) if path else None


@lru_cache(maxsize=1)
def _face(name: str, _: int) -> ShownFace:
    return shown_face(name)


@lru_cache(maxsize=8)
def _map_onto(model: Model, face: FilmedFace, speaker: str) -> SpeakerMap:
    """Return the map of the motion of a speaker onto a face: the same for all lines, and slow to make."""
    return map_onto(model, face, speaker=speaker)


def check_line_settings(settings: BatchSettings) -> None:
    """Load what all lines need, so that a mistake in it ends the batch before its first line.

    Motion files of a moment of silence are made and deleted, so that channels, curves and formats are tried out.
    Raises InputError, ModelFormatError, ExportError: as ``load_model``, ``Lexicon.from_file``, ``checked_outputs``,
    ``write``.
    """
    anywhere = Path(tempfile.gettempdir())
    outputs = OutputSettings(
        _face(settings.face, _stamp(settings.face)),
        sounded=True,
        rate_hz=settings.rate_hz,
        fps=settings.fps,
        staging=settings.staging,
        delivery=settings.delivery,
    )
    checked_outputs([anywhere / f"line.{kind}" for kind in settings.kinds], outputs)
    if settings.curves:
        check_curve_set(settings.curves)
    _lexicon(settings.lexicon, _stamp(settings.lexicon))
    _try_out(settings, _model(settings.model, _stamp(settings.model)))


def _try_out(settings: BatchSettings, model: Model) -> None:
    """Write the motion files of a moment of silence into a folder that is deleted. Raises as ``animate``, ``write``."""
    kinds = [kind for kind in settings.kinds if motion_suffix(Path(f"line.{kind}"))]
    kinds = [kind for kind in kinds if not kind.startswith(CUES)]
    face = _face(settings.face, _stamp(settings.face))
    if not kinds or face.other_person(model, settings.speaker) is not None:
        return
    silence = Audio(np.zeros(round(SPEECH_RATE_HZ * SILENCE_S), np.float32), SPEECH_RATE_HZ)
    units = Timeline((Span(0.0, SILENCE_S, Unit("sil")),))
    request = SpeechRequest(silence, units=units, speaker=settings.speaker)
    with tempfile.TemporaryDirectory(prefix="lipmotion-") as folder:
        generation = animate(request, model=model)
        write(
            with_articulation(generation) if settings.articulation else generation,
            [Path(folder) / f"line.{kind}" for kind in kinds],
            speech=silence,
            channels=settings.channels or None,
            rate_hz=settings.rate_hz,
            staging=settings.staging,
            delivery=replace(settings.delivery, offset_ms=0.0),
            curves=settings.curves or None,
        )
