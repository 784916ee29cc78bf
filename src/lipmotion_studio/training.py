"""What a process of its own does for the page: a voice is trained, or a face is built, of recordings of one person."""

from __future__ import annotations

import logging
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lipmotion.corpora import Corpus, Selection
from lipmotion.engines import ENGINES, engine_named
from lipmotion.engines.registry import DEFAULT
from lipmotion.errors import LipMotionError
from lipmotion.extensions import load_provided
from lipmotion.formats.label_files import find_label_files
from lipmotion.pipeline.edit_files import check_sound
from lipmotion.pipeline.model import load_model, save_model
from lipmotion.pipeline.training.train import Run, train
from lipmotion.storage.files import atomic_file, confine, create_folders, remove
from lipmotion.storage.locks import keep_unfinished
from lipmotion.types import Item, Monitor, Progress, sub_monitor
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion.types.progress import warnings_to
from lipmotion.units import Lexicon
from lipmotion_faces.corpus.long_videos import HELD_OUT_SHARE, MIN_SPLIT_UTTERANCES
from lipmotion_faces.corpus.prepare import prepare
from lipmotion_faces.film.build import build_face
from lipmotion_faces.filmed.face import save_face

LOG = logging.getLogger("lipmotion")
VOICE, FACE = KINDS = ("voice", "face")
CORPUS, GATHERED = "corpus", "recordings"
"""Folders for the work: recordings that were prepared, which later voices use again; and those that are used now."""
PREPARED_SHARE, TRAINED_SHARE = 0.6, 0.95
"""Shares of the work that are done once recordings are prepared, and once a voice is trained."""
Report = Callable[[Mapping[str, Any]], None]


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
class TrainingRecording:
    """A recording that is learned from, its digest (empty: not known), and its words (empty: those beside it)."""

    path: Path
    name: str
    transcript: str
    sha256: str = ""


@dataclass(frozen=True)
class TrainingOrder:
    """What is to be made.

    work    : folder for what is prepared, which another order goes on with
    source  : a folder of recordings, or recordings of the project
    lexicon : pronunciations of the project; None: it has none
    """

    kind: str
    target: Path
    work: Path
    source: Path | tuple[TrainingRecording, ...]
    options: VoiceOptions
    lexicon: Path | None
    workers: int


def run_training(order: TrainingOrder, report: Report) -> None:
    """Make what is ordered; report its progress, warnings, recordings that are not used, and how it ended.

    A report is one of ``stage`` with ``share`` (0 to 1), ``warning``, ``skipped`` or ``noted`` with ``reason``, and at
    the end ``report`` or ``error``.
    """

    def monitor(event: Progress | Item) -> None:
        if isinstance(event, Progress):
            report({"stage": event.stage, "share": event.share})
        elif event.reason:
            report({"skipped" if event.outcome == "skipped" else "noted": event.name, "reason": event.reason})

    try:
        # the project is confined in this process
        with confine(order.work.parent), warnings_to(lambda text: report({"warning": text})):
            begun_s = time.monotonic()
            with create_folders([order.target.parent, order.work]), open_recordings(order) as recordings:
                if order.kind == VOICE:
                    facts = _train_voice(order, recordings, monitor)
                else:
                    name, workers = order.target.stem, order.workers
                    face = build_face(recordings, name=name, workers=workers, monitor=monitor)
                    save_face(face, order.target)
                    facts = {"facts": face.summary}
            report({"report": {"kind": order.kind, "seconds": round(time.monotonic() - begun_s), **facts}})
    except (LipMotionError, OSError) as error:
        report({"error": str(error)})
    except Exception as error:  # a bug, of which the page is told
        report({"error": f"a bug: {type(error).__name__}: {error}"})


@contextmanager
def open_recordings(order: TrainingOrder) -> Iterator[Path]:
    """Give a folder of the recordings: that of the order, or one that holds those of the project, with their words."""
    if isinstance(order.source, Path):
        yield order.source
        return
    place = order.work / GATHERED / order.target.stem
    remove(place.parent)  # of a process that was killed
    with create_folders([place]):
        try:
            taken: set[str] = set()
            for recording in order.source:
                stem = recording.name.replace("/", "-")
                while stem.casefold() in taken:
                    stem += "-2"
                taken.add(stem.casefold())
                if recording.sha256:
                    check_sound(recording.path, recording.sha256)
                _put(recording.path, place / f"{stem}{recording.path.suffix}")
                if recording.transcript:
                    with atomic_file(place / f"{stem}.txt") as text:
                        text.write_text(recording.transcript, encoding="utf-8")
                    continue
                for labels in find_label_files(recording.path):
                    _put(labels, place / f"{stem}{labels.name[len(recording.path.stem) :]}")
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


def _train_voice(order: TrainingOrder, recordings: Path, monitor: Monitor) -> dict[str, Any]:
    """Train a voice, and write it last of all, once it has been measured; return its figures."""
    engine, preparing = engine_named(order.options.engine), sub_monitor(monitor, 0, PREPARED_SHARE)
    done = prepare(recordings, order.work / CORPUS, workers=order.workers, crops=False, monitor=preparing)
    corpus = Corpus.open(done.corpus)
    learned, held_out = split_names(corpus, (*done.prepared, *done.kept), held_out=order.options.held_out)
    with keep_unfinished(order.target) as work:
        model, result = train(
            corpus,
            selection=Selection(names=learned),
            engine=engine,
            lexicon=Lexicon.from_file(order.lexicon) if order.lexicon else None,
            prior=load_model() if order.options.prior and engine.inputs().prior else None,
            run=Run(sub_monitor(monitor, PREPARED_SHARE, TRAINED_SHARE), work, order.workers),
        )
        measures: dict[str, Any] = {}
        if held_out:
            measuring, selection = sub_monitor(monitor, TRAINED_SHARE, 1, "measuring: "), Selection(names=held_out)
            try:
                figures = load_provided("evaluate")(model, corpus, selection=selection, monitor=measuring)
                rows = [
                    {"condition": name, "acc": row["acc"], "opening": row["channels"].get("opening", {}).get("acc")}
                    for name, row in figures["conditions"].items()
                ]
                measures = {"figures": rows, "table": load_provided("format_figures")(figures)}
            except LipMotionError as error:
                LOG.warning("the voice could not be measured: %s", error)
        save_model(model, order.target)
    for name, reason in result.skipped.items():
        monitor(Item(name, "skipped", reason))
    counts = {"learned": len(result.used), "minutes": model.about["minutes"], "kept_back": len(held_out)}
    return {**counts, "skipped": len(done.failed) + len(result.skipped), **measures}


def split_names(corpus: Corpus, names: Sequence[str], *, held_out: bool) -> tuple[list[str], list[str]]:
    """Return which of some utterances are learned from, and which show how good the voice is (``VoiceOptions``)."""
    names = sorted(names)
    if not held_out:
        return names, []
    lists = {split: [name for name in names if name in corpus.names(split)] for split in ("train", "test")}
    if lists["test"]:
        return lists["train"], lists["test"]
    count = round(HELD_OUT_SHARE * len(names)) if len(names) >= MIN_SPLIT_UTTERANCES else 0
    return names[: len(names) - count], names[len(names) - count :]
