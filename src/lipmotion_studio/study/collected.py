"""Answers of a study as the table that spreadsheets and statistics programs read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion_studio.study.answers import Answer, write_answers
from lipmotion_studio.study.manifest import Study, read_study
from lipmotion_studio.study.store import AnswerSheet, StudyStore, rater_name, rater_number
from lipmotion_studio.study.trials import questions_of, trials_of


def collected_answers(folder: Path) -> list[Answer]:
    """Return the answers of a study, in the order of raters and trials.

    Raises InputError: no study, or nobody has answered yet.
    """
    study = read_study(folder)
    with closing(StudyStore(folder, create=False)) as store:
        return list(answers_of(study, store.sheets()))


def export_answers(folder: Path, output: Path, rater: str | None = None) -> int:
    """Write the answers of a study as CSV (``write_answers``); return how many there are.

    rater : name of the only rater whose answers are written, as the page shows it; None: all raters
    Raises InputError: as ``collected_answers``, or no answers of this rater. Raises ExportError: the file cannot be
    written.
    """
    answers = collected_answers(folder)
    if rater is not None:
        name = rater_name(rater_number(rater))
        answers = [answer for answer in answers if answer.rater == name]
        if not answers:
            raise InputError(f"{folder}: no answers of the rater {name}; the names are in the exported answers")
    write_answers(output, answers)
    return len(answers)


def forget_rater(folder: Path, name: str) -> int:
    """Delete a rater and all of the rater's answers; return how many there were.

    name : as in the exported answers, and as the page shows it to the rater
    Files that were exported before are not changed.
    Raises InputError: no study, or no such rater.
    """
    read_study(folder)
    with closing(StudyStore(folder, create=False)) as store:
        return store.forget(rater_number(name))


def answers_of(study: Study, sheets: list[AnswerSheet]) -> Iterator[Answer]:
    """Yield one row for each judgement."""
    orders = {number: trials_of(study, number) for number in sorted({sheet.rater for sheet in sheets})}
    for sheet in sheets:
        trial = orders[sheet.rater][sheet.trial]
        for (question, condition, other), value in zip(questions_of(study, trial), sheet.values, strict=True):
            yield Answer(
                rater_name(sheet.rater),
                study.kind,
                sheet.trial,
                study.shown(trial)[0].sentence,
                question,
                condition,
                other,
                value,
                sheet.seconds,
                sheet.plays,
                trial.practice,
                trial.expected,
            )
