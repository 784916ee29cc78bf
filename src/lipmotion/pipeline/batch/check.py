"""Recordings against their script, before a batch: ``check(lines) → findings``; no motion is made, nothing written."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from lipmotion.errors import CorpusError, InputError
from lipmotion.pipeline.batch.checked_line import CheckedLine, LineToCheck, checked_line
from lipmotion.pipeline.batch.ledger import LEDGER
from lipmotion.pipeline.batch.lines import BatchLine, is_recording, read_lines
from lipmotion.pipeline.batch.pool import WorkerDied, local_pool
from lipmotion.pipeline.job import Job
from lipmotion.types import Monitor, Progress, silent_monitor

STAGE = "checking"
PAUSE_S, LETTERS_PER_S = 0.3, 15.0
"""How long words take: so long, and so many letters a second more."""
SHORT, LONG, LONGER_S = 0.5, 2.0, 1.0
"""A recording is too short or too long for its words below and above these shares of what they take; the last is how
much longer a drawn out word may be."""
FEWEST_LINES, SLOWEST = 10, 2.0
"""From so many lines with words on, their own median rate is the measure, at most so many times slower or faster."""
FEWEST_SAME_WORDS = 4
"""Shorter lines, as "Yes, sir", may well be said twice."""


@dataclass(frozen=True)
class Finding:
    """What is wrong with a line, or with a recording that no line has.

    kind : ``missing``, ``orphaned``, ``unreadable``, ``silent``, ``too short``, ``too long``, ``language``,
           ``same sound`` or ``same words``
    name : of the line; of an orphaned recording, its path
    text : what was found
    """

    kind: str
    name: str
    text: str


@dataclass(frozen=True)
class CheckSummary:
    """What was found in a number of lines."""

    lines: int
    findings: tuple[Finding, ...]

    @property
    def text(self) -> str:
        """The summary in one line."""
        counts: dict[str, int] = defaultdict(int)
        for finding in self.findings:
            counts[finding.kind] += 1
        return f"{self.lines} lines: " + (", ".join(f"{n} {kind}" for kind, n in counts.items()) or "nothing found")

    @property
    def table(self) -> str:
        """The findings, one in a row, with tabs between the columns."""
        rows = [("problem", "line", "found"), *((each.kind, each.name, each.text) for each in self.findings)]
        return "\n".join("\t".join(" ".join(cell.split()) for cell in row) for row in rows)


def check(
    source: str | Path, job: Job | None = None, *, jobs: int | None = None, monitor: Monitor = silent_monitor
) -> CheckSummary:
    """Compare recordings with their script: which are missing, of no use, of the wrong length or language, or doubles.

    source  : as of ``batch``
    job     : as of ``batch``: the language that is required, and the names of outputs; None: English
    jobs    : number of processes; None: one a core
    monitor : receives the progress
    Recordings of no line are those in the folder of all recordings of a list, with its sub-folders, where that lies in
    the list's own folder; else those beside the recordings. Outputs of batches do not count.
    Raises InputError: there are no lines, or too many. ExportError: two lines have the same output.
    """
    job = (job or Job()).at(Path.cwd())
    if jobs is not None and jobs < 1:
        raise InputError(f"{jobs} processes, required 1 or more; leave the number out for one a core")
    lines = read_lines(Path(source), job.outputs.kinds)
    checked: dict[str, CheckedLine] = {}
    try:
        with local_pool(jobs or os.cpu_count() or 1) as pool:
            for each in pool(checked_line, [LineToCheck(line, job.request) for line in lines]):
                checked[each.name] = each
                monitor(Progress(STAGE, len(checked), len(lines), len(checked) / len(lines)))
    except WorkerDied as error:
        raise CorpusError(f"a process that listened to recordings died ({error}); run it with --jobs 1") from error
    in_order = [checked[line.name] for line in lines]
    return CheckSummary(len(lines), tuple(_findings(in_order, _orphans(Path(source), lines))))


def _findings(checked: Sequence[CheckedLine], orphans: Iterable[str]) -> Iterator[Finding]:
    """Yield what is wrong, line after line, and then what is there twice, and the recordings of no line."""
    usual = _usual(checked)
    for each in checked:
        if each.problem:
            yield Finding(each.problem, each.name, each.reason)
            continue
        if each.reason:
            yield Finding("language", each.name, each.reason)
        if each.letters:
            yield from _length(each, usual)
    yield from _doubles("same sound", checked, lambda each: each.digest)
    yield from _doubles("same words", checked, lambda each: each.words if len(each.words) >= FEWEST_SAME_WORDS else ())
    yield from (Finding("orphaned", path, "no line has this recording") for path in orphans)


def expected_s(letters: float) -> float:
    """Return how long words of a number of letters usually take, without pauses, s.

    >>> expected_s(15)
    1.3
    """
    return PAUSE_S + letters / LETTERS_PER_S


def _usual(checked: Sequence[CheckedLine]) -> float:
    """Return how many times as long as usual the lines of a batch take; 1 where there are too few to tell."""
    shares = [each.spoken_s / expected_s(each.letters) for each in checked if each.letters]
    return min(max(median(shares), 1 / SLOWEST), SLOWEST) if len(shares) >= FEWEST_LINES else 1.0


def _length(each: CheckedLine, usual: float) -> Iterator[Finding]:
    wanted_s = usual * expected_s(each.letters)
    text = f"{each.spoken_s:.1f} s of speech, about {wanted_s:.1f} s for its {len(each.words)} words"
    if each.spoken_s < SHORT * wanted_s:
        yield Finding("too short", each.name, text)
    elif each.spoken_s > LONG * wanted_s + LONGER_S:
        yield Finding("too long", each.name, text)


def _doubles(kind: str, checked: Sequence[CheckedLine], key: Callable[[CheckedLine], object]) -> Iterator[Finding]:
    """Yield the lines that have the same as an earlier one; where the key is empty, they have nothing."""
    first: dict[object, str] = {}
    for each in checked:
        if found := key(each):
            if found in first:
                yield Finding(kind, each.name, f"as of {first[found]}")
            first.setdefault(found, each.name)


def _orphans(source: Path, lines: Sequence[BatchLine]) -> list[str]:
    """Return the paths of recordings that no line of a list has; of a folder, every recording is a line."""
    if source.is_dir():
        return []
    used = {os.path.realpath(line.recording) for line in lines}
    folders = {Path(line.recording).parent for line in lines}
    own = Path(os.path.abspath(source)).parent  # noqa: PTH100 # links are not followed
    is_inside = all(folder.is_relative_to(own) for folder in folders)
    roots, depth = ([Path(os.path.commonpath(folders))], "**/*") if is_inside else (sorted(folders), "*")
    found = (path for root in roots for path in sorted(root.glob(depth)) if is_recording(path) and path.is_file())
    return [str(path) for path in found if os.path.realpath(path) not in used and not _is_output(path, roots)]


def _is_output(path: Path, roots: Sequence[Path]) -> bool:
    """Return whether a recording is hidden, or lies in a folder that a batch has written."""
    inner = next(path.relative_to(root) for root in roots if path.is_relative_to(root))
    folders = path.parents[: len(inner.parts)]
    return any(part.startswith(".") for part in inner.parts) or any((folder / LEDGER).exists() for folder in folders)
