"""The experiments of a report: what each needs of a corpus, how it is run, and how its figures are told."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from lipmotion.corpora.store import Corpus
from lipmotion_lab.engines.engine_comparison import engines
from lipmotion_lab.folds import FOLDS, folds
from lipmotion_lab.hofer2008 import table1
from lipmotion_lab.learning_curve import learning_curve
from lipmotion_lab.minnis_breen2000.minnis2000 import minnis2000
from lipmotion_lab.report.section import Section
from lipmotion_lab.report.sections import (
    engines_section,
    folds_section,
    hofer_section,
    learning_section,
    minnis_section,
    xie_liu_section,
)
from lipmotion_lab.runner import ExperimentSettings
from lipmotion_lab.xie_liu2007 import six_systems
from lipmotion_lab.xie_liu2007.systems import COMPARED_SYSTEMS, selected_systems

TEST = "test"
QUICK_FOLDS = 2


@dataclass(frozen=True)
class PartRun:
    """What an experiment is run with.

    work   : an existing folder for finished parts of it
    models : a folder of engines' models, which several experiments share
    plots  : a folder for pictures; None: none are drawn
    """

    corpus: Corpus
    quick: bool
    work: Path
    models: Path
    plots: Path | None
    settings: ExperimentSettings


@dataclass(frozen=True)
class ReportPart:
    """An experiment of a report.

    lists    : that the corpus must have
    share    : of the time that all take, roughly
    run      : returns its figures
    section  : returns what they say
    draws    : whether it writes pictures, for which it needs matplotlib
    """

    lists: tuple[str, ...]
    share: float
    run: Callable[[PartRun], dict[str, Any]]
    section: Callable[[Mapping[str, Any]], Section]
    draws: bool = False

    def lacking(self, corpus: Corpus) -> list[str]:
        """Return the lists that a corpus lacks."""
        return [split for split in self.lists if not corpus.names(split)]


def can_draw() -> bool:
    """Return whether there is what draws the pictures of experiments: the extra ``plots``."""
    return find_spec("matplotlib") is not None


def _hofer(run: PartRun) -> dict[str, Any]:
    options = table1.QUICK if run.quick else table1.FULL
    return table1.hofer2008(run.corpus, options, work=run.work, settings=run.settings)


def _xie_liu(run: PartRun) -> dict[str, Any]:
    options = six_systems.QUICK if run.quick else six_systems.DEFAULT_OPTIONS
    if not run.corpus.names("val"):  # nothing to choose settings with
        printed = [name for name in selected_systems(options.systems) if not COMPARED_SYSTEMS[name].tunes]
        options = replace(options, systems=printed)
    return six_systems.xieliu2007(run.corpus, options, plots=run.plots, work=run.work, settings=run.settings)


def _minnis(run: PartRun) -> dict[str, Any]:
    return minnis2000(run.corpus, models=run.models, quick=run.quick, work=run.work, settings=run.settings)


def _engines(run: PartRun) -> dict[str, Any]:
    return engines(run.corpus, split=TEST, models=run.models, settings=run.settings)


def _learning_curve(run: PartRun) -> dict[str, Any]:
    count = len(run.corpus.names("train"))
    sizes = [(count + 1) // 2, count] if run.quick else None
    return learning_curve(run.corpus, sizes=sizes, work=run.work, settings=run.settings)


def _folds(run: PartRun) -> dict[str, Any]:
    most = QUICK_FOLDS if run.quick else FOLDS
    count = min(most, len(run.corpus.names("train")))
    return folds(run.corpus, count=count, work=run.work, settings=run.settings)


PARTS: dict[str, ReportPart] = {
    "hofer2008": ReportPart(("train", "val", TEST), 4, _hofer, hofer_section),
    "xieliu2007": ReportPart(("train", TEST), 8, _xie_liu, xie_liu_section, draws=True),
    "minnis2000": ReportPart(("train", TEST), 2, _minnis, minnis_section),
    "engines": ReportPart(("train", TEST), 4, _engines, engines_section),
    "learning-curve": ReportPart(("train", TEST), 2, _learning_curve, learning_section),
    "folds": ReportPart(("train",), 4, _folds, folds_section),
}
"""All experiments by name, in the order of the report: the papers' first."""
