"""Training one system on some recordings and generating the motion of held-out ones: shared by all experiments."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.source_recordings import SPLITS
from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import Engine
from lipmotion.errors import CorpusError
from lipmotion.hmm.model import HmmConfig
from lipmotion.pipeline.model import GEOMETRY, Model
from lipmotion.pipeline.training.labels import fingerprint_training
from lipmotion.pipeline.training.train import Run, train
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.storage.files import make_folder
from lipmotion.types import Monitor, silent_monitor, sub_monitor, with_progress
from lipmotion.units import Lexicon
from lipmotion_lab.evaluation.held_out import (
    OPENING,
    ComparedClip,
    HeldOutRecordings,
    choose_channels,
    generate_clips,
    load_held_out,
)

ItemT = TypeVar("ItemT")
MotionReceiver = Callable[[str, str, HeldOutRecordings, Sequence[ComparedClip]], None]
"""Called with the name of a system, a condition, the recordings, and what the system generates for each of them."""
QUICK_CLIPS = {"train": 20, "val": 4, "test": 6}
"""Most recordings of each list in a quick run of any experiment."""
_CURVES, _ABOUT = ("original", "generated", "time_s"), "about"
"""Fields of ``ComparedClip`` that are curves; the array with the rest of stored clips."""


@dataclass(frozen=True)
class ExperimentSettings:
    """Settings that all experiments have in common.

    recogniser : configuration of the phone models
    lexicon    : pronunciations; None: those of the dictionary
    seed       : of the shuffled training list, and of the bootstrap intervals
    workers    : number of processes, as in ``train``
    monitor    : receives the progress
    receive    : receives the motion that every system generates, once, before its figures are kept
    """

    recogniser: HmmConfig | None = None
    lexicon: Lexicon | None = None
    seed: int = 0
    workers: int = 1
    monitor: Monitor = silent_monitor
    receive: MotionReceiver = lambda *_: None


DEFAULT_SETTINGS = ExperimentSettings()


@dataclass(frozen=True, eq=False)
class HeldOutResult:
    """Motion that one trained system generates for held-out recordings.

    recordings : the held-out recordings
    clips      : generated and original curves of each recording, by condition
    used       : names of the utterances that the system was trained on
    seconds    : time of training, phone models and motion
    """

    recordings: HeldOutRecordings
    clips: Mapping[str, Sequence[ComparedClip]]
    used: tuple[str, ...]
    seconds: float


def train_and_generate(
    corpus: Corpus,
    names: Sequence[str],
    held_out: Sequence[str],
    channels: Sequence[str],
    settings: ExperimentSettings,
    work: Path | None = None,
) -> HeldOutResult:
    """Train the default engine on the utterances ``names``; return the ``channels`` it generates for ``held_out``.

    work : a folder from which training that was stopped goes on; None: none
    The names are sorted, so their order does not matter: all names of a list give the model of ``lipmotion train``.
    Raises as ``train`` and ``evaluate``.
    """
    monitor, lexicon = settings.monitor, settings.lexicon
    start_s = perf_counter()
    model, report = train(
        corpus,
        selection=Selection(names=sorted(names)),
        recogniser=settings.recogniser,
        lexicon=lexicon,
        run=Run(sub_monitor(monitor, 0, 0.8), work, settings.workers),
    )
    seconds = perf_counter() - start_s
    phones, recognising = cached_recogniser(model.phones), sub_monitor(monitor, 0.8, 0.95)
    recordings = load_held_out(
        corpus,
        phones,
        selection=Selection(names=sorted(held_out)),
        channels=channels,
        lexicon=lexicon,
        monitor=recognising,
        speakers=model.speakers,
    )
    conditions = with_progress(list(recordings.conditions), "comparing", sub_monitor(monitor, 0.95, 1))
    generated = {
        condition: generate_clips(recordings, condition, model.engine, model.learned) for condition in conditions
    }
    return HeldOutResult(recordings, generated, report.used, seconds)


def check_opening(corpus: Corpus, names: Sequence[str]) -> tuple[str, ...]:
    """Return the channels to compare in some utterances: called before the long work.

    Raises CorpusError: the opening is not among them, or the utterances have different channels.
    """
    channels, _ = choose_channels([corpus.utterance(name) for name in names])
    if OPENING not in channels:
        raise CorpusError(f"{corpus.path}: systems are compared by the channel {OPENING!r}, which is not in it")
    return channels


def shuffled(items: Sequence[ItemT], seed: int) -> tuple[ItemT, ...]:
    """Return the items in an order that depends on the seed alone."""
    return tuple(items[i] for i in np.random.default_rng(seed).permutation(len(items)))


def take_quick_part(corpus: Corpus, seed: int) -> Corpus:
    """Return a corpus with a few utterances of each list: those of every quick run with this seed."""
    return corpus.part([name for split in SPLITS for name in shuffled(corpus.names(split), seed)[: QUICK_CLIPS[split]]])


@dataclass(frozen=True)
class PartKey:
    """What the finished parts of an experiment depend on, beside corpus and settings.

    engine : with its configuration
    names  : of the utterances
    visual : kind of the channels
    model  : on which the parts stand, or None
    others : everything else, as text
    """

    engine: Engine[Any]
    names: Sequence[str]
    visual: str = GEOMETRY
    model: Model | None = None
    others: str = ""


def open_parts(folder: Path | None, corpus: Corpus, settings: ExperimentSettings, key: PartKey) -> Checkpoint:
    """Return the finished parts of an experiment, from which a call goes on after a stop.

    folder : made if need be, in one that exists; None: nothing is kept
    """
    if folder is None:
        return NO_CHECKPOINT
    make_folder(folder)
    config, lexicon = settings.recogniser or HmmConfig(), settings.lexicon or Lexicon()
    of_input = fingerprint_training(corpus, key.names, key.engine, config, lexicon, key.visual, key.model)
    return Checkpoint(folder, f"{of_input} {settings.seed} {key.others}")


def clips_to_arrays(clips: Sequence[ComparedClip]) -> dict[str, NDArray[Any]]:
    """Return what a system generated as arrays, from which ``clips_from_arrays`` makes it again."""
    arrays = {name: np.concatenate([getattr(clip, name) for clip in clips]) for name in _CURVES}
    about = [(len(clip.time_s), clip.spoken) for clip in clips]
    return {**arrays, _ABOUT: np.array(json.dumps(about))}


def clips_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> list[ComparedClip]:
    """Return the clips that ``clips_to_arrays`` stored."""
    about = json.loads(str(arrays[_ABOUT]))
    edges = np.cumsum([frames for frames, _ in about])[:-1]
    original, generated, time_s = (np.split(arrays[name], edges) for name in _CURVES)
    spoken = [tuple((start_s, end_s, phone) for start_s, end_s, phone in phones) for _, phones in about]
    return list(map(ComparedClip, original, generated, time_s, spoken))


def opening_row_with_rates(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of ``opening_row``, and how many closings there are outside p, b and m a minute of speech."""
    lips = figures["closures_p_b_m"]
    return opening_row(figures) | {name: lips[name] for name in ("false_per_minute", "original_per_minute")}


def opening_row(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of the opening that all tables show, from the figures of a condition; shares in %."""
    opening, closing, lips = figures["channels"][OPENING], figures["closures"], figures["closures_p_b_m"]
    return {
        "score": 100 * closing["score"],
        "precision": 100 * closing["precision"],
        "timing_ms": closing["timing_ms"],
        "closings": closing["original"],
        "generated_closings": closing["generated"],
        "recall_p_b_m": 100 * lips["recall"],
        "p_b_m": lips["intervals"],
        "acc": opening["acc"],
        "acc_95": figures["opening_acc_95"],
        "nrmse": opening["nrmse"],
        "global_variance": opening["global_variance"],
    }
