"""Raters and their answers in a database: SQLite, one file, in write-ahead-log mode."""

from __future__ import annotations

import queue
import sqlite3
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from secrets import token_urlsafe
from typing import Any, TypeVar

from lipmotion.errors import ExportError, InputError
from lipmotion.storage.files import check_own
from lipmotion.storage.sources import hash_file
from lipmotion_studio.study.answers import Answer, write_answers
from lipmotion_studio.study.manifest import MANIFEST, list_questions, order_trials, read_study

ResultT = TypeVar("ResultT")
Work = Callable[[sqlite3.Connection], Any]
ANSWERS = "answers.sqlite"
SCHEMA_VERSION = 1
MAX_RATERS = 100_000
MAX_TOGETHER = 256  # most pieces of work that are committed together
BUSY_S = 30.0  # how long another process, such as ``forget``, is waited for
_SCHEMA = Path(__file__).with_name("answers.sql").read_text(encoding="ascii")
_INSERT = """INSERT INTO answers SELECT :rater, :trial, :item, :value, :seconds, :plays
WHERE EXISTS (SELECT 1 FROM raters WHERE number = :rater) ON CONFLICT DO NOTHING"""


@dataclass(frozen=True)
class AnswerSheet:
    """The answers of a rater to all questions of one trial.

    trial   : number of the trial in the rater's order, from 0
    values  : one for each question
    plays   : how often its videos were played to their ends, all together
    """

    rater: int
    trial: int
    values: tuple[str, ...]
    seconds: float
    plays: int


class StudyStore:
    """The database of a study folder, created where it is not there.

    Whatever is written goes through one thread, which commits what waits together: a commit waits for the disk, and so
    many answers wait for it once. A result is given after the commit: what is acknowledged is on the disk, also if the
    process, or the machine, stops the moment after. The raters' tokens are stored as digests.

    create : whether to create the database; otherwise a study without answers is an error
    Raises InputError: no answers yet, answers of another study, no such database. Raises ExportError: cannot be opened.
    """

    def __init__(self, folder: Path, *, create: bool = True) -> None:
        self.path = folder / ANSWERS
        if not create and not self.path.is_file():
            raise InputError(f"{folder}: nobody has answered yet; let raters in: lipmotion study serve {folder}")
        digest = hash_file(folder / MANIFEST)
        for suffix in ("", "-wal", "-shm", "-journal"):  # which SQLite opens through links
            check_own(self.path.with_name(f"{ANSWERS}{suffix}"))
        try:
            self._reader = self._open(digest)
            self._writer = self._connect()
        except sqlite3.OperationalError as error:
            raise ExportError(f"{self.path}: cannot be opened: {error}") from error
        except sqlite3.DatabaseError as error:
            raise InputError(f"{self.path}: not a database of answers ({error}); move it away") from error
        self._waiting: queue.SimpleQueue[tuple[Work, Future[Any]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._write_all, name="answers", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Commit what waits, and close the database; a second time does nothing."""
        self._waiting.put(None)
        self._thread.join()
        self._writer.close()
        self._reader.close()

    def add_rater(self) -> Future[tuple[int, str]]:
        """Add a rater; the result is number and secret token, or raises InputError: there are ``MAX_RATERS``."""
        token = token_urlsafe(24)

        def work(database: sqlite3.Connection) -> tuple[int, str] | InputError:
            (count,) = database.execute("SELECT count(*) FROM raters").fetchone()
            if count >= MAX_RATERS:
                return InputError(f"the study has {count} raters, required at most {MAX_RATERS}")
            number = database.execute("INSERT INTO raters (token_sha256) VALUES (?)", [_digest(token)]).lastrowid
            return int(number or 0), token

        return self._submit(work)

    def find_rater(self, token: str) -> int | None:
        """Return the number of the rater with a token; None: nobody has it."""
        row = self._reader.execute("SELECT number FROM raters WHERE token_sha256 = ?", [_digest(token)]).fetchone()
        return None if row is None else int(row[0])

    def find_next_trial(self, rater: int) -> int:
        """Return the number of the trial that a rater has not answered yet, which may be one more than there are."""
        (last,) = self._reader.execute("SELECT max(trial) FROM answers WHERE rater = ?", [rater]).fetchone()
        return 0 if last is None else int(last) + 1

    def record(self, sheet: AnswerSheet) -> Future[bool]:
        """Store the first answers to a trial; the result: whether they are there (not of a forgotten rater)."""
        rows = [
            {"rater": sheet.rater, "trial": sheet.trial, "item": item, "value": value}
            | {"seconds": sheet.seconds, "plays": sheet.plays}
            for item, value in enumerate(sheet.values)
        ]

        def work(database: sqlite3.Connection) -> bool:
            database.executemany(_INSERT, rows)
            return database.execute("SELECT 1 FROM raters WHERE number = ?", [sheet.rater]).fetchone() is not None

        return self._submit(work)

    def list_sheets(self) -> list[AnswerSheet]:
        """Return all answers, in the order of raters and trials."""
        answers: dict[tuple[int, int], list[tuple[str, float, int]]] = {}
        order = "SELECT rater, trial, value, seconds, plays FROM answers ORDER BY rater, trial, item"
        for rater, trial, *rest in self._reader.execute(order):
            answers.setdefault((rater, trial), []).append((rest[0], rest[1], rest[2]))
        return [
            AnswerSheet(rater, trial, tuple(value for value, _, _ in rows), rows[0][1], rows[0][2])
            for (rater, trial), rows in answers.items()
        ]

    def forget(self, rater: int) -> int:
        """Delete a rater and all answers, on the disk too; return how many. Raises InputError: no such rater."""

        def work(database: sqlite3.Connection) -> int | None:
            (count,) = database.execute("SELECT count(*) FROM answers WHERE rater = ?", [rater]).fetchone()
            deleted = database.execute("DELETE FROM raters WHERE number = ?", [rater]).rowcount
            return int(count) if deleted else None

        count = self._submit(work).result()
        if count is None:
            raise InputError(f"{self.path}: no rater {name_rater(rater)}; the names are in the exported answers")
        self._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")  # the log would hold the answers for a while
        return int(count)

    def _open(self, digest: str) -> sqlite3.Connection:
        database = self._connect()
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("BEGIN IMMEDIATE")
        (version,) = database.execute("PRAGMA user_version").fetchone()
        if version == 0:
            for statement in _SCHEMA.split(";"):
                database.execute(statement)
            database.execute("INSERT INTO study VALUES (?)", [digest])
            database.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        elif version != SCHEMA_VERSION:
            raise InputError(f"{self.path}: of version {version}, required {SCHEMA_VERSION}; update lipmotion")
        database.execute("COMMIT")
        if database.execute("SELECT manifest_sha256 FROM study").fetchone() != (digest,):
            raise InputError(
                f"{self.path}: holds answers to another study, or {MANIFEST} has been changed since the first rater "
                "came; restore it, or move the answers away"
            )
        return database

    def _connect(self) -> sqlite3.Connection:
        database = sqlite3.connect(self.path, timeout=BUSY_S, isolation_level=None, check_same_thread=False)
        for setting in ("synchronous = FULL", "foreign_keys = ON", "secure_delete = ON"):
            database.execute(f"PRAGMA {setting}")
        return database

    def _submit(self, work: Callable[[sqlite3.Connection], ResultT | InputError]) -> Future[ResultT]:
        future: Future[ResultT] = Future()
        self._waiting.put((work, future))
        return future

    def _write_all(self) -> None:
        goes_on = True
        while goes_on:
            together = [self._waiting.get()]
            while len(together) < MAX_TOGETHER and not self._waiting.empty():
                together.append(self._waiting.get())
            goes_on = None not in together
            self._write([each for each in together if each is not None])

    def _write(self, together: Sequence[tuple[Work, Future[Any]]]) -> None:
        """Do pieces of work in one transaction, and give their results once it is on the disk."""
        try:
            self._writer.execute("BEGIN IMMEDIATE")
            results = [work(self._writer) for work, _ in together]
            self._writer.execute("COMMIT")
        except sqlite3.Error as error:
            if self._writer.in_transaction:
                self._writer.execute("ROLLBACK")
            results = [ExportError(f"{self.path}: cannot be written: {error}")] * len(together)
        for (_, future), result in zip(together, results, strict=True):
            if future.set_running_or_notify_cancel():
                if isinstance(result, Exception):
                    future.set_exception(result)
                else:
                    future.set_result(result)


def name_rater(number: int) -> str:
    """Return the name of a rater, who is known by a number alone.

    >>> name_rater(7)
    'r007'
    """
    return f"r{number:03d}"


def parse_rater(name: str) -> int:
    """Return the number of a rater's name. Raises InputError: not such a name."""
    digits = name.strip().lower().removeprefix("r")
    if not (digits.isascii() and digits.isdecimal() and len(digits) <= 9):
        raise InputError(f"no rater is called {name!r}; required a name as r007")
    return int(digits)


def _digest(token: str) -> str:
    return sha256(token.encode("utf-8", "replace")).hexdigest()


def collect_answers(folder: Path) -> list[Answer]:
    """Return the judgements of a study by rater and trial. Raises InputError: no study, or nobody has answered."""
    study = read_study(folder)
    with closing(StudyStore(folder, create=False)) as store:
        sheets = store.list_sheets()
    orders = {number: order_trials(study, number) for number in sorted({sheet.rater for sheet in sheets})}
    answers = []
    for sheet in sheets:
        trial = orders[sheet.rater][sheet.trial]
        rater, sentence = name_rater(sheet.rater), study.list_shown(trial)[0].sentence
        for (question, condition, other), value in zip(list_questions(study, trial), sheet.values, strict=True):
            judged = (question, condition, other, value, sheet.seconds, sheet.plays, trial.practice, trial.expected)
            answers.append(Answer(rater, study.kind, sheet.trial, sentence, *judged))
    return answers


def export_answers(folder: Path, output: Path, rater: str | None = None) -> int:
    """Write the answers of a study as CSV (``write_answers``); return how many there are.

    rater : name of the only rater whose answers are written, as the page shows it; None: all raters
    Raises InputError: as ``collect_answers``; no answers of this rater. Raises ExportError: the file is not written.
    """
    answers = collect_answers(folder)
    if rater is not None:
        name = name_rater(parse_rater(rater))
        answers = [answer for answer in answers if answer.rater == name]
        if not answers:
            raise InputError(f"{folder}: no answers of the rater {name}; the names are in the exported answers")
    write_answers(output, answers)
    return len(answers)


def forget_rater(folder: Path, name: str) -> int:
    """Delete a rater and all answers; return how many. Raises InputError: no study, no such rater."""
    read_study(folder)
    with closing(StudyStore(folder, create=False)) as store:
        return store.forget(parse_rater(name))
