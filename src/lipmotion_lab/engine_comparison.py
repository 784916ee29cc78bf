"""``lipmotion experiment engines``: all engines on the same recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import engine_named
from lipmotion.errors import InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.measures.evaluation_table import figure_text
from lipmotion.pipeline.model import Model, load_model, save_model
from lipmotion.pipeline.training.train import Run, about_training, train
from lipmotion.printable import printable
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.storage.files import make_folder, unfinished_work
from lipmotion.storage.json_text import nan_as_null
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import sub_monitor, with_progress
from lipmotion_lab.comparison import correlation_statistic, opening_curves, significance_mark
from lipmotion_lab.evaluation.evaluate import figures_of
from lipmotion_lab.evaluation.held_out import (
    OPENING,
    ComparedClip,
    HeldOutRecordings,
    compare_with_recorded,
    held_out_recordings,
    speech_of_condition,
)
from lipmotion_lab.learning_curve import check_training_names
from lipmotion_lab.runner import DEFAULT_SETTINGS, ExperimentSettings, channels_with_opening, opening_row

ENGINES_COMPARED = ("trajectory", "coupled", "selection")
SUFFIX = ".lipmotion"
CHECKED = ("corpus", "split", "minutes")
"""What the header of a model says of its training, and must say of this corpus's training list."""


@dataclass(frozen=True, eq=False)
class EngineModel:
    """A model of one engine.

    seconds : of its training in this run; None: it was there already
    """

    model: Model
    seconds: float | None


def engine_models(
    corpus: Corpus, folder: Path | None, settings: ExperimentSettings, names: Sequence[str] = ENGINES_COMPARED
) -> dict[str, EngineModel]:
    """Return models of the corpus's training list, each engine by its defaults.

    names  : of the engines
    folder : has or gets the models, ``trajectory.lipmotion`` and so on; None: all are trained, and none is kept.
             Training that was stopped goes on where it was.
    No model stands on another one, which may have been trained on the recordings that are compared.
    Raises CorpusError: no training list, or nothing in it that can be used.
    Raises InputError: a file in the folder is a model of something else.
    Raises ModelFormatError: a file in the folder is no model.
    Raises ExportError: the folder cannot be written to, or holds the corpus.
    """
    corpus.required("train")
    found: dict[str, EngineModel] = {}
    if folder is not None:
        check_apart((), [Source(corpus.path, "corpus")], folders=[folder])
        make_folder(folder)
        found = _present(corpus, folder, names)
    missing = [name for name in names if name not in found]
    for number, name in enumerate(missing):
        part = sub_monitor(settings.monitor, number / len(missing), (number + 1) / len(missing), f"{name}: ")
        found[name] = _trained(corpus, name, folder, settings, Run(part, None, settings.workers))
    return {name: found[name] for name in names}


def _trained(corpus: Corpus, name: str, folder: Path | None, settings: ExperimentSettings, run: Run) -> EngineModel:
    start_s = perf_counter()

    def learned(work: Path | None) -> Model:
        return train(
            corpus,
            engine=engine_named(name, {}),
            recogniser=settings.recogniser,
            lexicon=settings.lexicon,
            run=Run(run.monitor, work, run.workers),
        )[0]

    if folder is None:
        return EngineModel(learned(None), perf_counter() - start_s)
    path = folder / f"{name}{SUFFIX}"
    with unfinished_work(path) as work:
        save_model(learned(work), path)
    return EngineModel(load_model(path), perf_counter() - start_s)  # as the next run finds it


def _present(corpus: Corpus, folder: Path, engines: Sequence[str]) -> dict[str, EngineModel]:
    """Return the models that are in a folder. Raises InputError: one of them is of something else."""
    paths = {name: folder / f"{name}{SUFFIX}" for name in engines}
    models = {name: load_model(path) for name, path in paths.items() if path.is_file()}
    if models:
        names = corpus.required("train")
        wanted = about_training(corpus, [corpus.utterance(name) for name in names], "train", len(names))
        for name, model in models.items():
            _check(paths[name], name, model, wanted)
    return {name: EngineModel(model, None) for name, model in models.items()}


def _check(path: Path, name: str, model: Model, wanted: Mapping[str, object]) -> None:
    """Raise InputError unless a model is one of this engine and of the training list of the corpus."""
    way_out = "; move it away, or give another folder"
    if model.engine.name != name:
        raise InputError(f"{path}: a model of the engine {model.engine.name!r}, required {name!r}{way_out}")
    if model.prior is not None:
        raise InputError(
            f"{path}: stands on another model, which may know the recordings that are compared; required one that "
            f"stands on none (train --from none){way_out}"
        )
    different = [key for key in CHECKED if model.about.get(key) != wanted[key]]
    if different:
        found, required = (", ".join(f"{key} {about.get(key)}" for key in different) for about in (model.about, wanted))
        raise InputError(f"{path}: trained on {found}, required the training list of this corpus: {required}{way_out}")


NAME_WIDTH = 19
HEAD = (
    f"  {'system':{NAME_WIDTH}}{'ACC (95 %)':23}  nRMSE  variance  jerk  width | score  precision  p b m  false |"
    "  no pins: score  precision  p b m  false"
)
LEGEND = (
    "variance, jerk: by those of the recordings; width: its ACC; score, precision, p b m: %; false: closings outside "
    "p b m, a minute of speech; no pins: lips not made to meet"
)
CLOSURES = (("score", "6.1f"), ("precision", "11.1f"), ("recall_p_b_m", "7.1f"), ("false_per_minute", "7.0f"))


def table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``comparison.engines`` as text."""
    minutes = {row["minutes"] for row in figures["models"].values()}
    lines = [
        f"split {figures['split']}: {figures['clips']} clips; models of {' and '.join(map(str, sorted(minutes)))} "
        f"minutes of train; closed under {figures['closed_under']:.4f}"
    ]
    for name, condition in figures["conditions"].items():
        row = next(iter(condition["systems"].values()))
        lines += [
            "",
            f"{name}: opening, with {row['p_b_m']} p b m and {row['closings']} closings recorded, "
            f"{figure_text(row['original_per_minute'], '.0f')} a minute outside p b m",
            HEAD,
            *(_line(system, each, figures["reference"]) for system, each in condition["systems"].items()),
        ]
    lines += [
        "",
        f"* differs from {figures['reference']}: the 95 % interval of the difference on the same clips leaves out 0",
        LEGEND,
    ]
    return "\n".join(map(printable, lines))


def _line(name: str, row: Mapping[str, Any], reference: str) -> str:
    acc = "{}{} ({}–{})".format(
        figure_text(row["acc"], ".3f"),
        significance_mark(row["acc_gain_95"][reference]),
        *(figure_text(end, ".3f") for end in row["acc_95"]),
    )
    opening = figure_text(row["nrmse"], "7.3f") + figure_text(row["global_variance"], "10.2f")
    opening += figure_text(row["jerk"], "6.2f")
    return (
        f"  {name:{NAME_WIDTH}}{acc:23}{opening}{figure_text(row['width_acc'], '7.3f')} |{_closures(row)} |"
        f"{'':9}{_closures(row['unpinned'])}"
    )


def _closures(row: Mapping[str, Any]) -> str:
    return "".join(figure_text(row[name], form) for name, form in CLOSURES)


REFERENCE_ENGINE = "trajectory"
"""The engine that every other system is compared with; its phone models give the phones in time."""
WIDTH = "width"


@dataclass(frozen=True, eq=False)
class _MadeClips:
    """What a system generates in one condition, with closures forced and without."""

    pinned: Sequence[ComparedClip]
    free: Sequence[ComparedClip]


@one_thread()
def engines(
    corpus: Corpus,
    *,
    split: str | None = "val",
    models: Path | None = None,
    settings: ExperimentSettings = DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Return the figures of all engines on ``split``.

    split  : the recordings to compare; none of them may be in the training list
    models : folder of the engines' models (``models.engine_models``); None: they are trained and not kept
    The phones in time are those of the trajectory engine's phone models, for all of them.
    Raises CorpusError: no training list, no utterances of this split or some of the training list among them, or
    motion without an opening.
    Raises InputError, ModelFormatError, ExportError: as ``engine_models``.
    """
    held_out = corpus.required(split)
    check_training_names(corpus, corpus.required("train"), held_out)
    channels = channels_with_opening(corpus, held_out)
    monitor = settings.monitor
    trained = engine_models(corpus, models, replace(settings, monitor=sub_monitor(monitor, 0, 0.6)))
    recordings = held_out_recordings(
        corpus,
        cached_recogniser(trained[REFERENCE_ENGINE].model.phones),
        selection=Selection(names=held_out),
        channels=channels,
        lexicon=settings.lexicon,
        monitor=sub_monitor(monitor, 0.6, 0.7),
    )
    steps = [(condition, name) for condition in recordings.conditions for name in trained]
    made: dict[str, dict[str, _MadeClips]] = {condition: {} for condition in recordings.conditions}
    for condition, name in with_progress(steps, "comparing", sub_monitor(monitor, 0.7, 1)):
        system = trained[name].model
        known = replace(recordings, speakers=system.speakers)
        speech = speech_of_condition(known, condition, system.engine, system.learned)
        pinned = compare_with_recorded(known, speech, system.engine, system.learned)
        free = system.engine.without_closures()
        made[condition][name] = _MadeClips(
            pinned, compare_with_recorded(known, speech, free, system.learned) if free != system.engine else pinned
        )
        settings.receive(name, condition, recordings, made[condition][name].pinned)
    about = {"split": split or "all", "clips": len(held_out), "seed": settings.seed}
    about |= {"closed_under": recordings.closed_under, "reference": REFERENCE_ENGINE}
    about["models"] = {
        name: {
            "configuration": each.model.engine.config.as_mapping(),
            "utterances": each.model.about["utterances"],
            "minutes": each.model.about["minutes"],
            "seconds": each.seconds,
        }
        for name, each in trained.items()
    }
    conditions = {}
    for condition, found in made.items():
        references = {name: each.pinned for name, each in found.items()}
        rows = {name: _row(recordings, each, references, settings.seed) for name, each in found.items()}
        conditions[condition] = {"systems": rows}
    return nan_as_null(about | {"conditions": conditions})


def _row(
    recordings: HeldOutRecordings, made: _MadeClips, references: Mapping[str, Sequence[ComparedClip]], seed: int
) -> dict[str, Any]:
    """Return the figures of one system; ``unpinned``: those of the opening without forced closures.

    ``acc_gain_95`` has the paired 95 % interval of its ACC minus that of each engine.
    """
    own = correlation_statistic(*opening_curves(recordings, made.pinned))
    gains = {
        name: own.gain(correlation_statistic(*opening_curves(recordings, clips)), seed)
        for name, clips in references.items()
    }
    figures = figures_of(made.pinned, recordings, seed)
    width = figures["channels"].get(WIDTH, {})
    row = _opening(figures) | {"acc_gain_95": gains}
    row |= {f"{WIDTH}_{name}": width.get(name) for name in ("acc", "nrmse", "global_variance")}
    row |= {"jerk": figures["channels"][OPENING]["jerk"], "lag_ms": figures["lag_ms"]}
    return row | {"unpinned": _opening(figures_of(made.free, recordings, seed))}


def _opening(figures: Mapping[str, Any]) -> dict[str, Any]:
    lips = figures["closures_p_b_m"]
    return opening_row(figures) | {name: lips[name] for name in ("false_per_minute", "original_per_minute")}
