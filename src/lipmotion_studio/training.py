"""What a process of its own does for the page: a voice is trained, or a face is built, of recordings of one person."""

from __future__ import annotations

import logging
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import ENGINES, engine_named
from lipmotion.engines.registry import DEFAULT
from lipmotion.errors import InputError, LipMotionError
from lipmotion.extensions import load_provided
from lipmotion.formats.label_files import label_files_beside
from lipmotion.measures.evaluation_table import figures_table
from lipmotion.pipeline.edit_files import check_sound
from lipmotion.pipeline.model import Model, load_model, save_model
from lipmotion.pipeline.training.train import Run, train
from lipmotion.storage.files import atomic_file, confine, create_folders, remove, unfinished_work
from lipmotion.types import Item, Monitor, Progress, sub_monitor
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion.units import Lexicon
from lipmotion_faces.corpus.long_videos import HELD_OUT_SHARE, LEAST_SPLIT_UTTERANCES
from lipmotion_faces.corpus.prepare import prepare
from lipmotion_faces.film.build import build_face
from lipmotion_faces.filmed.face import save_face

LOG = logging.getLogger("lipmotion")
VOICE, FACE = KINDS = ("voice", "face")
CORPUS, GATHERED = "corpus", "recordings"
"""Folders for the work: recordings that were prepared, which later voices use again; and those that are used now."""
PREPARED_SHARE, TRAINED_SHARE = 0.6, 0.95
"""Shares of the work that are done once recordings are prepared, and once a voice is trained."""
Tell = Callable[[Mapping[str, Any]], None]


@dataclass(frozen=True)
class VoiceOptions(Configuration):
    """How a voice is trained.

    engine   : the method that learns
    prior    : the voice stands on the model that ships, where the engine can: for less than eight minutes of recordings
    held_out : some recordings are not learned from, and show how good the voice is: the list ``test`` of a folder or of
               a long video, else the last tenth of ten recordings or more
    """

    engine: str = option(DEFAULT, Rule(choices=ENGINES.names))
    prior: bool = option(True)
    held_out: bool = option(True)


@dataclass(frozen=True)
class LearnedLine:
    """A line of the project that is learned from: its recording, its name, and its words; empty: those beside it.

    sha256 : digest of the recording that the words are of; empty: not known
    """

    recording: Path
    name: str
    transcript: str
    sha256: str = ""


@dataclass(frozen=True)
class TrainingOrder:
    """What is to be made.

    kind    : ``voice`` or ``face``
    target  : the file that it becomes
    work    : folder for what is prepared, which another order goes on with
    source  : a folder of recordings, or lines of the project
    lexicon : pronunciations of the project; None: it has none
    workers : number of processes
    """

    kind: str
    target: Path
    work: Path
    source: Path | tuple[LearnedLine, ...]
    options: VoiceOptions
    lexicon: Path | None
    workers: int


def carry_out(order: TrainingOrder, tell: Tell) -> None:
    """Make what is ordered; tell of its progress, warnings, recordings that are not used, and of how it ended.

    What is told is one of ``stage`` with ``share`` (0 to 1), ``warning``, ``skipped`` with ``reason``, and at the end
    ``report`` or ``error``.
    """
    handler = _Teller(tell)
    LOG.addHandler(handler)
    try:
        with confine(order.work.parent):  # the project, in this process
            tell({"report": _made(order, partial(_report, tell))})
    except (LipMotionError, OSError) as error:
        tell({"error": str(error)})
    except Exception as error:  # a bug, of which the page is told
        tell({"error": f"a bug: {type(error).__name__}: {error}"})
    finally:
        LOG.removeHandler(handler)


class _Teller(logging.Handler):
    """Tells warnings."""

    def __init__(self, tell: Tell) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        self._tell({"warning": record.getMessage()})


def _report(tell: Tell, event: Progress | Item) -> None:
    if isinstance(event, Progress):
        tell({"stage": event.stage, "share": event.share})
    elif event.reason:
        tell({"skipped" if event.outcome == "skipped" else "noted": event.name, "reason": event.reason})


def _made(order: TrainingOrder, monitor: Monitor) -> dict[str, Any]:
    begun_s = time.monotonic()
    with create_folders([order.target.parent, order.work]), _gathered(order) as recordings:
        made = _voice(order, recordings, monitor) if order.kind == VOICE else _face(order, recordings, monitor)
    return {"kind": order.kind, "seconds": round(time.monotonic() - begun_s), **made}


@contextmanager
def _gathered(order: TrainingOrder) -> Iterator[Path]:
    """Give a folder of the recordings: that of the order, or one that holds its lines, with their words."""
    if isinstance(order.source, Path):
        yield order.source
        return
    place = order.work / GATHERED / order.target.stem
    remove(place.parent)  # of a process that was killed
    with create_folders([place]):
        try:
            taken: set[str] = set()
            for line in order.source:
                stem = line.name.replace("/", "-")
                while stem.casefold() in taken:
                    stem += "-2"
                taken.add(stem.casefold())
                if line.sha256:
                    check_sound(line.recording, line.sha256)
                _put(line.recording, place / f"{stem}{line.recording.suffix}")
                if line.transcript:
                    with atomic_file(place / f"{stem}.txt") as text:
                        text.write_text(line.transcript, encoding="utf-8")
                    continue
                for labels in label_files_beside(line.recording):
                    _put(labels, place / f"{stem}{labels.name[len(line.recording.stem) :]}")
            yield place
        finally:
            remove(place.parent)


def _put(file: Path, place: Path) -> None:
    """Put a file at another place, too: without a copy, where the disk can."""
    try:
        os.link(file.resolve(), place)
    except OSError:
        with atomic_file(place) as copy:
            shutil.copyfile(file, copy)


def _voice(order: TrainingOrder, recordings: Path, monitor: Monitor) -> dict[str, Any]:
    """Train a voice, and write it last of all, once it has been measured."""
    engine = engine_named(order.options.engine)
    begun = sub_monitor(monitor, 0, PREPARED_SHARE)
    done = prepare(recordings, order.work / CORPUS, workers=order.workers, crops=False, monitor=begun)
    corpus = Corpus.open(done.corpus)
    learned, kept_back = divided_names(corpus, (*done.prepared, *done.kept), held_out=order.options.held_out)
    with unfinished_work(order.target) as work:
        model, result = train(
            corpus,
            selection=Selection(names=learned),
            engine=engine,
            lexicon=Lexicon.from_file(order.lexicon) if order.lexicon else None,
            prior=load_model() if order.options.prior and engine.inputs().prior else None,
            run=Run(sub_monitor(monitor, PREPARED_SHARE, TRAINED_SHARE), work, order.workers),
        )
        measured = _measured(model, corpus, kept_back, sub_monitor(monitor, TRAINED_SHARE, 1, "measuring: "))
        save_model(model, order.target)
    for name, reason in result.skipped.items():
        monitor(Item(name, "skipped", reason))
    counts = {"learned": len(result.used), "minutes": model.about["minutes"], "kept_back": len(kept_back)}
    return {**counts, "skipped": len(done.failed) + len(result.skipped), **measured}


def divided_names(corpus: Corpus, names: Sequence[str], *, held_out: bool) -> tuple[list[str], list[str]]:
    """Return which of some utterances are learned from, and which show how good the voice is.

    held_out : as of ``VoiceOptions``
    """
    names = sorted(names)
    if not held_out:
        return names, []
    lists = {split: [name for name in names if name in corpus.names(split)] for split in ("train", "test")}
    if lists["test"]:
        return lists["train"], lists["test"]
    count = round(HELD_OUT_SHARE * len(names)) if len(names) >= LEAST_SPLIT_UTTERANCES else 0
    return names[: len(names) - count], names[len(names) - count :]


def _measured(model: Model, corpus: Corpus, names: Sequence[str], monitor: Monitor) -> dict[str, Any]:
    """Return the figures of recordings that were not learned from; empty: there are none, or they say why."""
    if not names:
        return {}
    try:
        figures = load_provided("evaluate")(model, corpus, selection=Selection(names=names), monitor=monitor)
    except LipMotionError as error:
        LOG.warning("the voice could not be measured: %s", error)
        return {}
    rows = [
        {"condition": name, "acc": found["acc"], "opening": found["channels"].get("opening", {}).get("acc")}
        for name, found in figures["conditions"].items()
    ]
    return {"figures": rows, "table": figures_table(figures)}


def _face(order: TrainingOrder, recordings: Path, monitor: Monitor) -> dict[str, Any]:
    face = build_face(recordings, name=order.target.stem, workers=order.workers, monitor=monitor)
    save_face(face, order.target)
    return {"facts": face.summary}


def check_options(given: Mapping[str, Any]) -> VoiceOptions:
    """Return the options that a request gives. Raises InputError: unknown, or a value that is not allowed."""
    if not isinstance(given, Mapping):
        raise InputError("options is no object of names and values")
    return VoiceOptions.parsed(given)
