"""What experiments share: training on some recordings, motion of held-out ones, finished parts, and the stamp."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import platform
import shlex
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from importlib import metadata
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import SPLITS, Corpus, Selection
from lipmotion.engines import ENGINES, Engine
from lipmotion.errors import CorpusError, InputError, shorten_list
from lipmotion.hmm.model import HmmConfig, UnitHmm
from lipmotion.kernels.compiler import list_blas_kernels
from lipmotion.pipeline.model import GEOMETRY, Model
from lipmotion.pipeline.training.labels import digest_corpus, fingerprint_training
from lipmotion.pipeline.training.train import Run, fit_phones, train
from lipmotion.pipeline.workers import open_training
from lipmotion.speech.recognition.recogniser import open_recogniser
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.storage.files import make_folder
from lipmotion.types import Example, Monitor, Utterance, silent_monitor, sub_monitor, with_progress
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
LOG = logging.getLogger("lipmotion")
MAX_MISSING = 0.05  # share of a list that a corpus may lack: recordings without a face, damaged ones
QUICK_CLIPS = {"train": 20, "val": 4, "test": 6}  # most recordings of each list in a quick run of any experiment
_CURVES, _ABOUT = ("original", "generated", "time_s"), "about"
"""Fields of ``ComparedClip`` that are curves; the array with the rest of stored clips."""


@dataclass(frozen=True)
class ExperimentSettings:
    """Settings that all experiments have in common.

    recogniser : what phone models are made as
    lexicon    : pronunciations; None: those of the dictionary
    seed       : of the shuffled training list, and of the bootstrap intervals
    workers    : number of processes, as in ``train``
    receive    : receives the motion that every system generates, once, before its figures are kept
    """

    recogniser: HmmConfig = field(default_factory=HmmConfig)
    lexicon: Lexicon | None = None
    seed: int = 0
    workers: int = 1
    monitor: Monitor = silent_monitor
    receive: MotionReceiver = lambda *_: None

    def narrow(self, start: float, stop: float, label: str = "") -> ExperimentSettings:
        """Return the settings of a part of the work, between two shares of the whole."""
        return replace(self, monitor=sub_monitor(self.monitor, start, stop, label))


DEFAULT_SETTINGS = ExperimentSettings()


@dataclass(frozen=True, eq=False)
class HeldOutResult:
    """A model, its motion of held-out recordings by condition; utterances used, and seconds, of the training."""

    model: Model
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

    The names are sorted, so their order does not matter: all names of a list give the model of ``lipmotion train``.
    Raises as ``train`` and ``evaluate``.
    """
    monitor, start_s = settings.monitor, perf_counter()
    model, report = train(
        corpus,
        selection=Selection(names=sorted(names)),
        recogniser=settings.recogniser,
        lexicon=settings.lexicon,
        run=Run(sub_monitor(monitor, 0, 0.8), work, settings.workers),
    )
    seconds, of_model = perf_counter() - start_s, {"channels": channels, "speakers": model.speakers}
    recordings = recognise_held_out(corpus, model.phones, sorted(held_out), settings.narrow(0.8, 0.95), **of_model)
    conditions = with_progress(list(recordings.conditions), "comparing", sub_monitor(monitor, 0.95, 1))
    generated = {
        condition: generate_clips(recordings, condition, model.engine, model.learned) for condition in conditions
    }
    return HeldOutResult(model, recordings, generated, report.used, seconds)


def share_out(
    settings: ExperimentSettings, labels: Sequence[str], start: float = 0.0, sizes: Sequence[float] = ()
) -> list[ExperimentSettings]:
    """Return the settings for each part of the work after ``start``: their monitors share what is left by ``sizes``."""
    ends = np.cumsum([0.0, *(sizes or [1.0] * len(labels))])
    shares = (start + (1 - start) * ends / max(ends[-1], 1e-9)).tolist()
    return [settings.narrow(*share, f"{label}: ") for label, share in zip(labels, pairwise(shares), strict=True)]


def recognise_held_out(
    corpus: Corpus, phones: UnitHmm, names: Sequence[str], settings: ExperimentSettings, **of_model: Any
) -> HeldOutRecordings:
    """Return the recordings of some names, as ``load_held_out``, with phones in time by given phone models."""
    recogniser, chosen = open_recogniser(phones), Selection(names=names)
    lexicon, monitor = settings.lexicon, settings.monitor
    return load_held_out(corpus, recogniser, selection=chosen, lexicon=lexicon, monitor=monitor, **of_model)


def train_phones(
    utterances: Sequence[Utterance], settings: ExperimentSettings, checkpoint: Checkpoint
) -> tuple[UnitHmm, list[Example]]:
    """Return phone models of some utterances, and these as examples for an engine."""
    lexicon = settings.lexicon or Lexicon()
    with open_training(settings.workers, len(utterances)) as each:
        parallel = replace(checkpoint, parallel_map=each)
        phones, examples, _ = fit_phones(utterances, settings.recogniser, lexicon, settings.monitor, parallel)
    return phones, examples


def check_opening(corpus: Corpus, names: Sequence[str]) -> tuple[str, ...]:
    """Return the channels to compare, before long work. Raises CorpusError: no opening, or different channels."""
    channels, _ = choose_channels([corpus.utterance(name) for name in names])
    if OPENING not in channels:
        raise CorpusError(f"{corpus.path}: systems are compared by the channel {OPENING!r}, which is not in it")
    return channels


def permute(items: Sequence[ItemT], seed: int) -> tuple[ItemT, ...]:
    """Return the items in an order that depends on the seed alone."""
    return tuple(items[i] for i in np.random.default_rng(seed).permutation(len(items)))


def take_quick_part(corpus: Corpus, seed: int) -> Corpus:
    """Return a corpus with a few utterances of each list: those of every quick run with this seed."""
    return corpus.divided({split: permute(corpus.names(split), seed)[: QUICK_CLIPS[split]] for split in SPLITS})


@dataclass(frozen=True)
class PartKey:
    """What the finished parts of an experiment depend on, beside corpus and settings."""

    engine: Engine[Any]
    names: Sequence[str]
    visual: str = GEOMETRY
    model: Model | None = None
    others: str = ""


def open_parts(folder: Path | None, corpus: Corpus, settings: ExperimentSettings, key: PartKey) -> Checkpoint:
    """Return the finished parts of an experiment, from which a call goes on after a stop."""
    if folder is None:
        return NO_CHECKPOINT
    make_folder(folder)
    lexicon = settings.lexicon or Lexicon()
    of_input = fingerprint_training(corpus, key.names, key.engine, settings.recogniser, lexicon, key.visual, key.model)
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


def make_opening_row(figures: Mapping[str, Any]) -> dict[str, Any]:
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
        "false_per_minute": lips["false_per_minute"],
        "original_per_minute": lips["original_per_minute"],
        "acc": opening["acc"],
        "acc_95": figures["opening_acc_95"],
        "nrmse": opening["nrmse"],
        "global_variance": opening["global_variance"],
    }


PACKAGES = ("lipmotion", "numpy", "scipy", "numba", "av", "pocketsphinx", "hama", "matplotlib")
"""Packages on which figures, or pictures, depend."""
ROOT = Path(__file__).parents[3]  # the root of a checkout of the source, where the package is in one
DIGITS = 8
CPU_INFO = Path("/proc/cpuinfo")


class Stamp:
    """What the figures of an experiment are stamped with; its time begins when it is made."""

    def __init__(self) -> None:
        self._begun = datetime.now(timezone.utc)
        self._start_s = perf_counter(), sum(os.times()[:4])

    def collect(self, command: Sequence[str], corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        """Return command, time, corpus, seed, options, commit, engines, machine and versions, by name.

        command : its words; of absolute paths the last name is kept, for figures are given to others
        The time is that of this call: a call that goes on after a stop does not count what was finished before.
        """
        seconds, used = perf_counter() - self._start_s[0], sum(os.times()[:4]) - self._start_s[1]
        words = (word.rpartition("=") for word in command)
        lists = {split: len(corpus.names(split)) for split in SPLITS}
        lexicon = "the user's" if settings.lexicon else "none but the dictionary"
        return {
            "command": shlex.join(
                f"{option}{equals}{Path(value).name if Path(value).is_absolute() else value}"
                for option, equals, value in words
            ),
            "begun": self._begun.isoformat(timespec="seconds"),
            "seconds": round(seconds, 1),
            "processor seconds": round(used, 1),
            "corpus": {"name": corpus.path.resolve().name, "SHA-256": digest_corpus(corpus), **lists},
            "seed": settings.seed,
            "options": {"workers": settings.workers, "lexicon": lexicon},
            "commit": find_commit(ROOT),
            "engines": {name: digest_engine(name) for name in ENGINES.built_in},
            **_describe_machine(),
        }


def digest_engine(name: str) -> str:
    """Return the digits that name the default options of an engine."""
    options = json.dumps(ENGINES.load(name).Config().as_mapping(), sort_keys=True)
    return hashlib.sha256(options.encode()).hexdigest()[:DIGITS]


def _describe_machine() -> dict[str, Any]:
    lines: list[str] = []
    with suppress(OSError):
        lines = CPU_INFO.read_text(encoding="utf-8").splitlines()
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    versions: dict[str, str | None] = {"Python": platform.python_version(), **dict.fromkeys(PACKAGES)}
    for package in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[package] = metadata.version(package)
    machine = {
        "cores": os.cpu_count(),
        "processor": named[0] if named else platform.processor() or platform.machine(),
        "system": platform.platform(),
        "linear algebra": ", ".join(map(str, list_blas_kernels())),
    }
    return {"machine": machine, "versions": versions}


def find_commit(root: Path) -> str | None:
    """Return the commit of a checkout of the source, and whether its ``src`` was changed since; None: it is none."""
    git = shutil.which("git")
    if git is None or not (root / ".git").exists():
        return None

    def ask(*arguments: str) -> str | None:
        done = subprocess.run([git, "-C", str(root), *arguments], capture_output=True, text=True, check=False)
        return done.stdout.strip() if done.returncode == 0 else None

    head = ask("rev-parse", "HEAD")
    return f"{head}, changed since" if head and ask("status", "--porcelain", "--", "src") else head


SIZES = (20, 50, 100, 200)
"""Default numbers of recordings: those of them that are smaller than the list; and the whole list."""


def choose_sizes(sizes: Sequence[int] | None, listed: int) -> list[int]:
    """Return the sizes, or the usual ones, rising. Raises InputError: not from 1 to ``listed``, or an empty list."""
    if not listed:
        raise InputError("the list of utterances to train on is empty; give one name a line")
    steps = sorted(set(sizes)) if sizes is not None else [*(n for n in SIZES if n < listed), listed]
    if not steps or not 1 <= steps[0] <= steps[-1] <= listed:
        named = ", ".join(map(str, steps)) or "none"
        raise InputError(f"sizes {named}; required: from 1 to {listed}, which is how many names the list has")
    return steps


def choose_training_names(
    corpus: Corpus, order: Sequence[str] | None, seed: int, held_out: Sequence[str]
) -> tuple[str, ...]:
    """Return the names to train on: a list, or the corpus's ``train``, shuffled.

    Names of recordings that could not be prepared are left out with a warning, if they are few.
    Raises CorpusError: as ``check_training_names``.
    """
    listed = tuple(order) if order is not None else permute(corpus.required("train"), seed)
    missing = [name for name in listed if name not in corpus.names()]
    if 0 < len(missing) <= MAX_MISSING * len(listed):
        some = f"{len(missing)} of {len(listed)} names to train on ({shorten_list(missing)})"
        LOG.warning(f"{corpus.path}: {some} are not in the corpus; left out")
        listed = tuple(name for name in listed if name not in missing)
    check_training_names(corpus, listed, held_out)
    return listed


def check_training_names(corpus: Corpus, listed: Sequence[str], held_out: Sequence[str]) -> None:
    """Raise CorpusError if names to train on are not in the corpus, twice in the list, or held out."""
    known, excluded = set(corpus.names()), set(held_out)
    wrong = {
        "are not in the corpus; take them out, or prepare them": [name for name in listed if name not in known],
        "are in the split that is compared with; take them out": [name for name in listed if name in excluded],
        "stand in the list more than once; keep one of each": [n for n in set(listed) if listed.count(n) > 1],
    }
    for reason, names in wrong.items():
        if names:
            some = f"{len(names)} of {len(listed)} names to train on ({shorten_list(sorted(names))})"
            raise CorpusError(f"{corpus.path}: {some} {reason}")
