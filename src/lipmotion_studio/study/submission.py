"""What the page sends after a trial, checked before it is stored."""

from __future__ import annotations

from typing import Any

from lipmotion.errors import InputError
from lipmotion.types.values import items, members, number, text, whole
from lipmotion_studio.study.answers import PAIRED, POSSIBLE, is_possible
from lipmotion_studio.study.manifest import Study, StudyTrial
from lipmotion_studio.study.store import AnswerSheet
from lipmotion_studio.study.trials import questions_of

SHARE_PLAYED = 0.9
"""Least time of a trial, as a share of the time that its videos last: clocks of browsers and files differ."""
LONGEST_S, MOST_PLAYS = 86_400.0, 1000
_MEMBERS = {
    **{"trial": whole(0, 1 << 31), "values": items(text(100)), "plays": items(whole(1, MOST_PLAYS))},
    "seconds": number(0, LONGEST_S),
}
_SHEET = members(_MEMBERS, _MEMBERS, alone=True)


def submitted_sheet(study: Study, trials: list[StudyTrial], rater: int, content: Any) -> AnswerSheet:
    """Return the answers that a page sent.

    trials  : in the order of this rater
    content : what the JSON text held: ``trial``, its number; ``values``, an answer to each question; ``plays``, how
              often each video was played to its end; ``seconds``, from the start of the trial to the answer
    Raises InputError: something else, an impossible value, or not all videos were played to their ends.
    """
    found = _SHEET(content)
    if found["trial"] >= len(trials):
        raise InputError(f"no such trial, required 0 to {len(trials) - 1}")
    trial, seconds = trials[found["trial"]], found["seconds"]
    if len(found["plays"]) != len(trial.videos):
        raise InputError(f"required the plays of {len(trial.videos)} videos")
    lasts_s = sum(video.seconds for video in study.shown(trial))
    if seconds < SHARE_PLAYED * lasts_s:
        raise InputError(f"{seconds:.1f} s for videos of {lasts_s:.1f} s; play all of them to their ends")
    given = found["values"]
    count = len(questions_of(study, trial))
    if len(given) != count:
        raise InputError(f"required {count} answers")
    if not all(is_possible(study.kind, value) for value in given):
        raise InputError(f"an answer that is not possible, required {POSSIBLE[study.kind]}")
    values = tuple(given if study.kind == PAIRED else (str(int(value)) for value in given))
    return AnswerSheet(rater, found["trial"], values, seconds, sum(found["plays"]))
