"""Unit selection: joins, pruning, sentences of the inventory, overlaps, and speed.

    python benchmarks/selection.py --corpus build/grid-s1 --model build/selection-train.lipmotion [--split val]
        [--only options|joins|pruning|inventory|overlaps|speed]

options   : correlation of opening, width and outer, nRMSE, global-variance ratio for other settings, with transcripts
joins     : change of the velocity of the opening over 80 ms at joins, beside that of the recordings in all speech,
            as in ``lipmotion experiment minnis2000``
pruning   : the least cost with and without pruning, and with all units of a phone as candidates
inventory : sentences that the model was trained on: share of their phones that come from their own recording
overlaps  : the forward share of a shared phone that joins best, for each pair of classes, learned on one half of the
            recordings of the model and judged on the other
speed     : selection and concatenation of 60 s, warm, median of five; --model of all clips
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
from anyone import compared
from numpy.typing import NDArray

from lipmotion import Corpus, load_model
from lipmotion.engines.selection.concatenation import concatenated, pieces_of
from lipmotion.engines.selection.config import SelectionConfig
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.lip_reading import INVISIBLE, NORMAL, PROTECTED, TABLE_1, lip_reading_class
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.search import select
from lipmotion.engines.selection.selection_training import target_of
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.understand.understood_speech import understand
from lipmotion.types import Features, Speech, Timeline, Utterance
from lipmotion.units import PHONES
from lipmotion_lab.minnis_breen2000.minnis2000 import join_figures

Array = NDArray[np.float64]
OPTIONS: dict[str, dict[str, Any]] = {
    "as it is": {},
    "no guide": {"guide": 0.0},
    "learned overlaps": {"overlap": "learned"},
    "symmetric": {"overlap": "symmetric"},
    "middle": {"overlap": "middle"},
    "nothing invisible": {"invisible": ""},
    "l invisible": {"invisible": "t d g k l"},
    "window 3": {"window": 3},
    "window 7": {"window": 7},
    "beam 30": {"beam": 30},
    "beam 120": {"beam": 120},
    "hard 0.5": {"hard": 0.5},
    "guide 10": {"guide": 10.0},
    "guide 40": {"guide": 40.0},
    "join 0.05": {"join": 0.05},
    "join 0.2": {"join": 0.2},
    "no stress, words": {"stress": 0.0, "word": 0.0},
    "protected 0": {"protected": 0.0},
    "no trust": {"trust": 0.0},
}
SHARES = tuple(n / 20 for n in range(2, 19))
CLASSES = (PROTECTED, INVISIBLE, NORMAL)


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpus", type=Path, default=Path("build/grid-s1"))
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--split", default="val")
    parser.add_argument("--only", action="append", choices=list(PARTS), help="repeatable; default: all")
    options = parser.parse_args()
    model, corpus = load_model(options.model), Corpus.open(options.corpus)
    utterances = [corpus.utterance(name) for name in corpus.names(options.split)]
    speech = [understand(model, Request(u.audio, transcript=" ".join(u.words or ()))) for u in utterances]
    for name in options.only or PARTS:
        for figure in PARTS[name](model, corpus, list(zip(utterances, speech, strict=True))):
            print(json.dumps({"part": name, **figure}), flush=True)


Spoken = list[tuple[Utterance, Speech]]


def other_settings(model: Model, _: Corpus, spoken: Spoken) -> Iterator[dict[str, Any]]:
    """Yield the figures of each of ``OPTIONS``; closures are not forced."""
    for name, changes in OPTIONS.items():
        engine = SelectionEngine(replace(model.engine.config, closures=False, **changes))
        pairs = [compared(engine.generate(model.learned, speech).motion, u.track) for u, speech in spoken]
        made, recorded = (np.concatenate(side) for side in zip(*pairs, strict=True))
        error = np.sqrt(np.square(made - recorded).mean(axis=0)) / recorded.std(axis=0)
        ratio = np.mean([a.std(axis=0) for a, _ in pairs], axis=0) / np.mean([b.std(axis=0) for _, b in pairs], axis=0)
        accuracy = [float(np.corrcoef(made[:, n], recorded[:, n])[0, 1]) for n in range(3)]
        yield {
            "setting": name,
            "acc": [round(each, 3) for each in accuracy],
            "nrmse": round(float(error[0]), 3),
            "variance": [round(float(each), 3) for each in ratio],
        }


def joins(model: Model, _: Corpus, spoken: Spoken) -> Iterator[dict[str, Any]]:
    """Yield the percentiles of velocity changes at joins, and of the recordings."""
    utterances, speech = zip(*spoken, strict=True)
    yield join_figures(model.engine, model.learned, speech, utterances)


def pruning(model: Model, _: Corpus, spoken: Spoken) -> Iterator[dict[str, Any]]:
    """Yield how often and by how much leaving out candidates changes the result."""
    learned: SelectionModel = model.learned
    config: SelectionConfig = model.engine.config
    count = len(learned.inventory.windows)
    everything = learned.costs(replace(config, candidates=count, beam=count))
    every_target = [target_of(learned, everything, speech) for _, speech in spoken]
    best = [select(everything, target, prune=False) for target in every_target]
    pruned = [select(everything, target) for target in every_target]
    yield {
        "candidates": "all",
        "pruned": "cost differs at most by",
        "value": float(max(abs(a.cost - b.cost) for a, b in zip(best, pruned, strict=True))),
    }
    for count in (10, 25, 50, 100, 200):
        costs = learned.costs(replace(config, beam=count))
        found = [select(costs, target_of(learned, costs, speech)) for _, speech in spoken]
        yield {
            "beam": count,
            "cost by that of all": round(sum(s.cost for s in found) / sum(s.cost for s in best), 4),
            "sentences with the same units": sum(
                bool(np.array_equal(a.units, b.units)) for a, b in zip(found, best, strict=True)
            ),
            "of": len(best),
        }


def inventory(model: Model, corpus: Corpus, _: Spoken) -> Iterator[dict[str, Any]]:
    """Yield how recorded sentences come back."""
    learned: SelectionModel = model.learned
    names = learned.inventory.names[:: max(len(learned.inventory.names) // 40, 1)]
    engine = model.engine.without_closures()
    own, errors = [], []
    for name in names:
        utterance = corpus.utterance(name)
        speech = understand(model, Request(utterance.audio, transcript=" ".join(utterance.words or ())))
        result = engine.generate(learned, speech)
        inside = [span for span in result.units if span.label.phone not in ("sil", "sp")]
        own += [span.label.unit.split(" ")[0] == name for span in inside]
        made, recorded = compared(result.motion, utterance.track)
        start, stop = (int(each * 25) for each in (inside[0].start_s, inside[-1].end_s))
        errors.append(np.abs(made - recorded)[start:stop, 0])
    yield {
        "sentences": len(names),
        "phones from their own recording": round(float(np.mean(own)), 4),
        "error of the opening, percentiles 50 99": np.percentile(np.concatenate(errors), [50, 99]).round(4).tolist(),
    }


def overlaps(model: Model, _: Corpus, __: Spoken) -> Iterator[dict[str, Any]]:
    """Yield the forward share of least error for each pair of classes, and its error on the other half."""
    learned: SelectionModel = model.learned
    costs = learned.costs(model.engine.config)
    stored, windows = learned.inventory, learned.inventory.windows
    rng = np.random.default_rng(0)
    continues, usable = windows.continues, stored.usable
    middles = np.flatnonzero(continues[:-1] & np.roll(continues, 1)[:-1] & usable[:-1])
    symbols = costs.index.contexts[:, costs.config.window // 2]
    errors: dict[tuple[str, str], list[tuple[int, Array]]] = {pair: [] for pair in product(CLASSES, CLASSES)}
    for unit in rng.permutation(middles)[:4000].tolist():
        phones = [PHONES[windows.phones[unit + offset]] for offset in (-1, 0, 1)]
        if "sil" in phones or "sp" in phones:
            continue
        others = middles[(symbols[middles] == symbols[unit]) & (windows.recording[middles] != windows.recording[unit])]
        left = others[symbols[others - 1] == symbols[unit - 1]]
        right = others[symbols[others + 1] == symbols[unit + 1]]
        if not len(left) or not len(right):
            continue
        pair = (
            lip_reading_class(phones[0], costs.config.invisible_phones),
            lip_reading_class(phones[2], costs.config.invisible_phones),
        )
        a, b = int(rng.choice(left)), int(rng.choice(right))
        errors[pair].append((int(windows.recording[unit] % 2), join_errors(learned, unit, a, b)))
    for pair, each in errors.items():
        halves = [np.array([row for half, row in each if half == wanted]) for wanted in (0, 1)]
        if min(len(half) for half in halves) < 20:
            continue
        means = [half.mean(axis=0) for half in halves]
        best = int(means[0].argmin())
        printed = int(np.argmin(np.abs(np.array(SHARES) - TABLE_1[pair])))
        yield {
            "before, after": pair,
            "triples": len(each),
            "printed share": TABLE_1[pair],
            "learned share": SHARES[best],
            "error on the other half, learned / printed / middle": [
                round(float(np.sqrt(means[1][n])), 4) for n in (best, printed, SHARES.index(0.5))
            ],
        }


def join_errors(learned: SelectionModel, unit: int, left: int, right: int) -> Array:
    """Return the mean squared error of motion joined at each of ``SHARES`` of a shared phone [shape=(SHARES,)].

    unit : the phone as it was recorded between its neighbours; left, right: the same phone after the one before, and
           before the one after it, in other recordings
    """
    stored = learned.inventory
    fractions = np.linspace(0, 1, 21)
    truth, one, two = (
        np.stack([stored.poses(np.array([each]), fraction)[0] for fraction in fractions])
        for each in (unit, left, right)
    )
    rows = []
    for share in SHARES:
        phase = np.clip((fractions - share) / min(share, 1 - share), -1, 1)
        weight = ((1 + np.sin(phase * np.pi / 2)) / 2)[:, None]
        rows.append(np.square(((1 - weight) * one + weight * two - truth) * learned.scale).sum(axis=1).mean())
    return np.array(rows)


def speed(model: Model, _: Corpus, spoken: Spoken) -> Iterator[dict[str, Any]]:
    """Yield the seconds for 60 s of speech."""
    learned: SelectionModel = model.learned
    long = minute(spoken)
    costs = learned.costs(model.engine.config)
    times = []
    for _ in range(6):
        start = time.perf_counter()
        target = target_of(learned, costs, long)
        guided = time.perf_counter()
        chosen = select(costs, target)
        searched = time.perf_counter()
        concatenated(learned.inventory, target, pieces_of(costs, target, chosen.units), len(long.features.values))
        times.append(np.diff([start, guided, searched, time.perf_counter()]))
    seconds = np.median(np.array(times)[1:], axis=0).round(3).tolist()
    yield {"units": int(learned.inventory.usable.sum()), "seconds: guide, selection, concatenation": seconds}
    start = time.perf_counter()
    model.engine.generate(learned, long)
    yield {"seconds, all of the engine": round(time.perf_counter() - start, 3)}


def minute(spoken: Spoken) -> Speech:
    """Return 60 s of speech: clips one after another."""
    values, spectra, spans, frames = [], [], [], 0
    for _, speech in spoken:
        spans += list(Timeline(speech.units.spans).shifted(frames / 100))
        values.append(np.asarray(speech.features.values))
        spectra.append(speech.spectrum)
        frames += len(values[-1])
        if frames > 6000:
            break
    edges = [replace(one, end_s=min(one.end_s, two.start_s)) for one, two in pairwise(spans)]
    features = Features(np.concatenate(values), (frames - 1) / 100)
    spectrum = np.concatenate([each for each in spectra if each is not None]) if spectra[0] is not None else None
    return Speech(features, Timeline((*edges, spans[-1])), spectrum=spectrum)


PARTS = {
    "options": other_settings,
    "joins": joins,
    "pruning": pruning,
    "inventory": inventory,
    "overlaps": overlaps,
    "speed": speed,
}

if __name__ == "__main__":
    main()
