"""Studies as folders: ``study.json`` with the trials and how each video was made, and ``videos/``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from itertools import permutations
from pathlib import Path
from typing import TypeVar

from lipmotion.errors import InputError
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.storage.sources import hash_file, read_text_file
from lipmotion.types.values import any_members, as_tuple, items, number, text, truth, value_of, whole
from lipmotion_studio.study.answers import ANCHOR, FIRST, KINDS, MOS, PAIRED, SECOND, is_possible
from lipmotion_studio.study.settings import PREFERENCE, SCALES

FORMAT, VERSION = "lipmotion_studio.study", 1
MANIFEST, VIDEOS = "study.json", "videos"
VIDEO_NAME = re.compile(r"[0-9a-f]{32}\.mp4")
"""Names of videos: the beginning of the digest of their content, so that raters cannot tell what made them."""
MAX_TRIALS = 10_000


@dataclass(frozen=True)
class StudyVideo:
    """A video that raters watch.

    file      : its name in the folder of videos
    sha256    : digest of its content
    made      : how it was made: texts by name, among them digests of what it was made from
    """

    file: str
    sentence: str
    condition: str
    seconds: float
    sha256: str
    made: Mapping[str, str]


@dataclass(frozen=True)
class StudyTrial:
    """What a rater sees on one page.

    videos   : numbers of videos in the study, in the order in which they are shown
    expected : the value that an attentive rater gives to every question; empty: there is none
    note     : on pages that check attention, which answer to give; otherwise empty
    """

    videos: tuple[int, ...]
    practice: bool = False
    expected: str = ""
    note: str = ""


@dataclass(frozen=True)
class Study:
    """A study: what is shown, and what is asked.

    kind         : ``paired`` or ``mos``
    consent      : what raters agree to before they begin
    instructions : what raters are asked to do
    scales       : names of the scales of ``mos``
    seed         : decides the order in which each rater sees the trials
    conditions   : how each condition was given, by its name
    sentences    : file and digest of each sentence's recording, by its name
    videos       : all videos
    trials       : all trials, those for practice first
    made_by      : program and version that made the study, and its settings
    """

    kind: str
    title: str
    consent: str
    instructions: str
    scales: tuple[str, ...]
    seed: int
    conditions: Mapping[str, str]
    sentences: Mapping[str, Mapping[str, str]]
    videos: tuple[StudyVideo, ...]
    trials: tuple[StudyTrial, ...]
    made_by: Mapping[str, str]

    def __post_init__(self) -> None:
        """Raise ValueError: the parts do not fit one another."""
        if self.kind not in KINDS:
            raise ValueError(f"the kind {self.kind!r}, required one of {', '.join(KINDS)}")
        if not self.trials or len(self.trials) > MAX_TRIALS:
            raise ValueError(f"{len(self.trials)} trials, required 1 to {MAX_TRIALS}")
        if self.kind == MOS and (not self.scales or not set(self.scales) <= SCALES.keys()):
            raise ValueError(f"the scales {', '.join(self.scales)}, required some of {', '.join(SCALES)}")
        for video in self.videos:
            if not VIDEO_NAME.fullmatch(video.file):
                raise ValueError(f"a video called {video.file!r}, required 32 hexadecimal digits and .mp4")
        for trial in self.trials:
            if len(trial.videos) != (2 if self.kind == PAIRED else 1):
                raise ValueError(f"a trial of {len(trial.videos)} videos in a study of the kind {self.kind}")
            if not all(0 <= video < len(self.videos) for video in trial.videos):
                raise ValueError("a trial shows a video that is not there")
            if trial.expected and not is_possible(self.kind, trial.expected):
                raise ValueError(f"a trial expects {trial.expected!r}, which nobody can answer")

    def list_shown(self, trial: StudyTrial) -> list[StudyVideo]:
        """Return the videos of a trial, in the order in which they are shown."""
        return [self.videos[number] for number in trial.videos]


def write_manifest(study: Study, folder: Path) -> None:
    """Write ``study.json`` into a folder."""
    content = {"format": FORMAT, "version": VERSION, **asdict(study)}
    (folder / MANIFEST).write_text(as_json(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def read_study(folder: Path) -> Study:
    """Return the study of a folder. Raises InputError: no study, or one that this version cannot read."""
    path = folder / MANIFEST
    if not path.is_file():
        raise InputError(f"{folder}: has no {MANIFEST}; make a study: lipmotion study design -o {folder} ...")
    document = read_text_file(path, "study")
    try:
        content = from_json(document)
        if not isinstance(content, dict) or (content.pop("format", ""), content.pop("version", 0)) != (FORMAT, VERSION):
            raise ValueError(f"not {FORMAT} of version {VERSION}")
        return _STUDY(content)
    except ValueError as error:
        raise InputError(f"{path}: not a study that can be read ({error}); design it again") from error


def check_videos(study: Study, folder: Path) -> dict[str, Path]:
    """Return a study's videos by name. Raises InputError: one is missing, or not as when the study was designed."""
    paths = {video.file: folder / VIDEOS / video.file for video in study.videos}
    for video in study.videos:
        if not paths[video.file].is_file():
            raise InputError(f"{paths[video.file]}: this video of the study is missing; copy the whole folder")
        if hash_file(paths[video.file]) != video.sha256:
            raise InputError(f"{paths[video.file]}: has changed since the study was designed; design it again")
    return paths


_TEXT, _NUMBERS = text(1 << 20), as_tuple(items(whole(0, 1 << 31)))
_VIDEO = {"seconds": number(0, 1e6), "made": any_members(_TEXT)} | dict.fromkeys(
    ("file", "sentence", "condition", "sha256"), _TEXT
)
_TRIAL = {"videos": _NUMBERS, "practice": truth, "expected": _TEXT, "note": _TEXT}
_MEMBERS = {
    **dict.fromkeys(("kind", "title", "consent", "instructions"), _TEXT),
    **{"scales": as_tuple(items(_TEXT)), "seed": whole(-(1 << 63), 1 << 63), "conditions": any_members(_TEXT)},
    **{"sentences": any_members(any_members(_TEXT)), "made_by": any_members(_TEXT)},
    "videos": as_tuple(items(value_of(StudyVideo, _VIDEO, _VIDEO))),
    "trials": as_tuple(items(value_of(StudyTrial, _TRIAL, ("videos",)))),
}
_STUDY = value_of(Study, _MEMBERS, _MEMBERS)


PlaceT = TypeVar("PlaceT")
VideoNumbers = Mapping[tuple[str, str], int]  # the number of the video of a sentence and a condition


def shuffle(items: Iterable[PlaceT], *key: object) -> list[PlaceT]:
    """Return items in an order that depends on a key, every order being equally likely.

    >>> shuffle("abcd", 1), shuffle("abcd", 2)
    (['d', 'a', 'b', 'c'], ['b', 'd', 'c', 'a'])
    """

    def place(pair: tuple[int, PlaceT]) -> bytes:
        return sha256("/".join(map(str, (*key, pair[0]))).encode()).digest()

    return [item for _, item in sorted(enumerate(items), key=place)]


def make_main_trials(
    kind: str, conditions: Sequence[str], sentences: Sequence[str], videos: VideoNumbers
) -> list[StudyTrial]:
    """Return the trials that count.

    conditions : names, without the anchor
    Paired comparison: every pair of conditions in both orders, for every sentence, so that each rater judges each pair
    twice: 3 conditions and 6 sentences make 36 trials. Mean opinion scores: every video once.
    Source: Hofer 2008, section 7; Xie & Liu 2007, section 7.3.
    """
    trials = []
    for sentence in sentences:
        shown = {name: videos[sentence, name] for name in (*conditions, ANCHOR) if (sentence, name) in videos}
        if kind == PAIRED:
            trials += [StudyTrial((shown[a], shown[b])) for a, b in permutations(conditions, 2)]
        else:
            trials += [StudyTrial((number,)) for number in shown.values()]
    return trials


def make_anchor_trials(base: str, sentences: Sequence[str], videos: VideoNumbers) -> list[StudyTrial]:
    """Return, for each sentence, a condition beside itself out of step, which is second and first in turn."""
    trials = []
    for n, sentence in enumerate(sentences):
        pair = (videos[sentence, base], videos[sentence, ANCHOR])
        trials.append(StudyTrial(pair[:: -1 if n % 2 else 1], expected=SECOND if n % 2 else FIRST))
    return trials


_ANSWERS = {
    PAIRED: ((SECOND, "the second video"), (FIRST, "the first video")),
    MOS: (("2", "2 on every scale"), ("4", "4 on every scale")),
}


def make_attention_trials(kind: str, trials: Sequence[StudyTrial], count: int, seed: int) -> list[StudyTrial]:
    """Return trials whose page states what to answer, made from some of the trials that count."""
    checks = []
    for n, trial in enumerate(shuffle(trials, "check", seed)[:count]):
        value, words = _ANSWERS[kind][n % 2]
        note = f"This page checks that you read it: after the videos, please answer {words}, whatever you saw."
        checks.append(replace(trial, expected=value, note=note))
    return checks


def make_practice_trials(trials: Sequence[StudyTrial], count: int, seed: int) -> list[StudyTrial]:
    """Return trials for practice, made of some of those that count."""
    return [replace(trial, practice=True, expected="") for trial in shuffle(trials, "practice", seed)[:count]]


def order_trials(study: Study, rater: int) -> list[StudyTrial]:
    """Return the trials as a rater sees them: practice first, then all others in an order of the rater's own.

    rater : number of the rater in the study
    """
    practice = [trial for trial in study.trials if trial.practice]
    counted = [trial for trial in study.trials if not trial.practice]
    return practice + shuffle(counted, study.seed, rater)


def list_questions(study: Study, trial: StudyTrial) -> list[tuple[str, str, str]]:
    """Return what a trial asks, in the order of its answers: question, condition and other condition of each."""
    conditions = [video.condition for video in study.list_shown(trial)]
    if study.kind == PAIRED:
        return [(PREFERENCE, conditions[0], conditions[1])]
    return [(scale, conditions[0], "") for scale in study.scales]
