"""``lipmotion experiment engines``: all engines on the same recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from lipmotion.corpora import Corpus
from lipmotion.engines import Engine, engine_named
from lipmotion.errors import InputError
from lipmotion.kernels.compiler import limit_threads
from lipmotion.pipeline.model import Model, load_model, save_model
from lipmotion.pipeline.training.train import TRAINING_LIST, Run, describe_training, train
from lipmotion.storage.files import make_folder
from lipmotion.storage.json_text import replace_nan
from lipmotion.storage.locks import keep_unfinished
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import sub_monitor, with_progress
from lipmotion_lab import runner
from lipmotion_lab.evaluation.evaluate import measure_clips, pair_curves, sum_correlations
from lipmotion_lab.evaluation.held_out import OPENING, ComparedClip, HeldOutRecordings, generate_compared, make_speech

ENGINES_COMPARED = ("trajectory", "coupled", "selection")
SUFFIX = ".lipmotion"
CHECKED = ("corpus", "split", "minutes")
"""What the header of a model says of its training, and must say of this corpus's training list."""


def train_engines(
    corpus: Corpus, folder: Path | None, settings: runner.ExperimentSettings, names: Sequence[str] = ENGINES_COMPARED
) -> dict[str, tuple[Model, float | None]]:
    """Return models of the corpus's training list, and the seconds of their training (None: it was there already).

    Every engine has its defaults.

    folder : holds the models; what is not there yet is trained and put there. None: all are trained and not kept
    A run that was stopped goes on where it was.
    Raises CorpusError: no training list. Raises InputError: a file in the folder is a model of something else.
    Raises ModelFormatError: a file in the folder is no model.
    Raises ExportError: the folder cannot be written to, or holds the corpus.
    """
    training = corpus.required("train")
    models: dict[str, tuple[Model, float | None]] = {}
    if folder is not None:
        check_apart((), [Source(corpus.path, "corpus")], folders=[folder])
        make_folder(folder)
        paths = {name: folder / f"{name}{SUFFIX}" for name in names}
        models = {name: (load_model(path), None) for name, path in paths.items() if path.is_file()}
        if models:
            utterances = [corpus.utterance(name) for name in training]
            required = describe_training(corpus, utterances, TRAINING_LIST, len(training))
            for name, (model, _) in models.items():
                _check_model(paths[name], name, model, required)
    missing = [name for name in names if name not in models]
    for name, here in zip(missing, runner.share_out(settings, missing), strict=True):
        start_s, engine = perf_counter(), engine_named(name, {})
        if folder is None:
            model = train_engine(corpus, engine, here)
        else:
            with keep_unfinished(paths[name]) as work:
                save_model(train_engine(corpus, engine, here, work), paths[name])
            model = load_model(paths[name])  # as the next run finds it
        models[name] = model, perf_counter() - start_s
    return {name: models[name] for name in names}


def train_engine(
    corpus: Corpus, engine: Engine[Any], settings: runner.ExperimentSettings, work: Path | None = None
) -> Model:
    """Return a model of the training list; ``work``: a folder from which training that was stopped goes on."""
    run = Run(settings.monitor, work, settings.workers)
    return train(corpus, engine=engine, recogniser=settings.recogniser, lexicon=settings.lexicon, run=run)[0]


def _check_model(path: Path, name: str, model: Model, required: Mapping[str, object]) -> None:
    """Raise InputError unless a model is one of this engine and of the training list of the corpus."""
    way_out = "; move it away, or give another folder"
    if model.engine.name != name:
        raise InputError(f"{path}: a model of the engine {model.engine.name!r}, required {name!r}{way_out}")
    if model.prior is not None:
        raise InputError(
            f"{path}: stands on another model, which may know the recordings that are compared; required one that "
            f"stands on none (train --from none){way_out}"
        )
    different = [key for key in CHECKED if model.about.get(key) != required[key]]
    if different:
        texts = [", ".join(f"{key} {about.get(key)}" for key in different) for about in (model.about, required)]
        raise InputError(
            f"{path}: trained on {texts[0]}, required the training list of this corpus: {texts[1]}{way_out}"
        )


REFERENCE_ENGINE = "trajectory"
"""The engine that every other system is compared with; its phone models give the phones in time."""
WIDTH, WIDTH_FIGURES = "width", ("acc", "nrmse", "global_variance")


@limit_threads()
def compare_engines(
    corpus: Corpus,
    *,
    split: str | None = "val",
    models: Path | None = None,
    settings: runner.ExperimentSettings = runner.DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Return the figures of all engines on ``split``.

    models : folder of the engines' models (``train_engines``); None: they are trained and not kept
    The phones in time are those of the trajectory engine's phone models, for all of them.
    Raises CorpusError: no training list, no utterances of this split or some of the training list among them, or
    motion without an opening.
    Raises InputError, ModelFormatError, ExportError: as ``train_engines``.
    """
    held_out = corpus.required(split)
    runner.check_training_names(corpus, corpus.required("train"), held_out)
    channels = runner.check_opening(corpus, held_out)
    trained = train_engines(corpus, models, settings.narrow(0, 0.6))
    phones = trained[REFERENCE_ENGINE][0].phones
    recordings = runner.recognise_held_out(corpus, phones, held_out, settings.narrow(0.6, 0.7), channels=channels)
    steps = [(condition, name) for condition in recordings.conditions for name in trained]
    made: dict[str, dict[str, tuple[Sequence[ComparedClip], Sequence[ComparedClip]]]] = {
        condition: {} for condition in recordings.conditions
    }
    for condition, name in with_progress(steps, "comparing", sub_monitor(settings.monitor, 0.7, 1)):
        system = trained[name][0]
        known = replace(recordings, speakers=system.speakers)
        speech = make_speech(known, condition, system.engine, system.learned)
        clips = generate_compared(known, speech, system.engine, system.learned)
        free = system.engine.without_closures()
        unpinned = clips if free == system.engine else generate_compared(known, speech, free, system.learned)
        made[condition][name] = clips, unpinned
        settings.receive(name, condition, recordings, clips)
    about = {"split": split or "all", "clips": len(held_out), "seed": settings.seed}
    about |= {"closed_under": recordings.closed_under, "reference": REFERENCE_ENGINE}
    about["models"] = {
        name: {"configuration": model.engine.config.as_mapping()}
        | {key: model.about[key] for key in ("utterances", "minutes")}
        | {"seconds": seconds}
        for name, (model, seconds) in trained.items()
    }
    conditions = {name: {"systems": _make_rows(recordings, systems, settings.seed)} for name, systems in made.items()}
    return replace_nan(about | {"conditions": conditions})


def _make_rows(
    recordings: HeldOutRecordings, made: Mapping[str, tuple[Sequence[ComparedClip], Sequence[ComparedClip]]], seed: int
) -> dict[str, dict[str, Any]]:
    """Return the figures of systems, with ACC gains over each system; ``unpinned``: without forced closures."""
    acc = {name: sum_correlations(*pair_curves(recordings, clips)) for name, (clips, _) in made.items()}
    rows = {}
    for name, (clips, free) in made.items():
        figures = measure_clips(clips, recordings, seed)
        width = figures["channels"].get(WIDTH, {})
        row = runner.make_opening_row(figures) | {f"{WIDTH}_{key}": width.get(key) for key in WIDTH_FIGURES}
        row |= {"acc_gain_95": {other: acc[name].compute_gain(statistic, seed) for other, statistic in acc.items()}}
        row |= {"jerk": figures["channels"][OPENING]["jerk"], "lag_ms": figures["lag_ms"]}
        rows[name] = row | {"unpinned": runner.make_opening_row(measure_clips(free, recordings, seed))}
    return rows
