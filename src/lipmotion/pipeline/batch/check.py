"""Recordings against their script, before a batch: ``check(lines) → findings``; no motion is made, nothing written."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median

from lipmotion.errors import CorpusError, LipMotionError
from lipmotion.pipeline.analysis.language import detect_english
from lipmotion.pipeline.analysis.read_request import read_request
from lipmotion.pipeline.batch.ledger import LEDGER
from lipmotion.pipeline.batch.lines import BatchLine, read_lines
from lipmotion.pipeline.batch.run import open_local_pool
from lipmotion.pipeline.job import Job
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.workers import WorkerDiedError, process_count
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.pauses import list_spans, measure_levels_db
from lipmotion.storage.sources import is_recording
from lipmotion.types import Monitor, Progress, TimedTranscript, silent_monitor
from lipmotion.types.audio import to_sixteen_bits
from lipmotion.types.languages import AUTO, ENGLISH, find_script
from lipmotion.units.lexicon import COMMON_WORDS, detect_language
from lipmotion.units.spoken_text import parse_tagged_text
from lipmotion.units.text_normalisation import find_words, split_written_words

SILENT_DB = -60.0  # a recording that is nowhere louder, in dB of full scale, is silent
MIN_SPOKEN_S = 0.1  # a recording with less sound above its quiet level has nothing said in it
SHORTEST_TOLD_S, MIN_TOLD_WORDS = 8.0, 5
"""The language of shorter speech, or of fewer words, is not told: it takes a dozen long words to be sure."""
LETTERS_OF = {"CJK": 4.0, "HANGUL": 3.0, "HIRAGANA": 2.0, "KATAKANA": 2.0}
"""How many Latin letters take as long to say as one of a script."""


@dataclass(frozen=True)
class CheckedLine:
    """What was found in the recording and the words of a line.

    problem  : kind of what makes the recording of no use: ``missing``, ``unreadable``, ``silent``; empty: it is of use
    reason   : what is wrong with it, or with the language of words or speech; empty: nothing
    digest   : of the samples, the same for a sound under two names
    spoken_s : seconds from pause to pause, without the pauses
    letters  : of the words, as many as Latin letters would take as long
    words    : that are to be said; empty: not known
    """

    name: str
    problem: str = ""
    reason: str = ""
    digest: str = ""
    spoken_s: float = 0.0
    letters: float = 0.0
    words: tuple[str, ...] = ()


def check_line(line: BatchLine, request: Request) -> CheckedLine:
    """Return what is found in the recording of a line, and what is to be said in it, as a request understands it."""
    path = Path(line.recording)
    if not path.exists():
        return CheckedLine(line.name, "missing", f"{path}: no such file")
    try:
        audio = read_audio(path, warn=False)
        words = _read_words(line, request)
    except (LipMotionError, OSError) as error:
        return CheckedLine(line.name, "unreadable", str(error))
    levels = measure_levels_db(audio)
    loudest_db = float(levels.max())
    if loudest_db < SILENT_DB:
        return CheckedLine(line.name, "silent", f"nowhere louder than {loudest_db:.0f} dB of full scale")
    spoken_s = sum(end_s - start_s for start_s, end_s in list_spans(levels))
    if spoken_s < MIN_SPOKEN_S:
        return CheckedLine(line.name, "silent", "no sound longer than a click")
    detected = detect_language(words) if len(words) >= MIN_TOLD_WORDS else ""
    required, reason = request.language if request.language != AUTO else detected, ""
    if detected and required in COMMON_WORDS and detected != required:
        reason = f"the words are in {detected}, required {required}"
    elif required and spoken_s >= SHORTEST_TOLD_S:
        english = detect_english(audio)
        if english is not None and english != (required == ENGLISH):
            reason = f"the speech is {'' if english else 'not '}English, required {required}"
    digest = hashlib.sha256(to_sixteen_bits(audio.samples).tobytes()).hexdigest()
    return CheckedLine(line.name, "", reason, digest, spoken_s, count_letters(words), words)


def count_letters(words: Sequence[str]) -> float:
    """Return how many letters words have, those of other scripts as many as take as long to say."""
    return sum((LETTERS_OF.get(find_script(letter), 1.0) for word in words for letter in word), 0.0)


def _read_words(line: BatchLine, request: Request) -> tuple[str, ...]:
    """Return the words of a line without tags, numbers spelled out where they are English; none: they are not known."""
    request = replace(request, recording=Path(line.recording), lexicon=None)
    transcript = line.transcript or read_request(request, words_beside=True).transcript
    if transcript is None or isinstance(transcript, TimedTranscript):
        return transcript.words if transcript else ()
    text = parse_tagged_text(str(transcript)).text
    if request.language == ENGLISH:
        return find_words(text)
    return split_written_words(text) if text.strip() else ()


PAUSE_S, LETTERS_PER_S = 0.3, 15.0  # how long words take: so long, and so many letters a second more
SHORT, LONG, LONGER_S = 0.5, 2.0, 1.0
"""A recording is too short or too long for its words below and above these shares of what they take; the last is how
much longer a drawn out word may be."""
MIN_LINES, SLOWEST = 10, 2.0
"""From so many lines with words on, their own median rate is the measure, at most so many times slower or faster."""
MIN_SAME_WORDS = 4  # shorter lines, as "Yes, sir", may well be said twice


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
        counts = Counter(finding.kind for finding in self.findings)
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
    Recordings of no line are those in the folder of all recordings of a list, with its sub-folders, where that lies in
    the list's own folder; else those beside the recordings. Outputs of batches do not count.
    Raises InputError: there are no lines, or too many. ExportError: two lines have the same output.
    """
    job = (job or Job()).at(Path.cwd())
    processes = process_count(jobs)
    lines = read_lines(Path(source), job.outputs.kinds)
    checked: dict[str, CheckedLine] = {}
    try:
        with open_local_pool(processes) as pool:
            for each in pool(partial(check_line, request=job.request), lines):
                checked[each.name] = each
                monitor(Progress("checking", len(checked), len(lines), len(checked) / len(lines)))
    except WorkerDiedError as error:
        raise CorpusError(f"a process that listened to recordings died ({error}); run it with --jobs 1") from error
    in_order = [checked[line.name] for line in lines]
    return CheckSummary(len(lines), tuple(_find_problems(in_order, _find_orphans(Path(source), lines))))


def _find_problems(checked: Sequence[CheckedLine], orphans: Iterable[str]) -> Iterator[Finding]:
    """Yield what is wrong, line after line, and then what is there twice, and the recordings of no line."""
    rates = [each.spoken_s / estimate_time(each.letters) for each in checked if each.letters]
    usual = min(max(median(rates), 1 / SLOWEST), SLOWEST) if len(rates) >= MIN_LINES else 1.0
    for each in checked:
        if each.problem:
            yield Finding(each.problem, each.name, each.reason)
            continue
        if each.reason:
            yield Finding("language", each.name, each.reason)
        wanted_s = usual * estimate_time(each.letters)
        text = f"{each.spoken_s:.1f} s of speech, about {wanted_s:.1f} s for its {len(each.words)} words"
        if each.letters and each.spoken_s < SHORT * wanted_s:
            yield Finding("too short", each.name, text)
        elif each.letters and each.spoken_s > LONG * wanted_s + LONGER_S:
            yield Finding("too long", each.name, text)
    yield from _find_doubles("same sound", checked, lambda each: each.digest)
    yield from _find_doubles(
        "same words", checked, lambda each: each.words if len(each.words) >= MIN_SAME_WORDS else ()
    )
    yield from (Finding("orphaned", path, "no line has this recording") for path in orphans)


def estimate_time(letters: float) -> float:
    """Return how long words of a number of letters usually take, without pauses, s."""
    return PAUSE_S + letters / LETTERS_PER_S


def _find_doubles(kind: str, checked: Sequence[CheckedLine], key: Callable[[CheckedLine], object]) -> Iterator[Finding]:
    """Yield the lines that have the same as an earlier one; where the key is empty, they have nothing."""
    first: dict[object, str] = {}
    for each in checked:
        value = key(each)
        if value and value in first:
            yield Finding(kind, each.name, f"as of {first[value]}")
        first.setdefault(value, each.name)


def _find_orphans(source: Path, lines: Sequence[BatchLine]) -> list[str]:
    """Return the paths of recordings that no line of a list has; of a folder, every recording is a line."""
    if source.is_dir():
        return []
    used = {os.path.realpath(line.recording) for line in lines}
    folders = {Path(line.recording).parent for line in lines}
    list_folder = Path(os.path.abspath(source)).parent  # noqa: PTH100 # links are not followed
    is_inside = all(folder.is_relative_to(list_folder) for folder in folders)
    roots, depth = ([Path(os.path.commonpath(folders))], "**/*") if is_inside else (sorted(folders), "*")
    orphans = []
    for root in roots:
        for path in sorted(root.glob(depth)):
            parts = path.relative_to(root).parts
            is_written = any((folder / LEDGER).exists() for folder in path.parents[: len(parts)])  # by a batch
            is_hidden = any(part.startswith(".") for part in parts)
            if is_recording(path) and path.is_file() and os.path.realpath(path) not in used:
                orphans += [] if is_hidden or is_written else [str(path)]
    return orphans
