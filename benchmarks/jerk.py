"""Jerk: what brings back the fast movement that is missing in generated motion, and what it costs in correlation.

    python benchmarks/jerk.py CORPUS MODEL [MODEL ...] [--split val] [--clips 120] [-o FILE.json]
                              [--strangers FOLDER [--only NAME ...] [--tracks FOLDER]]

Audio only. The filter and the ratios of the global variance are learned from ``--clips`` clips of ``train``; every
method has a strength, so that each is a curve of correlation against jerk. Methods:

as generated    : variance scaling and parameter generation
sharpening      : once more what a Gaussian of 40 ms takes away, deviation restored
dynamic means   : the means of Δ and Δ² times a factor
variance of Δ²  : the likelihood of the global variance of Δ² inside the generation (Toda & Tokuda 2007), at
                  a large weight: the most probable curve with that variance, utterance by utterance; no closures
spectrum        : the modulation filter towards the recorded spectrum, the tracker's noise included
filter          : the modulation filter as it is in the package, freed of that noise; of models that have one, theirs
by voice        : the same, weaker for voices that training does not know, as it is in the package

``jerk`` is against the reference as tracked; ``freed`` against its jerk without the share of its power that it has in
silence, more than 0.3 s away from speech. ``--strangers``: videos of other people, mean ACC per clip, best lag within
60 ms; closings against a tenth of the 95th percentile of each one's opening.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from anyone import best_lag
from kept_tracks import kept_track
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded
from scipy.ndimage import gaussian_filter1d

from lipmotion import Corpus, load_model
from lipmotion.kernels.sequences.banded import normal_equations
from lipmotion.measures import closures, curves
from lipmotion.measures.curves import modulation_distance_db
from lipmotion.motion import generation
from lipmotion.motion.modulation_filter import (
    RESTING_MARGIN_S,
    ModulationFilter,
    fit_modulation_filter,
)
from lipmotion.motion.resample import to_model_frames
from lipmotion.motion.rest import away_from_speech, runs, speech_intervals
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.training.train import phones_of
from lipmotion.pipeline.understand.understood_speech import understand
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.types import Audio, Motion, Timeline, Track, Unit
from lipmotion.types.motion import between_frames
from lipmotion.units import VISEMES, Lexicon

Array = NDArray[np.float64]
RATE_HZ = 100.0
DISTANCES = ("opening", "width", "outer")
STRENGTHS = (0.5, 0.75, 1.0, 1.25)
LARGER = (*STRENGTHS, 1.5, 1.75, 2.0)
"""Strengths of the filter."""


@dataclass(frozen=True, eq=False)
class Clip:
    """What parameter generation was given for one clip, and what was recorded, in the motion space.

    means, precisions : scaled [each shape=(T, 3, Q)]
    ranges            : the frames of each p, b and m
    original          : at the camera's rate [shape=(N, Q)]
    """

    motion: generation.LearnedMotion
    means: Array
    precisions: Array
    ranges: Sequence[slice]
    original: Array
    seen: NDArray[np.bool_]
    rate_hz: float
    reference: Timeline[Unit]
    voice: float

    @property
    def time_s(self) -> Array:
        """Time of each frame of the camera in which the face was measured."""
        return (np.arange(len(self.original)) / self.rate_hz)[self.seen]

    def generated(self, modulation: ModulationFilter | None = None, dynamics: float = 1.0) -> Array:
        """Return generated motion at 100 Hz [shape=(T, Q)]."""
        means = self.means * np.array([1.0, dynamics, dynamics])[:, None]
        result = generation._generated(self.motion.closure, (means, self.precisions), {}, self.ranges, modulation)
        return result[0]

    def by_voice(self, modulation: ModulationFilter) -> Array:
        """Return generated motion as the package filters it, for what training knows of the voice."""
        return self.generated(replace(self.motion, modulation=modulation).for_voice(self.voice).modulation)

    def as_recorded(self, values: Array) -> Array:
        """Return motion at 100 Hz in the measured frames of the camera, the mouth open or closed."""
        found = between_frames(values, RATE_HZ, self.time_s)
        found[:, 0] = np.maximum(found[:, 0], 0)
        return found


Method = Callable[[Clip], Array]


@contextmanager
def spied(seen: dict[str, Any]) -> Iterator[None]:
    """Keep what each generation of a model is given."""
    plain = generation.LearnedMotion._generated

    def spy(self: Any, statistics: Any, frames: int, ranges: Any, pins: Any, scaling: Any) -> Any:
        given = statistics(slice(0, frames))
        seen.update(motion=self, ranges=ranges, statistics=scaling.apply(*given) if scaling is not None else given)
        return plain(self, statistics, frames, ranges, pins, scaling)

    with mock.patch.object(generation.LearnedMotion, "_generated", spy):
        yield


def clips_of(model: Model, corpus: Corpus, names: Sequence[str]) -> list[Clip]:
    """Return clips, understood audio only."""
    phones = cached_recogniser(model.phones, "auto", model.adaptation)
    utterances = [corpus.utterance(name) for name in names]
    return [clip_of(model, each.audio, each.track, phones_of(each, phones, Lexicon())) for each in utterances]


def clip_of(model: Model, recording: Audio | Path, track: Track, reference: Timeline[Unit] | None = None) -> Clip:
    """Return one clip, understood audio only; without given phones, with those that were recognised."""
    given: dict[str, Any] = {}
    speech = understand(model, Request(recording))
    with spied(given):
        model.engine.generate(model.learned, speech)
    original = given["motion"].space.reduce(np.asarray(track.motion.values, float))
    units = reference if reference is not None else speech.units
    camera = track.seen, track.motion.rate_hz
    return Clip(given["motion"], *given["statistics"], given["ranges"], original, *camera, units, speech.voice)


def resting(clips: Sequence[Clip], rate_hz: float) -> list[Array]:
    """Return recorded motion in silence away from speech, at the camera's rate or at 100 Hz."""
    found = []
    for clip in clips:
        values, valid = clip.original, clip.seen
        if rate_hz != clip.rate_hz:
            values, valid = to_model_frames(clip.original, clip.seen, clip.rate_hz, len(clip.means), rate_hz)
        far = away_from_speech(np.arange(len(values)) / rate_hz, speech_intervals(clip.reference), RESTING_MARGIN_S)
        found += [values[start:stop] for start, stop in runs(far & valid)]
    return found


def own_filter(model: Model) -> ModulationFilter | None:
    """Return the filter that a model has learned, at strength 1; None: it has none."""
    strength, modulation = getattr(model.engine.config, "modulation_filter", 0), model.learned.motion.modulation
    return modulation.of_strength(1 / strength) if strength and modulation is not None else None


def learned_filters(clips: Sequence[Clip]) -> dict[str, ModulationFilter]:
    """Return the filter with and without the tracker's noise in the spectrum that is aimed at."""
    recorded, generated = [], []
    for clip in clips:
        values, valid = to_model_frames(clip.original, clip.seen, clip.rate_hz, len(clip.means), RATE_HZ)
        recorded.append(values[valid])
        generated.append(clip.generated()[valid])
    return {
        "spectrum": fit_modulation_filter(recorded, generated),
        "filter": fit_modulation_filter(recorded, generated, resting(clips, RATE_HZ)),
    }


def sharpened(clip: Clip, strength: float) -> Array:
    """Return plain sharpening."""
    values = clip.generated()
    more = values + strength * (values - gaussian_filter1d(values, 4.0, axis=0, mode="nearest"))
    middle = values.mean(axis=0)
    return middle + (more - more.mean(axis=0)) * values.std(axis=0) / np.maximum(more.std(axis=0), 1e-9)


def with_variance(clip: Clip, ratios: Array) -> Array:
    """Return the most probable curves whose deviation of Δ² is larger by given ratios [shape=(Q,)].

    They solve (W'PW - λ D'D) x = W'P m, with D the second difference.
    """
    main, first, second, right = normal_equations(clip.means, clip.precisions)
    frames = len(main)
    square = np.zeros((3, frames))
    for weight, row in ((1.0, 0), (-2.0, 1), (1.0, 2)):
        square[2, row : row + frames - 2] += weight * weight
    square[1, 1 : frames - 1] -= 2
    square[1, 2:] -= 2
    square[0, 2:] += 1
    values = np.empty_like(main)
    for column, ratio in enumerate(ratios):
        bands = np.zeros((3, frames))
        bands[2], bands[1, 1:], bands[0, 2:] = main[:, column], first[:-1, column], second[:-2, column]
        best = solveh_banded(bands, right[:, column])
        wanted, low, high = ratio * np.diff(best, 2).std(), 0.0, float(np.median(bands[2]))
        for _ in range(30):
            middle = (low + high) / 2
            try:
                curve = solveh_banded(bands - middle * square, right[:, column])
            except LinAlgError:
                high = middle
                continue
            if np.diff(curve, 2).std() > wanted:
                high = middle
            else:
                low, best = middle, curve
        values[:, column] = best
    return values


def methods(clips: Sequence[Clip], own: ModulationFilter | None) -> dict[str, Method]:
    """Return all methods by name, with what they learn from training clips; the filter is the model's own, if any."""
    filters = learned_filters(clips)
    filters["filter"] = own or filters["filter"]
    deviations = []
    for clip in clips:
        recorded, valid = to_model_frames(clip.original, clip.seen, clip.rate_hz, len(clip.means), RATE_HZ)
        deviations.append([np.diff(each[valid], 2, axis=0).std(axis=0) for each in (recorded, clip.generated())])
    recorded, generated = np.mean(deviations, axis=0)
    ratios = recorded / np.maximum(generated, 1e-12)
    found: dict[str, Method] = {"as generated": lambda clip: clip.generated()}
    for strength in STRENGTHS:
        found[f"sharpening {strength}"] = lambda clip, s=strength: sharpened(clip, s)  # type: ignore[misc]
    for factor in (1.2, 1.5, 2.0):
        found[f"dynamic means {factor}"] = lambda clip, f=factor: clip.generated(dynamics=f)  # type: ignore[misc]
    for strength in STRENGTHS:
        wanted = 1 + strength * (np.maximum(ratios, 1) - 1)
        found[f"variance of Δ² {strength}"] = lambda clip, w=wanted: with_variance(clip, w)  # type: ignore[misc]
    for name, modulation in filters.items():
        for strength in LARGER:
            part = modulation.of_strength(strength)
            found[f"{name} {strength}"] = lambda clip, p=part: clip.generated(p)  # type: ignore[misc]
    for strength in LARGER:
        part = filters["filter"].of_strength(strength)
        found[f"by voice {strength}"] = lambda clip, p=part: clip.by_voice(p)  # type: ignore[misc]
    return found


def figures(clips: Sequence[Clip], made: Sequence[Array], threshold: float, noise: Array) -> dict[str, Any]:
    """Return the figures of one method; ``noise``: share of the power of the reference's jerk."""
    generated = [clip.as_recorded(values)[:, :3] for clip, values in zip(clips, made, strict=True)]
    original = [clip.original[clip.seen][:, :3] for clip in clips]
    rate_hz, jerk = clips[0].rate_hz, curves.jerk_ratio(generated, original)
    openings = [[side[:, 0] for side in sides] for sides in (generated, original)]
    closing = VISEMES["bi"]
    spans = [[(s.start_s, s.end_s) for s in clip.reference if s.label.phone in closing] for clip in clips]
    quiet = [
        clip[:, 0][away_from_speech(c.time_s, speech_intervals(c.reference), RESTING_MARGIN_S)]
        for clip, c in zip(generated, clips, strict=True)
    ]
    speech = (s for clip in clips for s in clip.reference if s.label.phone not in (*closing, *VISEMES["sip"]))
    other_s = sum(s.duration_s for s in speech)
    return {
        "acc": curves.pooled_correlation(generated, original).tolist(),
        "jerk": jerk.tolist(),
        "freed": (jerk / np.sqrt(1 - noise)).tolist(),
        "variance": curves.global_variance_ratio(generated, original).tolist(),
        "nrmse": curves.normalised_rmse(generated, original).tolist(),
        "modulation_db": modulation_distance_db(generated, original, rate_hz).tolist(),
        "closures": asdict(closures.closure_figures(*openings, threshold, rate_hz)),
        "p_b_m": asdict(closures.phone_closures(*openings, spans, other_s, threshold, rate_hz)),
        "silence": [float(np.concatenate(quiet).mean()), float(np.concatenate(quiet).std())],
    }


def line(name: str, row: dict[str, Any], first: dict[str, Any]) -> str:
    """Return one row as text."""
    lost = np.subtract(row["acc"], first["acc"])
    parts = [f"{name:22}", "ACC " + " ".join(f"{value:.3f}" for value in row["acc"])]
    parts += [f"lost {lost.mean():+.4f} (" + " ".join(f"{value:+.4f}" for value in lost) + ")"]
    parts += [
        f"{key} " + " ".join(f"{value:.2f}" for value in row[key])
        for key in ("jerk", "freed", "variance", "modulation_db")
    ]
    parts += [f"F1 {row['closures']['f1']:.3f} pbm {row['p_b_m']['recall']:.3f} rest ±{row['silence'][1]:.4f}"]
    return "  ".join(parts)


def of_strangers(model: Model, paths: Sequence[Path], kept: Path | None, found: dict[str, Method]) -> dict[str, Any]:
    """Print and return the figures of all methods on videos of people whom the model does not know.

    kept : folder of their tracks, as of ``kept_tracks.py``; None: they are tracked
    """
    tracks = [kept_track(path, kept) for path in paths]
    clips = [clip_of(model, path, each) for path, each in zip(paths, tracks, strict=True)]
    originals = [clip.original[clip.seen][:, :3] for clip in clips]
    result: dict[str, Any] = {"voices": [clip.voice for clip in clips]}
    for name, method in found.items():
        made = [method(clip) for clip in clips]
        channels = clips[0].motion.space.channels[:3]
        motions = [Motion(np.maximum(values[:, :3], (0, -1, -1)), RATE_HZ, channels) for values in made]
        lags = [best_lag(motion, each, 0.06) for motion, each in zip(motions, tracks, strict=True)]
        generated = [clip.as_recorded(values)[:, :3] for clip, values in zip(clips, made, strict=True)]
        pairs = zip(generated, originals, clips, strict=True)
        f1 = [
            closures.closure_figures([g[:, 0]], [o[:, 0]], closures.closed_threshold([o[:, 0]]), clip.rate_hz).f1
            for g, o, clip in pairs
        ]
        result[name] = {
            "acc": np.mean([[lag[channel] for channel in DISTANCES] for lag in lags], axis=0).tolist(),
            "jerk": curves.jerk_ratio(generated, originals).tolist(),
            "f1": float(np.nanmean(f1)),
        }
        print(f"strangers {name:22}", *(f"{key} {np.round(value, 3)}" for key, value in result[name].items()))
    return result


def experiment(
    model: Model, corpus: Corpus, split: str, count: int, strangers: Sequence[Path], kept: Path | None
) -> dict[str, Any]:
    """Print and return the figures of all methods with one model."""
    names = list(corpus.names("train"))
    training = clips_of(model, corpus, names[:: max(len(names) // count, 1)][:count])
    clips = clips_of(model, corpus, list(corpus.names(split)))
    direct = training[0].motion.space.direct_names
    if direct[:3] != DISTANCES:
        raise SystemExit(f"the model has {', '.join(direct[:3])}, required {', '.join(DISTANCES)} first")
    threshold = closures.closed_threshold([clip.original[clip.seen][:, 0] for clip in training])
    quiet = np.concatenate([np.diff(x, 3, axis=0) for x in resting([*training, *clips], clips[0].rate_hz)])
    whole = np.concatenate([np.diff(clip.original[clip.seen], 3, axis=0) for clip in [*training, *clips]])
    noise = (np.square(quiet).mean(axis=0) / np.square(whole).mean(axis=0))[:3]
    print(f"tracker's noise, share of the power of jerk: {noise.round(3)}")
    result: dict[str, Any] = {"noise": noise.tolist()}
    found = methods(training, own_filter(model))
    for name, method in found.items():
        result[name] = figures(clips, [method(clip) for clip in clips], threshold, noise)
        print(line(name, result[name], result["as generated"]), flush=True)
    return result | ({"strangers": of_strangers(model, strangers, kept, found)} if strangers else {})


def main() -> None:
    """Print a row for each method and strength, model by model."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path, help="prepared, of the training speaker")
    parser.add_argument("models", type=Path, nargs="+", help="trained on its list train, of any engine")
    parser.add_argument("--split", default="val")
    parser.add_argument("--clips", type=int, default=120, help="training clips from which methods learn (default: 120)")
    parser.add_argument("--strangers", type=Path, help="folder of videos of other people (.mpg, .mp4)")
    parser.add_argument("--only", nargs="+", help="names of those of them that are used (default: all)")
    parser.add_argument("--tracks", type=Path, help="folder of their kept tracks (default: they are tracked)")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    corpus, results = Corpus.open(options.corpus), {}
    found = sorted(options.strangers.glob("*.mp[g4]")) if options.strangers else []
    strangers = [path for path in found if not options.only or path.stem in options.only]
    for path in options.models:
        print(f"{path.name}, {options.split}")
        results[path.name] = experiment(
            load_model(path), corpus, options.split, options.clips, strangers, options.tracks
        )
    if options.output:
        options.output.write_text(json.dumps({"split": options.split, "models": results}, indent=1) + "\n")


if __name__ == "__main__":
    main()
