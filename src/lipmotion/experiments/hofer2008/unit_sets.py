"""Hofer 2008, Table 1, on any corpus: which unit set finds the closings, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.corpora.store import Corpus
from lipmotion.engines import engine_named
from lipmotion.experiments.comparison import correlation_tally, mark, openings_of, score_tally
from lipmotion.experiments.runner import channels_with_opening, opening_row
from lipmotion.hmm.model import HmmConfig
from lipmotion.kernels.threads import one_thread
from lipmotion.measures import curves
from lipmotion.measures.report import number
from lipmotion.pipeline.evaluation.evaluate import Clip, Recorded, clips, figures_of, recorded
from lipmotion.pipeline.training.train import FEWEST, phones_and_examples
from lipmotion.pipeline.workers import working
from lipmotion.speech.recogniser import recogniser as cached_recogniser
from lipmotion.storage.checkpoint import NOTHING_KEPT
from lipmotion.storage.json_text import defined
from lipmotion.types import Example, Monitor, counted, part_of, silent_monitor
from lipmotion.units import UNIT_SETS, Lexicon

PAPER: dict[str, float] = {"2vis": 66.5, "pbVis": 67.7, "sVis": 67.4, "eVis": 68.8, "phone": 65.2}
"""Closure scores of Table 1, its rows in their order."""
BASELINE = "phone"
"""What every set is compared with."""
SYSTEMS: dict[str, dict[str, Any]] = {
    "default engine, plain Gaussians": {"listens": False, "full_range": False, "joint": False},
    "default engine": {"joint": False},
}
"""Settings of the trajectory engine, by the name of the block of the table: none is the paper's own system, in which
units are recognised by their own models and their states begin where these say."""


@one_thread()
def unit_sets(
    corpus: Corpus,
    *,
    split: str | None = "test",
    closures: bool = False,
    recogniser: HmmConfig | None = None,
    lexicon: Lexicon | None = None,
    seed: int = 0,
    monitor: Monitor = silent_monitor,
    workers: int = 1,
) -> dict[str, Any]:
    """Train the trajectory engine on ``train`` with each unit set, and return what it makes of ``split``.

    closures   : make the lips meet in every p, b and m; else what is learned decides, which is what is compared
    recogniser : configuration of the phone models
    workers    : processes that share the finding of the phones
    The phones in time are found once and are the same for all sets: those of the training list by forced alignment,
    those of the split by recognition (audio only) and, where there are transcripts, by alignment.
    Intervals are 95 % bootstrap intervals over clips; differences from ``phone`` are of the same draws of clips.
    Raises CorpusError: no utterances to train on or of this split, or motion without an opening.
    """
    channels_with_opening(corpus, corpus.required(split))  # before the long work
    utterances = [corpus.utterance(name) for name in corpus.required("train")]
    lexicon = lexicon or Lexicon()
    with working(min(workers, len(utterances) // FEWEST)) as team:
        finding = part_of(monitor, 0, 0.5)
        config = recogniser or HmmConfig()
        phones, examples, _ = phones_and_examples(utterances, config, lexicon, finding, NOTHING_KEPT, team.each)
    listening = part_of(monitor, 0.5, 0.6)
    found = recorded(corpus, cached_recogniser(phones), split=split, lexicon=lexicon, monitor=listening)
    systems = {
        name: _block(found, examples, settings | {"closures": closures}, seed, part_of(monitor, *share, f"{name}: "))
        for (name, settings), share in zip(SYSTEMS.items(), ((0.6, 0.75), (0.75, 1.0)), strict=True)
    }
    about = {"split": split or "all", "clips": len(found.utterances), "trained_on": len(examples)}
    about |= {"closed_under": found.closed_under, "closures": closures}
    figures: dict[str, Any] = defined(about | {"systems": systems})
    return figures


def _block(
    found: Recorded, examples: Sequence[Example], settings: Mapping[str, Any], seed: int, monitor: Monitor
) -> dict[str, dict[str, Any]]:
    """Return the figures of every condition and unit set."""
    made: dict[str, dict[str, list[Clip]]] = {condition: {} for condition in found.conditions}
    for units in counted(list(PAPER), "unit sets", monitor):
        engine = engine_named("trajectory", {**settings, "units": units})
        learned = engine.fit(examples, silent_monitor).model
        for condition in found.conditions:
            made[condition][units] = clips(found, condition, engine, learned)
    return {
        condition: {units: _row(found, units, rows[units], rows[BASELINE], seed) for units in PAPER}
        for condition, rows in made.items()
    }


def _row(found: Recorded, units: str, made: Sequence[Clip], baseline: Sequence[Clip], seed: int) -> dict[str, Any]:
    (generated, original), (other, _) = openings_of(found, made), openings_of(found, baseline)
    threshold = found.closed_under or 0.0
    score, acc = score_tally(generated, original, threshold), correlation_tally(generated, original)
    return {
        "units": UNIT_SETS[units].count,
        "paper": PAPER[units],
        "score_95": score.interval(seed),
        "score_gain_95": score.gain(score_tally(other, original, threshold), seed),
        "acc_gain_95": acc.gain(correlation_tally(other, original), seed),
        "rmse": float(curves.rmse(generated, original)[0]),
    } | opening_row(figures_of(made, found, seed))


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
        f"* differs from {BASELINE}: the 95 % interval of the difference on the same clips leaves out 0",
        NOTE,
    ]
    return "\n".join(lines)


NOTE = "paper: Hofer's own system; here phones are found once for all sets and cut at fixed times: only orders compare"
HEAD = (
    f"  {'set':6} units  paper  {'score (95 %)':22}precision  p b m  timing  {'ACC (95 %)':22}  RMSE    nRMSE  variance"
)


def _line(units: str, row: Mapping[str, Any]) -> str:
    low, high = row["score_95"]
    score = f"{number(row['score'], '.1f')}{mark(row['score_gain_95'])} ({number(low, '.1f')}–{number(high, '.1f')})"
    acc = "{:.3f}{} ({:.3f}–{:.3f})".format(row["acc"], mark(row["acc_gain_95"]), *row["acc_95"])
    return (
        f"  {units:6} {row['units']:5} {row['paper']:6.1f}  {score:22}{number(row['precision'], '9.1f')}"
        f"{number(row['recall_p_b_m'], '7.1f')}{number(row['timing_ms'], '+8.0f')}  {acc:22}"
        f"{row['rmse']:6.4f}{row['nrmse']:9.3f}{row['global_variance']:10.2f}"
    )
