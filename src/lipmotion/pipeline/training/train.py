"""Training: ``train(corpus) → model``; adaptation to a speaker without transcripts: ``adapt(model, recordings)``."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib import metadata
from itertools import cycle, groupby
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.corpora import Corpus, Selection
from lipmotion.engines import Engine, engine_named
from lipmotion.errors import CorpusError, InputError
from lipmotion.extensions import find_version
from lipmotion.hmm.model import HmmConfig, UnitHmm
from lipmotion.hmm.unit_training import TranscribedUtterance, UnitInventory, train_hmm
from lipmotion.kernels.compiler import limit_threads
from lipmotion.motion.space import resample_track
from lipmotion.motion.speaker_estimation import add_habits, map_to_mean_person
from lipmotion.pipeline.analysis.transcribe import align_or_recognise, warn_of_guesses
from lipmotion.pipeline.model import GEOMETRY, Model, load_model, with_prior
from lipmotion.pipeline.training import channels, labels
from lipmotion.pipeline.training.other_speakers import SpokenSentence
from lipmotion.pipeline.workers import open_training
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import LOG_ENERGY
from lipmotion.speech.recognition.adaptation_estimation import estimate_adaptation
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.speaker_similarity import JUDGED_RECORDINGS, embed_speaker
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import (
    FRAME_RATE_HZ,
    Audio,
    Example,
    Features,
    Monitor,
    Motion,
    Progress,
    Speech,
    Timeline,
    Unit,
    Utterance,
    silent_monitor,
    sub_monitor,
)
from lipmotion.types.values import check_class
from lipmotion.units import PAUSE, SILENCE, Lexicon, is_silent

WARP_CYCLE = (1.0, 0.88, 1.0, 0.94, 1.12, 1.06)  # warps of the frequencies, of one recording after the other
MIN_WARPED_RECORDINGS = 60
"""Fewer recordings than this are not warped: they are too few to train models of one speaker on, let alone several."""

LOG = logging.getLogger("lipmotion")


@dataclass(frozen=True)
class TrainReport:
    """Report of a training.

    used     : names of the utterances that were used
    skipped  : reason for every utterance that was not used, by name
    figures  : figures of the engine's training, by name
    """

    used: tuple[str, ...]
    skipped: Mapping[str, str]
    figures: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Run:
    """Options of the execution of long work; the result does not depend on them.

    monitor : called with reports of progress, and with the utterances that are not used
    work    : a folder for checkpoints, from which the same call continues after it was stopped
              (``storage.locks.keep_unfinished`` creates one); the model is the same to the byte. None: no checkpoints
    workers : number of processes, fewer if the corpus is small. With more than one, a script must be guarded by
              ``if __name__ == "__main__":``. Or the address of a Dask scheduler, as ``tcp://HOST:8786``

    >>> Run(workers=2).workers
    2
    """

    monitor: Monitor = silent_monitor
    work: Path | None = None
    workers: int | str = 1


DEFAULT_RUN, TRAINING_LIST = Run(), Selection("train")


@limit_threads()
def train(  # noqa: PLR0913
    corpus: Corpus,
    *,
    selection: Selection = TRAINING_LIST,
    engine: Engine[Any] | None = None,
    recogniser: HmmConfig | None = None,
    lexicon: Lexicon | None = None,
    visual: str = GEOMETRY,
    voices: Iterable[SpokenSentence] = (),
    prior: Model | None = None,
    run: Run = DEFAULT_RUN,
) -> tuple[Model, TrainReport]:
    """Return a model that is trained on a corpus, and a report of the training.

    Phone models are trained on all transcribed or labelled utterances, then the engine is trained on the motion of all
    utterances. Of several people by name, it learns the motion of the mean person, and the model has a map to each
    (``Model.speakers``). Of motion with different channels, it learns the channels that all have.
    corpus     : from ``prepare``
    selection  : the utterances; by default those of the list ``train``
    engine     : the engine, with its configuration; None: the trajectory engine
    recogniser : configuration of the phone models; None: the default one
    lexicon    : pronunciations of words, ahead of those of the dictionary
    visual     : ``geometry``: tracked or supplied channels; ``eigenlips``: principal components of mouth pictures
                 (docs/eigenlips.md); ``both``
    voices     : speech of other speakers, without motion, for the second stage of training
                 (``pipeline.training.other_speakers``); only for engines that take ``speech_alone`` (``Inputs``)
    prior      : a model on which the new one stands, ``load_model()`` for instance: what it makes of the speech is an
                 input of the engine, and part of the new model. None: the new model stands on none. It must not have
                 been trained on recordings that the new model is judged on
    run        : monitor, checkpoints and processes; the model does not depend on them
    Labelled phones are used as they are. The phones of utterances without transcript are recognised, by the phone
    models of the other utterances or, if there are none, by those of the shipped model.
    Random numbers are drawn by fixed seeds: the same corpus gives the same model.
    Raises CorpusError: no such utterances, none that can be used, or motion without a common channel.
    Raises InputError: no such ``visual``, or ``voices`` for an engine that is not trained on speech alone.
    Source: of the engines; of the two stages of training, Xie & Liu 2007, §3.4.

    >>> import lipmotion
    >>> corpus = lipmotion.Corpus.open("my-corpus")
    >>> few = lipmotion.Selection(names=corpus.names("train")[:1])
    >>> model, report = lipmotion.train(corpus, selection=few, recogniser=HmmConfig(mixtures=1, iterations=1))
    >>> model.engine.name, len(report.used)
    ('trajectory', 1)
    """
    check_class(corpus, Corpus, "corpus", "Corpus.open(FOLDER)")
    channels.check_visual(visual)
    if run.work is not None:
        check_apart((), [Source(corpus.path, "corpus")], folders=[run.work])
    if prior is not None and prior.prior is not None:
        raise InputError("the model to start from stands on another model itself; start from that one, or from none")
    lexicon = lexicon or Lexicon()
    engine = engine or engine_named("trajectory", {})
    chosen = corpus.selected(selection)
    recogniser = recogniser or HmmConfig()
    speech_examples = list(list_motionless(engine, voices, run.monitor))
    utterances = [corpus.utterance(name) for name in chosen]
    eigenlips = channels.train_eigenlips(utterances) if visual != GEOMETRY else None
    seen = [channels.with_visual_channels(each, visual, eigenlips) for each in utterances]
    utterances = channels.with_common_channels(seen)
    job = labels.fingerprint_training(corpus, chosen, engine, recogniser, lexicon, visual, prior) if run.work else ""
    with open_training(run.workers, len(chosen)) as each:
        checkpoint = Checkpoint(run.work, job, each)
        monitor = sub_monitor(run.monitor, 0, 0.5)
        phones, examples, skipped = fit_phones(utterances, recogniser, lexicon, monitor, checkpoint)
        speaker_of = {utterance.name: utterance.speaker for utterance in utterances}
        people = [speaker_of[example.name] for example in examples]
        several = len(set(filter(None, people))) > 1
        examples, speakers = map_to_mean_person(examples, people) if several else (examples, None)
        sound = {utterance.name: utterance.audio for utterance in utterances}
        examples = channels.with_sound_inputs(engine, examples, sound, sub_monitor(run.monitor, 0.5, 0.6), each)
        examples = [replace(example, speech=with_prior(prior, example.speech)) for example in examples]
        learning = sub_monitor(run.monitor, 0.6, 1, "learning motion: ")
        fit = engine.fit([*examples, *speech_examples], learning, checkpoint)
    used = tuple(example.name for example in examples)
    about = describe_training(corpus, utterances, selection, len(used))
    about |= {"voices": sorted({example.name for example in speech_examples})} if speech_examples else {}
    about |= {"visual": visual, "eigenlips": eigenlips.summary} if eigenlips is not None else {}
    if speakers is not None:
        generated = (engine.generate(fit.model, example.speech).motion.values for example in examples)
        speakers = add_habits(speakers, examples, people, generated)
        about["speakers"] = list(speakers)
    prior = prior if fit.uses_prior else None
    model = Model(phones, engine, fit.model, about, eigenlips=eigenlips, prior=prior, speakers=speakers)
    return model, TrainReport(used, skipped, fit.figures)


def fit_phones(
    utterances: Sequence[Utterance], recogniser: HmmConfig, lexicon: Lexicon, monitor: Monitor, checkpoint: Checkpoint
) -> tuple[UnitHmm, list[Example], dict[str, str]]:
    """Return phone models, the examples for an engine, and the reason for every utterance that is not used.

    Raises CorpusError: no utterance can be used.
    """
    learning, labelling = sub_monitor(monitor, 0, 0.78, "learning phones: "), sub_monitor(monitor, 0.78, 1)
    phones = _train_phone_models(utterances, lexicon, recogniser, learning, checkpoint)
    judged = utterances[:: -(-len(utterances) // JUDGED_RECORDINGS)]
    vectors = [embed_speaker(analysed(utterance.audio)) for utterance in judged]
    phones = replace(phones, speaker=np.mean(vectors, axis=0).astype(np.float32))
    examples: list[Example] = []
    skipped: dict[str, str] = {}
    labelled: list[tuple[Utterance, Timeline[Unit]]] = []
    labels.warn_of_missing_transcripts(utterances)
    labeller = partial(label_phones, phones=Recogniser(phones), lexicon=lexicon)
    for utterance, units in labels.label_utterances(utterances, labeller, labelling, checkpoint):
        if isinstance(units, str):
            skipped[utterance.name] = units
            continue
        labelled.append((utterance, units))
        motion, valid = resample_track(utterance.track, len(utterance.features.values))
        spectrum = analysed(utterance.audio).spectrum
        speech = Speech(utterance.features, units, log_f0(utterance.audio), spectrum=spectrum)
        examples.append(Example(utterance.name, speech, motion, valid))
    if not examples:
        name, reason = next(iter(skipped.items()))
        raise CorpusError(f"none of {len(skipped)} utterances could be used; the first, {name}: {reason}")
    general = Recogniser(phones, "general")
    labels.warn_of_doubtful_transcripts(labelled, partial(label_phones, phones=general, lexicon=lexicon))
    return phones, examples, skipped


def list_motionless(
    engine: Engine[Any], voices: Iterable[SpokenSentence], monitor: Monitor = silent_monitor
) -> Iterator[Example]:
    """Yield speech without motion as examples without valid frames; their names are those of the speakers.

    Raises InputError: the engine is not trained on speech alone.
    """
    for number, spoken in enumerate(voices, start=1):
        if not engine.inputs().speech_alone:
            refused = f"the engine {engine.name!r} does not learn from other voices without motion"
            raise InputError(f"{refused}; use one that does (--engine coupled), or leave the voices out")
        monitor(Progress("aligning other voices", number, number, 0.0))
        features = analysed(spoken.audio).mfcc()
        frames = len(features.values)
        no_motion = Motion(np.zeros((frames, 0)), FRAME_RATE_HZ, ())
        yield Example(spoken.speaker, Speech(features, spoken.phones), no_motion, np.zeros(frames, bool))


def label_phones(utterance: Utterance, phones: Recogniser, lexicon: Lexicon) -> Timeline[Unit]:
    """Return the phones in time of an utterance: labelled, or aligned if its words are known, or recognised."""
    if utterance.phones is not None:
        return utterance.phones
    features = Features(np.asarray(utterance.features.values), utterance.features.duration_s)
    return align_or_recognise(phones, analysed(utterance.audio, features), utterance.words, lexicon)


def _train_phone_models(
    utterances: Sequence[Utterance], lexicon: Lexicon, config: HmmConfig, monitor: Monitor, checkpoint: Checkpoint
) -> UnitHmm:
    """Return phone models of all transcribed or labelled utterances, or those of the shipped model.

    The frequencies of many recordings are warped as by vocal tracts of other lengths, to fit other speakers, too.
    Source: Jaitly & Hinton 2013 (vocal tract length perturbation), without random draws or more data.
    """
    transcribed: list[tuple[Audio, tuple[str, ...]]] = []
    labelled: list[tuple[Audio, tuple[str, ...]]] = []
    pronunciations: dict[str, tuple[tuple[str, ...], ...]] = {}
    for utterance in utterances:
        if utterance.phones is not None:  # the phones between two silences are a word with one pronunciation
            phones = groupby((span.label.phone for span in utterance.phones), key=is_silent)
            runs = [tuple(run) for silent, run in phones if not silent]
            labelled.append((utterance.audio, tuple(map(" ".join, runs))))
            pronunciations |= {" ".join(run): (run,) for run in runs}
        elif utterance.words:
            with suppress(InputError):  # a word in another script; the utterance is reported when it is aligned
                if all(lexicon.pronunciations(word) for word in utterance.words):
                    transcribed.append((utterance.audio, utterance.words))
    if not transcribed and not labelled:
        LOG.warning("no transcripts in the corpus: its phones are recognised by the shipped model")
        return load_model().phones
    vocabulary = dict.fromkeys(word for _, words in transcribed for word in words)
    warn_of_guesses(tuple(vocabulary), lexicon)
    lexicon = Lexicon(lexicon.user | pronunciations)
    spoken = [*transcribed, *labelled]
    turns = WARP_CYCLE if len(spoken) >= MIN_WARPED_RECORDINGS else (1.0,)
    examples = [
        TranscribedUtterance(analysed(audio).mfcc(warp).values, tuple(lexicon.pronunciations(word) for word in words))
        for (audio, words), warp in zip(spoken, cycle(turns), strict=False)
    ]
    return train_hmm(examples, UnitInventory(SILENCE, PAUSE, LOG_ENERGY), config, monitor, checkpoint)


def describe_training(
    corpus: Corpus, utterances: Sequence[Utterance], selection: Selection, used: int
) -> dict[str, Any]:
    """Return the part of the header of a model that is for users: corpus, licence, attribution, versions.

    used : how many of the selected utterances could be used
    """
    speakers = sorted(set(selection.speakers)) if selection.speakers and selection.names is None else []
    sources = [utterance.source for utterance in utterances]
    minutes = sum(utterance.audio.duration_s for utterance in utterances) / 60
    return {
        "corpus": sorted({source["collection"] for source in sources if "collection" in source}) or [corpus.path.name],
        "split": "given names" if selection.names is not None else selection.split or "all",
        "seed": "fixed: the same corpus gives the same model",
        "utterances": used,
        "minutes": round(minutes, 1),
        "licence": sorted({source["licence"] for source in sources if "licence" in source}),
        "attribution": sorted({source["attribution"] for source in sources if "attribution" in source}),
        "versions": {"lipmotion": find_version()} | {name: metadata.version(name) for name in ("numpy", "scipy")},
        **({"speakers": speakers} if speakers else {}),
    }


@limit_threads()
def adapt(model: Model | str | Path | None, recordings: Sequence[str | Path | Audio]) -> Model:
    """Return a model whose phone models are adapted to one speaker, for recognition and alignment.

    model      : from ``load_model``, or the path of a model file; None: the shipped model. The new adaptation replaces
                 an earlier one
    recordings : of this speaker alone: audio or video files, or samples at 16 kHz; transcripts are not needed
    Raises InputError: no recording, one that cannot be read, or too little speech in them.
    Raises MissingDependencyError: pocketsphinx is not installed.
    Source: Gales 1998, constrained maximum-likelihood linear regression (``speech.recognition.adaptation_estimation``).

    >>> import lipmotion
    >>> adapted = lipmotion.adapt(None, ["examples/welcome.flac"])
    >>> adapted.about["adapted"]["recordings"], adapted.about["adapted"]["speech_s"] > 4
    (1, True)
    """
    if isinstance(recordings, str | Path | Audio) or not len(recordings):
        raise InputError("recordings are not a list, or it is empty; required: one or more recordings of the speaker")
    chosen = load_model(model)
    sounds = [recording if isinstance(recording, Audio) else read_audio(Path(recording)) for recording in recordings]
    estimated = estimate_adaptation(chosen.phones, sounds)
    about = {**chosen.about, "adapted": {"recordings": len(recordings), "speech_s": round(estimated.speech_s, 1)}}
    return replace(chosen, about=about, adaptation=estimated.adaptation)
