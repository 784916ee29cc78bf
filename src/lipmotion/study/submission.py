"""What the page sends after a trial, checked before it is stored."""

from __future__ import annotations

from typing import Any

from lipmotion.errors import InputError
from lipmotion.study.answers import PAIRED, POSSIBLE, is_possible
from lipmotion.study.manifest import Study, StudyTrial
from lipmotion.study.store import AnswerSheet
from lipmotion.study.trials import questions_of

SHARE_PLAYED = 0.9
"""Least time of a trial, as a share of the time that its videos last: clocks of browsers and files differ."""
LONGEST_S, MOST_PLAYS = 86_400.0, 1000
MEMBERS = {"trial", "values", "plays", "seconds"}


def submitted_sheet(study: Study, trials: list[StudyTrial], rater: int, content: Any) -> AnswerSheet:
    """Return the answers that a page sent.

    trials  : in the order of this rater
    content : what the JSON text held: ``trial``, its number; ``values``, an answer to each question; ``plays``, how
              often each video was played to its end; ``seconds``, from the start of the trial to the answer
    Raises InputError: something else, an impossible value, or not all videos were played to their ends.
    """
    if not isinstance(content, dict) or content.keys() != MEMBERS:
        raise InputError(f"required an object with {', '.join(sorted(MEMBERS))}")
    number = content["trial"]
    if type(number) is not int or not 0 <= number < len(trials):
        raise InputError(f"no such trial, required 0 to {len(trials) - 1}")
    trial = trials[number]
    plays = _plays(content["plays"], len(trial.videos))
    seconds = content["seconds"]
    lasts_s = sum(video.seconds for video in study.shown(trial))
    if type(seconds) not in (int, float) or not 0 <= seconds <= LONGEST_S:
        raise InputError(f"the seconds are not a number from 0 to {LONGEST_S:.0f}")
    if seconds < SHARE_PLAYED * lasts_s:
        raise InputError(f"{seconds:.1f} s for videos of {lasts_s:.1f} s; play all of them to their ends")
    return AnswerSheet(rater, number, _values(study, trial, content["values"]), float(seconds), sum(plays))


def _plays(given: Any, count: int) -> list[int]:
    if not isinstance(given, list) or len(given) != count or not all(type(each) is int for each in given):
        raise InputError(f"required the plays of {count} videos")
    if not all(1 <= each <= MOST_PLAYS for each in given):
        raise InputError("a video was not played to its end; play all of them")
    return given


def _values(study: Study, trial: StudyTrial, given: Any) -> tuple[str, ...]:
    count = len(questions_of(study, trial))
    if not isinstance(given, list) or len(given) != count:
        raise InputError(f"required {count} answers")
    for value in given:
        if not isinstance(value, str) or not is_possible(study.kind, value):
            raise InputError(f"an answer that is not possible, required {POSSIBLE[study.kind]}")
    return tuple(given if study.kind == PAIRED else (str(int(value)) for value in given))
