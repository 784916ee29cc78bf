"""Whether a filmed face mumbles: its range, its closures, its teeth and its rounding, tracked again.

    python benchmarks/video_range.py CORPUS --clips FOLDER --model FILE.lipmotion --face FILE.face [--face ...]
        [--split val] [--count N] [--tracked]

CORPUS is a prepared corpus of the person of the faces, FOLDER has its videos. Every clip is made again in its own
footage, moved by its sound alone, or by its own tracked points (``--tracked``). Prints a JSON object a face, in which
1 is as recorded:

deviation, range : of opening and width: standard deviation within clips, and 5th to 95th percentile of all frames;
                   ``driver_…`` of the motion itself
acc              : correlation with the recording, over all frames
closed           : share of the frames of p, b and m in which the mouth is closed; ``closed_recorded``
p_b_m            : share of p, b and m in which the recorded mouth closes, in which this one closes, too
closed_sharpness : of the lips, in frames of p, b and m in which both are closed
inside_sharpness : within the inner lips, in frames that are open by ``OPEN``, by the opening of each
rounding         : how much narrower than in the mean of all frames the mouth is in uw and w, eye distances; recorded,
                   driver and made
sharpness, lips_sharpness, flicker, psnr_db : as of ``video_face.py``
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from picture_measures import picture_figures, sharpness
from PIL import Image, ImageDraw
from video_face import LIPS, closures, distances, lower_face, phones, stored
from video_results import Judged
from video_sheets import Sheets
from video_ways import AROUND_PX, MOUTH, Pictures, RecordedClip, on_frames, recorded_clip, video_of

from lipmotion import Corpus, animate, load_model
from lipmotion.kernels.threads import one_thread
from lipmotion.measures.closures import closed_threshold
from lipmotion.motion.mouth_region import EYE_DISTANCE_PX
from lipmotion.pipeline.request import Outputs, Request
from lipmotion.types import Motion, Timeline, Unit
from lipmotion_faces.appearance import lower_face as region
from lipmotion_faces.film.filmed_video import film_of
from lipmotion_faces.filmed.face import FilmedFace, load_face
from lipmotion_lab.evaluation.figures import BILABIAL

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
INNER_LIPS = (78, 191, 80, 81, 82, 13, 312, 311, 310, 415, 308, 324, 318, 402, 317, 14, 87, 178, 88, 95)
"""Points of the inner lips, around the mouth."""
ROUND = {"uw", "w"}
OPEN = ((0.06, 0.09), (0.09, 0.12), (0.12, 0.16))
"""Openings in which teeth are compared, eye distances."""
LEAST_INSIDE_PX = 8
"""Frames with fewer pixels within the inner lips are left out."""


@dataclass(eq=False)
class Seen:
    """A clip as one face shows it: distances, and sharpness of the lips and within them, by side, in frames seen."""

    figures: dict[str, float]
    judged: Judged
    lips: dict[str, Array]
    inside: dict[str, Array]


def main() -> None:
    """Print a JSON object a face."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--clips", type=Path, required=True)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--face", type=Path, action="append", required=True)
    parser.add_argument("--split", default="val")
    parser.add_argument("--count", type=int)
    parser.add_argument("--tracked", action="store_true")
    options = parser.parse_args()
    corpus, model = Corpus.open(options.corpus), load_model(options.model)
    names = corpus.names(options.split)[: options.count]
    spoken = phones(corpus, names, model)
    openings = [np.asarray(corpus.utterance(name).track.motion["opening"], float) for name in corpus.names("train")]
    threshold = closed_threshold(openings)
    for path in options.face:
        face, seen = load_face(path), list[Seen]()
        with one_thread():
            for name in names:
                clip = recorded_clip(corpus, name, video_of(options.clips, name))
                made = animate(Request(clip.utterance.audio), model=model)
                motion = clip.utterance.track.motion if options.tracked else made.motion
                seen.append(shown(face, clip, motion, made.units))
        print(json.dumps({"face": path.name, **figures(seen, spoken, threshold)}), flush=True)


def shown(face: FilmedFace, clip: RecordedClip, motion: Motion, units: Timeline[Unit]) -> Seen:
    """Return what one face shows of a clip."""
    film = film_of(face, motion, units=units, options=Outputs(background=clip.path))
    frames, tracked = stored(film.frames, clip, mp4=False)
    true = clip.utterance.track
    assert tracked is not None
    count = len(clip.frames)
    sides = {"made": (lower_face(clip, frames), tracked.motion), "true": (lower_face(clip, clip.frames), true.motion)}
    pictures = {side: faces[(slice(None), *MOUTH)] for side, (faces, _) in sides.items()}
    curves = {side: distances(moved)[:count] for side, (_, moved) in sides.items()}
    curves["driver"] = distances(on_frames(motion, clip))
    return Seen(
        picture_figures(pictures["made"], pictures["true"]),
        Judged({}, curves, np.zeros(count), true.seen & tracked.seen[:count], 0.0, Sheets({}, {})),
        {side: sharpness(mouths[LIPS]) for side, mouths in pictures.items()},
        {side: inside_sharpness(faces, moved) for side, (faces, moved) in sides.items()},
    )


def inside_sharpness(faces: Pictures, motion: Motion) -> Array:
    """Return the energy of the gradient within the inner lips of each frame, NaN where they are shut [shape=(T,)]."""
    grey = faces.astype(np.float32).mean(axis=3)
    energy = np.zeros(grey.shape, np.float32)
    energy[:, :-1] += np.square(np.diff(grey, axis=1))
    energy[:, :, :-1] += np.square(np.diff(grey, axis=2))
    points = EYE_DISTANCE_PX * np.stack(
        [[motion[f"x_{index}"], -np.asarray(motion[f"y_{index}"])] for index in INNER_LIPS], axis=-1
    )
    values = np.full(len(faces), np.nan)
    for frame in range(len(faces)):
        outline = points[:, frame].T - np.array(region.CORNER) + AROUND_PX
        picture = Image.new("L", (faces.shape[2], faces.shape[1]))
        ImageDraw.Draw(picture).polygon([tuple(point) for point in outline.tolist()], fill=1)
        inside = np.asarray(picture) > 0
        if inside.sum() > LEAST_INSIDE_PX:
            values[frame] = energy[frame][inside].mean()
    return values


def figures(seen: Sequence[Seen], spoken: Sequence[Sequence[tuple[float, float, str]]], threshold: float) -> Any:
    """Return the figures of one face over all clips."""
    judged = [each.judged for each in seen]

    def pooled(side: str, column: int) -> Array:
        return np.concatenate([each.curves[side][each.seen, column] for each in judged])

    def said(names: set[str] | frozenset[str]) -> Mask:
        parts = []
        for each, units in zip(judged, spoken, strict=True):
            frames = np.zeros(len(each.seen), bool)
            for start_s, end_s, phone in units:
                first = int(np.ceil(start_s * 25))
                if phone in names:
                    frames[first : max(int(np.ceil(end_s * 25)), first + 1)] = True
            parts.append(frames[each.seen])
        return np.concatenate(parts)

    found: dict[str, Any] = {}
    for column, name in enumerate(("opening", "width")):
        true = pooled("true", column)
        for side, prefix in (("made", ""), ("driver", "driver_")):
            within, recorded = (
                np.mean([each.curves[of][each.seen, column].std() for each in judged]) for of in (side, "true")
            )
            spans = [float(np.subtract(*np.percentile(values, [95, 5]))) for values in (pooled(side, column), true)]
            found |= {f"{prefix}deviation_{name}": within / recorded, f"{prefix}range_{name}": spans[0] / spans[1]}
        found[f"acc_{name}"] = float(np.corrcoef(pooled("made", column), true)[0, 1])
    made, true, bilabial = pooled("made", 0), pooled("true", 0), said(set(BILABIAL))
    found |= {"closed": (made[bilabial] < threshold).mean(), "closed_recorded": (true[bilabial] < threshold).mean()}
    found |= closures(judged, spoken, threshold)
    both = bilabial & (made < threshold) & (true < threshold)
    lips, inside = (
        {side: np.concatenate([getattr(e, part)[side][: len(e.judged.seen)][e.judged.seen] for e in seen]) for side in
         ("made", "true")} for part in ("lips", "inside")
    )  # fmt: skip
    found["closed_sharpness"] = lips["made"][both].mean() / lips["true"][both].mean()
    found["inside_sharpness"] = [
        float(np.nanmean(inside["made"][(made >= low) & (made < high)]))
        / float(np.nanmean(inside["true"][(true >= low) & (true < high)]))
        for low, high in OPEN
    ]
    rounded = said(ROUND)
    found["rounding"] = [
        float(pooled(side, 1)[rounded].mean() - pooled(side, 1).mean()) for side in ("true", "driver", "made")
    ]
    for name in ("psnr_db", "sharpness", "flicker"):
        found[name] = np.mean([each.figures[name] for each in seen])
    found["lips_sharpness"] = float(np.mean(lips["made"]) / np.mean(lips["true"]))
    return {name: np.round(value, 4).tolist() for name, value in found.items()}


if __name__ == "__main__":
    main()
