"""A corpus to a model: ``train(corpus) → model``."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import metadata
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import Engine, engine_named
from lipmotion.engines.base import TrainsOnSpeechAlone
from lipmotion.errors import CorpusError, InputError
from lipmotion.hmm.model import HmmConfig, UnitHmm
from lipmotion.kernels.threads import one_thread
from lipmotion.motion.resample import to_model_frames
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.training.channels import GEOMETRY, check_visual, train_eigenlips, with_visual_channels
from lipmotion.pipeline.training.fingerprint import fingerprint
from lipmotion.pipeline.training.labels import label_utterances
from lipmotion.pipeline.training.voices import VoiceExample
from lipmotion.pipeline.transcribe import phones_in_time, warn_of_guesses
from lipmotion.pipeline.workers import worker_pool
from lipmotion.speech.f0 import log_f0
from lipmotion.speech.phone_models import train_phone_models
from lipmotion.speech.recogniser import Recogniser
from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import (
    FRAME_RATE_HZ,
    Example,
    Features,
    Monitor,
    Motion,
    ParallelMap,
    Progress,
    Speech,
    Timeline,
    Track,
    Unit,
    Utterance,
    silent_monitor,
    sub_monitor,
)
from lipmotion.units import Lexicon, is_silent

LOG = logging.getLogger("lipmotion")
UTTERANCES_PER_WORKER = 32
"""Utterances that are worth a process of their own."""


@dataclass(frozen=True)
class TrainReport:
    """What training used and found.

    used     : names of the utterances behind the motion
    skipped  : utterances left out, name to reason
    figures  : of the engine's training, by name
    """

    used: tuple[str, ...]
    skipped: Mapping[str, str]
    figures: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Run:
    """How long work is run, which changes nothing of its result.

    monitor : called with the progress, and with the utterances that are left out
    work    : a folder for checkpoints, from which the same call continues after it was stopped
              (``storage.files.unfinished_work`` makes one); the model is the same to the byte
    workers : processes that share the work, fewer if the corpus is small. With more than one, a script must call under
              ``if __name__ == "__main__":``, as for every process pool
    """

    monitor: Monitor = silent_monitor
    work: Path | None = None
    workers: int = 1


DEFAULT_RUN, TRAINING_LIST = Run(), Selection("train")


@one_thread()
def train(
    corpus: Corpus,
    *,
    selection: Selection = TRAINING_LIST,
    engine: Engine[Any] | None = None,
    recogniser: HmmConfig | None = None,
    lexicon: Lexicon | None = None,
    visual: str = GEOMETRY,
    voices: Iterable[VoiceExample] = (),
    run: Run = DEFAULT_RUN,
) -> tuple[Model, TrainReport]:
    """Train phone models on what is transcribed, then the motion of everything.

    corpus     : from ``prepare``
    selection  : the utterances to train on; the list ``train`` by default
    engine     : with its configuration; the trajectory engine by default
    recogniser : configuration of the phone models
    visual     : ``geometry``: the channels that were tracked or given; ``eigenlips``: principal components of the mouth
                 pictures (docs/eigenlips.md); ``both``
    voices     : speech of other speakers, without motion, for the second stage of training
                 (``pipeline.training.voices``); only for engines that ``TrainsOnSpeechAlone``
    run        : monitor, checkpoints and processes: the model does not depend on any of them
    Phones that are labelled are taken as they are. Utterances without a transcript are recognised, by the phone models
    of the others or, where there are none, by those of the shipped model.
    Nothing here is random: the same corpus gives the same model.
    Raises CorpusError: no such utterances, or nothing in them to learn from.
    Raises InputError: no such ``visual``, or voices and an engine that has no use for them.
    """
    check_visual(visual)
    if run.work is not None:
        check_apart((), [Source(corpus.path, "corpus")], folders=[run.work])
    lexicon = lexicon or Lexicon()
    engine = engine or engine_named("trajectory", {})
    chosen = corpus.selected(selection)
    recogniser = recogniser or HmmConfig()
    others = list(examples_without_motion(engine, voices, run.monitor))
    utterances = [corpus.utterance(name) for name in chosen]
    eigenlips = train_eigenlips(utterances) if visual != GEOMETRY else None
    utterances = [with_visual_channels(utterance, visual, eigenlips) for utterance in utterances]
    job = fingerprint(corpus, chosen, engine, recogniser, lexicon, visual) if run.work else ""
    checkpoint = Checkpoint(run.work, job) if run.work else NO_CHECKPOINT
    with worker_pool(min(run.workers, len(chosen) // UTTERANCES_PER_WORKER)) as team:
        listening = sub_monitor(run.monitor, 0, 0.9)
        phones, examples, skipped = phones_and_examples(
            utterances, recogniser, lexicon, listening, checkpoint, team.ordered_map
        )
    fit = engine.fit([*examples, *others], sub_monitor(run.monitor, 0.9, 1, "learning motion: "), checkpoint)
    used = tuple(example.name for example in examples)
    about = _about(
        corpus, utterances, "given names" if selection.names is not None else selection.split or "all", len(used)
    )
    if selection.speakers and selection.names is None:
        about["speakers"] = sorted(set(selection.speakers))
    if others:
        about["voices"] = sorted({example.name for example in others})
    if eigenlips is not None:
        about |= {"visual": visual, "eigenlips": eigenlips.summary}
    return Model(phones, engine, fit.model, about, eigenlips=eigenlips), TrainReport(used, skipped, fit.figures)


def phones_and_examples(
    utterances: Sequence[Utterance],
    recogniser: HmmConfig,
    lexicon: Lexicon,
    monitor: Monitor,
    checkpoint: Checkpoint,
    each: ParallelMap,
) -> tuple[UnitHmm, list[Example], dict[str, str]]:
    """Return phone models of what is transcribed, every utterance ready for an engine, and why others are left out.

    each : shares the work
    Raises CorpusError: no utterance can be used.
    """
    learning, finding = sub_monitor(monitor, 0, 0.78, "learning phones: "), sub_monitor(monitor, 0.78, 1)
    phones = _phones(utterances, lexicon, recogniser, learning, checkpoint, each)
    examples, skipped = _examples(utterances, Recogniser(phones), lexicon, finding, checkpoint, each)
    return phones, examples, skipped


def examples_without_motion(
    engine: Engine[Any], voices: Iterable[VoiceExample], monitor: Monitor = silent_monitor
) -> Iterator[Example]:
    """Give speech of others as examples in which no motion was seen, by the names of the speakers.

    Raises InputError: the engine has no use for them.
    """
    for number, (features, units, speaker) in enumerate(voices, start=1):
        if not (isinstance(engine, TrainsOnSpeechAlone) and engine.trains_on_speech_alone):
            raise InputError(
                f"the engine {engine.name!r} does not learn from other voices without motion; use one that does "
                "(--engine coupled), or leave the voices out"
            )
        monitor(Progress("hearing other voices", number, number, 0.0))
        frames = len(features.values)
        unseen = Motion(np.zeros((frames, 0)), FRAME_RATE_HZ, ())
        yield Example(speaker, Speech(features, units), unseen, np.zeros(frames, bool))


def phones_of(utterance: Utterance, phones: Recogniser, lexicon: Lexicon) -> Timeline[Unit]:
    """Return the phones of an utterance: labelled, else aligned if its words are known, else recognised."""
    if utterance.phones is not None:
        return utterance.phones
    features = Features(np.asarray(utterance.features.values), utterance.features.duration_s)
    return phones_in_time(phones, utterance.audio, features, utterance.words, lexicon)


def model_motion(track: Track, frames: int) -> tuple[Motion, Any]:
    """Return tracked motion on ``frames`` model frames, and where it rests on seen camera frames."""
    motion = track.motion
    values, valid = to_model_frames(
        np.asarray(motion.values, float), np.asarray(track.seen), motion.rate_hz, frames, FRAME_RATE_HZ
    )
    return replace(motion, values=values, rate_hz=FRAME_RATE_HZ), valid


def _phones(
    utterances: Sequence[Utterance],
    lexicon: Lexicon,
    config: HmmConfig,
    monitor: Monitor,
    checkpoint: Checkpoint,
    each: ParallelMap,
) -> UnitHmm:
    spoken = [(u.audio, u.words) for u in utterances if u.phones is None and u.words and _can_be_said(u.words, lexicon)]
    given = [(u.audio, _runs(u.phones)) for u in utterances if u.phones is not None]
    if not spoken and not given:
        LOG.warning("no transcripts in the corpus: its phones are recognised by the shipped model")
        return load_model().phones
    said = dict.fromkeys(word for _, words in spoken for word in words)
    warn_of_guesses(tuple(said), lexicon)
    runs = {" ".join(run): (run,) for _, found in given for run in found}
    as_words = [(audio, tuple(map(" ".join, found))) for audio, found in given]
    words = Lexicon(lexicon.user | runs)
    return train_phone_models([*spoken, *as_words], words, config, monitor, checkpoint, each)


def _runs(phones: Timeline[Unit]) -> list[tuple[str, ...]]:
    """Return the phones spoken between one silence and the next: each is a word that can be said in one way."""
    names = (span.label.phone for span in phones)
    return [tuple(run) for silent, run in groupby(names, key=is_silent) if not silent]


def _can_be_said(words: Sequence[str], lexicon: Lexicon) -> bool:
    try:
        return all(lexicon.pronunciations(word) for word in words)
    except InputError:  # a word of another script; the utterance is reported when it is aligned
        return False


def _examples(
    utterances: Sequence[Utterance],
    phones: Recogniser,
    lexicon: Lexicon,
    monitor: Monitor,
    checkpoint: Checkpoint,
    each: ParallelMap,
) -> tuple[list[Example], dict[str, str]]:
    examples: list[Example] = []
    skipped: dict[str, str] = {}
    label = partial(phones_of, phones=phones, lexicon=lexicon)
    for utterance, units in label_utterances(utterances, label, monitor, checkpoint, each):
        if isinstance(units, str):
            skipped[utterance.name] = units
            continue
        motion, valid = model_motion(utterance.track, len(utterance.features.values))
        heard = Speech(utterance.features, units, log_f0(utterance.audio))
        examples.append(Example(utterance.name, heard, motion, valid))
    if not examples:
        name, reason = next(iter(skipped.items()))
        raise CorpusError(f"none of {len(skipped)} utterances could be used; the first, {name}: {reason}")
    return examples, skipped


def _about(corpus: Corpus, utterances: Sequence[Utterance], split: str, used: int) -> dict[str, Any]:
    """Return the header's part that users must know, attribution above all."""
    sources = [utterance.source for utterance in utterances]
    minutes = sum(utterance.audio.duration_s for utterance in utterances) / 60
    return {
        "corpus": sorted({source["collection"] for source in sources if "collection" in source}) or [corpus.path.name],
        "split": split,
        "seed": "none: training draws no random numbers",
        "utterances": used,
        "minutes": round(minutes, 1),
        "licence": sorted({source["licence"] for source in sources if "licence" in source}),
        "attribution": sorted({source["attribution"] for source in sources if "attribution" in source}),
        "versions": {name: metadata.version(name) for name in ("lipmotion", "numpy", "scipy")},
    }
