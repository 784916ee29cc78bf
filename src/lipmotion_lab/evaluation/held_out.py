"""Held-out recordings, and pairs of recorded and generated motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import Corpus, Selection
from lipmotion.engines import Animator
from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.measures import curves
from lipmotion.measures.closures import find_threshold
from lipmotion.motion.eigenlips import Eigenlips
from lipmotion.motion.speaker_maps import SpeakerMaps
from lipmotion.pipeline.analysis.speech_analysis import build_speech, recognise_speech, with_voice
from lipmotion.pipeline.analysis.transcribe import warn_of_guesses
from lipmotion.pipeline.generation import generate_for
from lipmotion.pipeline.model import GEOMETRY, Model, with_prior
from lipmotion.pipeline.training.channels import with_visual_channels
from lipmotion.pipeline.training.train import label_phones
from lipmotion.speech.recognition.recognised_speech import Recognition
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.types import GREY, Monitor, Speech, Timeline, Unit, Utterance, silent_monitor, sub_monitor, with_progress
from lipmotion.units import Lexicon, is_silent

ModelT = TypeVar("ModelT")
OPENING = "opening"
TEST_LIST = Selection("test")
AUDIO_ONLY, WITH_TRANSCRIPT = "audio only", "with transcript"
DISTANCES = (OPENING, "width", "outer")
"""The channels that are compared where faces were tracked; the other channels are points, which move with these."""


@dataclass(frozen=True, eq=False)
class HeldOutRecordings:
    """Recordings with which generated motion is compared, and their phones in time.

    channels     : names of the channels that are compared
    still        : names of the channels that are left out because they do not move
    closed_under : the opening under which the mouth counts as closed, in eye distances (None: no channel ``opening``)
    reference    : phones in time of every utterance: labelled, or aligned, or recognised
    conditions   : phones in time that the engine is given, by condition: ``audio only``, ``with transcript``
    eigenlips    : principal components of mouth pictures (None: their coefficients are not compared)
    prior        : the model on which the evaluated one stands (None: it stands on none)
    speakers     : maps of the people whom the evaluated model knows (None: it tells no people apart)
    """

    utterances: Sequence[Utterance]
    channels: tuple[str, ...]
    still: tuple[str, ...]
    closed_under: float | None
    reference: Sequence[Timeline[Unit]]
    conditions: Mapping[str, Sequence[Timeline[Unit]]]
    phones: Recogniser
    recognitions: Sequence[Recognition]
    eigenlips: Eigenlips | None = None
    prior: Model | None = None
    speakers: SpeakerMaps | None = None

    def select_first(self, count: int) -> HeldOutRecordings:
        """Return the first recordings alone."""
        conditions = {name: phones[:count] for name, phones in self.conditions.items()}
        parts = {name: getattr(self, name)[:count] for name in ("utterances", "reference", "recognitions")}
        return replace(self, conditions=conditions, **parts)

    @cached_property
    def sounds(self) -> Sequence[AnalysedAudio]:
        """The sound of every utterance, which is analysed once for all systems."""
        return [analysed(utterance.audio, utterance.features) for utterance in self.utterances]

    @property
    def eigenlips_channels(self) -> tuple[str, ...]:
        """Names of the compared channels that are eigenlips."""
        names = {channel.name for channel in self.eigenlips.channels} if self.eigenlips is not None else ()
        return tuple(name for name in self.channels if name in names)


@dataclass(frozen=True, eq=False)
class ComparedClip:
    """Recorded and generated motion of one utterance, in the N frames of the recording in which the face was measured.

    original, generated : values of the compared channels [each shape=(N, P)]
    time_s : time of every frame in seconds [shape=(N,)]
    spoken : start and end in seconds, and phone, of every phone that is not silence
    """

    original: NDArray[np.float64]
    generated: NDArray[np.float64]
    time_s: NDArray[np.float64]
    spoken: tuple[tuple[float, float, str], ...]


def load_held_out(  # noqa: PLR0913
    corpus: Corpus,
    phones: Recogniser,
    *,
    selection: Selection = TEST_LIST,
    channels: Sequence[str] | None = None,
    lexicon: Lexicon | None = None,
    monitor: Monitor = silent_monitor,
    visual: str = GEOMETRY,
    eigenlips: Eigenlips | None = None,
    prior: Model | None = None,
    speakers: SpeakerMaps | None = None,
) -> HeldOutRecordings:
    """Return held-out recordings with aligned and recognised phones. Raises as ``evaluate``.

    channels  : the channels to compare, whether they move or not; None: from ``choose_channels``
    visual, eigenlips : of the model: the kind of its channels, and its principal components of mouth pictures
    """
    lexicon = lexicon or Lexicon()
    utterances = [
        with_visual_channels(corpus.utterance(name), visual, eigenlips) for name in corpus.selected(selection)
    ]
    compared, still = (tuple(channels), ()) if channels is not None else choose_channels(utterances)
    warn_of_guesses([word for utterance in utterances for word in utterance.words or ()], lexicon)
    aligned = with_progress(utterances, "phones: alignment", sub_monitor(monitor, 0, 0.4))
    reference = []
    for utterance in aligned:
        try:
            reference.append(label_phones(utterance, phones, lexicon))
        except AlignmentError as error:
            raise AlignmentError(f"{utterance.name}: {error}; correct its transcript, or leave it out") from error
    threshold = None
    if OPENING in compared:
        training = [corpus.utterance(name) for name in corpus.names("train", selection.speakers)]
        tracks = [utterance.track for utterance in training or utterances]
        threshold = find_threshold([np.asarray(each.motion[OPENING], float)[np.asarray(each.seen)] for each in tracks])
    recognised = with_progress(utterances, "phones: recognition", sub_monitor(monitor, 0.4, 0.9))
    recognitions = [phones.recognise(analysed(each.audio, each.features)) for each in recognised]
    conditions = {AUDIO_ONLY: [each.units for each in recognitions]}
    if all(utterance.words or utterance.phones for utterance in utterances):
        conditions[WITH_TRANSCRIPT] = reference
    return HeldOutRecordings(
        utterances, compared, still, threshold, reference, conditions, phones, recognitions, eigenlips, prior, speakers
    )


def choose_channels(utterances: Sequence[Utterance]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the channels to compare, and of those that are left out because they do not move.

    All eigenlips are compared, whether they move or not: their figures are means over a known number.
    Raises CorpusError: the utterances have different channels, or nothing moves.
    """
    channels = utterances[0].track.motion.channels
    if any(utterance.track.motion.channels != channels for utterance in utterances):
        raise CorpusError("the utterances have different motion channels; evaluate one kind, with --speaker or --split")
    names = utterances[0].track.motion.names
    eigenlips = tuple(channel.name for channel in channels if channel.unit == GREY)
    if set(names) >= set(DISTANCES):
        return (*DISTANCES, *eigenlips), ()
    originals = [np.asarray(utterance.track.motion.values, float) for utterance in utterances]
    moves = curves.select_moving(originals, [channel.unit for channel in channels])
    moving = tuple(name for name, does in zip(names, moves, strict=True) if does or name in eigenlips)
    if not moving:
        raise CorpusError(f"none of {len(names)} motion channels moves in these {len(utterances)} utterances")
    return moving, tuple(name for name in names if name not in moving)


def generate_clips(
    recordings: HeldOutRecordings, condition: str, engine: Animator[ModelT], learned: ModelT
) -> list[ComparedClip]:
    """Return recorded and generated motion of all utterances. Raises CorpusError: the model has other channels."""
    speech = make_speech(recordings, condition, engine, learned)
    return generate_compared(recordings, speech, engine, learned)


def make_speech(
    recordings: HeldOutRecordings, condition: str, engine: Animator[ModelT], learned: ModelT
) -> list[Speech]:
    """Return the speech of all utterances under a condition, as ``animate`` gives it to the engine."""
    phones, speech = recordings.phones, []
    spoken = zip(recordings.sounds, recordings.conditions[condition], recordings.recognitions, strict=True)
    for sound, units, recognition in spoken:
        used: list[Recognition] = []  # what was recognised, if the engine needs it
        if condition == AUDIO_ONLY:

            def recognise(result: Recognition = recognition, used: list[Recognition] = used) -> Recognition:
                used.append(result)
                return result

            plain = recognise_speech(engine, learned, sound, sound.mfcc(), phones, recognise)
        else:
            plain = build_speech(engine, sound, sound.mfcc(), units, phones.kind)
        voiced = with_voice(phones.own, sound, plain, used[-1] if used else None)
        speech.append(with_prior(recordings.prior, voiced))
    return speech


def generate_compared(
    recordings: HeldOutRecordings, speech: Sequence[Speech], engine: Animator[ModelT], learned: ModelT
) -> list[ComparedClip]:
    """Return recorded and generated motion of all utterances for their speech. Raises CorpusError: other channels."""
    clips, channels = [], recordings.channels
    for utterance, spoken, reference in zip(recordings.utterances, speech, recordings.reference, strict=True):
        person = recordings.speakers.get(utterance.speaker) if recordings.speakers else None
        generated = generate_for(person, engine, learned, spoken).motion
        if missing := [name for name in channels if name not in generated.names]:
            names = ", ".join(missing[:6])
            raise CorpusError(
                f"the model has no channels {names}, which the corpus has: it was trained on other motion"
            )
        motion, seen = utterance.track.motion, np.asarray(utterance.track.seen)
        time_s = (np.arange(len(motion.values)) / motion.rate_hz)[seen]
        clip = ComparedClip(
            original=np.stack([motion[name][seen] for name in channels], axis=1).astype(float),
            generated=np.stack([np.interp(time_s, generated.time_s, generated[name]) for name in channels], axis=1),
            time_s=time_s,
            spoken=tuple((s.start_s, s.end_s, s.label.phone) for s in reference if not is_silent(s.label.phone)),
        )
        clips.append(clip)
    return clips
