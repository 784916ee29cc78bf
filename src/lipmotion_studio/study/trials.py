"""The trials of a study, and the order in which a rater sees them.

Nothing here draws random numbers: whatever comes in a random order is sorted by digests of its place and the seed. So
an order is the same on every machine and with every version of Python.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from itertools import permutations
from typing import TypeVar

from lipmotion_studio.study.answers import ANCHOR, FIRST, HIGHEST_RANK, MOS, PAIRED, SECOND
from lipmotion_studio.study.manifest import Study, StudyTrial
from lipmotion_studio.study.settings import MATCH, PREFERENCE

PlaceT = TypeVar("PlaceT")
VideoNumbers = Mapping[tuple[str, str], int]
"""The number of the video of a sentence and a condition."""


def shuffled(items: Iterable[PlaceT], *key: object) -> list[PlaceT]:
    """Return items in an order that depends on a key, every order being equally likely.

    >>> shuffled("abcd", 1), shuffled("abcd", 2)
    (['d', 'a', 'b', 'c'], ['b', 'd', 'c', 'a'])
    """

    def place(pair: tuple[int, PlaceT]) -> bytes:
        return sha256("/".join(map(str, (*key, pair[0]))).encode()).digest()

    return [item for _, item in sorted(enumerate(items), key=place)]


def main_trials(
    kind: str, conditions: Sequence[str], sentences: Sequence[str], videos: VideoNumbers
) -> list[StudyTrial]:
    """Return the trials that count.

    conditions : names, without the anchor; a ranking shows it where ``videos`` has one for the sentence
    Paired comparison: every pair of conditions in both orders, for every sentence, so that each rater judges each pair
    twice: 3 conditions and 6 sentences make 36 trials. Mean opinion scores: every video once. Ranking: every sentence
    once, with all conditions on a page.
    Source: Hofer 2008, section 7; Xie & Liu 2007, section 7.3; ITU-R BS.1534 (the page of sliders).
    """
    trials = []
    for sentence in sentences:
        shown = {name: videos[sentence, name] for name in (*conditions, ANCHOR) if (sentence, name) in videos}
        if kind == PAIRED:
            trials += [StudyTrial((shown[a], shown[b])) for a, b in permutations(conditions, 2)]
        elif kind == MOS:
            trials += [StudyTrial((number,)) for number in shown.values()]
        else:
            trials.append(StudyTrial(tuple(shown.values())))
    return trials


def anchor_trials(base: str, sentences: Sequence[str], videos: VideoNumbers) -> list[StudyTrial]:
    """Return pairs of a condition and the same out of step, for each sentence, second and first in turns."""
    trials = []
    for n, sentence in enumerate(sentences):
        pair = (videos[sentence, base], videos[sentence, ANCHOR])
        trials.append(StudyTrial(pair[:: -1 if n % 2 else 1], expected=SECOND if n % 2 else FIRST))
    return trials


_TOLD = {
    PAIRED: ((SECOND, "the second video"), (FIRST, "the first video")),
    MOS: (("2", "2 on every scale"), ("4", "4 on every scale")),
}


def attention_trials(kind: str, trials: Sequence[StudyTrial], count: int, seed: int) -> list[StudyTrial]:
    """Return trials whose page tells what to answer, made of some of the trials that count."""
    checks = []
    for n, trial in enumerate(shuffled(trials, "check", seed)[:count]):
        told = _TOLD.get(kind, (("0", "0 for every video"), (str(HIGHEST_RANK), f"{HIGHEST_RANK} for every video")))
        value, words = told[n % 2]
        note = f"This page checks that you read it: after the videos, please answer {words}, whatever you saw."
        checks.append(replace(trial, expected=value, note=note))
    return checks


def practice_trials(trials: Sequence[StudyTrial], count: int, seed: int) -> list[StudyTrial]:
    """Return trials for practice, made of some of those that count."""
    return [replace(trial, practice=True, expected="") for trial in shuffled(trials, "practice", seed)[:count]]


def order_trials(study: Study, rater: int) -> list[StudyTrial]:
    """Return the trials as a rater sees them: practice first, then all others in an order of the rater's own.

    rater : number of the rater in the study
    On a page of several videos for a ranking, they too have an order of the rater's own.
    """
    practice = [trial for trial in study.trials if trial.practice]
    counted = [trial for trial in study.trials if not trial.practice]
    ordered = practice + shuffled(counted, study.seed, rater)
    if study.kind in (PAIRED, MOS):
        return ordered
    return [
        replace(trial, videos=tuple(shuffled(trial.videos, study.seed, rater, n))) for n, trial in enumerate(ordered)
    ]


def list_questions(study: Study, trial: StudyTrial) -> list[tuple[str, str, str]]:
    """Return what a trial asks, in the order of its answers: question, condition and other condition of each."""
    conditions = [video.condition for video in study.shown(trial)]
    if study.kind == PAIRED:
        return [(PREFERENCE, conditions[0], conditions[1])]
    if study.kind == MOS:
        return [(scale, conditions[0], "") for scale in study.scales]
    return [(MATCH, condition, "") for condition in conditions]
