"""Drawn characters: what a tracker measures on them, which sounds their mouths tell apart, and pictures of ten sounds.

    python benchmarks/character.py [--faces woman,man,cartoon] [--sheet FILE.png] [--json FILE.json] [--still]

Ten sentences are spoken by a synthetic voice (the extra ``text``), so their phones are known.

*Re-tracked*: the faces are drawn at 25 frames a second, written as .mp4 and tracked (the
extra ``video``); ACC of opening, width and outer, pooled over all sentences, against the motion given. ``distances
alone``: the same motion, but only silence is known of the phones, so that nothing but the channels is drawn. *Told*:
the gap and the width of the poses, that is the motion with what the phones add. *By colour*: a second judge, which
counts the pixels of the opening down the middle of the mouth, and the columns of the lips, on the pictures themselves;
it knows the colours of the character.

*Confusion*: in the middle of every p b m f v th oo w aa ee the drawn mouth is measured: width and height of the lips
and of the opening, how round the opening is, and the dark, the teeth and the tongue in it (roots of areas), by colour,
in eye distances. A linear discriminant is learned on nine sentences and names the sounds of the tenth, in turn. To its
covariance ``EYE`` squared is added: differences that a viewer would not see do not count. ``as visemes`` counts p b m
as one, f v as one. The same driver measures the portrait of an earlier version: PYTHONPATH=OLD/src, --faces portrait.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lipmotion
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.types import Audio, Motion, Timeline, Unit
from lipmotion_faces import face_named
from lipmotion_faces.portrait.pose import mouth_poses
from lipmotion_faces.video.mp4 import write_mp4

try:
    from lipmotion_faces import Staging, staged_face
except ImportError:  # the first version of the portrait
    Staging = None

SENTENCES = (
    "Please buy my big baby piano.",
    "Five very funny elves have fifty waves.",
    "Thirty three thin moths gather there.",
    "We see these clean green trees with Lee.",
    "You could move two blue shoes and a new moon.",
    "My father saw a large calm palm far off.",
    "Why would we wait with one white wheel?",
    "Sally sells sea shells down by the shore.",
    "Bob may put a map of Africa on the wall.",
    "He knew the loud voice of the young judge.",
)
SOUNDS = {"p": "p", "b": "b", "m": "m", "f": "f", "v": "v", "th": "th dh", "oo": "uw", "w": "w", "aa": "aa", "ee": "iy"}
VISEME = {"p": "pbm", "b": "pbm", "m": "pbm", "f": "fv", "v": "fv"}
SIZE, LEAST_S = 480, 0.04
EYE = 0.03
"""Difference that a viewer sees at a glance, in eye distances: 2 mm on a face."""
Spoken = tuple[Audio, Motion, Timeline[Unit]]


def drawn(face: str, motion: Motion, units: Timeline[Unit], fps: float, still: bool) -> Iterator[NDArray[np.uint8]]:
    if Staging is None:
        return face_named(face).render(motion, units, fps=fps)
    parts = dict.fromkeys(("blinks", "gaze", "brows", "head"), not still)
    return staged_face(face, Staging(size=SIZE, **parts)).render(motion, units, fps=fps)


def retracked(face: str, spoken: Sequence[Spoken], still: bool) -> dict[str, Any]:
    from lipmotion_faces.tracking.track import track

    given, measured, told, coloured = [], [], [], []
    tones = tones_of(face)
    with tempfile.TemporaryDirectory() as folder:
        for sound, motion, units in spoken:
            path = Path(folder) / "drawn.mp4"
            pictures = list(drawn(face, motion, units, 25.0, still))
            write_mp4(path, iter(pictures), fps=25.0, audio=sound)
            found = track(path, crops=False)
            frames = min(len(found.motion.values), len(motion.resampled(25.0).values))
            seen = found.seen[:frames]
            names = ("opening", "width", "outer")
            given.append(np.stack([motion.resampled(25.0)[name][:frames][seen] for name in names], axis=1))
            measured.append(np.stack([found.motion[name][:frames][seen] for name in names], axis=1))
            poses = mouth_poses(spoken_mouth(motion, units, 25.0))[:frames]
            told.append(np.array([(pose.gap, pose.width) for pose in poses])[seen])
            coloured.append(np.array([colour_measures(picture, tones) for picture in pictures[:frames]])[seen])
    one, other = np.concatenate(given), np.concatenate(measured)
    figures = {
        name: float(np.corrcoef(one[:, k], other[:, k])[0, 1]) for k, name in enumerate(("opening", "width", "outer"))
    }
    closed = one[:, 0] < 0.012
    asked, painted = np.concatenate(told), np.concatenate(coloured)
    return {
        "ACC": figures,
        "ACC of told with given": accuracies(asked, one),
        "ACC of tracked with told": accuracies(other, asked),
        "ACC by colour": accuracies(painted, one),
        "ACC by colour with told": accuracies(painted, asked),
        "opening where closed, 95th percentile": float(np.percentile(other[closed, 0], 95)),
        "widest opening": float(np.percentile(other[:, 0], 99.5)),
        "frames": len(one),
    }


def accuracies(one: NDArray[np.float64], other: NDArray[np.float64]) -> dict[str, float | None]:
    """Return ACC of opening and width; None where a judge sees no movement."""
    return {
        name: float(np.corrcoef(one[:, k], other[:, k])[0, 1]) if np.ptp(one[:, k]) > 0 else None
        for k, name in enumerate(("opening", "width"))
    }


def colour_measures(frame: NDArray[np.uint8], tones: NDArray[np.float64]) -> tuple[float, float]:
    """Return the opening down the middle of the mouth, and the width of the lips, in eye distances."""
    label, scale = labelled(frame, tones)
    corners = (label > 0)[int(0.2 * scale) : int(0.42 * scale)]  # between nose and chin, about the line of the lips
    corners[:, : int(0.06 * scale)] = corners[:, -int(0.06 * scale) :] = False
    columns = np.flatnonzero(corners.sum(axis=0) > 1)
    if not len(columns):
        return 0.0, 0.0
    middle = (columns[0] + columns[-1]) // 2
    down = label[int(0.13 * scale) :, middle - 2 : middle + 3] >= 3
    return float(down.sum()) / 5 / scale, float(np.ptp(columns) + 1) / scale


def silence_of(units: Timeline[Unit]) -> Timeline[Unit]:
    return Timeline(tuple(span for span in units if span.label.phone == "sil"))


def labelled(frame: NDArray[np.uint8], tones: NDArray[np.float64]) -> tuple[NDArray[np.intp], float]:
    """Return what the pixels around the mouth show, and the pixels in an eye distance.

    0: skin, 1 and 2: lips, 3: the dark of the mouth, 4: teeth, 5: tongue
    """
    height = len(frame)
    scale = 0.285 * height
    area = frame[
        int(0.4 * height + 0.62 * scale) : int(0.4 * height + 1.42 * scale),
        int(height / 2 - 0.5 * scale) : int(height / 2 + 0.5 * scale),
    ]
    label = (
        np.square(area[:, :, None].astype(float) - tones).sum(axis=3).argmin(axis=2)
    )  # skin skin lip lip dark tooth tongue
    label = np.where(label <= 1, 0, label - 1)
    return label, scale


def mouth_measures(frame: NDArray[np.uint8], tones: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return width and height of lips and opening, roundness, and areas inside, in parts of the picture's height."""
    label, scale = labelled(frame, tones)
    lips = label > 0
    columns, rows = np.flatnonzero(lips.sum(axis=0) > 2), np.flatnonzero(lips.sum(axis=1) > 4)
    inside = np.isin(label, (3, 4))
    inner_columns, inner_rows = np.flatnonzero(inside.sum(axis=0) > 1), np.flatnonzero(inside.sum(axis=1) > 2)
    spans = [float(np.ptp(x) + 1) / scale if len(x) else 0.0 for x in (columns, rows, inner_columns, inner_rows)]
    areas = [float((label == k).sum()) / scale**2 for k in (3, 4, 5)]
    round_ = 0.2 * spans[3] / spans[2] if spans[2] else 0.0
    return np.array([*spans, round_, *(np.sqrt(a) for a in areas)])


def tones_of(face: str) -> NDArray[np.float64]:
    try:
        from lipmotion_faces import face_named as named

        colours = named(face).design.palette
        get = lambda name: getattr(colours, name)  # noqa: E731
    except AttributeError:
        from lipmotion_faces.portrait import design as palette

        get = lambda name: getattr(palette, name.upper())  # noqa: E731
    names = ("skin", "skin_shade", "lower_lip_light", "upper_lip_dark", "cavity", "tooth", "tongue")
    return np.array([get(name) for name in names], float)


def samples(face: str, spoken: Sequence[Spoken]) -> list[tuple[int, str, NDArray[np.float64], NDArray[np.uint8]]]:
    found, tones = [], tones_of(face)
    sounds = {phone: sound for sound, phones in SOUNDS.items() for phone in phones.split()}
    for number, (_, motion, units) in enumerate(spoken):
        frames = list(drawn(face, motion, units, 50.0, True))
        for span in units:
            sound = sounds.get(span.label.phone)
            if sound and span.duration_s >= LEAST_S:
                frame = frames[min(round((span.start_s + span.end_s) * 25), len(frames) - 1)]
                found.append((number, sound, mouth_measures(frame, tones), frame))
    return found


def confusion(found: list[tuple[int, str, NDArray[np.float64], NDArray[np.uint8]]]) -> dict[str, Any]:
    names = list(SOUNDS)
    table = np.zeros((len(names), len(names)), int)
    values = np.array([measures for _, _, measures, _ in found])
    classes = np.array([names.index(sound) for _, sound, _, _ in found])
    sentence = np.array([number for number, *_ in found])
    for number in np.unique(sentence):
        train = sentence != number
        means = np.array([values[train & (classes == k)].mean(axis=0) for k in range(len(names))])
        rest = values[train] - means[classes[train]]
        precision = np.linalg.inv(rest.T @ rest / train.sum() + EYE**2 * np.eye(values.shape[1]))
        apart = values[sentence == number][:, None] - means
        chosen = np.einsum("nkd,de,nke->nk", apart, precision, apart).argmin(axis=1)
        np.add.at(table, (classes[sentence == number], chosen), 1)
    viseme = [VISEME.get(name, name) for name in names]
    same = np.array([[one == other for other in viseme] for one in viseme])
    return {
        "sounds": names,
        "table": table.tolist(),
        "right": float(np.trace(table) / table.sum()),
        "right as visemes": float(table[same].sum() / table.sum()),
        "balanced, as visemes": float(
            np.mean([(table[k] * same[k]).sum() / table[k].sum() for k in range(len(names))])
        ),
    }


def sheet(faces: dict[str, list[Any]], path: Path) -> None:
    """Write a picture with a row for each face: of every sound the mouth that is most like all of that sound."""
    from PIL import Image, ImageDraw

    rows = []
    for found in faces.values():
        row = []
        for sound in SOUNDS:
            values = np.array([measures for _, name, measures, _ in found if name == sound])
            frames = [frame for _, name, _, frame in found if name == sound]
            typical = frames[int(np.square(values - np.median(values, axis=0)).sum(axis=1).argmin())]
            h = len(typical)
            row.append(typical[int(0.545 * h) : int(0.82 * h), int(0.355 * h) : int(0.645 * h)])
        rows.append(np.hstack(row))
    top = np.full((22, rows[0].shape[1], 3), 255, np.uint8)
    picture = Image.fromarray(np.vstack([top, *rows]))
    width = rows[0].shape[1] // len(SOUNDS)
    for n, sound in enumerate(SOUNDS):
        ImageDraw.Draw(picture).text((n * width + width // 2, 11), sound, fill=(0, 0, 0), anchor="mm", font_size=15)
    picture.save(path, optimize=True)


def main() -> None:
    """Print one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faces", default="woman,man,cartoon")
    parser.add_argument("--sheet", type=Path, help="a picture of each sound, a row for each face")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--still", action="store_true", help="re-track faces of which only the mouth moves")
    parser.add_argument("--untracked", action="store_true", help="do not track again")
    options = parser.parse_args()
    spoken: list[Spoken] = []
    for sentence in SENTENCES:
        sound, result = lipmotion.speak(sentence)
        spoken.append((sound, result.motion, result.units))
    figures, found = {}, {}
    for face in options.faces.split(","):
        found[face] = samples(face, spoken)
        figures[face] = confusion(found[face])
        if not options.untracked:
            figures[face] |= {"retracked": retracked(face, spoken, options.still)}
            alone = [(sound, motion, silence_of(units)) for sound, motion, units in spoken]
            figures[face] |= {"retracked, distances alone": retracked(face, alone, options.still)}
    if options.sheet:
        sheet(found, options.sheet)
    text = json.dumps(figures, indent=1)
    if options.json:
        options.json.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
