"""How real refined mouths look: likeness, sharpness, flicker and speed, of recorded clips made from their eigenlips.

    python benchmarks/refinement.py CORPUS [--split val] [--clips 50] [--sweep] [--sheet FILE.png]

CORPUS is a prepared corpus with mouth pictures of one speaker. Eigenlips and candidates are learned on ``train``. The
clips of --split are projected onto the eigenlips, made again from those 90 numbers, and compared with the recorded
pictures. Prints one JSON object per case. --sweep also tries other options and choices of candidates (for ``val``);
--sheet writes pictures to look at: recorded, eigenlips, Eqs. 14-16, steady, nearest recorded mouth.
"""

from __future__ import annotations

import argparse
import json
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from picture_measures import picture_figures, sharpness

from lipmotion.corpora.store import Corpus
from lipmotion.motion.eigenlips import Eigenlips, fit_eigenlips
from lipmotion.pipeline.training.channels import PICTURES
from lipmotion.stats.pca import evenly_spaced
from lipmotion_faces.appearance.camera_noise import NoiseSource, estimate_noise
from lipmotion_faces.appearance.candidates import CANDIDATES, choose_candidates, make_candidates, squared_distances
from lipmotion_faces.appearance.refinement import PAPER, RefinementOptions, Refiner, moving_average

Pictures = NDArray[np.uint8]
Array = NDArray[Any]
Method = Callable[[Array], Pictures]
INNER = (slice(None), slice(16, 40), slice(16, 56))
"""The part of a picture in which lips and teeth are."""
SHEET_FRAMES = 9


def main() -> None:
    """Print the figures of each case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--clips", type=int, default=50)
    parser.add_argument("--sweep", action="store_true")
    parser.add_argument("--sheet", type=Path)
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    training = recorded(corpus, corpus.names("train"))
    held_out = recorded(corpus, corpus.names(options.split)[: options.clips])
    pictures = np.concatenate(training)
    space = fit_eigenlips(pictures[evenly_spaced(PICTURES, len(pictures))])
    known, wanted = space.project(pictures), [space.project(clip) for clip in held_out]
    show({"split": options.split, "clips": len(held_out), "frames": sum(map(len, held_out)), "pool": len(pictures)})

    start = time.process_time()
    chosen = choose_candidates(known, CANDIDATES)
    choice_s = time.process_time() - start
    choices = {
        "ours": chosen,
        "evenly spaced": evenly_spaced(CANDIDATES, len(pictures)),
        "random": np.random.default_rng(0).choice(len(pictures), CANDIDATES, replace=False),
    }
    for name, numbers in choices.items():
        show({"candidates": name, **coverage(np.concatenate(wanted), known[numbers])})
    candidates = make_candidates(space, pictures[chosen])
    packed = [len(zlib.compress(array.tobytes())) for array in (candidates.details, pictures[chosen])]
    sizes = {"details, deflated bytes": packed[0], "pictures, deflated bytes": packed[1]}
    show({"chosen": len(chosen), "undamaged": len(candidates), "choice, CPU s": round(choice_s, 1)} | sizes)
    noise = estimate_noise(training)
    show({"noise, grey levels": np.round(noise.deviation, 2).tolist(), "spread, px": noise.spread_px.round(2).tolist()})

    paper, steady = Refiner(space, candidates, PAPER), Refiner(space, candidates)
    source = NoiseSource(noise, space.size, 0)
    methods: dict[str, Method] = {
        "eigenlips alone": space.restore,
        "Eqs. 14-16": paper.refine,
        "one candidate for all colours": Refiner(space, candidates, RefinementOptions(steadiness=0.0)).refine,
        "steady, each colour its own": Refiner(space, candidates, RefinementOptions(together=False)).refine,
        "steady": steady.refine,
        "steady, noise": lambda values: source.add(steady.refine(values)),
        "nearest recorded mouth": lambda values: pictures[nearest(values, known)],
        "nearest candidate, whole": lambda values: pictures[chosen[nearest(values, known[chosen])]],
        "moving average, eigenlips alone": lambda values: space.restore(moving_average(values)),
        "moving average, Eqs. 14-16, noise (the paper)": lambda values: source.add(
            paper.refine(moving_average(values))
        ),
        "moving average, steady": lambda values: steady.refine(moving_average(values)),
        "moving average, steady, noise": lambda values: source.add(steady.refine(moving_average(values))),
    }
    if options.sweep:
        methods |= sweep(space, candidates, pictures, choices)
    for name, method in methods.items():
        show({"case": name} | figures(method, wanted, held_out))
    speed(steady, source, np.concatenate(wanted))
    if options.sheet:
        write_sheet(options.sheet, held_out, wanted, [space.restore, paper.refine, steady.refine])


def sweep(space: Eigenlips, candidates: Any, pictures: Pictures, choices: dict[str, Array]) -> dict[str, Method]:
    """Return the methods that were tried on ``val``."""
    tried: dict[str, Method] = {}
    for name in ("evenly spaced", "random"):
        tried[f"steady, candidates {name}"] = Refiner(space, make_candidates(space, pictures[choices[name]])).refine
    for steadiness in (0.1, 0.3, 0.5, 2.0, 4.0, 8.0):
        options = RefinementOptions(steadiness=steadiness)
        tried[f"steadiness {steadiness:g}"] = Refiner(space, candidates, options).refine
    for neighbours in (5, 10, 50):
        tried[f"{neighbours} neighbours"] = Refiner(space, candidates, RefinementOptions(neighbours=neighbours)).refine
    return tried


def recorded(corpus: Corpus, names: tuple[str, ...]) -> list[Pictures]:
    """Return the pictures of the frames that show a face, clip by clip."""
    tracks = [corpus.utterance(name).track for name in names]
    return [np.asarray(track.crops)[track.seen] for track in tracks if track.crops is not None]


def nearest(values: Array, known: Array) -> Array:
    """Return the nearest of the known mouths for each frame."""
    return squared_distances(values.astype(np.float32), known).argmin(axis=1)


def coverage(values: Array, candidates: Array) -> dict[str, int]:
    """Return distances to the nearest candidate in the space of eigenlips, grey levels."""
    distances = np.sqrt(squared_distances(values, candidates).min(axis=1))
    return {
        "mean": round(float(distances.mean())),
        "95th percentile": round(float(np.percentile(distances, 95))),
        "largest": round(float(distances.max())),
    }


def figures(method: Method, wanted: list[Array], held_out: list[Pictures]) -> dict[str, float]:
    """Return the means over all clips of PSNR, SSIM, and ratios to what the recorded pictures have."""
    rows = []
    for values, true in zip(wanted, held_out, strict=True):
        made = method(values)
        row = picture_figures(made, true)
        lips = float(sharpness(made[INNER]).mean() / sharpness(true[INNER]).mean())
        rows.append(
            {
                "PSNR, dB": row["psnr_db"],
                "SSIM": row["ssim"],
                "sharpness": row["sharpness"],
                "of the lips": lips,
                "colour edges": row["colour_edges"],
                "flicker": row["flicker"],
            }
        )
    return {key: round(float(np.mean([row[key] for row in rows])), 3) for key in rows[0]}


def speed(refiner: Refiner, source: NoiseSource, values: Array) -> None:
    """Print frames a second of each step, by CPU time and by the clock: medians of nine runs, after a first one."""
    chosen = refiner.choose(values[:2])
    source.add(refiner.pictures(values[:2], chosen))
    for name, clock in (("CPU", time.process_time), ("wall", time.perf_counter)):
        seconds = np.empty((9, 3))
        for row in seconds:
            marks = [clock()]
            chosen = refiner.choose(values)
            marks.append(clock())
            pictures = refiner.pictures(values, chosen)
            marks.append(clock())
            source.add(pictures)
            marks.append(clock())
            row[:] = np.diff(marks)
        middle = np.median(seconds, axis=0)
        rates = dict(zip(("choice", "pictures", "noise"), (len(values) / middle).round().tolist(), strict=True))
        show({f"frames a second, {name} time": rates | {"all": round(len(values) / float(middle.sum()))}})


def write_sheet(path: Path, held_out: list[Pictures], wanted: list[Array], methods: list[Method]) -> None:
    """Write frames of four clips: recorded, and below it what each method makes of it."""
    from PIL import Image

    rows = []
    for number in np.linspace(0, len(held_out) - 1, 4).astype(int):
        frames = np.linspace(8, len(held_out[number]) - 10, SHEET_FRAMES).astype(int)
        clips = [held_out[number], *(method(wanted[number]) for method in methods)]
        rows += [np.concatenate(list(clip[frames]), axis=1) for clip in clips]
    Image.fromarray(np.concatenate(rows)).save(path)


def show(row: dict[str, Any]) -> None:
    """Print one result."""
    print(json.dumps(row, ensure_ascii=False), flush=True)


if __name__ == "__main__":
    main()
