"""Mouths of photographs beside drawn ones, sound by sound: width, hole and lips in parts of the width at rest.

    python benchmarks/proportions.py CORPUS [--every 3] [--faces woman,man,cartoon] [--json FILE.json]

CORPUS : prepared videos of one person, with transcripts (``lipmotion corpus prepare``)

The transcripts are aligned with the model of the package. At the middle of every sound of at least 40 ms:

*Photographs*: the tracked points of the lips. The hole is as wide as the inner lips are more than ``SEEN_GAP`` apart.
*Drawings*: the outlines that a face draws for the tracked motion and the phones of the same utterances, before they are
painted. *Tracked*: the drawing of the middle pose of each sound,
written as .mp4 and tracked as the photographs were.

Medians over all examples. Each person, photographed or drawn, is measured in the median width of his or her own lips in
silence.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lipmotion
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.types import Audio, Motion, Timeline, Unit, Utterance
from lipmotion_faces import face_named
from lipmotion_faces.portrait.geometry import lip_outlines
from lipmotion_faces.portrait.portrait_rasteriser import FacePose, Rasteriser
from lipmotion_faces.portrait.pose import MouthPose, mouth_poses
from lipmotion_faces.video.mp4 import write_mp4

SOUNDS = {
    "silence": "sil", "p b m": "p b m", "f": "f", "v": "v", "th": "th dh", "oo (two, blue)": "uw",
    "w (with, white)": "w", "aa, ay (r, i)": "aa ay", "ae (at)": "ae", "eh": "eh", "ee (three, green)": "iy",
    "l": "l", "s": "s", "t d n": "t d n",
}  # fmt: skip
INNER = ((191, 95), (80, 88), (81, 178), (82, 87), (13, 14), (312, 317), (311, 402), (310, 318), (415, 324))
"""Points of the inner lips above one another, between the inner corners 78 and 308."""
LEAST_S, SEEN_GAP, SIZE, HELD_FRAMES, FPS = 0.04, 0.015, 640, 6, 25.0
COLUMNS = ("width", "hole width", "hole height", "lips height")
Row = NDArray[np.float64]


def units_of(utterance: Utterance) -> Timeline[Unit]:
    sound = Audio(utterance.audio.samples, utterance.audio.rate_hz)
    return lipmotion.animate(sound, transcript=" ".join(utterance.words or ())).units


def photographed(motion: Motion, at_s: float) -> Row:
    """Return the four measures of the nearest tracked frame, in eye distances."""
    frame = min(round(at_s * motion.rate_hz), len(motion.values) - 1)

    def point(number: int) -> Row:
        return np.array([motion[f"{axis}_{number}"][frame] for axis in "xy"])

    left, right = point(78), point(308)
    pairs = [(point(upper), point(lower)) for upper, lower in INNER]
    x = np.array([left[0], *((upper[0] + lower[0]) / 2 for upper, lower in pairs), right[0]])
    apart = np.array([0.0, *(upper[1] - lower[1] for upper, lower in pairs), 0.0])
    order = np.argsort(x)
    across = np.linspace(x.min(), x.max(), 400)
    hole = float(np.ptp(x)) * float((np.interp(across, x[order], apart[order]) > SEEN_GAP).mean())
    return np.array([motion["width"][frame], hole, motion["opening"][frame], motion["outer"][frame]])


def outlined(face: str, pose: MouthPose) -> Row:
    """Return the four measures of the outlines that are drawn, in eye distances."""
    x = np.linspace(-0.6, 0.6, 1201)
    lips = face_named(face).design.lips  # type: ignore[attr-defined]
    shape = lip_outlines(lips, pose, x)
    apart = shape.lower_inner - shape.upper_inner
    hole = float((apart > SEEN_GAP).mean() * 1.2) if pose.gap > 0 else 0.0
    return np.array([2 * shape.half_width, hole, apart.max(), (shape.lower_outer - shape.upper_outer)[600]])


def middle_pose(poses: list[MouthPose]) -> MouthPose:
    return MouthPose(*np.median(np.array(poses), axis=0).tolist())


def tracked(face: str, poses: dict[str, MouthPose]) -> dict[str, Row]:
    """Return the four measures of drawings as the project's tracker sees them."""
    from lipmotion_faces.tracking.track import track

    drawing = Rasteriser(face_named(face).design, SIZE)  # type: ignore[attr-defined]
    frames = [
        drawing.picture(FacePose(pose, 0.07), drawing.canvas()) for pose in poses.values() for _ in range(HELD_FRAMES)
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "held.mp4"
        sound = Audio(np.zeros(int(16_000 * len(frames) / FPS), np.float32), 16_000)
        write_mp4(path, iter(frames), fps=FPS, audio=sound)
        motion = track(path, crops=False).motion
    return {name: photographed(motion, (n * HELD_FRAMES + HELD_FRAMES - 2) / FPS) for n, name in enumerate(poses)}


def measured(corpus: lipmotion.Corpus, every: int, faces: list[str]) -> dict[str, Any]:
    photographs: dict[str, list[Row]] = defaultdict(list)
    drawn: dict[str, list[MouthPose]] = defaultdict(list)
    sounds = {phone: sound for sound, phones in SOUNDS.items() for phone in phones.split()}
    names = corpus.names()[::every]
    for name in names:
        utterance = corpus.utterance(name)
        units, motion = units_of(utterance), utterance.track.motion
        poses = mouth_poses(spoken_mouth(motion, units))
        for span in units:
            sound = sounds.get(span.label.phone)
            if sound and span.duration_s >= LEAST_S:
                at_s = (span.start_s + span.end_s) / 2
                photographs[sound].append(photographed(motion, at_s))
                drawn[sound].append(poses[min(round(at_s * motion.rate_hz), len(poses) - 1)])
    ordered = [sound for sound in SOUNDS if sound in drawn]
    middle = {sound: middle_pose(drawn[sound]) for sound in ordered}
    tables = {"photographs": {sound: np.median(photographs[sound], axis=0) for sound in ordered}}
    for face in faces:
        tables[face] = {sound: np.median([outlined(face, pose) for pose in drawn[sound]], axis=0) for sound in ordered}
        tables[f"{face}, tracked"] = tracked(face, middle)
    shown = {
        who: {sound: [round(float(x), 3) for x in row / table["silence"][0]] for sound, row in table.items()}
        for who, table in tables.items()
    }
    counts = {sound: len(drawn[sound]) for sound in ordered}
    return {"utterances": len(names), "examples": counts, "columns": COLUMNS, "in widths at rest": shown}


def main() -> None:
    """Print one JSON object, and a table in Markdown of the photographs beside the first face."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--every", type=int, default=3, help="take every such utterance")
    parser.add_argument("--faces", default="woman,man,cartoon")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    faces = options.faces.split(",")
    figures = measured(lipmotion.Corpus.open(options.corpus), options.every, faces)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    shown = figures["in widths at rest"]
    print(json.dumps(figures))
    print("| sound | examples |", " | ".join(f"{name}: photographs, drawn, tracked" for name in COLUMNS), "|")
    for sound, count in figures["examples"].items():
        rows = [shown[who][sound] for who in ("photographs", faces[0], f"{faces[0]}, tracked")]
        print(
            f"| {sound} | {count} |", " | ".join("  ".join(f"{x:.2f}" for x in one) for one in np.transpose(rows)), "|"
        )


if __name__ == "__main__":
    main()
