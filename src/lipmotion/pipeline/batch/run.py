"""Thousands of recordings to files: ``batch(lines, out) → summary``; resumable, in many processes."""

from __future__ import annotations

import logging
import os
import uuid
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from lipmotion.errors import CorpusError, ExportError, shorten
from lipmotion.pipeline.batch.ledger import (
    DONE,
    FAILED,
    Ledger,
    Place,
    Record,
    are_same_inputs,
    check_job,
    fingerprint_job,
    fingerprint_line,
    open_ledger,
)
from lipmotion.pipeline.batch.lines import MAX_NAMED_LINES, BatchLine, check_names, read_lines
from lipmotion.pipeline.batch.one_line import LineWork, check_line_job, finish_line
from lipmotion.pipeline.batch.report import (
    APPROVE,
    MARKS,
    REDO,
    Mark,
    is_due,
    merge_marks,
    read_marks,
    write_marks,
    write_reports,
)
from lipmotion.pipeline.job import Job
from lipmotion.pipeline.workers import ItemT, Pool, ResultT, WorkerDiedError, cluster_pool, process_count, worker_pool
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import Item, Monitor, Progress, silent_monitor


@contextmanager
def local_pool(jobs: int) -> Iterator[Pool]:
    """Give a pool of processes on this machine; with one job, this process itself."""

    def each(function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        with worker_pool(jobs) as workers:
            yield from workers.unordered_map(function, items)

    yield each


LOG = logging.getLogger("lipmotion")
STAGE = "animating"
MAX_DEATHS = 3
"""After so many deaths of workers in a row that no line explains, the batch ends."""


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
    chosen = _choose_marks(Path(place.out), marks, lines)
    check_line_job(job, place.run)
    of_settings = fingerprint_job(job)
    with open_ledger(place, lines) as ledger:
        if marks is not None:
            write_marks(Path(place.out) / MARKS, chosen)
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
        pool = cluster_pool(cluster, Path(place.out)) if cluster else local_pool(processes)
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


def _choose_marks(out: Path, table: str | Path | None, lines: Sequence[BatchLine]) -> dict[str, Mark]:
    """Return the marks in a folder of outputs, with those of a further file in their place. Raises InputError."""
    earlier = read_marks(out / MARKS) if (out / MARKS).is_file() else {}
    later = read_marks(Path(table)) if table is not None else {}
    names = {line.name for line in lines}
    if unknown := [name for name in later if name not in names]:
        LOG.warning("%s: %d marks of lines that are not in this batch: %s", table, len(unknown), _some(unknown))
    return merge_marks(earlier, later)


def _find_finished(
    lines: Sequence[BatchLine], ledger: Ledger, place: Place, of_settings: str, marks: Mapping[str, Mark]
) -> set[str]:
    """Return the names of the lines that need not be done; a warning names approved ones that are out of date."""
    out, finished, outdated = Path(place.out), set(), []
    for line in lines:
        mark = marks.get(line.name)
        if mark is not None and is_due(mark, ledger.record_of(line.name)):
            continue
        approved = ledger.finished(line, out) if mark is not None and mark.kind == APPROVE else None
        if approved is not None or ledger.kept(line, of_settings, out) is not None:
            finished.add(line.name)
        if approved is not None and not are_same_inputs(line, approved):
            outdated.append(line.name)
    if outdated:
        LOG.warning(
            "%d approved lines have another recording or other words now, and are kept: %s; mark them redo",
            *(len(outdated), _some(outdated)),
        )
    return finished


def _some(names: Sequence[str]) -> str:
    return ", ".join(map(shorten, names[:MAX_NAMED_LINES])) + ", ..." * (len(names) > MAX_NAMED_LINES)


def _finish_lines(each: Pool, waiting: Sequence[LineWork]) -> Generator[Record, None, None]:
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
                raise CorpusError(
                    f"the worker processes die before they begin ({error}); is there enough memory? what is finished "
                    "is kept: run it again, with fewer --jobs"
                ) from error
            for work in suspects:
                del left[work.line.name]
                try:
                    yield next(iter(each(finish_line, [work])))  # while nothing else is done
                except WorkerDiedError:
                    yield {
                        "name": work.line.name,
                        "recording": work.line.recording,
                        "run": work.place.run,
                        "fingerprint": fingerprint_line(work.line, work.of_settings),
                        "outcome": FAILED,
                        "inputs": [],
                        "outputs": {},
                        "error": f"{work.line.recording}: the process that worked on it died (out of memory?); is the "
                        "recording damaged?",
                    }
