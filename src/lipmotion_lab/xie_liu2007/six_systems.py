"""Xie & Liu 2007, Table 3, on any corpus: which structure of chains predicts lips best, beside other systems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.corpora import Corpus
from lipmotion.engines import engine_named
from lipmotion.engines.coupled.chains.model import speech_observations
from lipmotion.engines.coupled.conversion import convert
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.errors import ExportError, InputError, MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion.kernels.compiler import limit_threads
from lipmotion.measures import curves
from lipmotion.pipeline.model import EIGENLIPS, GEOMETRY
from lipmotion.pipeline.training.channels import check_visual, train_eigenlips, with_visual_channels
from lipmotion.pipeline.training.other_speakers import SpokenSentence
from lipmotion.pipeline.training.train import list_motionless
from lipmotion.stats.curves import varies
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.files import atomic_file, make_folder
from lipmotion.storage.json_text import replace_nan
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import GREY, Example, Monitor, Speech, Timeline, sub_monitor
from lipmotion_lab import runner
from lipmotion_lab.evaluation import evaluate
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, OPENING, ComparedClip, HeldOutRecordings, generate_clips
from lipmotion_lab.xie_liu2007 import systems

CONVERGENCE_RECORDINGS, PREDICTED_RECORDINGS = 8, 6  # recordings that are shown in one picture
PLOT_FILES = {"start": "conversion.png", "steps": "convergence.png", "clips": "predicted.png"}
PLOT_CAPTIONS = {
    PLOT_FILES["start"]: "As Fig. 7: conversion by ph-vi-CHMM of one recording, from means along the best path by EM",
    PLOT_FILES["steps"]: "As Fig. 10: convergence of the conversion, by steps of EM",
    PLOT_FILES["clips"]: "As Fig. 11: predicted beside recorded motion, ph-vi-CHMM",
}


def check_plot_folder(folder: Path) -> None:
    """Check, before long work, that pictures can be written. Raises MissingDependencyError, ExportError."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError(
            f"pictures need matplotlib, which cannot be imported ({error}); {install_command('plots')}"
        ) from error
    if not folder.parent.is_dir():
        raise ExportError(f"{folder}: the folder {folder.parent} does not exist; create it first")
    if folder.exists() and not folder.is_dir():
        raise ExportError(f"{folder}: is a file; give a folder for the pictures")


def draw_plots(chains: systems.TrainedSystem, recordings: HeldOutRecordings, folder: Path) -> None:
    """Write pictures of the conversion by EM of the first recordings. Raises ExportError: they cannot be written."""
    from matplotlib.figure import Figure  # which needs no screen

    some = recordings.select_first(CONVERGENCE_RECORDINGS)
    by_em = generate_clips(some, AUDIO_ONLY, chains.engine, chains.model)
    path_engine = CoupledEngine(replace(chains.engine.config, conversion="viterbi"))
    by_path = generate_clips(some, AUDIO_ONLY, path_engine, chains.model)
    make_folder(folder)

    picture = Figure(figsize=(10, 4.2), layout="constrained")
    axes, clip = picture.subplots(), by_em[0]
    axes.plot(clip.time_s, clip.original[:, 0], "k:", label="recorded")
    axes.plot(by_path[0].time_s, by_path[0].generated[:, 0], color="tab:orange", label="means along the best path")
    axes.plot(clip.time_s, clip.generated[:, 0], color="tab:blue", label="EM, started from these means")
    _label_axes(axes, some, f"Audio to visual conversion: {some.utterances[0].name}")
    axes.set_xlabel("time (s)")
    axes.legend(loc="upper right")
    _save(picture, folder / PLOT_FILES["start"])

    picture = Figure(figsize=(7, 4.6), layout="constrained")
    axes, model, config = picture.subplots(), chains.model, chains.engine.config
    for utterance in some.utterances:
        observations = speech_observations(Speech(utterance.features, Timeline(())), model.visual)
        how = config.start, config.update, config.steps
        _, steps = convert(model.chains, observations, model.chains.full_lattice, *how)
        axes.plot(range(len(steps)), steps, "o-", markersize=3, label=utterance.name)
    axes.set_xlabel("step of EM (0: means along the best path)")
    axes.set_ylabel("log likelihood of speech and lips (nats per frame)")
    axes.set_title(f"Convergence of the conversion, {len(some.utterances)} recordings")
    picture.legend(loc="outside right upper", fontsize="small")
    axes.grid(alpha=0.3)
    _save(picture, folder / PLOT_FILES["steps"])

    made = by_em[:PREDICTED_RECORDINGS]
    picture = Figure(figsize=(10, 2.2 * len(made)), layout="constrained")
    all_axes = picture.subplots(len(made), 1, squeeze=False)[:, 0]
    for axes, clip, utterance in zip(all_axes, made, some.utterances, strict=False):
        axes.plot(clip.time_s, clip.original[:, 0], "k:", label="recorded")
        axes.plot(clip.time_s, clip.generated[:, 0], color="tab:blue", label="predicted")
        _label_axes(axes, some, f"{utterance.name}: {' '.join(utterance.words or ())}")
    all_axes[0].legend(loc="upper right", ncols=2)
    all_axes[-1].set_xlabel("time (s)")
    _save(picture, folder / PLOT_FILES["clips"])


def _label_axes(axes: Any, recordings: HeldOutRecordings, title: str) -> None:
    name = recordings.channels[0]
    unit = next(c.unit for c in recordings.utterances[0].track.motion.channels if c.name == name).replace("_", " ")
    axes.set_ylabel(f"{name} ({unit}{'s' if unit != GREY else ' levels'})")
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.3)


def _save(picture: Any, path: Path) -> None:
    with atomic_file(path) as unfinished:
        picture.savefig(unfinished, format="png", dpi=110)


@dataclass(frozen=True)
class ComparisonOptions:
    """Which systems are compared, and in which conditions.

    mixtures    : most Gaussians a state where their number is chosen, on the list ``val``
    visual      : which motion is modelled and compared, as in ``train``; eigenlips are those of the training
    transcripts : compare also with known transcripts
    voices      : speech of others, on which systems of two stages are trained as well
    """

    systems: Sequence[str] | None = None
    mixtures: int = 8
    visual: str = GEOMETRY
    transcripts: bool = False
    voices: Sequence[SpokenSentence] = ()


DEFAULT_OPTIONS = ComparisonOptions()
QUICK = ComparisonOptions(
    systems=[
        *systems.PAPER_FIGURES,
        *(name + systems.SPLIT for name in systems.PAPER_FIGURES if "FHMM" not in name),
        "mean pose",
    ],
    mixtures=2,
)
"""A small comparison, for the recordings of ``runner.take_quick_part``; conversion by factorial chains is slow."""


@limit_threads()
def run_xieliu2007(  # noqa: PLR0913
    corpus: Corpus,
    options: ComparisonOptions = DEFAULT_OPTIONS,
    *,
    split: str | None = "test",
    order: Sequence[str] | None = None,
    sizes: Sequence[int] | None = None,
    plots: Path | None = None,
    work: Path | None = None,
    settings: runner.ExperimentSettings = runner.DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Train the six systems of the paper, this project's engines and baselines; return their figures on ``split``.

    order, sizes : train on the first N names of a list, as in ``run_learning_curve``; by default on all of ``train``
    The phones in time are computed once for each size and are the same for all systems.
    Raises InputError: no such system, or sizes that the list does not have.
    Raises CorpusError: no utterances to train on, to choose with, or of this split, or motion without an opening.
    Raises MissingDependencyError: the pictures need a package that is not installed.
    Raises ExportError: the pictures cannot be written.
    """
    names, seed = systems.select_systems(options.systems), settings.seed
    if not options.voices and (without := [name for name in names if systems.COMPARED_SYSTEMS[name].second_stage]):
        raise InputError(f"{without[0]} needs speech of others; give it by --recordings or --voices")
    check_visual(options.visual)
    chosen_on_val = any(systems.COMPARED_SYSTEMS[name].splits for name in names)
    held_out, validation = corpus.required(split), corpus.required("val") if chosen_on_val else ()
    listed = runner.choose_training_names(corpus, order, seed, (*held_out, *validation))
    steps = runner.choose_sizes(sizes if sizes is not None else [len(listed)], len(listed))
    setup = _TrainingSetup(corpus, held_out, validation, options, settings, work)
    if options.visual != EIGENLIPS:
        runner.check_opening(corpus, held_out)  # before the long work
    if plots is not None:
        check_plot_folder(plots)
        check_apart([plots], [Source(corpus.path, "corpus")])
    rows: list[dict[str, Any]] = []
    parts = runner.share_out(settings, [f"{count} clips" for count in steps], sizes=steps)
    for count, part in zip(steps, parts, strict=True):
        used, recordings, trained = setup.train(names, listed[:count], part.monitor)
        checkpoint = setup.open_checkpoint(listed[:count], held_out)
        figures = _measure_systems(recordings, trained, options.transcripts, settings, checkpoint)
        rows.append({"names": count, "used": used} | figures)
    if plots is not None:
        draw_plots(trained[systems.REFERENCE_SYSTEM], recordings, plots)
    about = {"split": split or "all", "clips": len(held_out), "seed": seed, "workers": settings.workers}
    about |= {"order": "given" if order is not None else "shuffled", "visual": options.visual}
    about |= {"channels": list(recordings.channels), "closed_under": recordings.closed_under}
    return replace_nan(about | {"validation": len(validation), "rows": rows})


@dataclass(frozen=True, eq=False)
class _TrainingSetup:
    """What the trainings on all sizes have in common."""

    corpus: Corpus
    held_out: Sequence[str]
    validation: Sequence[str]
    options: ComparisonOptions
    settings: runner.ExperimentSettings
    work: Path | None

    def train(
        self, wanted: Sequence[str], names: Sequence[str], monitor: Monitor
    ) -> tuple[int, HeldOutRecordings, dict[str, systems.TrainedSystem]]:
        """Return how many utterances ``names`` are used, what is held out, and systems trained on the same phones."""
        examples, recordings = self._prepare(names, sub_monitor(monitor, 0, 0.3))
        checkpoint, trained = self.open_checkpoint(names), dict[str, systems.TrainedSystem]()
        others = [*list_motionless(engine_named("coupled"), self.options.voices)]
        for number, name in enumerate(wanted):
            start, stop = 0.3 + 0.7 * number / len(wanted), 0.3 + 0.7 * (number + 1) / len(wanted)
            part, compared = sub_monitor(monitor, start, stop, f"{name}: "), systems.COMPARED_SYSTEMS[name]
            chains = compared.make is None and not compared.same_model_as  # coupled chains of its own
            arrays = checkpoint.load(f"system-{name}") if chains else None
            if arrays is not None:
                trained[name] = systems.system_from_arrays(arrays)
                continue
            known = [*systems.with_inputs_of(name, examples, self.corpus)]
            known += others if compared.second_stage else []
            trained[name] = systems.train_system(
                name, known, recordings.get("val"), trained, self.options.mixtures, part
            )
            if chains:  # their arrays are rounded when they are stored, and so is every model that is used
                arrays = systems.system_to_arrays(trained[name])
                checkpoint.save(f"system-{name}", arrays)
                trained[name] = systems.system_from_arrays(arrays)
        return len(examples), recordings["held out"], trained

    def _prepare(self, names: Sequence[str], monitor: Monitor) -> tuple[list[Example], dict[str, HeldOutRecordings]]:
        """Return the examples of some utterances, and recordings with the phones of models trained on these."""
        settings, visual = replace(self.settings, monitor=monitor), self.options.visual
        utterances = [self.corpus.utterance(name) for name in sorted(names)]
        eigenlips = train_eigenlips(utterances) if visual != GEOMETRY else None
        utterances = [with_visual_channels(utterance, visual, eigenlips) for utterance in utterances]
        phones, examples = runner.train_phones(utterances, settings.narrow(0, 0.7), self.open_checkpoint(names))
        parts = {name: part for name, part in (("held out", self.held_out), ("val", self.validation)) if part}
        recordings: dict[str, HeldOutRecordings] = {}
        for number, (name, part) in enumerate(parts.items()):
            reading = settings.narrow(0.7 + 0.15 * number, 0.85 + 0.15 * number)
            channels = recordings["held out"].channels if recordings else None
            recordings[name] = runner.recognise_held_out(
                self.corpus, phones, part, reading, channels=channels, visual=visual, eigenlips=eigenlips
            )
        return examples, recordings

    def open_checkpoint(self, names: Sequence[str], compared: Sequence[str] = ()) -> Checkpoint:
        """Return what is kept of the work on the first recordings of a list, and of comparisons on others."""
        others = " ".join((str(self.options.mixtures), *(spoken.name for spoken in self.options.voices), *compared))
        everything = (*names, *self.corpus.names("val"))
        key = runner.PartKey(engine_named("coupled"), everything, self.options.visual, others=others)
        return runner.open_parts(self.work and self.work / str(len(names)), self.corpus, self.settings, key)


def _measure_systems(
    recordings: HeldOutRecordings,
    trained: Mapping[str, systems.TrainedSystem],
    transcripts: bool,
    settings: runner.ExperimentSettings,
    checkpoint: Checkpoint,
) -> dict[str, Any]:
    """Return the figures of all systems trained on one number of utterances."""
    conditions, seed = list(recordings.conditions) if transcripts else [AUDIO_ONLY], settings.seed
    generated: dict[str, dict[str, list[ComparedClip]]] = {condition: {} for condition in conditions}
    for condition, made in generated.items():
        for name, system in trained.items():
            arrays = checkpoint.load(f"{condition}-{name}")
            if arrays is None:
                arrays = runner.clips_to_arrays(generate_clips(recordings, condition, system.engine, system.model))
                checkpoint.save(f"{condition}-{name}", arrays)
            made[name] = runner.clips_from_arrays(arrays)
    for condition, made in generated.items():
        for name, clips in made.items():
            settings.receive(name, condition, recordings, clips)
    training: dict[str, dict[str, Any]] = {}
    for name, system in trained.items():
        row: dict[str, Any] = {"seconds": system.seconds, "parameters": None, "options": None}
        row["tried"] = [*map(systems.as_row, system.tried)]
        if name == systems.BLSTM and system.tried:
            row |= {key: getattr(systems.find_best_trial(system.tried), key) for key in ("parameters", "options")}
        if isinstance(system.model, CoupledModel):
            row["parameters"] = system.model.chains.parameters
            row["options"] = systems.list_changed_options(system.engine.config)
        training[name] = row
    return {
        "training": training,
        "conditions": {condition: _make_rows(recordings, clips, seed) for condition, clips in generated.items()},
        "pairs": _compare_paper_pairs(recordings, generated[AUDIO_ONLY], seed),
    }


def _compare_paper_pairs(
    recordings: HeldOutRecordings, made: Mapping[str, list[ComparedClip]], seed: int
) -> list[dict[str, Any]]:
    """Return how much better each system of the paper is than each that is worse in print, on the same clips."""
    by_acc = sorted(systems.PAPER_FIGURES, key=lambda name: -systems.PAPER_FIGURES[name][1])
    rows = []
    for ending in ("", systems.SPLIT):
        compared = [name + ending for name in by_acc if name + ending in made]
        pairs = [*combinations(compared, 2)]
        if not ending:
            pairs += [(name + more, name) for name in compared for more in (", tied", ", together", systems.ALL_PATHS)]
            pairs += combinations([name + systems.ALL_PATHS for name in by_acc], 2)
            pairs += [(name, name.replace(systems.TWO_STAGES, "")) for name in made if systems.TWO_STAGES in name]
        pairs = [pair for pair in pairs if {*pair} <= made.keys()]
        statistics = {name: evaluate.list_statistics(recordings, made[name]) for pair in pairs for name in pair}
        for better, worse in pairs:
            row: dict[str, Any] = {"better": better, "worse": worse}
            for key in ("acc", "amse"):
                better_value, other = statistics[better][key], statistics[worse][key]
                row |= {key: better_value.value - other.value, f"{key}_95": better_value.compute_gain(other, seed)}
            rows.append(row)
    return rows


def _make_rows(recordings: HeldOutRecordings, made: Mapping[str, list[ComparedClip]], seed: int) -> dict[str, Any]:
    """Return the figures of what all systems generate for the same recordings, and differences from the reference."""
    reference, rows = evaluate.list_statistics(recordings, made[systems.REFERENCE_SYSTEM]), {}
    for system, clips in made.items():
        figures = evaluate.measure_clips(clips, recordings, seed)
        row: dict[str, Any] = {}
        for name, statistic in evaluate.list_statistics(recordings, clips).items():
            row[name], row[f"{name}_95"] = statistic.value, statistic.compute_interval(seed)
            row[f"{name}_gain_95"] = statistic.compute_gain(reference[name], seed)
        still = not varies(np.concatenate([clip.generated for clip in clips])).any()
        row |= {"lag_ms": None if still else figures["lag_ms"], "opening": None}
        if OPENING in recordings.channels:
            rmse = float(curves.rmse(*evaluate.pair_curves(recordings, clips))[0])
            row["opening"] = runner.make_opening_row(figures) | {"rmse": rmse}
        rows[system] = row
    return rows
