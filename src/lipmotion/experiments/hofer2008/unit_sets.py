"""Hofer 2008, Table 1, on any corpus: which unit set predicts closings best, and how accurate its motion is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import engine_named
from lipmotion.experiments.comparison import (
    closing_score_statistic,
    correlation_statistic,
    opening_curves,
    significance_mark,
)
from lipmotion.experiments.runner import DEFAULT_SETTINGS, ExperimentSettings, channels_with_opening, opening_row
from lipmotion.hmm.model import HmmConfig
from lipmotion.kernels.threads import one_thread
from lipmotion.measures import curves
from lipmotion.measures.evaluation_table import figure_text
from lipmotion.pipeline.evaluation.figures import figures_of
from lipmotion.pipeline.evaluation.held_out import (
    ComparedClip,
    HeldOutRecordings,
    compared_clips,
    held_out_recordings,
)
from lipmotion.pipeline.training.train import UTTERANCES_PER_WORKER, phones_and_examples
from lipmotion.pipeline.workers import worker_pool
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.storage.checkpoint import NO_CHECKPOINT
from lipmotion.storage.json_text import nan_as_null
from lipmotion.types import Example, Monitor, silent_monitor, sub_monitor, with_progress
from lipmotion.units import UNIT_SETS, Lexicon

PAPER_SCORES: dict[str, float] = {"2vis": 66.5, "pbVis": 67.7, "sVis": 67.4, "eVis": 68.8, "phone": 65.2}
"""Closure scores of Table 1, in the order of its rows."""
REFERENCE_SET = "phone"
"""The unit set that every other one is compared with."""
ENGINE_SETTINGS: dict[str, dict[str, Any]] = {
    "default engine, plain Gaussians": {
        "acoustic_regression": False,
        "variance_scaling": False,
        "joint_recogniser": False,
    },
    "default engine": {"joint_recogniser": False},
}
"""Options of the trajectory engine, by the name of the block of the table.

None of them is the paper's own system, in which units are recognised by their own models, which also give the times of
their states.
"""


@one_thread()
def unit_sets(
    corpus: Corpus,
    *,
    split: str | None = "test",
    closures: bool = False,
    settings: ExperimentSettings = DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Train the trajectory engine on ``train`` with each unit set; return figures of each model on ``split``.

    closures : whether the lips are pinned closed in every p, b and m; without pins the models alone are compared
    settings : its workers share the forced alignment
    The phones in time are computed once and are the same for all sets: those of the training list by forced alignment,
    those of the split by recognition (audio only) and, where there are transcripts, by alignment.
    Intervals are 95 % bootstrap intervals over clips; differences from ``phone`` are of the same draws of clips.
    Raises CorpusError: no utterances to train on or of this split, or motion without an opening.
    """
    channels_with_opening(corpus, corpus.required(split))  # before the long work
    utterances = [corpus.utterance(name) for name in corpus.required("train")]
    lexicon, monitor = settings.lexicon or Lexicon(), settings.monitor
    with worker_pool(min(settings.workers, len(utterances) // UTTERANCES_PER_WORKER)) as team:
        aligning = sub_monitor(monitor, 0, 0.5)
        config = settings.recogniser or HmmConfig()
        phones, examples, _ = phones_and_examples(
            utterances, config, lexicon, aligning, NO_CHECKPOINT, team.ordered_map
        )
    recognising = sub_monitor(monitor, 0.5, 0.6)
    recordings = held_out_recordings(
        corpus, cached_recogniser(phones), selection=Selection(split), lexicon=lexicon, monitor=recognising
    )
    blocks = {}
    for (name, options), share in zip(ENGINE_SETTINGS.items(), ((0.6, 0.75), (0.75, 1.0)), strict=True):
        part = sub_monitor(monitor, *share, f"{name}: ")
        blocks[name] = _block(recordings, examples, options | {"closures": closures}, settings.seed, part)
    about = {"split": split or "all", "clips": len(recordings.utterances), "trained_on": len(examples)}
    about |= {"closed_under": recordings.closed_under, "closures": closures}
    return nan_as_null(about | {"systems": blocks})


def _block(
    recordings: HeldOutRecordings, examples: Sequence[Example], options: Mapping[str, Any], seed: int, monitor: Monitor
) -> dict[str, dict[str, Any]]:
    """Return the figures of every condition and unit set."""
    generated: dict[str, dict[str, list[ComparedClip]]] = {condition: {} for condition in recordings.conditions}
    for units in with_progress(list(PAPER_SCORES), "unit sets", monitor):
        engine = engine_named("trajectory", {**options, "units": units})
        model = engine.fit(examples, silent_monitor).model
        for condition in recordings.conditions:
            generated[condition][units] = compared_clips(recordings, condition, engine, model)
    return {
        condition: {
            units: _row(recordings, units, by_set[units], by_set[REFERENCE_SET], seed) for units in PAPER_SCORES
        }
        for condition, by_set in generated.items()
    }


def _row(
    recordings: HeldOutRecordings,
    units: str,
    made: Sequence[ComparedClip],
    reference: Sequence[ComparedClip],
    seed: int,
) -> dict[str, Any]:
    """Return the figures of one unit set, and its differences from the reference set."""
    (generated, original), (other, _) = opening_curves(recordings, made), opening_curves(recordings, reference)
    threshold = recordings.closed_under or 0.0
    score = closing_score_statistic(generated, original, threshold)
    acc = correlation_statistic(generated, original)
    return {
        "units": UNIT_SETS[units].count,
        "paper": PAPER_SCORES[units],
        "score_95": score.interval(seed),
        "score_gain_95": score.gain(closing_score_statistic(other, original, threshold), seed),
        "acc_gain_95": acc.gain(correlation_statistic(other, original), seed),
        "rmse": float(curves.rmse(generated, original)[0]),
    } | opening_row(figures_of(made, recordings, seed))


def table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``unit_sets`` as text."""
    pinned = "lips made to meet on p b m" if figures["closures"] else "no lips made to meet"
    lines = [
        f"trained on {figures['trained_on']} clips; split {figures['split']}: {figures['clips']} clips, {pinned}; "
        f"closed under {figures['closed_under']:.4f}"
    ]
    for system, conditions in figures["systems"].items():
        for condition, rows in conditions.items():
            lines += ["", f"{system}; {condition}", HEAD, *(_line(units, row) for units, row in rows.items())]
    lines += [
        "",
        f"* differs from {REFERENCE_SET}: the 95 % interval of the difference on the same clips leaves out 0",
        NOTE,
    ]
    return "\n".join(lines)


NOTE = "paper: Hofer's own system; here phones are found once for all sets and cut at fixed times: only orders compare"
HEAD = (
    f"  {'set':6} units  paper  {'score (95 %)':22}precision  p b m  timing  {'ACC (95 %)':22}  RMSE    nRMSE  variance"
)


def _line(units: str, row: Mapping[str, Any]) -> str:
    interval = "–".join(figure_text(end, ".1f") for end in row["score_95"])
    score = f"{figure_text(row['score'], '.1f')}{significance_mark(row['score_gain_95'])} ({interval})"
    acc = "{:.3f}{} ({:.3f}–{:.3f})".format(row["acc"], significance_mark(row["acc_gain_95"]), *row["acc_95"])
    return (
        f"  {units:6} {row['units']:5} {row['paper']:6.1f}  {score:22}{figure_text(row['precision'], '9.1f')}"
        f"{figure_text(row['recall_p_b_m'], '7.1f')}{figure_text(row['timing_ms'], '+8.0f')}  {acc:22}"
        f"{row['rmse']:6.4f}{row['nrmse']:9.3f}{row['global_variance']:10.2f}"
    )
