"""Synthetic video beside the recorded video: does it look like it, and does its mouth move as it was told.

    python benchmarks/video_face.py CORPUS --clips FOLDER [--split val] [--engine FILE.lipmotion ...] [--only NAME ...]
        [--face FILE.face] [--work FOLDER] [-o FILE.json] [--table FILE.md] [--sheets FOLDER] [--mp4] [--count N]
        [--processes 2]

CORPUS is a prepared corpus of one speaker with mouth pictures, FOLDER has its videos. Each *way* makes the frames of a
clip again, with another mouth: simple ways (``video_ways.py``) learned on ``train``, and the original itself as the
ceiling. They are driven by the clip's own track, by what an engine generates from its sound alone, or by the track of
another clip (``crossed``: nothing of the recorded mouth may shine through; PSNR and SSIM then say nothing). Printed is
a table in Markdown, with 95 % bootstrap intervals over clips in the JSON:

psnr_db, ssim, sharpness, colour_edges, flicker : of the mouth region, in the pose of the recorded head; ``lips_`` of
                   the middle of it, where lips and teeth are
seam, seam_ratio, colour_offset, colour_drift   : at the outline of what was put in (``picture_measures.py``)
acc_*, driver_*  : correlation of opening, width and outer lips, when the result is tracked again, with those of the
                   recording, and with those of the motion that drove it; pooled over all frames
engine_opening   : correlation of the driving motion itself with the recording
landmarks, landmarks_px : mean distance of the 40 lip points from those of the recording, eye distances, px of the video
p_b_m            : share of p, b and m in which the recorded mouth closes, in which the tracked one closes, too
false_closures   : closings elsewhere a minute of speech, less those of the recording

``--mp4`` measures the frames after ``lipmotion``'s own encoding instead of lossless ones. ``--sheets`` writes pictures
to look at: original above, synthetic below.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from picture_measures import outline_figures, picture_figures, psnr_db
from video_sheets import Judged, Sheets, face_crop, load_judged, save_judged, write_sheets
from video_ways import (
    CROSSED,
    LOWER_FACE,
    MOUTH,
    Pictures,
    RecordedClip,
    RecordedMouths,
    Way,
    filmed_ways,
    lips,
    on_frames,
    recorded_clip,
    simple_ways,
    video_of,
)

from lipmotion import Corpus, animate, load_model
from lipmotion.errors import InputError
from lipmotion.measures.closures import find_threshold, measure_phones
from lipmotion.measures.curves import compute_interval, correlate_pooled
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.training.train import label_phones
from lipmotion.pipeline.workers import open_workers
from lipmotion.speech.recognition.recogniser import open_recogniser
from lipmotion.types import Audio, Motion, Track
from lipmotion.units import Lexicon, is_silent
from lipmotion_faces.appearance.placing import cut
from lipmotion_faces.filmed.face import load_face
from lipmotion_faces.tracking.frames import open_video
from lipmotion_faces.tracking.track import track
from lipmotion_faces.video.mp4 import write_mp4
from lipmotion_lab.evaluation.evaluate import BILABIAL

Array = NDArray[np.float64]
Span = tuple[float, float]
LIPS = (slice(None), slice(16, 40), slice(16, 56))  # the part of the mouth region in which lips and teeth are
UNTOUCHED_FRAMES = 30  # rows of pixels from the top that no way changes
DISTANCES = ("opening", "width", "outer")
INTERVALS = ("psnr_db", "ssim", "sharpness", "flicker", "seam_ratio", "acc_opening", "driver_opening", "landmarks")


@dataclass(frozen=True)
class Setting:
    """What the workers need to know."""

    corpus: Path
    clips: Path
    engines: tuple[Path, ...]
    face: Path | None
    only: tuple[str, ...]
    mp4: bool
    work: Path


@dataclass(frozen=True)
class Job:
    """One clip.

    other : the clip whose motion is ``crossed``
    sheet : how many of its frames, evenly spaced, are wanted for the sheets
    """

    setting: Setting
    name: str
    other: str
    sheet: int


def main() -> None:
    """Measure every clip of a split, and print the table."""
    options = parsed()
    corpus = Corpus.open(options.corpus)
    names = corpus.names(options.split)[: options.count]
    with tempfile.TemporaryDirectory() as temporary:
        work = options.work or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        engines = tuple(options.engine)
        only = tuple(options.only)
        setting = Setting(options.corpus, options.clips, engines, options.face, only, options.mp4, work)
        report(options, corpus, names, setting)


def report(options: argparse.Namespace, corpus: Corpus, names: Sequence[str], setting: Setting) -> None:
    """Measure the clips; print the table, and write what is wanted."""
    with_sheets = set(np.linspace(0, len(names) - 1, 3).astype(int)) if options.sheets else set()
    jobs = [
        Job(setting, name, names[number - 1], options.frames if number in with_sheets else 0)
        for number, name in enumerate(names)
    ]
    with open_workers(options.processes) as workers:
        judged = {
            name: load_judged(path) for name, path in zip(names, workers.ordered_map(stored_judge, jobs), strict=True)
        }
    ways = list(judged[names[0]])
    spoken = phones(corpus, names, load_model(options.engine[0] if options.engine else None))
    openings = [np.asarray(corpus.utterance(name).track.motion["opening"], float) for name in corpus.names("train")]
    threshold = find_threshold(openings)
    results = {way: figures([judged[name][way] for name in names], spoken, threshold) for way in ways}
    table = as_table(results)
    print(f"split {options.split}, {len(names)} clips, {'after encoding' if options.mp4 else 'lossless'}\n\n{table}")
    if options.table:
        options.table.write_text(table + "\n", encoding="utf-8")
    if options.output:
        clips = {way: {name: judged[name][way].figures for name in names} for way in ways}
        found = {"split": options.split, "names": names, "mp4": options.mp4, "ways": results, "clips": clips}
        options.output.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if options.sheets:
        write_sheets(options.sheets, {way: {name: judged[name][way].sheets for name in names} for way in ways})


def parsed() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--clips", type=Path, required=True, help="the folder of the corpus's videos")
    parser.add_argument("--split", default="val")
    parser.add_argument("--count", type=int, help="the first clips of the split only")
    parser.add_argument("--engine", type=Path, action="append", default=[], help="a model file; repeatable")
    parser.add_argument("--face", type=Path, help="a file of ``lipmotion face build``, of the same speaker")
    parser.add_argument("--only", action="append", default=[], help="ways whose name begins so; repeatable")
    parser.add_argument("--work", type=Path, help="where what was measured is kept: a run can be stopped and continued")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--mp4", action="store_true")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--sheets", type=Path)
    parser.add_argument("--frames", type=int, default=9, help="in a row of a sheet")
    return parser.parse_args()


@cache
def all_ways(setting: Setting) -> tuple[Way, ...]:
    """Return the ways that are compared."""
    corpus = Corpus.open(setting.corpus)
    engines = [path.stem for path in setting.engines]
    mouths = RecordedMouths(corpus, corpus.names("train"), setting.clips)
    ways = simple_ways(mouths, engines)
    if setting.face:
        ways += filmed_ways(load_face(setting.face), mouths, engines)
    return tuple(way for way in ways if not setting.only or way.name.startswith(setting.only))


@cache
def engine(path: Path) -> Model:
    """Return a model of motion."""
    return load_model(path)


def stored_judge(job: Job) -> Path:
    """Return the file with what was measured of one clip; it is measured if there is none."""
    path = job.setting.work / f"{job.name}.npz"
    if not path.exists():
        save_judged(path, judge(job))
        print(job.name, file=sys.stderr, flush=True)
    return path


def judge(job: Job) -> dict[str, Judged]:
    """Return what was measured of one clip, by way."""
    setting = job.setting
    corpus = Corpus.open(setting.corpus)
    clip = recorded_clip(corpus, job.name, video_of(setting.clips, job.name))
    motions = {"tracked": clip.utterance.track.motion, CROSSED: corpus.utterance(job.other).track.motion}
    ways = all_ways(setting)
    for file in setting.engines:
        if any(way.motion == file.stem for way in ways):
            motions[file.stem] = animate(Request(clip.utterance.audio), model=engine(file)).motion
    found = {}
    true = lower_face(clip, clip.frames)
    for way in ways:
        driver = on_frames(motions[way.motion], clip) if way.motion else None
        found[way.name] = judged_way(clip, way, driver, true, job)
    return found


def judged_way(clip: RecordedClip, way: Way, driver: Motion | None, true: Pictures, job: Job) -> Judged:
    """Return what was measured of one clip, made one way."""
    frames, tracked = stored(way.render(clip, driver), clip, job.setting.mp4)
    track_true = clip.utterance.track
    curves = {"true": distances(track_true.motion)}
    if driver is not None:
        curves["driver"] = distances(driver)
    seen, landmarks = np.zeros(len(frames), bool), np.full(len(frames), np.nan)
    if tracked is not None:
        curves["made"] = distances(tracked.motion)[: len(frames)]
        seen = track_true.seen & tracked.seen
        moved = (lips(tracked.motion) - lips(track_true.motion)).reshape(len(frames), -1, 2)
        landmarks = np.linalg.norm(moved, axis=2).mean(axis=1)
    if way.motion_only:
        return Judged({}, curves, landmarks, seen, clip.eyes_px, Sheets({}, {}))
    if not job.setting.mp4 and (frames[:, :UNTOUCHED_FRAMES] != clip.frames[:, :UNTOUCHED_FRAMES]).any():
        raise InputError(f"{clip.name}, {way.name}: other frames behind the face than those of the clip, in its order")
    made = lower_face(clip, frames)
    inner = (slice(None), *MOUTH)
    row = picture_figures(made[inner], true[inner])
    inside = picture_figures(made[inner][LIPS], true[inner][LIPS])
    row |= {f"lips_{name}": inside[name] for name in ("sharpness", "contrast")}
    if way.region is not None:
        row |= outline_figures(made, true, way.region)
    sheets = sheets_of(clip, frames, job.sheet, {"psnr": -psnr_db(made[inner], true[inner]), "landmarks": landmarks})
    return Judged(row, curves, landmarks, seen, clip.eyes_px, sheets)


def stored(frames: Iterable[Pictures], clip: RecordedClip, mp4: bool) -> tuple[Pictures, Track | None]:
    """Return frames as a video file gives them back, and the track of that video; None if the face is not found.

    mp4 : whether they are encoded as ``animate`` does, or without loss
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / ("made.mp4" if mp4 else "made.mkv")
        if mp4:
            silence = Audio(np.zeros(16_000, np.float32), 16_000)
            write_mp4(path, frames, fps=clip.rate_hz, audio=silence)
        else:
            write_lossless(path, frames, clip.rate_hz)
        with open_video(path) as video:
            decoded = np.stack([frame.image for frame in video.frames])
        if len(decoded) != len(clip.frames):
            raise InputError(f"{clip.name}: {len(decoded)} frames were made, required {len(clip.frames)}")
        try:
            return decoded, track(path, crops=False)
        except InputError as error:
            print(f"{clip.name}: {error}", flush=True)
            return decoded, None


def write_lossless(path: Path, frames: Iterable[Pictures], rate_hz: float) -> None:
    """Write frames without loss."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=Fraction(rate_hz).limit_denominator(1001))
        stream.pix_fmt = "bgr0"
        for number, frame in enumerate(frames):
            if not number:
                stream.height, stream.width = frame.shape[:2]
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24").reformat(format="bgr0")
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


def lower_face(clip: RecordedClip, frames: Pictures) -> Pictures:
    """Return the aligned lower face of frames, in the pose of the recorded head [shape=(T, 152, 152, 3)]."""
    pairs = zip(frames, clip.lower_face_to_frame, strict=True)
    parts = [cut(frame, to_frame, LOWER_FACE) for frame, to_frame in pairs]
    rounded: Pictures = np.clip(np.rint(np.stack(parts)), 0, 255).astype(np.uint8)
    return rounded


def distances(motion: Motion) -> Array:
    """Return opening, width and outer lips [shape=(T, 3)]."""
    return np.stack([np.asarray(motion[name], float) for name in DISTANCES], axis=1)


def sheets_of(clip: RecordedClip, frames: Pictures, count: int, badness: dict[str, Array]) -> Sheets:
    """Return crops of frames for the sheets: evenly spaced ones, and the worst."""

    def pair(number: int) -> tuple[Pictures, Pictures]:
        return face_crop(clip.frames[number], clip.maps[number]), face_crop(frames[number], clip.maps[number])

    spaced = {int(n): pair(int(n)) for n in np.linspace(3, len(frames) - 4, count).astype(int)} if count else {}
    spaced |= {int(n): pair(int(n)) for n in range(30, 30 + 2 * count)} if count else {}
    worst = {}
    for name, values in badness.items():
        if count != 0 or np.isfinite(values).any():
            number = int(np.nanargmax(values))
            worst[name] = (float(values[number]), number, pair(number))
    return Sheets(spaced, worst)


def phones(corpus: Corpus, names: Sequence[str], model: Model) -> list[list[tuple[float, float, str]]]:
    """Return start and end in seconds of every spoken phone, clip by clip, by forced alignment."""
    recogniser = open_recogniser(model.phones, "auto", model.adaptation)
    found = [label_phones(corpus.utterance(name), recogniser, Lexicon()) for name in names]
    return [[(s.start_s, s.end_s, s.label.phone) for s in units if not is_silent(s.label.phone)] for units in found]


def figures(
    judged: Sequence[Judged], spoken: Sequence[Sequence[tuple[float, float, str]]], threshold: float
) -> dict[str, Any]:
    """Return the figures of one way over all clips; the intervals of ``INTERVALS`` under ``low`` and ``high``."""
    rows: dict[str, Any] = {}
    low, high = dict[str, float](), dict[str, float]()

    def add(name: str, figure: Callable[..., float], made: list[Array], true: list[Array]) -> None:
        rows[name] = figure(made, true)
        if name in INTERVALS:
            low[name], high[name] = compute_interval(figure, made, true, 0)

    for name in judged[0].figures:
        values = [np.array([each.figures[name]]) for each in judged]
        add(name, mean, values, values)
    tracked = [each for each in judged if "made" in each.curves]
    rows["tracked_clips"] = len(tracked)
    if tracked:
        for column, name in enumerate(DISTANCES):
            made = [each.curves["made"][each.seen, column : column + 1] for each in tracked]
            true = [each.curves["true"][each.seen, column : column + 1] for each in tracked]
            add(f"acc_{name}", acc, made, true)
            if "driver" in tracked[0].curves:
                driver = [each.curves["driver"][each.seen, column : column + 1] for each in tracked]
                add(f"driver_{name}", acc, made, driver)
                rows[f"engine_{name}"] = acc(driver, true)
            rows[f"variance_{name}"] = mean([m.std(axis=0) for m in made], []) / mean([t.std(axis=0) for t in true], [])
        add("landmarks", mean, [e.landmarks[e.seen] for e in tracked], [e.landmarks[e.seen] for e in tracked])
        rows["landmarks_px"] = float(np.mean([each.landmarks[each.seen].mean() * each.eyes_px for each in tracked]))
        if len(tracked) == len(judged):
            rows |= closures(judged, spoken, threshold)
    return rows | {"low": low, "high": high}


def mean(values: Sequence[Array], _: Sequence[Array]) -> float:
    """Return the mean of all values."""
    return float(np.concatenate(values).mean())


def acc(made: Sequence[Array], true: Sequence[Array]) -> float:
    """Return the correlation over all frames of all clips."""
    return float(correlate_pooled(made, true)[0])


def closures(
    judged: Sequence[Judged], spoken: Sequence[Sequence[tuple[float, float, str]]], threshold: float
) -> dict[str, float]:
    """Return the figures of p, b and m."""
    made, true = ([each.curves[side][:, 0] for each in judged] for side in ("made", "true"))
    inside: list[list[Span]] = [[(s, e) for s, e, phone in clip if phone in BILABIAL] for clip in spoken]
    other_s = sum(e - s for clip in spoken for s, e, phone in clip if phone not in BILABIAL)
    found = measure_phones(made, true, inside, other_s, threshold, 25.0)
    return {
        "p_b_m": found.recall,
        "p_b_m_intervals": found.intervals,
        "false_closures": found.false_per_minute - found.original_per_minute,
    }


COLUMNS = {
    "psnr_db": ("PSNR, dB", ".1f"),
    "ssim": ("SSIM", ".3f"),
    "sharpness": ("sharpness", ".2f"),
    "lips_sharpness": ("of the lips", ".2f"),
    "lips_contrast": ("contrast", ".2f"),
    "flicker": ("flicker", ".2f"),
    "colour_edges": ("colour edges", ".2f"),
    "seam": ("seam", ".2f"),
    "seam_ratio": ("seam ratio", ".2f"),
    "colour_offset": ("colour offset", ".1f"),
    "colour_drift": ("colour drift", ".1f"),
    "engine_opening": ("ACC opening, driver", ".3f"),
    "engine_width": ("width", ".3f"),
    "acc_opening": ("ACC opening", ".3f"),
    "acc_width": ("width", ".3f"),
    "acc_outer": ("outer", ".3f"),
    "driver_opening": ("to driver: opening", ".3f"),
    "driver_width": ("width", ".3f"),
    "driver_outer": ("outer", ".3f"),
    "variance_opening": ("variance", ".2f"),
    "landmarks": ("landmarks, eyes", ".4f"),
    "landmarks_px": ("px", ".2f"),
    "p_b_m": ("p b m", ".2f"),
    "false_closures": ("false closures", "+.1f"),
}


def as_table(results: dict[str, dict[str, Any]]) -> str:
    """Return the figures as two tables in Markdown: of pictures, and of motion."""
    parts = []
    for names in (list(COLUMNS)[:11], list(COLUMNS)[11:]):
        lines = ["| way | " + " | ".join(COLUMNS[name][0] for name in names) + " |", "|---" * (len(names) + 1) + "|"]
        for way, rows in results.items():
            if any(name in rows for name in names):
                cells = [format(rows[name], COLUMNS[name][1]) if name in rows else "" for name in names]
                lines.append(f"| {way} | " + " | ".join(cells) + " |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


if __name__ == "__main__":
    main()
