"""Xie & Liu 2007, Table 3, on any corpus: which structure of chains predicts lips best, beside other systems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.errors import InputError
from lipmotion.experiments.comparison import ClipStatistic, correlation_statistic, distance_statistic, opening_curves
from lipmotion.experiments.learning_curve import check_training_names, training_sizes
from lipmotion.experiments.noise import recordings_in_noise
from lipmotion.experiments.runner import (
    DEFAULT_SETTINGS,
    ExperimentSettings,
    channels_with_opening,
    opening_row,
    shuffled,
)
from lipmotion.experiments.xie_liu2007.mixtures import MIXTURE_COUNTS, check_mixture_counts
from lipmotion.experiments.xie_liu2007.plots import check_plot_folder, draw_plots
from lipmotion.experiments.xie_liu2007.systems import REFERENCE_SYSTEM, TrainedSystem, selected_systems, train_systems
from lipmotion.hmm.model import HmmConfig
from lipmotion.kernels.threads import one_thread
from lipmotion.measures import curves
from lipmotion.pipeline.evaluation.conditions import (
    AUDIO_ONLY,
    OPENING,
    ComparedClip,
    HeldOutRecordings,
    compared_clips,
    held_out_recordings,
)
from lipmotion.pipeline.evaluation.figures import figures_of
from lipmotion.pipeline.training.channels import (
    EIGENLIPS,
    GEOMETRY,
    check_visual,
    train_eigenlips,
    with_visual_channels,
)
from lipmotion.pipeline.training.train import UTTERANCES_PER_WORKER, phones_and_examples
from lipmotion.pipeline.workers import worker_pool
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.speech.sound.noise import FEWEST_TALKERS, NOISE_KINDS
from lipmotion.stats.rounding import varies
from lipmotion.storage.checkpoint import NO_CHECKPOINT
from lipmotion.storage.json_text import nan_as_null
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import Audio, Monitor, sub_monitor, with_progress
from lipmotion.units import Lexicon

STATES = 5
"""Per unit, in the paper."""
BABBLE = "babble"
RATIOS_DB = (20.0, 10.0, 5.0, 0.0)


@dataclass(frozen=True)
class NoiseConditions:
    """Noise that is added to the held-out recordings.

    kinds     : of ``speech.sound.noise.NOISE_KINDS``
    ratios_db : signal-to-noise ratios
    talkers   : recordings for the babble
    """

    kinds: tuple[str, ...] = ()
    ratios_db: tuple[float, ...] = RATIOS_DB
    talkers: tuple[Audio, ...] = ()

    def __post_init__(self) -> None:
        unknown = [kind for kind in self.kinds if kind not in NOISE_KINDS]
        if unknown:
            raise InputError(f"unknown noise {unknown[0]!r}; required some of: {', '.join(NOISE_KINDS)}")
        if BABBLE in self.kinds and len(self.talkers) < FEWEST_TALKERS:
            raise InputError(f"a babble of {len(self.talkers)} talkers; required at least {FEWEST_TALKERS}: --talkers")


@dataclass(frozen=True)
class ComparisonOptions:
    """Which systems are compared, and in which conditions.

    systems     : names of ``systems.COMPARED_SYSTEMS``; None: all whose packages are installed
    states      : per unit, in the systems of the paper
    mixtures    : numbers of Gaussians per state of these systems; one is selected on the list ``val`` for each size
    visual      : which motion is modelled and compared, as in ``train``; eigenlips are those of the training
    transcripts : compare also with known transcripts
    noise       : noise in which the systems trained on the largest size are compared as well
    """

    systems: Sequence[str] | None = None
    states: int = STATES
    mixtures: Sequence[int] = MIXTURE_COUNTS
    visual: str = GEOMETRY
    transcripts: bool = False
    noise: NoiseConditions | None = None


DEFAULT_OPTIONS = ComparisonOptions()


@one_thread()
def table3(
    corpus: Corpus,
    options: ComparisonOptions = DEFAULT_OPTIONS,
    *,
    split: str | None = "test",
    order: Sequence[str] | None = None,
    sizes: Sequence[int] | None = None,
    plots: Path | None = None,
    settings: ExperimentSettings = DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Train the six systems of the paper, this project's engines and baselines; return their figures on ``split``.

    order, sizes : train on the first N names of a list, as in ``learning_curve``; by default on all of ``train``
    plots        : a folder for pictures like Figs. 7, 10 and 11 of the paper, of the largest size
    settings     : its workers share the forced alignment
    The phones in time are computed once for each size and are the same for all systems.
    Raises InputError: no such system, sizes that the list does not have, numbers that are no powers of two.
    Raises CorpusError: no utterances to train on, to choose with, or of this split, or motion without an opening.
    Raises MissingDependencyError: a system or the pictures need a package that is not installed.
    Raises ExportError: the pictures cannot be written.
    """
    names, mixtures, seed = selected_systems(options.systems), options.mixtures, settings.seed
    check_mixture_counts(mixtures)
    check_visual(options.visual)
    listed = tuple(order) if order is not None else shuffled(corpus.required("train"), seed)
    held_out, validation = corpus.required(split), corpus.required("val") if len(mixtures) > 1 else ()
    check_training_names(corpus, listed, (*held_out, *validation))
    steps = training_sizes(sizes if sizes is not None else [len(listed)], len(listed))
    setup = _TrainingSetup(corpus, names, held_out, validation, options, settings)
    if options.visual != EIGENLIPS:
        channels_with_opening(corpus, held_out)  # before the long work
    if plots is not None:
        check_plot_folder(plots)
        check_apart([plots], [Source(corpus.path, "corpus")])
    shares = 0.9 * np.cumsum([0, *steps]) / sum(steps)
    rows: list[dict[str, Any]] = []
    for count, (start, stop) in zip(steps, pairwise(shares), strict=True):
        part = sub_monitor(settings.monitor, float(start), float(stop), f"{count} clips: ")
        trained = setup.train(listed[:count], part)
        rows.append({"names": count} | _size(trained, options.transcripts, seed))
    noise = options.noise or NoiseConditions()
    noise_rows = _noise_rows(trained, noise, seed, sub_monitor(settings.monitor, 0.9, 1))
    recordings = trained.recordings
    if plots is not None:
        draw_plots(trained.systems[REFERENCE_SYSTEM], recordings, plots)
    about = {"split": split or "all", "clips": len(held_out), "seed": seed, "states": options.states}
    about |= {"workers": settings.workers, "order": "given" if order is not None else "shuffled"}
    about |= {"mixtures": list(mixtures), "visual": options.visual}
    about |= {"channels": list(recordings.channels), "closed_under": recordings.closed_under}
    return nan_as_null(about | {"rows": rows, "noise": noise_rows})


@dataclass(frozen=True, eq=False)
class _TrainedSystems:
    """Systems trained on some utterances, and the held-out recordings.

    used : names of the utterances that they were trained on
    """

    used: tuple[str, ...]
    recordings: HeldOutRecordings
    systems: Mapping[str, TrainedSystem]


@dataclass(frozen=True, eq=False)
class _TrainingSetup:
    """What the trainings on all sizes have in common.

    systems              : names
    held_out, validation : names of utterances
    """

    corpus: Corpus
    systems: Sequence[str]
    held_out: Sequence[str]
    validation: Sequence[str]
    options: ComparisonOptions
    settings: ExperimentSettings

    def train(self, names: Sequence[str], monitor: Monitor) -> _TrainedSystems:
        """Return all systems, trained on the same phones of the utterances ``names``."""
        lexicon, config = self.settings.lexicon or Lexicon(), self.settings.recogniser or HmmConfig()
        visual, options = self.options.visual, self.options
        utterances = [self.corpus.utterance(name) for name in sorted(names)]
        eigenlips = train_eigenlips(utterances) if visual != GEOMETRY else None
        utterances = [with_visual_channels(utterance, visual, eigenlips) for utterance in utterances]
        with worker_pool(min(self.settings.workers, len(utterances) // UTTERANCES_PER_WORKER)) as team:
            aligning = sub_monitor(monitor, 0, 0.2)
            phones, examples, _ = phones_and_examples(
                utterances, config, lexicon, aligning, NO_CHECKPOINT, team.ordered_map
            )
        read = partial(held_out_recordings, self.corpus, cached_recogniser(phones), lexicon=lexicon)
        read = partial(read, visual=visual, eigenlips=eigenlips)
        recordings = read(selection=Selection(names=self.held_out), monitor=sub_monitor(monitor, 0.2, 0.25))
        validation = None
        if self.validation:
            recognising = sub_monitor(monitor, 0.25, 0.3)
            validation = read(
                selection=Selection(names=self.validation), channels=recordings.channels, monitor=recognising
            )
        training = sub_monitor(monitor, 0.3, 1)
        systems = train_systems(self.systems, examples, validation, options.states, options.mixtures, training)
        return _TrainedSystems(tuple(example.name for example in examples), recordings, systems)


def _size(trained: _TrainedSystems, transcripts: bool, seed: int) -> dict[str, Any]:
    """Return the figures of all systems trained on one number of utterances."""
    recordings, systems = trained.recordings, trained.systems
    conditions = list(recordings.conditions) if transcripts else [AUDIO_ONLY]
    return {
        "used": len(trained.used),
        "training": {name: _training_row(system) for name, system in systems.items()},
        "conditions": {condition: _rows(recordings, condition, systems, seed) for condition in conditions},
    }


def _training_row(system: TrainedSystem) -> dict[str, Any]:
    """Return training time, number of Gaussians, and the ACC by which it was selected."""
    tried = {str(count): acc for count, acc in system.validation_acc.items()}
    return {"seconds": system.seconds, "mixtures": system.mixtures, "tried": tried}


def _rows(
    recordings: HeldOutRecordings, condition: str, systems: Mapping[str, TrainedSystem], seed: int
) -> dict[str, dict[str, Any]]:
    """Return the figures of all systems on the same recordings in one condition."""
    made = {
        name: compared_clips(recordings, condition, system.engine, system.model) for name, system in systems.items()
    }
    return {name: _row(recordings, own, made[REFERENCE_SYSTEM], seed) for name, own in made.items()}


def _row(
    recordings: HeldOutRecordings, made: Sequence[ComparedClip], reference: Sequence[ComparedClip], seed: int
) -> dict[str, Any]:
    """Return the figures of one system, and its differences from the reference system."""
    figures, others = figures_of(made, recordings, seed), _statistics(recordings, reference)
    row: dict[str, Any] = {}
    for name, statistic in _statistics(recordings, made).items():
        intervals = {"95": statistic.interval(seed), "gain_95": statistic.gain(others[name], seed)}
        row |= {name: statistic.value} | {f"{name}_{key}": interval for key, interval in intervals.items()}
    still = not varies(np.concatenate([clip.generated for clip in made])).any()
    row |= {"lag_ms": None if still else figures["lag_ms"], "opening": None}
    if OPENING not in recordings.channels:
        return row
    lips, (generated, original) = figures["closures_p_b_m"], opening_curves(recordings, made)
    opening = opening_row(figures) | {"rmse": float(curves.rmse(generated, original)[0])}
    return row | {"opening": opening | {key: lips[key] for key in ("false_per_minute", "original_per_minute")}}


def _statistics(recordings: HeldOutRecordings, made: Sequence[ComparedClip]) -> dict[str, ClipStatistic]:
    """Return AMSE and ACC of geometry, or of eigenlips if there is no geometry; and the ACC of the opening."""
    pictured = np.array([name in recordings.eigenlips_channels for name in recordings.channels])
    parts = {"": pictured} if pictured.all() else {"": ~pictured, "eigenlips_": pictured}
    statistics = {}
    for part, columns in parts.items():
        if columns.any():
            generated = [clip.generated[:, columns] for clip in made]
            original = [clip.original[:, columns] for clip in made]
            statistics[f"{part}amse"] = distance_statistic(generated, original)
            statistics[f"{part}acc"] = correlation_statistic(generated, original)
    if OPENING in recordings.channels:
        statistics["opening_acc"] = correlation_statistic(*opening_curves(recordings, made))
    return statistics


def _noise_rows(trained: _TrainedSystems, noise: NoiseConditions, seed: int, monitor: Monitor) -> list[dict[str, Any]]:
    """Return the figures of all systems for every kind of noise and ratio."""
    rows = []
    conditions = [(kind, ratio_db) for kind in noise.kinds for ratio_db in noise.ratios_db]
    for kind, ratio_db in with_progress(conditions, "comparing in noise", monitor):
        recordings = recordings_in_noise(trained.recordings, kind, ratio_db, noise.talkers, seed)
        systems = _rows(recordings, AUDIO_ONLY, trained.systems, seed)
        rows.append({"kind": kind, "snr_db": ratio_db, "systems": systems})
    return rows
