"""``lipmotion experiment all``: all experiments on a corpus, and one page of what they found."""

from __future__ import annotations

import hashlib
import shlex
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from lipmotion.corpora import SPLITS, Corpus
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, ExportError, InputError, LipMotionError
from lipmotion.pipeline.model import GEOMETRY
from lipmotion.pipeline.training.labels import fingerprint_training
from lipmotion.storage import files, locks
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import Item, sub_monitor
from lipmotion.units import Lexicon
from lipmotion_lab import hofer2008
from lipmotion_lab.engine_comparison import compare_engines
from lipmotion_lab.folds import FOLDS, cross_validate
from lipmotion_lab.learning_curve import run_learning_curve
from lipmotion_lab.minnis2000 import run_minnis2000
from lipmotion_lab.report import sections
from lipmotion_lab.report.html import GENERATOR
from lipmotion_lab.report.page import ClipKeeper, FinishedPart, write_html, write_videos
from lipmotion_lab.report.section import Section, write_text
from lipmotion_lab.runner import DEFAULT_SETTINGS, ExperimentSettings, Stamp, check_opening, share_out, take_quick_part
from lipmotion_lab.xie_liu2007 import six_systems
from lipmotion_lab.xie_liu2007.six_systems import PLOT_CAPTIONS
from lipmotion_lab.xie_liu2007.systems import COMPARED_SYSTEMS, select_systems

TEST = "test"
QUICK_FOLDS = 2


@dataclass(frozen=True)
class PartRun:
    """What an experiment is run with; ``models`` are shared by several."""

    corpus: Corpus
    quick: bool
    work: Path
    models: Path
    plots: Path | None
    settings: ExperimentSettings


@dataclass(frozen=True)
class ReportPart:
    """An experiment of a report, and its rough share of the time."""

    lists: tuple[str, ...]
    share: float
    run: Callable[[PartRun], dict[str, Any]]
    section: Callable[[Mapping[str, Any]], Section]
    draws: bool = False


def _run_xie_liu(run: PartRun) -> dict[str, Any]:
    options = six_systems.QUICK if run.quick else six_systems.DEFAULT_OPTIONS
    if not run.corpus.names("val"):  # nothing to choose settings with
        printed = [name for name in select_systems(options.systems) if not COMPARED_SYSTEMS[name].splits]
        options = replace(options, systems=printed)
    return six_systems.run_xieliu2007(run.corpus, options, plots=run.plots, work=run.work, settings=run.settings)


def _run_learning_curve(run: PartRun) -> dict[str, Any]:
    count = len(run.corpus.names("train"))
    sizes = [(count + 1) // 2, count] if run.quick else None
    return run_learning_curve(run.corpus, sizes=sizes, work=run.work, settings=run.settings)


def _run_folds(run: PartRun) -> dict[str, Any]:
    count = min(QUICK_FOLDS if run.quick else FOLDS, len(run.corpus.names("train")))
    return cross_validate(run.corpus, count=count, work=run.work, settings=run.settings)


PARTS: dict[str, ReportPart] = {
    "hofer2008": ReportPart(
        ("train", "val", TEST),
        4,
        lambda run: hofer2008.run_hofer2008(
            run.corpus, hofer2008.QUICK if run.quick else hofer2008.FULL, work=run.work, settings=run.settings
        ),
        sections.build_hofer_section,
    ),
    "xieliu2007": ReportPart(("train", TEST), 8, _run_xie_liu, sections.build_xie_liu_section, draws=True),
    "minnis2000": ReportPart(
        ("train", TEST),
        2,
        lambda run: run_minnis2000(
            run.corpus, models=run.models, quick=run.quick, work=run.work, settings=run.settings
        ),
        sections.build_minnis_section,
    ),
    "engines": ReportPart(
        ("train", TEST),
        4,
        lambda run: compare_engines(run.corpus, split=TEST, models=run.models, settings=run.settings),
        sections.build_engines_section,
    ),
    "learning-curve": ReportPart(("train", TEST), 2, _run_learning_curve, sections.build_learning_section),
    "folds": ReportPart(("train",), 4, _run_folds, sections.build_folds_section),
}
"""All experiments by name, in the order of the report: the papers' first."""


PAGE, FIGURES = "index.html", "figures.json"
"""The page; and in the folder of an experiment its figures with their stamp."""
KEY_DIGITS = 8
NOT_YET = "not finished; the same command goes on with it"
FAILED, AGAIN = "failed: ", "mend that, then give the same command: it goes on with it"
NOT_CHOSEN = "not chosen"


@dataclass(frozen=True)
class WrittenReport:
    """A report that was written.

    verdicts : what was found, one sentence by experiment
    left_out : why experiments are not in it, by name
    failed   : errors of experiments that failed, by name; the same command tries them again
    made     : names of the experiments that ran now; the others were there
    """

    page: Path
    verdicts: Mapping[str, str]
    left_out: Mapping[str, str]
    failed: Mapping[str, Exception]
    made: Sequence[str]


def write_report(
    corpus: Corpus,
    folder: Path,
    *,
    only: Sequence[str] | None = None,
    quick: bool = False,
    settings: ExperimentSettings = DEFAULT_SETTINGS,
) -> WrittenReport:
    """Run experiments on a corpus, and write a page of what they found, with its tables and pictures.

    folder   : of the report, made if need be. What is finished in it is not computed again; a call after a stop goes on
    The page is written anew when an experiment is finished; where nothing is left to do, nothing is written. Every
    experiment has a folder of its own beside the page. Where the corpus lacks a list, the page says what is left out.
    An experiment that fails does not stop the others: the page says with what error it failed.
    Raises InputError: no such experiment.
    Raises CorpusError: no utterances to train on or for an experiment of ``only``, or motion without an opening.
    Raises ExportError: the folder holds something else or cannot be written to, or another call is at work on it.
    """
    unknown = [name for name in only or () if name not in PARTS]
    if unknown:
        raise InputError(f"no experiment {unknown[0]!r}; there are: {', '.join(PARTS)}")
    wanted = [name for name in PARTS if only is None or name in only]
    corpus = take_quick_part(corpus, settings.seed) if quick else corpus
    for split in ("train", TEST):
        if names := corpus.names(split):
            check_opening(corpus, names)
    lacking: dict[str, str] = {}
    for name in wanted:
        if missing_lists := [split for split in PARTS[name].lists if not corpus.names(split)]:
            lacking[name] = f"left out: the corpus has no recordings of the list {', '.join(missing_lists)}"
            lacking[name] += " (docs/corpora.md says how to make one)"
    if lacking and (only is not None or len(lacking) == len(wanted)):
        name, reason = next(iter(lacking.items()))
        raise CorpusError(f"{corpus.path}: {name} is {reason}")
    check_apart((), [Source(corpus.path, "corpus")], folders=[folder])
    _check_folder(folder)
    with locks.lock_folder(folder):
        locks.remove_unfinished(folder)
        engine, phones, lexicon = engine_named("trajectory"), settings.recogniser, settings.lexicon or Lexicon()
        of_input = fingerprint_training(corpus, corpus.names(), engine, phones, lexicon, GEOMETRY, None)
        lists, can_draw = [[split, *corpus.names(split)] for split in SPLITS], find_spec("matplotlib") is not None
        of_run = f"{of_input} {lists} {quick} {settings.seed} {can_draw}"
        writer = _Writer(corpus, folder, quick, settings, lacking, of_run, can_draw)
        writer.write_page(wanted)
        missing = [name for name in wanted if name not in lacking and writer.record(name) is None]
        parts = share_out(settings, missing, sizes=[PARTS[name].share for name in missing])
        for name, part in zip(missing, parts, strict=True):
            try:
                writer.run(name, part)
            except ExportError:
                raise  # nor could the others write
            except Exception as error:  # one experiment must not stop the others
                part.monitor(Item(name, "failed", describe_error(error)))
                writer.failed[name] = error
            writer.write_page(wanted)
        finished = writer.list_finished()
    verdicts = {part.name: part.section.verdict for part in finished}
    made = [name for name in missing if name not in writer.failed]
    return WrittenReport(folder / PAGE, verdicts, lacking, writer.failed, made)


def _check_folder(folder: Path) -> None:
    """Raise ExportError if a folder is neither new, nor empty, nor a report."""
    page = folder / PAGE
    try:
        inner = folder.exists() and [path for path in folder.iterdir() if not path.name.startswith(files.TEMPORARY)]
        if not inner or (page.is_file() and GENERATOR in page.read_text("utf-8", errors="replace")):
            return
    except OSError as error:
        raise ExportError(f"{folder}: cannot be used: {error.strerror or error}; give another folder") from error
    raise ExportError(f"{folder}: holds something that is no report; give a new or an empty folder")


@dataclass(frozen=True)
class _Writer:
    corpus: Corpus
    folder: Path
    quick: bool
    settings: ExperimentSettings
    lacking: Mapping[str, str]
    digest: str
    can_draw: bool
    failed: dict[str, Exception] = field(default_factory=dict)

    def make_key(self, name: str) -> str:
        """Return a digest of all that the figures of an experiment depend on."""
        return hashlib.sha256(f"{name} {self.digest}".encode()).hexdigest()

    def record(self, name: str) -> dict[str, Any] | None:
        """Return the figures of an experiment that is finished; None: it is not, or was another one."""
        try:
            record = dict(from_json((self.folder / name / FIGURES).read_bytes()))
            return record if record["key"] == self.make_key(name) else None
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def list_finished(self) -> list[FinishedPart]:
        """Return all experiments that are finished, in the order of the page."""
        finished = []
        for name, part in PARTS.items():
            record = self.record(name)
            if record is not None:
                try:
                    finished.append(FinishedPart(name, record, part.section(record["figures"])))
                except Exception as error:  # what one experiment says must not hide the others
                    self.failed[name] = error
        return finished

    def write_page(self, wanted: Sequence[str]) -> None:
        """Write the page, if anything in it has changed."""
        finished = self.list_finished()
        there = {part.name for part in finished}
        left_open = {
            name: self.lacking.get(name, NOT_YET if name in wanted else NOT_CHOSEN)
            for name in PARTS
            if name not in there and name not in self.failed
        }
        failed = {name: f"{FAILED}{describe_error(error)}; {AGAIN}" for name, error in self.failed.items()}
        corpus = self.corpus.path.resolve().name
        about = self.corpus.summary() | {"corpus": corpus, "made with": shlex.join(self._build_command(wanted))}
        text = write_html(f"Experiments on {corpus}", about, finished, left_open, failed, quick=self.quick)
        page = self.folder / PAGE
        if not page.is_file() or page.read_text("utf-8", errors="replace") != text:
            write_text(page, text)

    def run(self, name: str, settings: ExperimentSettings) -> None:
        """Run an experiment with its settings, and write its folder. Raises the errors of the experiment."""
        part, target, key = PARTS[name], self.folder / name, self.make_key(name)
        models = self.folder / "models" / self.make_key("models")[:KEY_DIGITS]  # of other recordings, other models
        with locks.keep_unfinished(self.folder / f"{name}.json") as work:
            stamp, plots = Stamp(), work / "plots" if part.draws and self.can_draw else None
            keeper = ClipKeeper(work / "motion.json", key)
            running = replace(settings.narrow(0, 0.95), receive=keeper)
            figures = part.run(PartRun(self.corpus, self.quick, work, models, plots, running))
            section, motion = part.section(figures), keeper.collect()
            made_with = stamp.collect(self._build_command([name]), self.corpus, settings)
            shutil.rmtree(target, ignore_errors=True)
            with files.replace_folder(target) as made:
                captions = PLOT_CAPTIONS if plots is not None else {}
                for file in captions:
                    shutil.move(work / "plots" / file, made / file)
                pictures = [{"file": file, "caption": caption} for file, caption in captions.items()]
                record = {"experiment": name, "key": key, "stamp": made_with, "figures": figures, "pictures": pictures}
                if motion:
                    drawing = sub_monitor(settings.monitor, 0.95, 1)
                    record["clip"] = f"{motion['name']}: {' '.join(motion['words'])}"
                    record["videos"] = write_videos(motion, section.shown, self.corpus, made, drawing)
                section.write_tables(made / "tables")
                write_text(made / FIGURES, as_json(record, indent=1) + "\n")

    def _build_command(self, wanted: Sequence[str]) -> list[str]:
        words = ["lipmotion", "experiment", "all", self.corpus.path.resolve().name, "-o", self.folder.resolve().name]
        words += ["--only", ",".join(wanted)] if len(wanted) < len(PARTS) else []
        words += ["--lexicon", "FILE"] if self.settings.lexicon else []
        return [*words, *(["--quick"] if self.quick else [])]


def describe_error(error: Exception) -> str:
    """Return what an error says; of one that is not raised on purpose its kind, too."""
    return str(error) if isinstance(error, LipMotionError) else f"{type(error).__name__}: {error}"
