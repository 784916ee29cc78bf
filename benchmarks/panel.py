"""A panel that judges strips of pictures blind: which mouth is the recording, which closes, which sound is said.

    python benchmarks/panel.py make CORPUS --clips CLIPS --model MODEL.lipmotion --face FACE.face --seed 1 -o PANEL
    python benchmarks/panel.py score PANEL --answers ANSWERS.csv -o PANEL.json

``make`` designs a study of the recordings, the filmed face and the 3D head (``lipmotion study design``; the mouth
alone, encoded twice each), and draws strips of its videos into ``PANEL/sheets``; nothing is shown in time or with
sound. What is behind which strip is in ``PANEL/key.json`` and ``PANEL/study/study.json``, which a reader does not open.

*pairs*    : eight frames of a recording and the same moment of the filmed face, above and below in random order, with
             the phone of each frame. Each sentence comes once. In every second pair the filmed face is in the
             recording's own footage, in the others in that of another recording of ``train``.
*closures* : seven frames of one mouth. In which do the lips meet? About half have one p, b or m; the others none.
*sounds*   : five frames about the middle of a sound, each a random one of six. Which is it?

ANSWERS.csv has the columns sheet, item, answer, note: A or B; a number of a frame, or none; a name of ``SOUNDS``. It
needs pairs, and may leave closures or sounds out.
``score`` counts the right ones, and writes ``answers.csv`` of the pairs beside the study, as ``lipmotion study export``
does, for ``lipmotion study analyse``. Intervals are exact (Clopper & Pearson), for other moments and the same reader.
"""

from __future__ import annotations

import argparse
import csv
import json
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from character import drawn
from numpy.typing import NDArray
from panel_sheets import write_pair, write_rows
from video_face import phones

import lipmotion
from lipmotion.corpora.store import Corpus
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion_faces.tracking.footage import untracked_frames
from lipmotion_faces.video.mp4 import SOUND_HZ, write_mp4
from lipmotion_lab.evaluation.figures import BILABIAL
from lipmotion_studio.study.analysis.analyse import analyse_study
from lipmotion_studio.study.analysis.paired import binomial_p, exact_interval
from lipmotion_studio.study.answers import FIRST, PAIRED, RECORDING, SECOND, Answer, write_answers
from lipmotion_studio.study.collected import answers_of
from lipmotion_studio.study.design import design_study
from lipmotion_studio.study.manifest import Study, check_videos, read_study
from lipmotion_studio.study.region import Region
from lipmotion_studio.study.settings import StudySettings
from lipmotion_studio.study.store import AnswerSheet
from lipmotion_studio.study.trials import trials_of

Pictures = NDArray[np.uint8]
Spoken = tuple[float, float, str]
FILMED, HEAD = "filmed", "head"
SOURCES = (RECORDING, FILMED, HEAD)
OWN, ELSEWHERE = "own footage", "other footage"
"""Into which footage a filmed face is stitched: the recording itself, or another one."""
PAIRS, CLOSURES, SOUNDS_SHEET = "pairs", "closures", "sounds"
SOUNDS = {"pbm": "p b m", "fv": "f v", "th": "th dh", "oo": "uw w", "ah": "aa ae ay", "ee": "iy"}
SOUND_OF = {phone: sound for sound, names in SOUNDS.items() for phone in names.split()}
REGION = "0.285,0.62,0.32,0.28"
"""The lower face of GRID s1."""
HEAD_TOP, HEAD_BOTTOM = 0.60, 0.86
"""Upper and lower edge of the same part of the 3D head, in parts of the height of its picture."""
PAIR_FRAMES, CLOSURE_FRAMES, SOUND_FRAMES = 8, 7, 5
FPS, LEAST_S, NEAR_FRAMES = 25.0, 0.04, 1
"""A closure counts as found up to so many frames beside its phone."""
READER, ASKED = 1, "recorded"


@dataclass(frozen=True)
class Item:
    """What a reader is asked at once.

    sheet, number : its place
    source : what made the mouth; of a pair, into which footage the filmed face was stitched
    video  : file in the study; of a pair, none
    trial  : of a pair, in the order of the reader; otherwise -1
    start  : first frame
    truth  : the right answers
    """

    sheet: str
    number: int
    source: str
    video: str
    trial: int
    start: int
    truth: tuple[str, ...]


@dataclass(frozen=True)
class Strip:
    """Successive frames of a sentence, and the right answers to it."""

    sentence: str
    start: int
    truth: tuple[str, ...]


def make(options: argparse.Namespace) -> None:
    """Make the videos, the study, the key and the sheets."""
    corpus = Corpus.open(options.corpus)
    names = corpus.names(options.split)[: options.count]
    model = lipmotion.load_model(options.model)
    options.output.mkdir(parents=True)
    with tempfile.TemporaryDirectory(dir=options.output) as folder:
        made = Path(folder)
        footage = make_videos(made, corpus, names, model, options)
        conditions = [RECORDING, *(f"{name}={made / name}" for name in (FILMED, HEAD))]
        settings = StudySettings(practice=0, anchors=0, checks=0, region=REGION, seed=options.seed)
        study = design_study(options.output / "study", PAIRED, conditions, [made / RECORDING], settings)
    spoken = dict(zip(names, phones(corpus, names, model), strict=True))
    draw = np.random.default_rng(options.seed)
    items = [
        *pairs(study, spoken, footage, draw),
        *numbered(CLOSURES, study, closure_strips(spoken, draw, options.each), draw),
        *numbered(SOUNDS_SHEET, study, sound_strips(spoken, draw, options.each), draw),
    ]
    (options.output / "key.json").write_text(json.dumps([asdict(item) for item in items], indent=1), encoding="utf-8")
    draw_sheets(options.output, study, items, spoken)
    print({sheet: sum(item.sheet == sheet for item in items) for sheet in (PAIRS, CLOSURES, SOUNDS_SHEET)})


def make_videos(
    folder: Path, corpus: Corpus, names: Sequence[str], model: lipmotion.Model, options: argparse.Namespace
) -> dict[str, str]:
    """Write a video of every sentence by every condition, and return into which footage the filmed face was stitched.

    All are encoded once, also the recordings.
    """
    face, draw = lipmotion.load_face(options.face), np.random.default_rng(options.seed)
    others = draw.choice(corpus.names("train"), len(names), replace=False)
    footage = dict(zip(draw.permutation(names).tolist(), [OWN, ELSEWHERE] * len(names), strict=False))
    for name in SOURCES:
        (folder / name).mkdir()
    for name, other in zip(names, others, strict=True):
        clip, recording = options.clips / f"{name}.mkv", folder / RECORDING / f"{name}.mp4"
        frames, rate_hz = untracked_frames(clip)
        sound = read_audio(clip, SOUND_HZ, warn=False)
        write_mp4(recording, frames, fps=rate_hz, audio=sound)
        request = lipmotion.Request(corpus.utterance(name).audio, onto=face)
        result = lipmotion.animate(request, model=model)
        film = lipmotion.Outputs(background=clip if footage[name] == OWN else options.clips / f"{other}.mkv")
        target = folder / FILMED / f"{name}.mp4"
        lipmotion.write(result, target, speech=recording, model=model, face=face, film=film)
        size = next(iter(untracked_frames(clip)[0])).shape[:2]
        heads = head_frames(result, size)
        write_mp4(folder / HEAD / f"{name}.mp4", heads, fps=FPS, audio=sound)
        print(f"{len(list(target.parent.iterdir()))} of {len(names)}", flush=True)
    return footage


def head_frames(result: lipmotion.Generation, size: tuple[int, int]) -> Iterator[Pictures]:
    """Yield frames of the 3D head whose mouth is where the region shows it."""
    from PIL import Image

    region, blank = Region.parsed(REGION), np.zeros((*size, 3), np.uint8)
    high, wide = round(region.height * size[0]), round(region.width * size[1])
    top, left = round(region.top * size[0]), round(region.left * size[1])
    half = (HEAD_BOTTOM - HEAD_TOP) * wide / high / 2
    for frame in drawn(HEAD, result.motion, result.units, FPS, True):
        middle, px = frame.shape[1] / 2, frame.shape[0]
        box = (middle - half * px, HEAD_TOP * px, middle + half * px, HEAD_BOTTOM * px)
        placed = blank.copy()
        mouth = Image.fromarray(frame).resize((wide, high), Image.Resampling.LANCZOS, box)
        placed[top : top + high, left : left + wide] = np.asarray(mouth)
        yield placed


def pairs(
    study: Study, spoken: Mapping[str, Sequence[Spoken]], footage: Mapping[str, str], draw: np.random.Generator
) -> list[Item]:
    """Return a pair of each sentence, in the order in which the study shows them to the reader."""
    items: list[Item] = []
    seen: set[str] = set()
    for number, trial in enumerate(trials_of(study, READER)):
        shown = study.shown(trial)
        name, conditions = shown[0].sentence, [video.condition for video in shown]
        if name in seen or set(conditions) != {RECORDING, FILMED}:
            continue
        seen.add(name)
        first, last = spoken_frames(spoken[name])[[0, -1]]
        start = int(draw.integers(first, max(first, last - PAIR_FRAMES + 1) + 1))
        truth = "AB"[conditions.index(RECORDING)]
        items.append(Item(PAIRS, len(items) + 1, footage[name], "", number, start, (truth,)))
    return items


def numbered(sheet: str, study: Study, strips: Mapping[str, Sequence[Strip]], draw: np.random.Generator) -> list[Item]:
    """Return the strips of all sources, mixed."""
    files = {(video.sentence, video.condition): video.file for video in study.videos}
    found = [(source, strip) for source, mine in strips.items() for strip in mine]
    return [
        Item(sheet, n + 1, source, files[strip.sentence, source], -1, strip.start, strip.truth)
        for n, (source, strip) in enumerate(found[k] for k in draw.permutation(len(found)))
    ]


def closure_strips(
    spoken: Mapping[str, Sequence[Spoken]], draw: np.random.Generator, each: int
) -> dict[str, list[Strip]]:
    """Return strips for each source, about half of them with one closure, other moments for each."""
    with_closure, without = list[Strip](), list[Strip]()
    for name, units in spoken.items():
        said = set(spoken_frames(units).tolist())
        closed = [frames_of(unit) for unit in units if unit[2] in BILABIAL]
        for start in draw.permutation(sorted(said)).tolist():
            window = range(start, start + CLOSURE_FRAMES)
            if not said.issuperset(window):
                continue
            around = set(range(start - NEAR_FRAMES, start + CLOSURE_FRAMES + NEAR_FRAMES))
            near = [frames for frames in closed if around & set(frames)]
            if not near:
                without.append(Strip(name, start, ("none",)))
            elif len(near) == 1 and set(near[0]) <= set(window[1:-1]):
                right = range(near[0][0] - NEAR_FRAMES, near[0][-1] + NEAR_FRAMES + 1)
                with_closure.append(Strip(name, start, tuple(str(n - start + 1) for n in right)))
    count = int(draw.binomial(each, 0.5))
    parts = shared(with_closure, draw, count), shared(without, draw, each - count)
    return {source: [*parts[0][source], *parts[1][source]] for source in SOURCES}


def sound_strips(
    spoken: Mapping[str, Sequence[Spoken]], draw: np.random.Generator, each: int
) -> dict[str, list[Strip]]:
    """Return strips for each source, each of a random sound, other moments for each as far as there are enough."""
    found: dict[str, list[Strip]] = {sound: [] for sound in SOUNDS}
    for name, units in spoken.items():
        for start_s, end_s, phone in units:
            if phone in SOUND_OF and end_s - start_s >= LEAST_S:
                start = int((start_s + end_s) / 2 * FPS) - SOUND_FRAMES // 2
                found[SOUND_OF[phone]].append(Strip(name, start, (SOUND_OF[phone],)))
    strips: dict[str, list[Strip]] = {source: [] for source in SOURCES}
    for mine, count in zip(found.values(), draw.multinomial(each, [1 / len(SOUNDS)] * len(SOUNDS)), strict=True):
        for source, part in shared(mine, draw, int(count)).items():
            strips[source] += part
    return strips


def shared(strips: Sequence[Strip], draw: np.random.Generator, each: int) -> dict[str, list[Strip]]:
    """Return so many strips for each source, those of other sentences first."""
    mixed = [strips[k] for k in draw.permutation(len(strips))]
    used, places = Counter[str](), list[int]()
    for strip in mixed:
        places.append(used[strip.sentence])
        used[strip.sentence] += 1
    ordered = [mixed[k] for k in np.argsort(places, kind="stable")]
    wanted = [ordered[n % len(ordered)] for n in range(each * len(SOURCES))]
    return {source: wanted[k :: len(SOURCES)] for k, source in enumerate(SOURCES)}


def frames_of(unit: Spoken) -> range:
    """Return the frames in a phone, at least the nearest one."""
    first, end = int(np.ceil(unit[0] * FPS)), int(np.ceil(unit[1] * FPS))
    return range(first, end) if end > first else range(first, first + 1)


def spoken_frames(units: Sequence[Spoken]) -> NDArray[np.intp]:
    """Return all frames in which a phone is said."""
    return np.unique(np.concatenate([frames_of(unit) for unit in units]))


def draw_sheets(folder: Path, study: Study, items: Sequence[Item], spoken: Mapping[str, Sequence[Spoken]]) -> None:
    """Write a sheet of each pair, and of every few strips."""
    paths = check_videos(study, folder / "study")
    sheets = folder / "sheets"
    sheets.mkdir()

    @cache
    def frames(file: str) -> Pictures:
        return np.stack(list(untracked_frames(paths[file])[0]))

    def strip(item: Item, file: str, count: int) -> Pictures:
        found = frames(file)
        return found[np.clip(np.arange(item.start, item.start + count), 0, len(found) - 1)]

    order = trials_of(study, READER)
    for item in items:
        if item.sheet == PAIRS:
            shown = study.shown(order[item.trial])
            said = {n: unit[2] for unit in spoken[shown[0].sentence] for n in frames_of(unit)}
            labels = [said.get(n, "-") for n in range(item.start, item.start + PAIR_FRAMES)]
            both = [strip(item, video.file, PAIR_FRAMES) for video in shown]
            write_pair(sheets / f"{PAIRS}-{item.number:03}.png", item.number, both, labels)
    for sheet, count in ((CLOSURES, CLOSURE_FRAMES), (SOUNDS_SHEET, SOUND_FRAMES)):
        mine = [(item.number, strip(item, item.video, count)) for item in items if item.sheet == sheet]
        write_rows(sheets, sheet, mine)


def score(options: argparse.Namespace) -> None:
    """Print and write how many answers are right, and the answers to pairs as a study exports them."""
    study = read_study(options.panel / "study")
    items = [
        Item(**{**item, "truth": tuple(item["truth"])}) for item in json.loads((options.panel / "key.json").read_text())
    ]
    with options.answers.open(encoding="utf-8", newline="") as file:
        given = {(row["sheet"], int(row["item"])): row["answer"].strip() for row in csv.DictReader(file)}
    answered = {sheet for sheet, _ in given}
    items = [item for item in items if item.sheet in answered]
    missing = [(item.sheet, item.number) for item in items if (item.sheet, item.number) not in given]
    if missing or len(given) != len(items):
        raise SystemExit(f"{options.answers}: {len(given)} answers to {len(items)} items; missing {missing[:5]}")
    right = {(item.sheet, item.number): given[item.sheet, item.number] in item.truth for item in items}
    rows = exported(study, items, given)
    write_answers(options.panel / "answers.csv", rows)
    figures: dict[str, Any] = {
        PAIRS: {"all": share([right[i.sheet, i.number] for i in items if i.sheet == PAIRS])}
        | {source: of_source(items, right, PAIRS, source) for source in (OWN, ELSEWHERE)},
        CLOSURES: {
            source: of_source(items, right, CLOSURES, source)
            | {"with": closures(items, right, source, True), "without": closures(items, right, source, False)}
            for source in SOURCES
        },
        SOUNDS_SHEET: {
            source: of_source(items, right, SOUNDS_SHEET, source) | {"named": named(items, given, source)}
            for source in SOURCES
        },
        "first_preferred": analyse_study(rows)["all"][0]["first_preferred"],
        "items": [
            [item.sheet, item.number, item.source, " ".join(item.truth), given[item.sheet, item.number]]
            for item in items
        ],
    }
    options.output.write_text(json.dumps(figures) + "\n", encoding="utf-8")
    print(json.dumps({sheet: figures[sheet] for sheet in (PAIRS, CLOSURES, SOUNDS_SHEET)}, indent=1))


def exported(study: Study, items: Sequence[Item], given: Mapping[tuple[str, int], str]) -> list[Answer]:
    """Return the answers to pairs as rows of a study's table."""
    sides = {"A": FIRST, "B": SECOND}
    sheets = [
        AnswerSheet(READER, item.trial, (sides[given[PAIRS, item.number]],), 0.0, 0)
        for item in items
        if item.sheet == PAIRS
    ]
    return [replace(answer, question=ASKED) for answer in answers_of(study, sheets)]


def of_source(
    items: Sequence[Item], right: Mapping[tuple[str, int], bool], sheet: str, source: str
) -> dict[str, float]:
    return share([right[i.sheet, i.number] for i in items if (i.sheet, i.source) == (sheet, source)])


def closures(
    items: Sequence[Item], right: Mapping[tuple[str, int], bool], source: str, is_with: bool
) -> dict[str, float]:
    mine = [item for item in items if (item.sheet, item.source) == (CLOSURES, source)]
    return share([right[i.sheet, i.number] for i in mine if (i.truth != ("none",)) == is_with])


def named(items: Sequence[Item], given: Mapping[tuple[str, int], str], source: str) -> dict[str, dict[str, int]]:
    """Return how often each sound was called what."""
    found: dict[str, Counter[str]] = {sound: Counter() for sound in SOUNDS}
    for item in items:
        if (item.sheet, item.source) == (SOUNDS_SHEET, source):
            found[item.truth[0]][given[item.sheet, item.number]] += 1
    return {sound: dict(counts) for sound, counts in found.items()}


def share(right: Sequence[bool]) -> dict[str, float]:
    """Return how many are right, of how many, the share, its exact interval, and the p-value against one half."""
    wins, count = sum(right), len(right)
    if not count:
        return {"right": 0, "of": 0}
    interval = exact_interval(wins, count)
    figures = {"right": wins, "of": count, "share": round(wins / count, 3), "p_half": round(binomial_p(wins, count), 4)}
    return figures | {"low": round(interval.low, 3), "high": round(interval.high, 3)}


def main() -> None:
    """Make a panel, or score the answers to one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    making = verbs.add_parser("make")
    making.add_argument("corpus", type=Path)
    making.add_argument("--clips", type=Path, required=True, help="the folder of the corpus's videos")
    making.add_argument("--model", type=Path, help="trained on ``train`` (default: the model that ships)")
    making.add_argument("--face", type=Path, required=True, help="of ``lipmotion face build``, made of ``train``")
    making.add_argument("--split", default="test")
    making.add_argument("--count", type=int, help="the first sentences of the split only")
    making.add_argument("--each", type=int, default=18, help="strips of each source for closures and sounds")
    making.add_argument("--seed", type=int, default=0)
    making.add_argument("-o", "--output", type=Path, required=True, help="a new folder")
    making.set_defaults(run=make)
    scoring = verbs.add_parser("score")
    scoring.add_argument("panel", type=Path)
    scoring.add_argument("--answers", type=Path, required=True)
    scoring.add_argument("-o", "--output", type=Path, required=True)
    scoring.set_defaults(run=score)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
