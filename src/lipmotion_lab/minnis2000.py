"""Minnis & Breen 2000 on any corpus: their unit selection as printed, and what each addition of this project changes.

The paper prints no figures ("initial subjective evaluation suggests …", §7); its Table 1 is one of the settings.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import Corpus
from lipmotion.engines import engine_named
from lipmotion.engines.selection.concatenation import Piece, to_pieces
from lipmotion.engines.selection.costs import ABUTTING_JOIN, JOIN_BEFORE, Costs, SelectionConfig, Target, select
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.selection_training import build_target
from lipmotion.kernels.compiler import limit_threads
from lipmotion.pipeline.model import Model
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.json_text import replace_nan
from lipmotion.types import FRAME_RATE_HZ, Speech, Utterance, sub_monitor, with_progress
from lipmotion_lab import runner
from lipmotion_lab.engine_comparison import train_engine, train_engines
from lipmotion_lab.evaluation.evaluate import measure_clips, pair_curves, sum_correlations, sum_distances
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, OPENING, generate_compared, make_speech

Array = NDArray[np.float64]
REACH = 4  # frames before and after a frame between which velocities are compared: 40 ms, a picture of a video
HALF = 0.5


def measure_joins(
    engine: SelectionEngine, model: SelectionModel, speech: Sequence[Speech], utterances: Sequence[Utterance]
) -> dict[str, Any]:
    """Return how many joins some speech takes, and how much the velocity of the opening changes there.

    ``candidates`` is the median number of units that are looked up for a phone, ``single`` the share of phones that
    have one alone; ``hard`` is the share of joins in which units abut; ``smooth`` that of joins where the velocity
    changes by no more than the 95th percentile of the recordings.
    """
    kinds, changes, recorded, candidates = [], [], [], list[int]()
    for utterance, spoken in zip(utterances, speech, strict=True):
        costs, target, pieces = select_pieces(engine, model, spoken)
        candidates += [len(costs.candidates(target, number)) for number in range(len(target))]
        opening = engine.generate(model, spoken).motion[OPENING]
        frames = np.array([round(piece.start_s * FRAME_RATE_HZ) for piece in pieces[1:]], np.intp)
        changes.append(measure_velocity_change(opening)[np.minimum(frames, len(opening) - 1)])
        kinds += [piece.join for piece in pieces[1:]]
        motion = utterance.track.motion
        original = np.interp(np.arange(len(opening)) / FRAME_RATE_HZ, motion.time_s, motion[OPENING])
        start_s, end_s = target.windows.times_s[0, 1], target.windows.times_s[-1, 0]
        recorded.append(measure_velocity_change(original)[int(start_s * FRAME_RATE_HZ) : int(end_s * FRAME_RATE_HZ)])
    made, own = np.concatenate(changes), np.concatenate(recorded)
    bound = float(np.percentile(own, 95)) if len(own) else float("nan")
    return {
        "candidates": float(np.median(candidates)),
        "single": float(np.mean(np.array(candidates) == 1)),
        "joins": len(kinds),
        "per_clip": len(kinds) / len(utterances),
        "hard": kinds.count(ABUTTING_JOIN) / len(kinds) if kinds else float("nan"),
        "smooth": float(np.mean(made <= bound)) if kinds else float("nan"),
    }


def select_pieces(engine: SelectionEngine, model: SelectionModel, speech: Speech) -> tuple[Costs, Target, list[Piece]]:
    """Return the costs of a system, the phones of some speech, and the pieces that it chooses for them."""
    costs = model.costs(engine.config)
    target = build_target(model, costs, speech)
    return costs, target, to_pieces(costs, target, select(costs, target)[0])


def list_overlaps(costs: Costs, target: Target, pieces: Sequence[Piece]) -> Array:
    """Return start and end of the phones in which pieces overlap in other shares than halves [shape=(N, 2)]."""
    shared = [piece.first - (piece.join == JOIN_BEFORE) for piece in pieces[1:] if piece.join != ABUTTING_JOIN]
    return target.windows.times_s[[number for number in shared if costs.forward_share(target, number) != HALF]]


def measure_velocity_change(curve: NDArray[np.floating[Any]]) -> Array:
    """Return the size of the second difference over 40 ms on both sides of each frame [shape=(T,)]."""
    padded = np.pad(np.asarray(curve, float), REACH, mode="edge")
    return np.abs(padded[2 * REACH :] - 2 * padded[REACH:-REACH] + padded[: -2 * REACH])


ENGINE = "selection"
PRINTED, UNGUIDED, EVERYTHING = "as printed", "all additions but the guide", "all additions: the default"
DEFAULTS = SelectionConfig().as_mapping()
_TABLE = json.loads(Path(__file__).with_name("minnis2000.json").read_text(encoding="ascii"))
ADDITIONS = {name: tuple(options) for name, options in _TABLE["additions"].items()}
"""Options of the preset that take the value of the default, by the name of the row."""
VARIANTS: Mapping[str, Mapping[str, Any]] = _TABLE["variants"]
"""Other readings of the print, and what it leaves open."""
_ROW, _SUMS, _OVERLAP = "row", "correlation", "overlap"
WHAT_IS_SHOWN = ("acc", "nrmse", "global_variance", "jerk")


def list_configurations(*, guided: bool = True) -> dict[str, SelectionConfig]:
    """Return the configuration of every row, by its name; closures are never pinned, so that units alone are judged.

    guided : with the rows whose models learn from the sound, a guide or phones of the speaker's own
    """
    printed = SelectionConfig.parsed(SelectionConfig.presets["minnis2000"])
    configurations = {PRINTED: printed} | {
        name: replace(printed, **{key: getattr(SelectionConfig(), key) for key in keys})
        for name, keys in ADDITIONS.items()
    }
    configurations |= {name: replace(printed, **changes) for name, changes in VARIANTS.items()}
    everything = SelectionConfig(closures=False)
    configurations |= {UNGUIDED: replace(everything, guide=0.0), EVERYTHING: everything}
    return {name: each for name, each in configurations.items() if guided or not (each.guide or each.joint_recogniser)}


@limit_threads()
def run_minnis2000(
    corpus: Corpus,
    *,
    models: Path | None = None,
    quick: bool = False,
    guided: bool = True,
    work: Path | None = None,
    settings: runner.ExperimentSettings = runner.DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Return the figures of the paper's system and of its variants on ``val``, if the corpus has it, and ``test``.

    models : folder of the model ``selection.lipmotion`` (``train_engines``), so that a second run does not train
             again; None: it is trained and not kept
    quick  : only see that it runs: few epochs
    guided : as of ``list_configurations``; without, training takes a minute instead of twenty, and no model is kept
    work   : a folder for finished rows, and for the model if ``models`` is None, from which the same call goes on
             after a stop; None: none
    All rows use one model, with the default's inventory, guide and phone recogniser, of which each takes what it needs:
    the row as printed is what ``train --preset minnis2000`` makes (tests/experiments/test_minnis2000.py).
    Raises CorpusError: no utterances to train on or of ``test``, or motion without an opening.
    Raises InputError, ModelFormatError, ExportError: as ``train_engines``.
    """
    splits = [split for split in ("val", "test") if split == "test" or corpus.names(split)]
    lists = {split: corpus.required(split) for split in splits}
    for held_out in lists.values():
        runner.check_training_names(corpus, corpus.required("train"), held_out)
    training = settings.narrow(0, 0.6)
    if quick or not guided:
        options = ({} if guided else {"guide": 0.0, "joint_recogniser": False}) | ({"epochs": 20} if quick else {})
        start_s, engine = perf_counter(), engine_named(ENGINE, options)
        model = train_engine(corpus, engine, training, work)
        seconds: float | None = perf_counter() - start_s
    else:
        model, seconds = train_engines(corpus, models or (work and work / "model"), training, [ENGINE])[ENGINE]
    figures, systems = {}, list_configurations(guided=guided)
    for (split, names), part in zip(lists.items(), runner.share_out(settings, [*lists], 0.6), strict=True):
        key = runner.PartKey(model.engine, names, model=model, others=str(systems))
        checkpoint = runner.open_parts(work and work / split, corpus, settings, key)
        figures[split] = _measure_list(corpus, names, model, systems, checkpoint, part)
    about: dict[str, Any] = {"seed": settings.seed, "quick": quick, "seconds": seconds}
    about |= {key: model.about[key] for key in ("utterances", "minutes")}
    printed = vars(SelectionConfig.parsed(SelectionConfig.presets["minnis2000"]))
    about["rows"] = {
        name: {key: value for key, value in vars(config).items() if value != printed[key]}
        for name, config in systems.items()
    }
    return replace_nan(about | {"lists": figures})


def _measure_list(
    corpus: Corpus,
    names: Sequence[str],
    model: Model,
    systems: Mapping[str, SelectionConfig],
    checkpoint: Checkpoint,
    settings: runner.ExperimentSettings,
) -> dict[str, Any]:
    """Return the figures of every condition and row on some utterances."""
    channels = runner.check_opening(corpus, names)
    recordings = runner.recognise_held_out(corpus, model.phones, names, settings.narrow(0, 0.4), channels=channels)
    conditions: dict[str, dict[str, Any]] = {condition: {} for condition in recordings.conditions}
    reference: dict[str, tuple[Array, Array]] = {}

    @cache
    def speak(condition: str, by_own_recogniser: bool) -> list[Speech]:
        listening = SelectionConfig(joint_recogniser=by_own_recogniser)
        engine, learned = SelectionEngine(listening), _simplify_model(model.learned, listening)
        return [each.with_arrays() for each in make_speech(recordings, condition, engine, learned)]

    @cache
    def find_overlaps(condition: str) -> list[NDArray[np.bool_]]:
        """Return which frames of each recording ``overlap`` is about: where the system as printed overlaps units."""
        system, masks = SelectionEngine(systems[PRINTED]), list[NDArray[np.bool_]]()
        units = _simplify_model(model.learned, system.config)
        for utterance, speech in zip(recordings.utterances, speak(condition, False), strict=True):
            time_s = np.flatnonzero(utterance.track.seen) / utterance.track.motion.rate_hz
            start_s, end_s = list_overlaps(*select_pieces(system, units, speech)).T[:, :, None]
            masks.append(((time_s >= start_s) & (time_s < end_s)).any(axis=0))
        return masks

    for name, config in with_progress(list(systems.items()), "comparing", sub_monitor(settings.monitor, 0.4, 1)):
        learned = _simplify_model(model.learned, config)
        for condition, rows in conditions.items():
            stage = f"{len(rows)} {condition}"
            arrays = checkpoint.load(stage)
            if arrays is None:
                engine = SelectionEngine(config)
                speech = speak(condition, config.joint_recogniser and condition == AUDIO_ONLY)
                clips = generate_compared(recordings, speech, engine, learned)
                settings.receive(name, condition, recordings, clips)
                figures = measure_clips(clips, recordings, settings.seed)
                row = runner.make_opening_row(figures)
                row["channels"] = {
                    channel: {figure: values[figure] for figure in WHAT_IS_SHOWN}
                    for channel, values in figures["channels"].items()
                }
                row["joins"] = measure_joins(engine, learned, speech, recordings.utterances)
                both, inside = pair_curves(recordings, clips), find_overlaps(condition)
                parts = ([x[mask] for x, mask in zip(each, inside, strict=True)] for each in both)
                statistics = sum_correlations(*both), sum_distances(*parts)
                sums = [np.stack(each.sums) for each in statistics]
                gains = [
                    each.compute_gain(replace(each, sums=list(printed)), settings.seed)
                    for each, printed in zip(statistics, reference.get(condition, sums), strict=True)
                ]
                row["acc_gain_95"] = gains[0]
                row["overlap"] = {
                    "frames": int(np.concatenate(inside).sum()),
                    "error": statistics[1].value,
                    "error_gain_95": gains[1],
                }
                arrays = {_ROW: np.array(json.dumps(row)), _SUMS: sums[0], _OVERLAP: sums[1]}
                checkpoint.save(stage, arrays)
            reference.setdefault(condition, (arrays[_SUMS], arrays[_OVERLAP]))
            rows[name] = json.loads(str(arrays[_ROW]))
    return {"clips": len(names), "closed_under": recordings.closed_under, "conditions": conditions}


def _simplify_model(learned: SelectionModel, config: SelectionConfig) -> SelectionModel:
    """Return what training with a configuration makes of the same recordings."""
    if not config.articulation:
        learned = replace(learned, motion=replace(learned.motion, prior=None))
    return learned if config.joint_recogniser else replace(learned, phone_recogniser=None)
