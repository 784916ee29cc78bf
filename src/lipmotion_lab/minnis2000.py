"""Minnis & Breen 2000 on any corpus: their unit selection as printed, and what each addition of this project changes.

The paper prints no figures ("initial subjective evaluation suggests …", §7); its Table 1 is one of the settings.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import engine_named
from lipmotion.engines.selection.concatenation import pieces_of
from lipmotion.engines.selection.costs import ABUTTING_JOIN, MINNIS_2000, SelectionConfig
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.search import select
from lipmotion.engines.selection.selection_training import target_of
from lipmotion.kernels.compiler import one_thread
from lipmotion.pipeline.model import Model
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.json_text import nan_as_null
from lipmotion.types import FRAME_RATE_HZ, Speech, Utterance, sub_monitor, with_progress
from lipmotion_lab import runner
from lipmotion_lab.engine_comparison import EngineModel, engine_models, train_engine
from lipmotion_lab.evaluation.evaluate import correlation_statistic, figures_of, opening_curves
from lipmotion_lab.evaluation.held_out import (
    AUDIO_ONLY,
    OPENING,
    generate_compared,
    load_held_out,
    make_speech,
)
from lipmotion_lab.learning_curve import check_training_names

Array = NDArray[np.float64]
REACH = 4
"""Frames before and after a frame between which velocities are compared: 40 ms, a picture of a video."""
PERCENTILES = (50, 75, 95)


def join_figures(
    engine: SelectionEngine, model: SelectionModel, speech: Sequence[Speech], utterances: Sequence[Utterance]
) -> dict[str, Any]:
    """Return how many joins some speech takes, and how much the velocity of the opening changes there.

    ``hard`` is the share of joins in which units abut; ``smooth`` that of joins where the velocity changes by no more
    than the 95th percentile of the recordings.
    """
    costs, kinds, changes, recorded = model.costs(engine.config), [], [], []
    for utterance, spoken in zip(utterances, speech, strict=True):
        target = target_of(model, costs, spoken)
        pieces = pieces_of(costs, target, select(costs, target).units)
        opening = engine.generate(model, spoken).motion[OPENING]
        frames = np.array([round(piece.start_s * FRAME_RATE_HZ) for piece in pieces[1:]], np.intp)
        changes.append(velocity_change(opening)[np.minimum(frames, len(opening) - 1)])
        kinds += [piece.join for piece in pieces[1:]]
        motion = utterance.track.motion
        original = np.interp(np.arange(len(opening)) / FRAME_RATE_HZ, motion.time_s, motion[OPENING])
        start_s, end_s = target.windows.times_s[0, 1], target.windows.times_s[-1, 0]
        recorded.append(velocity_change(original)[int(start_s * FRAME_RATE_HZ) : int(end_s * FRAME_RATE_HZ)])
    made, own = np.concatenate(changes), np.concatenate(recorded)
    bound = float(np.percentile(own, PERCENTILES[-1])) if len(own) else float("nan")
    return {
        "joins": len(kinds),
        "per_clip": len(kinds) / len(utterances),
        "hard": kinds.count(ABUTTING_JOIN) / len(kinds) if kinds else float("nan"),
        "smooth": float(np.mean(made <= bound)) if kinds else float("nan"),
        "changes": np.percentile(made, PERCENTILES).tolist() if kinds else None,
        "recorded_changes": np.percentile(own, PERCENTILES).tolist() if len(own) else None,
    }


def velocity_change(curve: NDArray[np.floating[Any]]) -> Array:
    """Return the size of the second difference over 40 ms on both sides of each frame [shape=(T,)]."""
    padded = np.pad(np.asarray(curve, float), REACH, mode="edge")
    return np.abs(padded[2 * REACH :] - 2 * padded[REACH:-REACH] + padded[: -2 * REACH])


ENGINE = "selection"
PRINTED, UNGUIDED, EVERYTHING = "as printed", "all additions but the guide", "all additions: the default"
DEFAULTS = SelectionConfig().as_mapping()
ADDITIONS: Mapping[str, tuple[str, ...]] = {
    "300 candidates a bias": ("candidates",),
    "guide from the sound": ("guide",),
    "300 candidates and the guide": ("candidates", "guide"),
    "joins cost what motions differ by": ("join",),
    "300 candidates and this": ("candidates", "join"),
    "durations count": ("duration",),
    "own phone recogniser": ("joint_recogniser",),
    "table of articulation": ("articulation",),
    "t d g k one symbol, but played": ("suppressed",),
}
"""Options of the preset that take the value of the default, by the name of the row."""
VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "no phone invisible": {"suppressed": False, "invisible": ""},
    "t d g k l suppressed": {"invisible": "t d g k l"},
    "Table 1 symmetric: 73/27 for 77/23": {"overlap": "symmetric"},
    "overlaps half and half": {"overlap": "middle"},
    "overlaps learned": {"overlap": "learned"},
    "window N = 3": {"window": 3},
    "window N = 7": {"window": 7},
}
"""Other readings of the print, and what it leaves open."""
_ROW, _SUMS = "row", "correlation"
WHAT_IS_SHOWN = ("acc", "nrmse", "global_variance", "jerk")


def rows() -> dict[str, SelectionConfig]:
    """Return the configuration of every row, by its name; closures are never pinned, so that units alone are judged."""
    printed = SelectionConfig.parsed(MINNIS_2000)
    found = {PRINTED: printed}
    found |= {
        name: replace(printed, **{key: getattr(SelectionConfig(), key) for key in keys})
        for name, keys in ADDITIONS.items()
    }
    found |= {name: replace(printed, **changes) for name, changes in VARIANTS.items()}
    everything = SelectionConfig(closures=False)
    return found | {UNGUIDED: replace(everything, guide=0.0), EVERYTHING: everything}


@one_thread()
def minnis2000(
    corpus: Corpus,
    *,
    models: Path | None = None,
    quick: bool = False,
    work: Path | None = None,
    settings: runner.ExperimentSettings = runner.DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Return the figures of the paper's system and of its variants on ``val``, if the corpus has it, and ``test``.

    models : folder of the model ``selection.lipmotion`` (``models.engine_models``), so that a second run does not train
             again; None: it is trained and not kept
    work   : a folder for finished rows, and for the model if ``models`` is None, from which the same call goes on
             after a stop; None: none
    All rows use one model, with the default's inventory, guide and phone recogniser, of which each takes what it needs:
    the row as printed is what ``train --preset minnis2000`` makes (tests/experiments/test_minnis2000.py).
    Raises CorpusError: no utterances to train on or of ``test``, or motion without an opening.
    Raises InputError, ModelFormatError, ExportError: as ``engine_models``.
    """
    splits = [split for split in ("val", "test") if split == "test" or corpus.names(split)]
    lists = {split: corpus.required(split) for split in splits}
    for held_out in lists.values():
        check_training_names(corpus, corpus.required("train"), held_out)
    monitor = settings.monitor
    training = replace(settings, monitor=sub_monitor(monitor, 0, 0.6))
    kept_in = models or (work and work / "model")
    if quick:
        start_s, model = perf_counter(), train_engine(corpus, engine_named(ENGINE, {"epochs": 20}), training)
        trained = EngineModel(model, perf_counter() - start_s)
    else:
        trained = engine_models(corpus, kept_in, training, [ENGINE])[ENGINE]
    found = {}
    for number, (split, names) in enumerate(lists.items()):
        start, stop = (0.6 + 0.4 * (number + step) / len(lists) for step in (0, 1))
        part = replace(settings, monitor=sub_monitor(monitor, start, stop, f"{split}: "))
        key = runner.PartKey(trained.model.engine, names, model=trained.model, others=str(rows()))
        kept = runner.open_parts(work and work / split, corpus, settings, key)
        found[split] = _on_list(corpus, names, trained.model, kept, part)
    about: dict[str, Any] = {"seed": settings.seed, "quick": quick, "seconds": trained.seconds}
    about |= {key: trained.model.about[key] for key in ("utterances", "minutes")}
    printed = vars(SelectionConfig.parsed(MINNIS_2000))
    options = {name: vars(config).items() for name, config in rows().items()}
    about |= {
        "rows": {name: {key: value for key, value in of if value != printed[key]} for name, of in options.items()}
    }
    return nan_as_null(about | {"lists": found})


def _on_list(
    corpus: Corpus, names: Sequence[str], model: Model, kept: Checkpoint, settings: runner.ExperimentSettings
) -> dict[str, Any]:
    """Return the figures of every condition and row on some utterances."""
    monitor = settings.monitor
    recordings = load_held_out(
        corpus,
        cached_recogniser(model.phones),
        selection=Selection(names=names),
        channels=runner.check_opening(corpus, names),
        lexicon=settings.lexicon,
        monitor=sub_monitor(monitor, 0, 0.4),
    )
    conditions: dict[str, dict[str, Any]] = {condition: {} for condition in recordings.conditions}
    spoken: dict[tuple[str, bool], list[Speech]] = {}
    reference: dict[str, NDArray[np.float64]] = {}
    for name, config in with_progress(list(rows().items()), "comparing", sub_monitor(monitor, 0.4, 1)):
        learned = _of_the_row(model.learned, config)
        for condition, found in conditions.items():
            stage = f"{len(found)} {condition}"
            arrays = kept.load(stage)
            if arrays is None:
                key = condition, config.joint_recogniser and condition == AUDIO_ONLY
                if key not in spoken:
                    listening = SelectionConfig(joint_recogniser=key[1])
                    spoken[key] = make_speech(
                        recordings, condition, SelectionEngine(listening), _of_the_row(model.learned, listening)
                    )
                engine = SelectionEngine(config)
                clips = generate_compared(recordings, spoken[key], engine, learned)
                settings.receive(name, condition, recordings, clips)
                figures = figures_of(clips, recordings, settings.seed)
                row = runner.opening_row_with_rates(figures)
                row["channels"] = {
                    channel: {figure: values[figure] for figure in WHAT_IS_SHOWN}
                    for channel, values in figures["channels"].items()
                }
                row["joins"] = join_figures(engine, learned, spoken[key], recordings.utterances)
                statistic = correlation_statistic(*opening_curves(recordings, clips))
                printed = replace(statistic, sums=list(reference.get(condition, statistic.sums)))
                row["acc_gain_95"] = statistic.gain(printed, settings.seed)
                arrays = {_ROW: np.array(json.dumps(row)), _SUMS: np.stack(statistic.sums)}
                kept.save(stage, arrays)
            reference.setdefault(condition, arrays[_SUMS])
            found[name] = json.loads(str(arrays[_ROW]))
    return {"clips": len(names), "closed_under": recordings.closed_under, "conditions": conditions}


def _of_the_row(learned: SelectionModel, config: SelectionConfig) -> SelectionModel:
    """Return what training with a configuration makes of the same recordings."""
    if not config.articulation:
        learned = replace(learned, motion=replace(learned.motion, prior=None))
    return learned if config.joint_recogniser else replace(learned, phone_recogniser=None)
