"""Hofer 2008, Table 1, by the system of the paper, on any corpus: which unit set predicts closings best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.corpora import Corpus
from lipmotion.engines.joint.engine import JointEngine, JointEngineConfig, JointModel
from lipmotion.errors import InputError
from lipmotion.hmm.multistream.densities import MOTION, SPEECH
from lipmotion.kernels.compiler import limit_threads
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.json_text import replace_nan
from lipmotion.types import Example, Monitor, sub_monitor
from lipmotion.units import UNIT_SETS
from lipmotion_lab import runner
from lipmotion_lab.evaluation import evaluate, held_out
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, OPENING, ComparedClip, HeldOutRecordings

PAPER_SCORES: dict[str, float] = {"eVis": 68.8, "pbVis": 67.7, "sVis": 67.4, "2vis": 66.5, "phone": 65.2}
"""Closure scores of Table 1, the best first."""
REFERENCE_SET = "phone"
PRESET = "hofer2008"
PINS = {"as printed": False, "lips made to meet on p b m": True}
"""Whether motion is generated with pins in p, b and m, by the name of the block of the table."""
TWICE_DOUBLED = 4
"""Training stops at so many times the Gaussians of the best model: two doublings have not helped."""
_ACC, _COUNTS = "table1/acc", "table1/gaussians"


@dataclass(frozen=True)
class PhoneticTableOptions:
    """What is trained.

    states   : numbers of states a unit; the paper does not print its own
    mixtures, motion_mixtures : numbers of Gaussians for speech, and then for motion, of which one is chosen on ``val``
    channels : channels of motion that are modelled, as ``opening width``: the two features of the paper; empty: all
    """

    states: Sequence[int] = (5,)
    mixtures: Sequence[int] = (1, 2, 4, 8, 16, 32, 64)
    motion_mixtures: Sequence[int] = (1, 2, 4, 8)
    channels: str = ""


FULL, QUICK = PhoneticTableOptions(), PhoneticTableOptions(mixtures=(1, 2), motion_mixtures=(1, 2))


ValidationAcc = Mapping[tuple[int, int], float]  # the ACC on ``val`` by the Gaussians a state: for speech, for motion


@limit_threads()
def run_hofer2008(
    corpus: Corpus,
    options: PhoneticTableOptions = FULL,
    *,
    split: str | None = "test",
    work: Path | None = None,
    settings: runner.ExperimentSettings = runner.DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Train the system of the paper on ``train`` with each unit set; return figures of each model on ``split``.

    Every system recognises its own units (``audio only``), or aligns those of given words itself (``with transcript``),
    each with and without pins in p, b and m. Intervals are 95 % bootstrap intervals over clips; those of differences
    are of the same draws of clips.
    Raises CorpusError: no utterances to train on, to choose with, or of this split, or motion without an opening.
    Source: Hofer 2008, §6 and Table 1.
    """
    runner.check_opening(corpus, compared := corpus.required(split))  # before the long work
    validation, names = corpus.required("val"), tuple(sorted(corpus.required("train")))
    preset = JointEngineConfig(**{**JointEngineConfig.presets[PRESET], "channels": options.channels})
    key = runner.PartKey(JointEngine(preset), (*names, *validation, *compared))
    checkpoint, utterances = runner.open_parts(work, corpus, settings, key), [corpus.utterance(name) for name in names]
    phones, examples = runner.train_phones(utterances, settings.narrow(0, 0.1), checkpoint)
    read = partial(runner.recognise_held_out, corpus, phones, channels=(OPENING,))
    choosing = read(names=validation, settings=settings.narrow(0.1, 0.12))
    recordings = read(names=compared, settings=settings.narrow(0.12, 0.15))
    cells = [(states, units) for states in options.states for units in PAPER_SCORES]
    made: dict[tuple[int, str, str], dict[str, tuple[ValidationAcc, Sequence[ComparedClip]]]] = {
        case: {} for case in product(options.states, recordings.conditions, PINS)
    }
    parts = runner.share_out(settings, [f"{units}, {states} states" for states, units in cells], 0.15)
    for (states, units), part in zip(cells, parts, strict=True):
        engine = JointEngine(replace(preset, units=units, states=states))
        model, acc = _train_system(engine, options, examples, choosing, checkpoint, part.monitor)
        for condition in recordings.conditions:
            speech = held_out.make_speech(recordings, condition, engine, model)
            for pins, closures in PINS.items():
                pinned = JointEngine(replace(engine.config, closures=closures))
                clips = held_out.generate_compared(recordings, speech, pinned, model)
                made[states, condition, pins][units] = acc, clips
                if not closures:
                    settings.receive(f"{units}, {states} states", condition, recordings, clips)
    about = {"split": split or "all", "clips": len(recordings.utterances), "trained_on": len(examples)}
    about |= {"closed_under": recordings.closed_under, "mixtures": list(options.mixtures), "seed": settings.seed}
    about |= {"channels": options.channels, "motion_mixtures": list(options.motion_mixtures)}
    tables = [
        {"condition": condition, "pins": pins} | _make_table(recordings, rows, settings.seed) | {"states": states}
        for (states, condition, pins), rows in made.items()
    ]
    return replace_nan(about | {"tables": tables})


def _train_system(
    engine: JointEngine,
    options: PhoneticTableOptions,
    examples: Sequence[Example],
    choosing: HeldOutRecordings,
    checkpoint: Checkpoint,
    monitor: Monitor,
) -> tuple[JointModel, ValidationAcc]:
    """Return a system with the numbers of Gaussians of the highest ACC: for speech, and with that number for motion.

    A number is doubled until twice in a row that does not help. Raises InputError: training ends before any number.
    """
    config, tried, arrays = engine.config, dict[tuple[int, int], float](), dict[str, Any]()

    def try_numbers(monitor: Monitor, **limits: Any) -> None:
        for model in JointEngine(replace(config, **limits)).growing_models(examples, monitor):
            sizes = (model.hmm.models[stream].tied.mixtures.size[1] for stream in (SPEECH, MOTION))
            speech, motion = (1 << (size - 1).bit_length() for size in sizes)  # where data is short, not all are split
            if (speech, motion) in tried or speech not in options.mixtures or motion not in options.motion_mixtures:
                continue
            clips = held_out.generate_clips(choosing, AUDIO_ONLY, engine, model)
            tried[speech, motion] = evaluate.sum_correlations(*evaluate.pair_curves(choosing, clips)).value
            if _find_best_count(tried) == (speech, motion):
                arrays.update(engine.to_arrays(model))
            if speech * motion >= TWICE_DOUBLED * np.prod(_find_best_count(tried)):
                return

    stage = f"{config.units}-{config.states}-{options.mixtures}-{options.motion_mixtures}"
    if (stored := checkpoint.load(stage)) is None:
        try_numbers(sub_monitor(monitor, 0, 0.6), mixtures=max(options.mixtures))
        if not tried:
            raise InputError(f"no state has data for {min(options.mixtures)} Gaussians; compare also fewer, from 1")
        if max(options.motion_mixtures) > 1:
            limits = {"mixtures": _find_best_count(tried)[0], "motion_mixtures": max(options.motion_mixtures)}
            try_numbers(sub_monitor(monitor, 0.6, 1), **limits)
        stored = arrays | {_COUNTS: np.array(list(tried)), _ACC: np.array(list(tried.values()))}
        checkpoint.save(stage, stored)
    acc = dict(zip(map(tuple, stored[_COUNTS].tolist()), stored[_ACC].tolist(), strict=True))
    return engine.from_arrays({name: array for name, array in stored.items() if name not in (_ACC, _COUNTS)}), acc


def _find_best_count(acc: ValidationAcc) -> tuple[int, int]:
    """Return the numbers of Gaussians with the highest correlation; among equals the smallest."""
    return max(acc, key=lambda counts: (acc[counts], -counts[0], -counts[1]))


def _make_table(
    recordings: HeldOutRecordings, made: Mapping[str, tuple[ValidationAcc, Sequence[ComparedClip]]], seed: int
) -> dict[str, Any]:
    """Return the figures of all sets in one condition, and the intervals of the differences of every two of them."""
    openings = {units: evaluate.pair_curves(recordings, clips) for units, (_, clips) in made.items()}
    threshold = recordings.closed_under or 0.0
    scores = {units: evaluate.sum_closings(*pair, threshold) for units, pair in openings.items()}
    acc = {units: evaluate.sum_correlations(*pair) for units, pair in openings.items()}
    rows = {}
    for units, (on_val, clips) in made.items():
        figures = evaluate.measure_clips(clips, recordings, seed)
        rows[units] = runner.make_opening_row(figures) | {
            "units": UNIT_SETS[units].count,
            "paper": PAPER_SCORES[units],
            **dict(zip(("gaussians", "motion_gaussians"), _find_best_count(on_val), strict=True)),
            "acc_on_val": {f"{speech}, {motion}": value for (speech, motion), value in on_val.items()},
            "jerk": figures["channels"][OPENING]["jerk"],
            "score_95": scores[units].compute_interval(seed),
            "score_gain_95": scores[units].compute_gain(scores[REFERENCE_SET], seed),
            "acc_gain_95": acc[units].compute_gain(acc[REFERENCE_SET], seed),
        }
    pairs = [
        {"better": better, "worse": worse, "score_gain_95": scores[better].compute_gain(scores[worse], seed)}
        for better, worse in combinations(PAPER_SCORES, 2)
    ]
    return {"rows": rows, "paper_order": pairs}
