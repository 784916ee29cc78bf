"""The 3D head: landmarks tracked again, sounds told apart by the mouth alone, speed, and a sheet of sounds.

    python benchmarks/head.py --retrack --apart --speed [--face portrait] [--sheet docs/images/head.png]

One JSON object a line. ``retrack``: each sentence is spoken by the default synthetic voice, animated and rendered to
mp4, and tracked with the project's own tracker; correlation of opening and width with the motion given, all frames of
all sentences pooled (ACC), and the mean of the sentences. The same again without the phones, and on ten other
sentences by which nothing of the face was chosen. ``as_drawn`` (the head alone) divides the loss in two: the gap and
width of the poses against the motion given, which is what phones change, and the tracked ones against the poses,
which is what the tracker misreads. ``closed``: p, b and m in which the lips touch in a frame of the poses. ``apart``:
the sounds of all sentences by leave-one-sentence-out, nearest mean of the sound in units of the standard deviation,
from what the picture shows of lips, hole, teeth and tongue at the sound's middle. ``speed``: frames a second of
rendering to mp4 at 1280 x 720, two threads, median of five runs, and the time of the whole process for 60 s of
speech; processor time, which other work on the machine lengthens less.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lipmotion
from lipmotion.formats.sound import write_sound
from lipmotion.types import Audio, Channel, Motion, Span, SpokenText, Timeline, Unit
from lipmotion.units import LIP_CLOSING
from lipmotion_faces import face_named
from lipmotion_faces.head.performance import head_poses
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.stage import Stage, camera_for
from lipmotion_faces.rendering.rasteriser import Camera
from lipmotion_faces.tracking.track import track
from lipmotion_faces.video.mp4 import write_mp4

SENTENCES = (
    "Please bring my mother the blue ball before the party.",
    "We saw five small boats move past the old farm.",
    "Both of them thought the weather would be fine.",
    "The father walks through the warm and quiet garden.",
    "You never told me who baked the lemon pie.",
    "Thin paper makes a very good map of the moon.",
    "She put three apples in the wooden bowl.",
    "My brother Paul flew home with the other team.",
    "Far above the water we could see the top of the wall.",
    "Keep the shoes away from the mud and the food.",
)
OTHER_SENTENCES = (
    "The baker made fifteen loaves of bread for the village fair.",
    "A thick fog moved over the valley before noon.",
    "We wish you would leave the window open in summer.",
    "Two brown foxes hopped over the broken fence.",
    "Mother bought a pair of blue shoes for my father.",
    "He thinks the river will rise above the bridge.",
    "Please put the violin back upon the top shelf.",
    "Every member of the family voted for the same move.",
    "Who saw the pretty bird that flew past the barn?",
    "Three farmers walked both ways to reach the market.",
)
"""Sentences by which nothing of the face was chosen."""
SOUNDS = {
    "p": "p b m", "b": "p b m", "m": "p b m", "f": "f v", "v": "f v", "th": "th", "dh": "th", "uw": "oo", "w": "w",
    "aa": "aa", "ao": "aa", "iy": "ee",
}  # fmt: skip
SHEET = (
    ("rest", "sil", 0.0, 0.0), ("p b m", "m", 0.0, 0.0), ("f v", "f", 0.02, 0.0), ("th", "th", 0.05, 0.0),
    ("oo", "uw", 0.045, -0.045), ("w", "w", 0.03, -0.045), ("aa", "aa", 0.2, -0.01), ("ee", "iy", 0.09, 0.03),
    ("l", "l", 0.09, 0.0), ("s", "s", 0.06, 0.015),
)  # fmt: skip
"""Name, phone, opening, and change of width at rest (0.57)."""


def main() -> None:
    """Print the figures that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--face", default="head")
    parser.add_argument("--retrack", action="store_true")
    parser.add_argument("--apart", action="store_true")
    parser.add_argument("--speed", action="store_true")
    parser.add_argument("--sheet", type=Path)
    options = parser.parse_args()
    spoken = [lipmotion.speak(text) for text in SENTENCES] if options.retrack or options.apart else []
    if options.retrack:
        print(json.dumps({"retrack": retrack(spoken, options.face)}), flush=True)
        others = [lipmotion.speak(text) for text in OTHER_SENTENCES]
        print(json.dumps({"other_sentences": retrack(others, options.face)}), flush=True)
        print(json.dumps({"without_phones": retrack(spoken, options.face, phones=False)}), flush=True)
        print(json.dumps({"closed": closed(spoken)}), flush=True)
    if options.apart:
        print(json.dumps({"apart": apart(spoken)}), flush=True)
    if options.speed:
        print(json.dumps({"speed": speed(options.face)}), flush=True)
    if options.sheet:
        sheet(options.sheet)


def retrack(spoken: list[SpokenText], face: str, *, phones: bool = True) -> dict[str, object]:
    """Return correlations of the motion that is tracked in the rendered videos with the motion given.

    phones : whether the face is told the phones; without them it draws the motion alone
    """
    given, tracked, drawn = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for each in spoken:
            path = Path(folder) / "sentence.mp4"
            motion = each.generation.motion
            units = each.generation.units if phones else Timeline[Unit](())
            write_mp4(path, face_named(face).render(motion, units, fps=25.0), fps=25.0, audio=each.sound)
            seen = track(path, crops=False).motion.resampled(25.0)
            count = min(len(seen.values), int(motion.time_s[-1] * 25))
            time_s = np.arange(count) / 25
            given.append(_channels(motion, time_s))
            tracked.append(_channels(seen, time_s))
            poses = head_poses(motion, units, 25.0)[:count]
            drawn.append(np.array([(pose.gap, pose.width) for pose in poses]))
    result: dict[str, object] = {"face": face, "frames": sum(map(len, given))}
    for column, name in enumerate(("opening", "width")):
        a, b = (np.concatenate([rows[:, column] for rows in parts]) for parts in (given, tracked))
        each_one = [np.corrcoef(x[:, column], y[:, column])[0, 1] for x, y in zip(given, tracked, strict=True)]
        result[name] = {
            "acc": round(float(np.corrcoef(a, b)[0, 1]), 3),
            "mean_of_sentences": round(float(np.mean(each_one)), 3),
            "slope": round(float(np.polyfit(a, b, 1)[0]), 2),
        }
        if face == "head":
            shown = np.concatenate([rows[:, column] for rows in drawn])
            result[f"{name}_as_drawn"] = {
                "drawn_against_given": round(float(np.corrcoef(a, shown)[0, 1]), 3),
                "tracked_against_drawn": round(float(np.corrcoef(shown, b)[0, 1]), 3),
            }
    return result


def _channels(motion: Motion, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    rows = motion.at(time_s)
    return rows[:, [motion.column("opening"), motion.column("width")]]


def closed(spoken: list[SpokenText]) -> dict[str, int]:
    """Return in how many p, b and m the lips touch, and how many there are."""
    total = touching = 0
    for each in spoken:
        poses = head_poses(each.generation.motion, each.generation.units, 25.0)
        for span in each.generation.units:
            if span.label.phone in LIP_CLOSING:
                frames = poses[int(span.start_s * 25) : int(np.ceil(span.end_s * 25)) + 1]
                total += 1
                touching += any(pose.gap == 0 for pose in frames)
    return {"p b m": total, "closed": touching}


def apart(spoken: list[SpokenText]) -> dict[str, object]:
    """Return the table of sounds that were read from the mouth alone: for each sound, what it was taken for."""
    names = sorted({*SOUNDS.values()})
    rows, labels, sentences = [], [], []
    for number, each in enumerate(spoken):
        poses = head_poses(each.generation.motion, each.generation.units, 100.0)
        for span in each.generation.units:
            if span.label.phone in SOUNDS:
                middle = round(50 * (span.start_s + span.end_s))
                rows.append(mouth_seen(poses[min(middle, len(poses) - 1)]))
                labels.append(names.index(SOUNDS[span.label.phone]))
                sentences.append(number)
    seen, sound, of = np.array(rows), np.array(labels), np.array(sentences)
    table = np.zeros((len(names), len(names)), int)
    for number in range(len(spoken)):
        train, test = of != number, of == number
        means = np.stack([seen[train & (sound == k)].mean(axis=0) for k in range(len(names))])
        spread = np.sqrt(np.mean((seen[train] - means[sound[train]]) ** 2, axis=0)) + 1e-6
        away = np.linalg.norm((seen[test][:, None] - means[None]) / spread, axis=2)
        for true, guess in zip(sound[test], away.argmin(axis=1), strict=True):
            table[true, guess] += 1
    right = {name: f"{table[k, k]}/{table[k].sum()}" for k, name in enumerate(names)}
    taken = {name: {names[j]: int(n) for j, n in enumerate(table[k]) if n} for k, name in enumerate(names)}
    return {"right": right, "share": round(float(np.trace(table) / table.sum()), 3), "table": taken}


def mouth_seen(pose: CharacterPose) -> list[float]:
    """Return what the picture shows of the mouth, head straight: widths, heights and areas, in eye distances.

    Width and height of the lips and of what is between them; areas of lips, upper teeth, lower teeth and tongue.
    """
    stage = _front()
    masks = stage.parts_seen(pose._replace(turn=(0.0, 0.0, 0.0), shut=0.0))
    unit = stage.canvas.camera.height / stage.canvas.camera.across
    inside = masks["upper teeth"] | masks["teeth"] | masks["tongue"] | masks["wall"]
    row = []
    for mask in (masks["lips"] | inside, inside):
        y, x = np.nonzero(mask)
        row += [float(np.ptp(x) / unit) if len(x) else 0.0, float(np.ptp(y) / unit) if len(y) else 0.0]
    row += [float(masks[name].sum() / unit**2) for name in ("lips", "upper teeth", "teeth", "tongue")]
    return [*row, float(inside.sum() / unit**2)]


_FRONT: list[Stage] = []


def _front() -> Stage:
    if not _FRONT:
        _FRONT.append(Stage(Camera(360, 300, (0.0, -0.68), 0.8)))
    return _FRONT[0]


def speed(face: str) -> dict[str, float]:
    """Return frames a second of rendering to mp4, and the whole process for 60 s of speech."""
    one = lipmotion.speak(" ".join(SENTENCES))
    rates, processor_s = [], []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "speed.mp4"
        count = int(one.generation.motion.time_s[-1] * 25) + 1
        for _ in range(6):
            start, used = time.perf_counter(), time.process_time()
            frames = face_named(face).render(one.generation.motion, one.generation.units, fps=25.0)
            write_mp4(path, frames, fps=25.0, audio=one.sound)
            rates.append(count / (time.perf_counter() - start))
            processor_s.append((time.process_time() - used) / count)
        sound = Path(folder) / "minute.wav"
        minute = np.tile(one.sound.samples, 4)[: 60 * one.sound.rate_hz]
        write_sound(sound, Audio(minute, one.sound.rate_hz))
        start = time.perf_counter()
        command = [sys.executable, "-c", "from lipmotion.cli.main import main; main()", "animate", str(sound)]
        subprocess.run([*command, "--face", face, "-o", str(path)], check=True, capture_output=True)
        whole_s = time.perf_counter() - start
        children = os.times().children_user
    return {
        "frames_per_s": round(statistics.median(rates[1:]), 1),
        "best_frames_per_s": round(max(rates), 1),
        "processor_ms_a_frame": round(1000 * min(processor_s), 1),
        "minute_whole_process_s": round(whole_s, 1),
        "minute_processor_s": round(children, 1),
        "load": round(os.getloadavg()[0], 1),
    }


def sheet(path: Path) -> None:
    """Write a picture of ten sounds, from the front and from the side, and of the whole head."""
    from PIL import Image, ImageDraw

    poses = list(sheet_poses())
    rows = []
    for turn in (0.0, 0.75):
        stage = Stage(Camera(240, 210, (0.0 if turn == 0 else 0.4, -0.68), 0.8))
        tiles = []
        for (name, *_), pose in zip(SHEET, poses, strict=True):
            tile = Image.fromarray(stage.picture(pose._replace(turn=(turn, 0.0, 0.0))))
            ImageDraw.Draw(tile).text((8, 6), name, fill=(40, 40, 40))
            tiles.append(np.asarray(tile))
        rows += [np.concatenate(tiles[:5], axis=1), np.concatenate(tiles[5:], axis=1)]
    whole = Stage(camera_for(1200, 720))
    left = whole.picture(poses[0]._replace(turn=(-0.08, 0.0, 0.02)))[:, 300:900]
    right = whole.picture(poses[6]._replace(turn=(0.4, 0.03, -0.02), gaze=(-0.3, 0.0)))[:, 300:900]
    whole_sheet = Image.fromarray(np.concatenate([np.concatenate([left, right], axis=1), *rows]))
    whole_sheet = whole_sheet.resize((1080, 1404), Image.Resampling.LANCZOS)
    few = whole_sheet.quantize(256, method=Image.Quantize.FASTOCTREE, kmeans=2)
    whole_sheet.quantize(palette=few, dither=Image.Dither.FLOYDSTEINBERG).save(path, optimize=True)


def sheet_poses() -> Iterator[CharacterPose]:
    """Yield the poses of the sounds of the sheet, eyes open and the head straight."""
    spans, values, start_s = [], [], 0.0
    for _, phone, opening, wider in SHEET:
        for said, row in ((phone, (opening, 0.57 + wider, 0.22 + opening)), ("sil", (0.0, 0.57, 0.22))):
            spans.append(Span(start_s, start_s + 0.4, Unit(said)))
            values += [row] * 40
            start_s += 0.4
    motion = Motion(np.array(values), 100.0, tuple(map(Channel, ("opening", "width", "outer"))))
    poses = head_poses(motion, Timeline(tuple(spans)), 25.0)
    for number in range(len(SHEET)):
        yield poses[int((0.8 * number + 0.2) * 25)]._replace(turn=(0.0, 0.0, 0.0), shut=0.0, gaze=(0.0, 0.0), brows=0.0)


if __name__ == "__main__":
    main()
