"""Hofer 2008, Table 1, by the system of the paper, on any corpus: which unit set predicts closings best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines.joint.engine import JointEngine, JointEngineConfig, JointModel
from lipmotion.errors import InputError
from lipmotion.hmm.model import HmmConfig
from lipmotion.hmm.multistream.densities import MOTION, SPEECH
from lipmotion.kernels.compiler import one_thread
from lipmotion.measures.evaluation_table import figure_text
from lipmotion.pipeline.training.train import UTTERANCES_PER_WORKER, phones_and_examples
from lipmotion.pipeline.workers import worker_pool
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.json_text import nan_as_null
from lipmotion.types import Example, Monitor, sub_monitor
from lipmotion.units import UNIT_SETS, Lexicon
from lipmotion_lab.evaluation.evaluate import (
    closing_score_statistic,
    correlation_statistic,
    figures_of,
    opening_curves,
    sign_of_difference,
    significance_mark,
)
from lipmotion_lab.evaluation.held_out import (
    AUDIO_ONLY,
    OPENING,
    ComparedClip,
    HeldOutRecordings,
    generate_clips,
    generate_compared,
    load_held_out,
    make_speech,
)
from lipmotion_lab.runner import DEFAULT_SETTINGS, ExperimentSettings, PartKey, check_opening, open_parts, opening_row

PAPER_SCORES: dict[str, float] = {"eVis": 68.8, "pbVis": 67.7, "sVis": 67.4, "2vis": 66.5, "phone": 65.2}
"""Closure scores of Table 1, the best first."""
REFERENCE_SET = "phone"
PRESET = "hofer2008"
PINS = {"as printed": False, "lips made to meet on p b m": True}
"""Whether motion is generated with pins in p, b and m, by the name of the block of the table."""
TWICE_DOUBLED = 4
_ACC, _COUNTS = "table1/acc", "table1/gaussians"


@dataclass(frozen=True)
class Table1Options:
    """What is trained.

    states   : numbers of states a unit
    mixtures, motion_mixtures : numbers of Gaussians for speech, and then for motion, of which one is chosen on ``val``
    channels : channels of motion that are modelled, as ``opening width``: the two features of the paper; empty: all
    """

    states: Sequence[int] = (3, 5)
    mixtures: Sequence[int] = (1, 2, 4, 8, 16, 32, 64)
    motion_mixtures: Sequence[int] = (1, 2, 4, 8)
    channels: str = ""


FULL, QUICK = Table1Options(), Table1Options(states=(5,), mixtures=(1, 2), motion_mixtures=(1, 2))


@dataclass(frozen=True, eq=False)
class _System:
    """A trained system of one unit set, and the ACC on ``val`` by its Gaussians a state: for speech, for motion."""

    engine: JointEngine
    model: JointModel
    acc: dict[tuple[int, int], float]

    def generate(self, recordings: HeldOutRecordings) -> dict[tuple[str, str], Sequence[ComparedClip]]:
        """Return what it makes of held-out recordings, by condition and name of ``PINS``."""
        clips: dict[tuple[str, str], Sequence[ComparedClip]] = {}
        for condition in recordings.conditions:
            speech = make_speech(recordings, condition, self.engine, self.model)
            for pins, closures in PINS.items():
                engine = JointEngine(replace(self.engine.config, closures=closures))
                clips[condition, pins] = generate_compared(recordings, speech, engine, self.model)
        return clips


@one_thread()
def hofer2008(
    corpus: Corpus,
    options: Table1Options = FULL,
    *,
    split: str | None = "test",
    work: Path | None = None,
    settings: ExperimentSettings = DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Train the system of the paper on ``train`` with each unit set; return figures of each model on ``split``.

    Every system recognises its own units (``audio only``), or aligns those of given words itself (``with transcript``),
    each with and without pins in p, b and m. Intervals are 95 % bootstrap intervals over clips; those of differences
    are of the same draws of clips.
    Raises CorpusError: no utterances to train on, to choose with, or of this split, or motion without an opening.
    Source: Hofer 2008, §6 and Table 1.
    """
    check_opening(corpus, held_out := corpus.required(split))  # before the long work
    validation, names = corpus.required("val"), tuple(sorted(corpus.required("train")))
    lexicon, config, monitor = settings.lexicon or Lexicon(), settings.recogniser or HmmConfig(), settings.monitor
    checkpoint = open_parts(
        work, corpus, settings, PartKey(_engine(channels=options.channels), (*names, *validation, *held_out))
    )
    with worker_pool(min(settings.workers, len(names) // UTTERANCES_PER_WORKER)) as team:
        phones, examples, _ = phones_and_examples(
            [corpus.utterance(name) for name in names],
            config,
            lexicon,
            sub_monitor(monitor, 0, 0.1),
            checkpoint,
            team.ordered_map,
        )

    def list_recordings(chosen: Sequence[str], part: Monitor) -> HeldOutRecordings:
        return load_held_out(
            corpus,
            cached_recogniser(phones),
            selection=Selection(names=chosen),
            channels=(OPENING,),
            lexicon=lexicon,
            monitor=part,
        )

    choosing = list_recordings(validation, sub_monitor(monitor, 0.1, 0.12))
    recordings = list_recordings(held_out, sub_monitor(monitor, 0.12, 0.15))
    cells = [(states, units) for states in options.states for units in PAPER_SCORES]
    systems: dict[int, dict[str, _System]] = {states: {} for states in options.states}
    generated: dict[tuple[int, str], dict[tuple[str, str], Sequence[ComparedClip]]] = {}
    for number, (states, units) in enumerate(cells):
        start, end = (0.15 + 0.85 * (number + step) / len(cells) for step in (0, 1))
        part = sub_monitor(monitor, start, end, f"{units}, {states} states: ")
        engine = _engine(units=units, states=states, channels=options.channels)
        system = _train_system(engine, options, examples, choosing, checkpoint, part)
        systems[states][units], generated[states, units] = system, system.generate(recordings)
        for (condition, pins), clips in generated[states, units].items():
            if not PINS[pins]:
                settings.receive(f"{units}, {states} states", condition, recordings, clips)
    about = {"split": split or "all", "clips": len(recordings.utterances), "trained_on": len(examples)}
    about |= {"closed_under": recordings.closed_under, "mixtures": list(options.mixtures), "seed": settings.seed}
    about |= {"channels": options.channels, "motion_mixtures": list(options.motion_mixtures)}
    tables = [
        {"condition": condition, "pins": pins}
        | _table(
            recordings,
            systems[states],
            {units: generated[states, units][condition, pins] for units in PAPER_SCORES},
            settings.seed,
        )
        | {"states": states}
        for states in options.states
        for condition in recordings.conditions
        for pins in PINS
    ]
    return nan_as_null(about | {"tables": tables})


def _engine(**options: Any) -> JointEngine:
    return JointEngine(JointEngineConfig(**{**JointEngineConfig.presets[PRESET], **options}))


def _train_system(
    engine: JointEngine,
    options: Table1Options,
    examples: Sequence[Example],
    choosing: HeldOutRecordings,
    checkpoint: Checkpoint,
    monitor: Monitor,
) -> _System:
    """Return a system with the numbers of Gaussians of the highest ACC: for speech, and with that number for motion.

    A number is doubled until twice in a row that does not help. Raises InputError: training ends before any number.
    """
    config, tried, arrays = engine.config, dict[tuple[int, int], float](), dict[str, Any]()

    def try_numbers(monitor: Monitor, **most: Any) -> None:
        for model in JointEngine(replace(config, **most)).growing_models(examples, monitor):
            sizes = (model.hmm.models[stream].tied.mixtures.size[1] for stream in (SPEECH, MOTION))
            speech, motion = (1 << (size - 1).bit_length() for size in sizes)  # where data is short, not all are split
            if (speech, motion) in tried or speech not in options.mixtures or motion not in options.motion_mixtures:
                continue
            clips = generate_clips(choosing, AUDIO_ONLY, engine, model)
            tried[speech, motion] = correlation_statistic(*opening_curves(choosing, clips)).value
            if _best_count(tried) == (speech, motion):
                arrays.update(engine.to_arrays(model))
            if speech * motion >= TWICE_DOUBLED * np.prod(_best_count(tried)):
                return

    stage = f"{config.units}-{config.states}-{options.mixtures}-{options.motion_mixtures}"
    if (kept := checkpoint.load(stage)) is None:
        try_numbers(sub_monitor(monitor, 0, 0.6), mixtures=max(options.mixtures))
        if not tried:
            raise InputError(f"no state has data for {min(options.mixtures)} Gaussians; compare also fewer, from 1")
        if max(options.motion_mixtures) > 1:
            most = {"mixtures": _best_count(tried)[0], "motion_mixtures": max(options.motion_mixtures)}
            try_numbers(sub_monitor(monitor, 0.6, 1), **most)
        kept = arrays | {_COUNTS: np.array(list(tried)), _ACC: np.array(list(tried.values()))}
        checkpoint.save(stage, kept)
    acc = dict(zip(map(tuple, kept[_COUNTS].tolist()), kept[_ACC].tolist(), strict=True))
    model = engine.from_arrays({name: array for name, array in kept.items() if name not in (_ACC, _COUNTS)})
    return _System(engine, model, acc)


def _best_count(acc: Mapping[tuple[int, int], float]) -> tuple[int, int]:
    """Return the numbers of Gaussians with the highest correlation; among equals the smallest."""
    return max(acc, key=lambda counts: (acc[counts], -counts[0], -counts[1]))


def _table(
    recordings: HeldOutRecordings,
    systems: Mapping[str, _System],
    clips: Mapping[str, Sequence[ComparedClip]],
    seed: int,
) -> dict[str, Any]:
    """Return the figures of all sets in one condition, and the intervals of the differences of every two of them."""
    openings = {units: opening_curves(recordings, own) for units, own in clips.items()}
    threshold = recordings.closed_under or 0.0
    scores = {units: closing_score_statistic(*pair, threshold) for units, pair in openings.items()}
    acc = {units: correlation_statistic(*pair) for units, pair in openings.items()}
    rows = {}
    for units, system in systems.items():
        figures = figures_of(clips[units], recordings, seed)
        rows[units] = opening_row(figures) | {
            "units": UNIT_SETS[units].count,
            "paper": PAPER_SCORES[units],
            **dict(zip(("gaussians", "motion_gaussians"), _best_count(system.acc), strict=True)),
            "acc_on_val": {f"{speech}, {motion}": value for (speech, motion), value in system.acc.items()},
            "jerk": figures["channels"][OPENING]["jerk"],
            "score_95": scores[units].interval(seed),
            "score_gain_95": scores[units].gain(scores[REFERENCE_SET], seed),
            "acc_gain_95": acc[units].gain(acc[REFERENCE_SET], seed),
        }
    pairs = [
        {"better": better, "worse": worse, "score_gain_95": scores[better].gain(scores[worse], seed)}
        for better, worse in combinations(PAPER_SCORES, 2)
    ]
    return {"rows": rows, "paper_order": pairs}


HEAD = (
    f"  {'set':6} units  paper  {'score (95 %)':22}precision  p b m  timing  {'ACC (95 %)':22}"
    "nRMSE   jerk  variance     K"
)
NOTES = (
    f"* differs from {REFERENCE_SET}: the 95 % interval of the difference on the same clips leaves out 0",
    "paper: its score, of another speaker, corpus and threshold of a closed mouth: only orders compare",
    "score, precision, p b m: %; timing: ms; ACC to variance: of the opening, jerk and variance by the recordings",
)


def table(figures: Mapping[str, Any]) -> str:
    """Return the tables of all conditions, each with a sentence on what held of the paper's order."""
    lines = [
        f"the system of Hofer 2008, trained on {figures['trained_on']} clips; split {figures['split']}: "
        f"{figures['clips']} clips; closed under {figures['closed_under']:.4f}",
        f"channels: {figures['channels'] or 'all'}; K: Gaussians a state for speech, for motion, chosen on val",
    ]
    for block in figures["tables"]:
        lines += ["", f"{block['states']} states; {block['condition']}; {block['pins']}", HEAD]
        lines += [_line(units, row) for units, row in block["rows"].items()]
        lines += [f"  {what_held(block)}"]
    return "\n".join([*lines, "", *NOTES])


def _line(units: str, row: Mapping[str, Any]) -> str:
    interval = "–".join(figure_text(end, ".1f") for end in row["score_95"])
    score = f"{figure_text(row['score'], '.1f')}{significance_mark(row['score_gain_95'])} ({interval})"
    acc = "{:.3f}{} ({:.3f}–{:.3f})".format(row["acc"], significance_mark(row["acc_gain_95"]), *row["acc_95"])
    return (
        f"  {units:6} {row['units']:5} {row['paper']:6.1f}  {score:22}{figure_text(row['precision'], '9.1f')}"
        f"{figure_text(row['recall_p_b_m'], '7.1f')}{figure_text(row['timing_ms'], '+8.0f')}  {acc:22}"
        f"{row['nrmse']:6.3f}{figure_text(row['jerk'], '7.2f')}{row['global_variance']:10.2f}"
        f"{row['gaussians']:4}, {row['motion_gaussians']}"
    )


def what_held(block: Mapping[str, Any]) -> str:
    """Return how many of the pairs of sets that the paper orders by score are ordered so here, and which is best."""
    signs = [sign_of_difference(pair["score_gain_95"]) for pair in block["paper_order"]]
    against = [
        f"{pair['worse']} over {pair['better']}"
        for pair, sign in zip(block["paper_order"], signs, strict=True)
        if sign < 0
    ]
    best = max(block["rows"], key=lambda units: block["rows"][units]["score"] or 0.0)
    reversed_pairs = f" ({', '.join(against)})" if against else ""
    return (
        f"best: {best}; of the paper's {len(signs)} pairs hold {signs.count(1)}, reversed {len(against)}"
        f"{reversed_pairs}, open {signs.count(0)}"
    )
