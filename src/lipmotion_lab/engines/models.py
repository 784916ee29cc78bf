"""The trained models of all engines, kept in a folder, so that a second comparison does not train again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from lipmotion.corpora.store import Corpus
from lipmotion.engines import engine_named
from lipmotion.errors import InputError
from lipmotion.pipeline.model import Model, load_model, save_model
from lipmotion.pipeline.training.train import Run, describe_training, train
from lipmotion.storage.files import make_folder, unfinished_work
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import sub_monitor
from lipmotion_lab.runner import ExperimentSettings

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
        wanted = describe_training(corpus, [corpus.utterance(name) for name in names], "train", len(names))
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
