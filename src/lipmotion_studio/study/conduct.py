"""Conducting a study: it is served over HTTP, its answers are exported, and raters are forgotten."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import closing
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion_studio.study.answers import Answer, write_answers
from lipmotion_studio.study.manifest import check_videos, list_questions, order_trials, read_study
from lipmotion_studio.study.store import StudyStore, name_rater, parse_rater
from lipmotion_studio.web.listening import HOST, check_installed, open_socket, serve

PORT = 8000


def serve_study(
    folder: Path,
    *,
    host: str = HOST,
    port: int = PORT,
    names: Collection[str] = (),
    started: Callable[[str], object] | None = None,
) -> None:
    """Let raters take part in a study, until the process is stopped.

    host    : address to listen at; the default can be reached from this machine alone
    port    : 0: any that is free
    names   : of the server as raters call it, where another passes their requests on, as ``study.example.org``
    started : called with the address of the page once raters can come
    Every answer is on the disk before the rater's page learns that it is stored. A stopped study goes on where it was.
    Raises InputError: no study, a video is missing or has changed, or the address cannot be listened at.
    Raises MissingDependencyError: a package of the extra ``study`` is not installed.
    """
    check_installed("serving a study", "study")
    from lipmotion_studio.study.application import create_application

    study = read_study(folder)
    videos = check_videos(study, folder)
    with open_socket(host, port) as place, closing(StudyStore(folder)) as store:
        serve(create_application(study, videos, store, names), place, host=host, started=started)


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
