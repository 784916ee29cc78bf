"""Generated mouths: how strong, how shut and how restful they are, on all faces, beside people.

    python benchmarks/mouth.py --open FOLDER [--characters FOLDER] [--tracks FOLDER] [--corpus FOLDER] [--model FILE]
        [--only strength|vowels|pauses|millimetres|accuracy]

One JSON object a line; lengths are in eye distances but where millimetres are named. The recordings of ``--open`` show
a person who speaks; their motion is generated from the sound alone, that of the people is tracked and moved by the lag
within 120 ms at which both fit best. Phones in time are those recognised, for people as well.

strength    : 98th percentile over speech of the opening and of ARKit's curves, of what is generated and of the person's
              tracked motion, beside a capture's
vowels      : share of the frames inside vowels opening less than ``SHUT_OPENING``, under several doubts of phones: of
              whole recordings and, of those longer than ten seconds, of pieces of five, where it is worst
pauses      : median opening in inner pauses of ``PAUSE_S``, without ``EDGE_S`` at both ends, over that in vowels; the
              same of what each face draws (``READINGS``)
millimetres : the example on several heads, how far their inner lips are apart: 98th percentile over speech, and median
              in vowels. Files in metres whose head is as high as people's (``HEAD_MM``, chin to top) count as they are,
              others are scaled to a height of ``USUAL_MM``; the 3D head has 90 mm between its outer eye corners
accuracy    : ``evaluate`` on ``--corpus`` and ``--split``; parts ``strangers`` and ``open`` of anyone.py
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from anyone import PIECE_S, lag_of, open_english, pieces, show, strangers
from kept_tracks import kept_track
from numpy.typing import NDArray

from lipmotion import Corpus, Selection, animate, evaluate, load_model
from lipmotion.articulation.lip_points import CHIN, LOWER_MIDDLE, UPPER_MIDDLE
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.articulation.pauses import PAUSE_STYLES, with_pauses
from lipmotion.articulation.symmetry import symmetrical
from lipmotion.meshes.files.gltf_writer import write_gltf_scene
from lipmotion.meshes.fitting.driven import driven_character
from lipmotion.meshes.fitting.lip_placement import LipPlacement, placed_by_shape
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion.meshes.model.scene import Scene
from lipmotion.meshes.model.surface import mesh_surface
from lipmotion.motion.predictors import Predictor
from lipmotion.motion.reliability import phone_reliability
from lipmotion.pipeline.generation import generate_for
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.outputs.curve_sets import curves_of
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.understand.understood_speech import understood_speech
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Generation, Motion, Speech, Timeline, Track, Unit
from lipmotion.units import is_silent
from lipmotion.units.classes import CLASSES
from lipmotion_faces.head.performance import head_poses
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.stage import figure, head_mesh
from lipmotion_faces.outputs.scenes import METRES

Array = NDArray[np.float64]
Inside = NDArray[np.bool_]
Units = Timeline[Unit]

EXAMPLE = Path(__file__).parents[1] / "examples" / "welcome.flac"
SHUT_OPENING = 0.015
PAUSE_S, EDGE_S = (0.2, 1.2), 0.12
LAG_S = 0.12
STRONG_PERCENTILE = 98
"""The percentile that is a mouth's strength: wider openings are rare, and often a tracker's."""
CAPTURED = {
    "jawOpen": 0.33, "mouthLowerDownLeft": 0.43, "mouthLowerDownRight": 0.43, "mouthFunnel": 0.39, "mouthPucker": 0.44,
    "mouthStretchLeft": None, "mouthStretchRight": None,
}  # fmt: skip
"""ARKit's curves, and their 98th percentiles in a Live Link take of a person, where they are known."""
DRAWN_HZ = 25.0
HEAD_MM, USUAL_MM = (180, 300), 220
VOWELS = {
    "A": CharacterPose(gap=0.3, upper_rise=0.03, jaw=0.23),
    "E": CharacterPose(gap=0.12, upper_rise=0.05, jaw=0.06, width=1.25, spread=1),
    "O": CharacterPose(gap=0.16, upper_rise=0.05, jaw=0.1, width=0.8, roundness=1, protrusion=0.09),
}
"""The shapes of a head that has only three."""
READINGS: dict[str, Callable[[Motion, Units], Array]] = {
    "opening": lambda motion, _: motion["opening"].astype(float),
    "all faces": lambda motion, units: spoken_mouth(motion, units).gap,
    "arkit": lambda motion, units: curves_of(motion, units, "arkit")["jawOpen"].astype(float),
}
"""How far each face opens the mouth, at the rate of the motion [shape=(T,)]."""


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--open", type=Path, help="folder of videos of people who speak")
    parser.add_argument("--characters", type=Path, help="folder of .glb files and folders of OBJ files")
    parser.add_argument("--tracks", type=Path, help="where tracks of videos are kept; default: they are not")
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--corpus", type=Path, default=Path("build/grid-s1"), help="prepared, of the training speaker")
    parser.add_argument("--split", default="val")
    parser.add_argument("--model", type=Path, help="default: the one that ships")
    parser.add_argument("--recogniser", default="auto")
    parser.add_argument("--only", action="append", choices=list(PARTS), help="repeatable; default: all")
    options = parser.parse_args()
    model = load_model(options.model)
    for name in options.only or PARTS:
        PARTS[name](options, model)


@dataclass(frozen=True, eq=False)
class Take:
    """A recording: its phones, its motion, and the person's.

    person  : the tracked motion, resampled to the times of what is generated
    opening : of the person; NaN where no face was seen [shape=(T,)]
    """

    speech: Speech
    generation: Generation
    person: Motion
    opening: Array
    lag_s: float

    def spoken(self, vowels: bool = False) -> Inside:
        """The frames of speech, or of its vowels [shape=(T,)]."""
        return inside(self.generation.units, self.generation.motion.time_s, vowels=vowels)


def inside(units: Units, time_s: Array, *, vowels: bool = False) -> Inside:
    """Return which times are in speech, or in vowels [shape=(T,)]."""
    found = np.zeros(len(time_s), bool)
    for span in units:
        if span.label.phone in CLASSES["vowel"] if vowels else not is_silent(span.label.phone):
            found |= (span.start_s <= time_s) & (time_s < span.end_s)
    return found


def paused(units: Units, time_s: Array) -> Inside:
    """Return which times are in inner pauses, away from the speech on both sides [shape=(T,)]."""
    speech = [(span.start_s, span.end_s) for span in units if not is_silent(span.label.phone)]
    found = np.zeros(len(time_s), bool)
    for (_, start_s), (stop_s, _) in pairwise(speech):
        if PAUSE_S[0] <= stop_s - start_s <= PAUSE_S[1]:
            found |= (start_s + EDGE_S <= time_s) & (time_s < stop_s - EDGE_S)
    return found


@cache
def takes(folder: Path, tracks: Path | None, model: Model, recogniser: str) -> dict[str, Take]:
    """Return the recordings of a folder by name."""
    paths = sorted(folder.glob("*.mp4"))
    return {path.stem: take(read_audio(path), kept_track(path, tracks), model, recogniser) for path in paths}


def take(audio: Audio, tracked: Track, model: Model, recogniser: str) -> Take:
    """Return a recording with what is generated for its sound."""
    speech = understood_speech(model, Request(audio, recogniser=recogniser)).speech
    generation = generate_for(None, model.engine, model.learned, speech)
    generation = replace(generation, motion=symmetrical(generation.motion))
    lag_s = lag_of(generation.motion, tracked, LAG_S)
    time_s = generation.motion.time_s - lag_s
    person = Motion(tracked.motion.at(time_s), generation.motion.rate_hz, tracked.motion.channels)
    seen = np.interp(time_s, tracked.motion.time_s, tracked.seen, left=0, right=0) == 1
    return Take(speech, generation, person, np.where(seen, person["opening"], np.nan), lag_s)


def takes_of(options: argparse.Namespace, model: Model) -> dict[str, Take]:
    """Return the recordings that are asked for."""
    return takes(options.open, options.tracks, model, options.recogniser) if options.open else {}


def strength(options: argparse.Namespace, model: Model) -> None:
    """Print how far mouths open, and how large the curves become."""
    rows: dict[str, list[dict[str, float]]] = {"generated": [], "person": []}
    for name, each in takes_of(options, model).items():
        for source, motion in (("generated", each.generation.motion), ("person", each.person)):
            curves = curves_of(motion, each.generation.units, "arkit")
            chosen = each.spoken() & np.isfinite(each.opening)
            row = {"opening": strong(motion["opening"][chosen])}
            rows[source].append(row | {curve: strong(curves[curve][chosen]) for curve in CAPTURED})
            lag_ms = round(1000 * each.lag_s)
            show(f"strength, {source}", recording=name, lag_ms=lag_ms, **rounded(rows[source][-1]))
    for source, found in rows.items():
        show_mean(f"strength, {source}", found)
    show("strength, captured", recording="a Live Link take", **CAPTURED)


def vowels(options: argparse.Namespace, model: Model) -> None:
    """Print how often the mouth is shut in vowels, by how far the phones are relied on."""
    whole = [vowels_of("whole", name, each, model) for name, each in takes_of(options, model).items()]
    show_worst("vowels, whole", whole)
    short = []
    for path in sorted(options.open.glob("*.mp4")) if options.open else []:
        parts = list(pieces(path, options.tracks))
        for name, audio, tracked in parts if len(parts) > 1 else []:
            short.append(vowels_of(f"{PIECE_S} s", name, take(audio, tracked, model, options.recogniser), model))
    show_worst(f"vowels, {PIECE_S} s", short)


def vowels_of(length: str, name: str, each: Take, model: Model) -> dict[str, Any]:
    """Print and return the shares of shut vowels of a recording."""
    chosen = each.spoken(vowels=True)
    speech, learned = each.speech, model.learned
    covered = replace(learned, network=Covered(learned.network))
    doubts = {
        f"confidence {value:g}": (replace(speech, confidence=value), learned) for value in (0, 0.25, 0.5, 0.75, 1)
    }
    doubts |= {
        "distorted": (speech, covered),
        "distorted, confidence 0": (replace(speech, confidence=0.0), covered),
    }
    openings = {"own": each.generation.motion["opening"], "person": each.opening}
    openings |= {
        doubt: generate_for(None, model.engine, made_by, doubted).motion["opening"]
        for doubt, (doubted, made_by) in doubts.items()
    }
    shares = {doubt: shut_share(opening[chosen]) for doubt, opening in openings.items()}
    distortion = learned.network.predict(speech)[1]
    show(
        f"vowels, {length}",
        recording=name,
        confidence=round(speech.confidence, 3),
        distortion=round(float(np.mean(distortion)), 3),
        reliability=round(float(phone_reliability(speech, distortion, len(chosen))[chosen].mean()), 3),
        frames=int(chosen.sum()),
        **rounded(shares),
    )
    return {"recording": name, **shares}


@dataclass(frozen=True, eq=False)
class Covered:
    """An acoustic network that hears all sound as wholly covered by noise; all else is as of the network."""

    network: Predictor

    def __getattr__(self, name: str) -> Any:
        return getattr(self.network, name)

    def predict(self, speech: Speech) -> tuple[Array, Array]:
        """Return the network's motion, and the largest distortion in all frames."""
        motion, distortion = self.network.predict(speech)
        return motion, np.ones_like(distortion)


def pauses(options: argparse.Namespace, model: Model) -> None:
    """Print how far mouths are open in pauses, as parts of vowels."""
    rows = []
    for name, each in takes_of(options, model).items():
        motion, units = each.generation.motion, each.generation.units
        paused_frames, vowel_frames = paused(units, motion.time_s), each.spoken(vowels=True)
        curves = {
            f"{face}, {style}": reading(with_pauses(each.generation, style).motion, units)
            for face, reading in READINGS.items()
            for style in PAUSE_STYLES
        } | {"person": each.opening}
        medians = {
            face: (float(np.nanmedian(curve[paused_frames])), float(np.nanmedian(curve[vowel_frames])))
            for face, curve in curves.items()
            if paused_frames.any()
        }
        rows.append({face: pause / vowel if vowel > 0 else np.nan for face, (pause, vowel) in medians.items()})
        inside_pauses = {f"{face}_medians": [round(value, 3) for value in pair] for face, pair in medians.items()}
        show("pauses", recording=name, frames=int(paused_frames.sum()), **rounded(rows[-1]), **inside_pauses)
    show_mean("pauses", [row for row in rows if row])


def millimetres(options: argparse.Namespace, model: Model) -> None:
    """Print how far the inner lips of several heads are apart in one sentence."""
    result = animate(EXAMPLE, model=model, transcript=EXAMPLE.with_suffix(".txt"))
    motion, units = result.motion, result.units
    time_s = np.arange(int(motion.time_s[-1] * DRAWN_HZ)) / DRAWN_HZ
    asked = 1000 * METRES * np.interp(time_s, motion.time_s, motion["opening"])
    show_lips("opening of the motion", asked, units, time_s)
    drawn = figure()
    mesh = head_mesh(drawn)
    lips = lip_rows(placed_by_shape(mesh, mesh_surface(mesh)))
    poses = head_poses(motion, units, DRAWN_HZ)[: len(time_s)]
    gaps = np.array([apart(drawn.placed(pose)[0], lips) for pose in poses])
    show_lips("3D head", 1000 * METRES * gaps, units, time_s, at_rest_mm=1000 * METRES * apart(mesh.vertices, lips))
    with tempfile.TemporaryDirectory() as folder:
        three = Path(folder) / "A E O.glb"
        write_gltf_scene(three, Scene(three_shapes(mesh)))
        for path in (three, *characters(options.characters)):
            lips_of_character(path, result, time_s)


def lips_of_character(path: Path, result: Generation, time_s: Array) -> None:
    """Print how far the inner lips of a character are apart."""
    character = driven_character(path)
    chin = character.placement.vertices[character.placement.row(CHIN)]
    height = float(np.ptp(character.mesh.vertices[[chin, character.mesh.vertices[:, 1].argmax()], 1]))
    is_metric = path.suffix == ".glb" and HEAD_MM[0] <= 1000 * height <= HEAD_MM[1]
    millimetres_each = 1000 if is_metric else USUAL_MM / height
    lips = lip_rows(character.placement)
    gaps = np.array([apart(each, lips) for each in character.vertices(result.motion, result.units, time_s)])
    show_lips(
        path.stem,
        millimetres_each * gaps,
        result.units,
        time_s,
        at_rest_mm=millimetres_each * apart(character.mesh.vertices, lips),
        head_mm=millimetres_each * height,
        scaled="metres, as in the file" if is_metric else f"to a head of {USUAL_MM} mm",
    )


def characters(folder: Path | None) -> Iterator[Path]:
    """Yield the characters of a folder."""
    for path in sorted(folder.iterdir()) if folder else []:
        if path.is_dir() or path.suffix == ".glb":
            yield path


def three_shapes(head: Mesh) -> Mesh:
    """Return the 3D head in metres, with the shapes of ``VOWELS`` alone."""
    rest = METRES * head.vertices
    shapes = [Blendshape.between(name, rest, METRES * figure().placed(pose)[0]) for name, pose in VOWELS.items()]
    return replace(head, vertices=rest, shapes=tuple(shapes))


def lip_rows(placement: LipPlacement) -> tuple[int, int]:
    """Return the vertices in the middles of the upper and of the lower inner lip."""
    return placement.vertices[placement.row(UPPER_MIDDLE)], placement.vertices[placement.row(LOWER_MIDDLE)]


def apart(places: Array, lips: tuple[int, int]) -> float:
    """Return the distance of two vertices."""
    return float(np.linalg.norm(places[lips[0]] - places[lips[1]]))


def show_lips(face: str, gap_mm: Array, units: Units, time_s: Array, **values: object) -> None:
    """Print how far lips are apart, in millimetres."""
    spoken, vowel = inside(units, time_s), inside(units, time_s, vowels=True)
    figures = {"peak_mm": strong(gap_mm[spoken]), "vowels_mm": float(np.median(gap_mm[vowel]))}
    show("millimetres", face=face, **rounded(figures | values, 1))


def accuracy(options: argparse.Namespace, model: Model) -> None:
    """Print the correlations with tracked people."""
    if options.corpus.is_dir():
        found = evaluate(model, Corpus.open(options.corpus), selection=Selection(options.split))
        audio_only = found["conditions"]["audio only"]["channels"]
        correlations = {name: row["acc"] for name, row in audio_only.items()}
        trained_on = model.about.get("split") in (options.split, "all")
        show(f"{options.split}, pooled", clips=found["clips"], seen_in_training=trained_on, **rounded(correlations))
    strangers(options, model)
    open_english(options, model)


def strong(curve: NDArray[np.floating[Any]]) -> float:
    """Return the strength of a curve."""
    return float(np.nanpercentile(curve, STRONG_PERCENTILE))


def shut_share(opening: NDArray[np.floating[Any]]) -> float:
    """Return the share of openings at which the mouth is shut."""
    return float(np.mean(opening[np.isfinite(opening)] < SHUT_OPENING))


def rounded(row: Mapping[str, object], digits: int = 3) -> dict[str, object]:
    """Return a row with its numbers rounded."""
    return {name: round(value, digits) if isinstance(value, float) else value for name, value in row.items()}


def show_mean(figure_name: str, rows: list[dict[str, float]]) -> None:
    """Print the means over recordings."""
    if rows:
        means = {name: float(np.nanmean([row[name] for row in rows])) for name in rows[0]}
        show(figure_name, recording="mean", recordings=len(rows), **rounded(means))


def show_worst(figure_name: str, rows: list[dict[str, Any]]) -> None:
    """Print the mean over recordings of each doubt, and the worst recording."""
    numbers = [{name: value for name, value in row.items() if isinstance(value, float)} for row in rows]
    show_mean(figure_name, numbers)
    if rows:
        worst = {name: max(rows, key=itemgetter(name)) for name in numbers[0]}
        show(
            figure_name,
            recording="worst",
            **{name: [row["recording"], round(row[name], 3)] for name, row in worst.items()},
        )


PARTS = {"strength": strength, "vowels": vowels, "pauses": pauses, "millimetres": millimetres, "accuracy": accuracy}

if __name__ == "__main__":
    main()
