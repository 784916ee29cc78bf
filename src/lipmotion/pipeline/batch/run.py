"""Thousands of recordings to files: ``batch(lines, out) → summary``; resumable, in many processes."""

from __future__ import annotations

import errno
import logging
import os
import tempfile
import time
import uuid
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.errors import CorpusError, ExportError, LipMotionError, shorten_list
from lipmotion.extensions import describe_failed_extension, load_provided
from lipmotion.formats.base import find_suffix
from lipmotion.measures.closures import CLOSED_SHARE
from lipmotion.motion.closure import OPENING, find_closable_ranges
from lipmotion.motion.frame_labels import list_speech_intervals
from lipmotion.motion.speaker_maps import SpeakerMap
from lipmotion.pipeline.analysis.read_request import read_lexicon
from lipmotion.pipeline.batch.ledger import (
    CUES,
    DONE,
    FAILED,
    Ledger,
    Place,
    Record,
    are_in_place,
    are_same_inputs,
    check_job,
    fingerprint_job,
    fingerprint_line,
    is_in_place,
    list_input_files,
    open_ledger,
    read_receipt,
    write_receipt,
)
from lipmotion.pipeline.batch.lines import MAX_NAMED_LINES, BatchLine, check_names, read_lines
from lipmotion.pipeline.batch.report import APPROVE, MARKS, REDO, Mark, is_due, read_marks, write_marks, write_reports
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.job import Job, check_outputs, open_face, run, write_job_outputs
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outputs.output import ShownFace
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.workers import ItemT, ResultT, WorkerDiedError, cluster_pool, open_workers, process_count
from lipmotion.storage.files import check_target, confine, make_folder, put_in_place, remove
from lipmotion.storage.locks import open_temporary
from lipmotion.storage.sources import Source, check_apart, hash_file
from lipmotion.types import SPEECH_RATE_HZ, Audio, Generation, ParallelMap, Span, Timeline, Unit
from lipmotion.types.progress import Item, Monitor, Progress, silent_monitor
from lipmotion.units import Lexicon
from lipmotion.units.phone_timelines import group_words

LOG = logging.getLogger("lipmotion")
MAX_WARNINGS = 10
SILENCE_S = 0.5  # seconds of silence with which the settings are tried out


@dataclass(frozen=True)
class LineWork:
    """What a worker needs to know of a line."""

    line: BatchLine
    job: Job
    of_settings: str  # from ``fingerprint_job``
    place: Place

    def record(self, outcome: str) -> Record:
        """Return the record of the line with an outcome, and without inputs and outputs."""
        return {
            "name": self.line.name,
            "recording": self.line.recording,
            "run": self.place.run,
            "fingerprint": fingerprint_line(self.line, self.of_settings),
            "outcome": outcome,
            "inputs": [],
            "outputs": {},
        }


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
    line, place, kinds, record = work.line, work.place, work.job.outputs.kinds, work.record(DONE)
    with _capture_warnings() as warnings:
        try:
            record["inputs"] = [asdict(each) for each in list_input_files(line)]
            record |= _describe_motion(_write_line(work))
            staged = {f"{line.name}.{kind}": place.staged(line.name, kind) for kind in kinds}
            record["outputs"] = {name: hash_file(path) for name, path in staged.items()}
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
    line, kinds, requested = work.line, work.job.outputs.kinds, work.job.request
    make_folder((Path(work.place.out) / line.name).parent)
    staged = tuple(str(work.place.staged(line.name, kind)) for kind in kinds)
    for kind in kinds:
        check_target(Path(work.place.out) / f"{line.name}.{kind}")
    (model, face, lexicon), speaker = _share(work.job, work.place.run), line.speaker or requested.speaker
    known: dict[str, Any] = {"transcript": line.transcript or None, "speaker": speaker, "lexicon": lexicon}
    if requested.onto is None and (other := face.find_other_person(model, speaker)) is not None:
        known["onto"] = _map_onto(model, other, speaker)
    job = work.job.of(Path(line.recording), staged)
    job = replace(job, request=replace(job.request, **known))
    return run(job, face=face, model=model, words_beside=True, is_typed=False)


def _describe_motion(generation: Generation) -> Record:
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
    kinds = [kind for kind in job.outputs.kinds if find_suffix(Path(f"line.{kind}")) and not kind.startswith(CUES)]
    if not kinds or face.find_other_person(model, job.request.speaker) is not None:
        return
    silence = Audio(np.zeros(round(SPEECH_RATE_HZ * SILENCE_S), np.float32), SPEECH_RATE_HZ)
    units = Timeline((Span(0.0, SILENCE_S, Unit("sil")),))
    request = Request(silence, units=units, speaker=job.request.speaker)
    with open_temporary() as folder:
        files = tuple(str(folder / f"line.{kind}") for kind in kinds)
        early = replace(job, delivery=replace(job.delivery, offset_ms=0.0), outputs=replace(job.outputs, files=files))
        write_job_outputs(early, face, animate(request, model=model), silence)


@contextmanager
def open_local_pool(jobs: int) -> Iterator[ParallelMap]:
    """Give a map in processes here (one job: in this one) whose results come as they are ready."""

    def each(function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        with open_workers(jobs) as workers:
            yield from workers.unordered_map(function, items)

    yield each


STAGE = "animating"
MAX_DEATHS = 3  # after so many deaths of workers in a row that no line explains, the batch ends


@dataclass(frozen=True)
class BatchSummary:
    """How a batch ended.

    done   : lines that were done in this run
    kept   : lines that an earlier run had done
    failed : lines that could not be done; the report says why
    csv, html : paths of the report
    """

    done: int
    kept: int
    failed: int
    csv: Path
    html: Path

    @property
    def text(self) -> str:
        """The summary in one line."""
        total = self.done + self.kept + self.failed
        return f"{total} lines: {self.done} done, {self.kept} kept, {self.failed} failed"


def batch(
    source: str | Path | Sequence[BatchLine],
    out: str | Path,
    job: Job | None = None,
    *,
    jobs: int | None = None,
    cluster: str = "",
    marks: str | Path | None = None,
    monitor: Monitor = silent_monitor,
) -> BatchSummary:
    """Turn many recordings into motion files, videos or cues, and write a report of all of them.

    source   : a folder of recordings, a list of them (docs/batch.md), or lines
    out      : folder of the outputs, created if needed; their names are those of the recordings, with the same
               sub-folders
    job      : what is made of every recording, and how; None: motion as ``.json``. Its ``outputs.kinds`` are suffixes
               without the first dot: those of ``lipmotion.write``, and ``cues.tsv``, ``cues.xml``, ``cues.json``,
               ``cues.dat``. Its speaker is that of lines that name none
    jobs     : number of processes; None: one a core. With more than one, a script must be guarded by
               ``if __name__ == "__main__":``
    cluster  : address of the scheduler of a Dask cluster that does the work instead of this machine
    marks    : table of approved lines and of those to be done again, as the report saves it; its rows are added to
               ``marks.csv`` in ``out``, whose marks hold in every run
    monitor  : receives an ``Item`` for every line and the progress
    A line that was done before, with the same settings and from the same files, is kept; so is an approved one,
    whatever has changed. A line that cannot be done is part of the report, and the others go on.
    The motion is that of ``animate``, whatever the number of processes.
    Raises InputError: there are no recordings, a setting is not usable, or the cluster is not.
    Raises ExportError: two lines have the same output, an output would replace a recording, another process is at
    work on the folder, or the disk is full.

    >>> import lipmotion, tempfile
    >>> from lipmotion.pipeline.batch import batch
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     batch("examples", folder, lipmotion.Job(outputs=lipmotion.Outputs(kinds=("csv",))), jobs=1).text
    '1 lines: 1 done, 0 kept, 0 failed'
    """
    job = (job or Job()).at(Path.cwd())
    check_job(job)
    processes = process_count(jobs)
    place = Place(os.path.abspath(out), uuid.uuid4().hex)  # noqa: PTH100
    if isinstance(source, str | Path):
        lines = read_lines(Path(source), job.outputs.kinds)
        check_apart([], [Source(Path(source), "list or folder of recordings")], folders=[Path(out)])
    else:
        lines = list(source)
        check_names(lines, job.outputs.kinds)
    inside = os.path.realpath(place.out) + os.sep
    for line in lines:
        if os.path.realpath(line.recording).startswith(inside):  # an output could replace it
            raise ExportError(f"{place.out}: holds the recording {line.recording}; give another folder for the outputs")
    marks_file = Path(place.out) / MARKS
    earlier = read_marks(marks_file) if marks_file.is_file() else {}
    new_marks = read_marks(Path(marks)) if marks is not None else {}
    names = {line.name for line in lines}
    if unknown := [name for name in new_marks if name not in names]:
        some = shorten_list(unknown, MAX_NAMED_LINES)
        LOG.warning("%s: %d marks of lines that are not in this batch: %s", marks, len(unknown), some)
    chosen = {name: mark for name, mark in (earlier | new_marks).items() if mark.kind}  # the others were taken back
    check_line_job(job, place.run)
    of_settings = fingerprint_job(job)
    with open_ledger(place, lines) as ledger:
        if marks is not None:
            write_marks(marks_file, chosen)
        counts = Counter[str]()
        monitor(Progress(STAGE, 0, len(lines), 0.0))

        def count(name: str, outcome: str, reason: str = "") -> None:
            counts[outcome] += 1
            monitor(Item(name, outcome, reason))
            monitor(Progress(STAGE, counts.total(), len(lines), counts.total() / len(lines)))

        finished = _find_finished(lines, ledger, place, of_settings, chosen)
        waiting = [LineWork(line, job, of_settings, place) for line in lines if line.name not in finished]
        for line in lines:
            if line.name in finished:
                count(line.name, "kept")
        pool = cluster_pool(cluster, Path(place.out)) if cluster else open_local_pool(processes)
        if waiting:
            with pool as each, closing(_finish_lines(each, waiting)) as records:
                for record in records:
                    mark = chosen.get(record["name"])
                    if mark is not None and mark.kind == REDO and record["outcome"] == DONE:
                        record["redone"] = mark.when  # so that it is redone once
                    ledger.append(record)
                    place.receipt(record["name"]).unlink(missing_ok=True)
                    count(record["name"], record["outcome"], record.get("error", ""))
        csv, html = write_reports(lines, ledger, Path(place.out), chosen)
    return BatchSummary(counts[DONE], counts["kept"], counts[FAILED], csv, html)


def _find_finished(
    lines: Sequence[BatchLine], ledger: Ledger, place: Place, of_settings: str, marks: Mapping[str, Mark]
) -> set[str]:
    """Return the names of the lines that need not be done; a warning names approved ones that are out of date."""
    out, finished, outdated = Path(place.out), set(), []
    for line in lines:
        mark = marks.get(line.name)
        if mark is not None and is_due(mark, ledger.record_of(line.name)):
            continue
        approved = ledger.find_finished(line, out) if mark is not None and mark.kind == APPROVE else None
        if approved is not None or ledger.find_same(line, of_settings, out) is not None:
            finished.add(line.name)
        if approved is not None and not are_same_inputs(line, approved):
            outdated.append(line.name)
    if outdated:
        changed = "another recording or other words now, and are kept"
        some = shorten_list(outdated, MAX_NAMED_LINES)
        LOG.warning("%d approved lines have %s: %s; mark them redo", len(outdated), changed, some)
    return finished


def _finish_lines(each: ParallelMap, waiting: Sequence[LineWork]) -> Generator[Record, None, None]:
    """Yield the record of every line. Where a worker dies, the lines go on that it had; one that kills again fails."""
    left, deaths = {work.line.name: work for work in waiting}, 0
    while left:
        try:
            for record in each(finish_line, list(left.values())):
                del left[record["name"]]
                deaths = 0
                yield record
        except WorkerDiedError as error:
            deaths += 1
            suspects = [work for work in left.values() if work.place.work(work.line.name).is_dir()]
            if not suspects and deaths >= MAX_DEATHS:
                died = f"the worker processes die before they begin ({error}), perhaps for want of memory"
                raise CorpusError(f"{died}; what is finished is kept: run it again, with fewer --jobs") from error
            for work in suspects:
                del left[work.line.name]
                try:
                    yield next(iter(each(finish_line, [work])))  # while nothing else is done
                except WorkerDiedError:
                    died = "the process that worked on it died (out of memory?); is the recording damaged?"
                    yield work.record(FAILED) | {"error": f"{work.line.recording}: {died}"}
