"""Held-out recordings, the conditions in which they are animated, and generated beside recorded motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.appearance.eigenlips import Eigenlips
from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import Animator
from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.measures import curves
from lipmotion.measures.closures import closed_threshold
from lipmotion.pipeline.training.channels import GEOMETRY, with_visual_channels
from lipmotion.pipeline.training.train import phones_of
from lipmotion.pipeline.transcribe import warn_of_guesses
from lipmotion.pipeline.understand import recognised_speech, speech_of
from lipmotion.speech.recogniser import Recogniser
from lipmotion.types import (
    GREY,
    Monitor,
    Motion,
    Speech,
    Timeline,
    Unit,
    Utterance,
    silent_monitor,
    sub_monitor,
    with_progress,
)
from lipmotion.units import Lexicon, is_silent

ModelT = TypeVar("ModelT")
OPENING = "opening"
TEST_LIST = Selection("test")
AUDIO_ONLY, WITH_TRANSCRIPT = "audio only", "with transcript"
DISTANCES = (OPENING, "width", "outer")
"""The channels compared where faces were tracked; all others are of points near these."""


@dataclass(frozen=True, eq=False)
class HeldOutRecordings:
    """Recordings to compare generated motion with, and their phones in time.

    channels   : names of the channels that are compared
    still      : names of those left out because they do not move
    closed_under : the opening under which the mouth is closed; None where there is no opening
    reference  : the phones of every utterance: labelled, else aligned, else recognised
    conditions : the phones that an engine is given, by condition: ``audio only``, ``with transcript``
    phones     : the recogniser that found them
    eigenlips  : the space of mouth pictures, if coefficients in it are compared
    """

    utterances: Sequence[Utterance]
    channels: tuple[str, ...]
    still: tuple[str, ...]
    closed_under: float | None
    reference: Sequence[Timeline[Unit]]
    conditions: Mapping[str, Sequence[Timeline[Unit]]]
    phones: Recogniser
    eigenlips: Eigenlips | None = None

    @property
    def eigenlips_channels(self) -> tuple[str, ...]:
        """The channels that are eigenlips."""
        names = {channel.name for channel in self.eigenlips.channels} if self.eigenlips is not None else ()
        return tuple(name for name in self.channels if name in names)


@dataclass(frozen=True, eq=False)
class ComparedClip:
    """One utterance: original and generated curves at the recording's own rate, frames without a face left out."""

    original: NDArray[np.float64]
    generated: NDArray[np.float64]
    time_s: NDArray[np.float64]
    spoken: tuple[tuple[float, float, str], ...]


def held_out_recordings(
    corpus: Corpus,
    phones: Recogniser,
    *,
    selection: Selection = TEST_LIST,
    channels: Sequence[str] | None = None,
    lexicon: Lexicon | None = None,
    monitor: Monitor = silent_monitor,
    visual: str = GEOMETRY,
    eigenlips: Eigenlips | None = None,
) -> HeldOutRecordings:
    """Return held-out recordings with the phones that ``phones`` aligns and recognises in them. Raises as ``evaluate``.

    selection : the list ``test`` by default
    channels : compare these, whether they move or not
    visual, eigenlips : of the model: which channels it has, and the space of the pictures among them
    """
    lexicon = lexicon or Lexicon()
    utterances = [
        with_visual_channels(corpus.utterance(name), visual, eigenlips) for name in corpus.selected(selection)
    ]
    compare_with_recorded, still = (tuple(channels), ()) if channels is not None else compared_channels(utterances)
    warn_of_guesses([word for utterance in utterances for word in utterance.words or ()], lexicon)
    heard = with_progress(utterances, "finding the phones", sub_monitor(monitor, 0, 0.4))
    reference = [_reference(utterance, phones, lexicon) for utterance in heard]
    threshold = None
    if OPENING in compare_with_recorded:
        threshold = closed_threshold([_openings(u) for u in _training(corpus, selection.speakers) or utterances])
    heard = with_progress(utterances, "recognising the phones", sub_monitor(monitor, 0.4, 0.9))
    conditions = {AUDIO_ONLY: [phones.recognise(u.audio, u.features) for u in heard]}
    if all(utterance.words or utterance.phones for utterance in utterances):
        conditions[WITH_TRANSCRIPT] = reference
    return HeldOutRecordings(
        utterances, compare_with_recorded, still, threshold, reference, conditions, phones, eigenlips
    )


def compared_channels(utterances: Sequence[Utterance]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the channels to compare, and those left out because they are still.

    All eigenlips are compared, whether they move or not: their figures are means over a known number.
    Raises CorpusError: the utterances have different channels, or nothing moves.
    """
    channels = utterances[0].track.motion.channels
    if any(utterance.track.motion.channels != channels for utterance in utterances):
        raise CorpusError("the utterances have different motion channels; evaluate one kind, with --speaker or --split")
    names = utterances[0].track.motion.names
    pictured = tuple(channel.name for channel in channels if channel.unit == GREY)
    if set(names) >= set(DISTANCES):
        return (*DISTANCES, *pictured), ()
    originals = [np.asarray(utterance.track.motion.values, float) for utterance in utterances]
    moves = curves.moving(originals, [channel.unit for channel in channels])
    moves |= np.array([channel.unit == GREY for channel in channels])
    if not moves.any():
        raise CorpusError(f"none of {len(names)} motion channels moves in these {len(utterances)} utterances")
    moving = tuple(name for name, moved in zip(names, moves, strict=True) if moved)
    return moving, tuple(name for name in names if name not in moving)


def _training(corpus: Corpus, speakers: Sequence[str]) -> list[Utterance]:
    return [corpus.utterance(name) for name in corpus.names("train", speakers)]


def _openings(utterance: Utterance) -> NDArray[np.float64]:
    return np.asarray(utterance.track.motion[OPENING], float)[np.asarray(utterance.track.seen)]


def _check_channels(motion: Motion, compare_with_recorded: Sequence[str]) -> None:
    missing = [name for name in compare_with_recorded if name not in motion.names]
    if missing:
        raise CorpusError(
            f"the model has no channels {', '.join(missing[:6])}, which the corpus has: it learned other motion"
        )


def _reference(utterance: Utterance, phones: Recogniser, lexicon: Lexicon) -> Timeline[Unit]:
    try:
        return phones_of(utterance, phones, lexicon)
    except AlignmentError as error:
        raise AlignmentError(f"{utterance.name}: {error}; correct its transcript, or leave it out") from error


def compared_clips(
    found: HeldOutRecordings, condition: str, engine: Animator[ModelT], learned: ModelT
) -> list[ComparedClip]:
    """Return what an engine makes of recordings, beside the originals. Raises CorpusError: it has other channels."""
    return compare_with_recorded(found, speech_of_condition(found, condition, engine, learned), engine, learned)


def speech_of_condition(
    found: HeldOutRecordings, condition: str, engine: Animator[ModelT], learned: ModelT
) -> list[Speech]:
    """Return all utterances as ``animate`` gives them to an engine under a condition."""
    return [
        _speech(engine, learned, found, utterance, units, condition == WITH_TRANSCRIPT)
        for utterance, units in zip(found.utterances, found.conditions[condition], strict=True)
    ]


def compare_with_recorded(
    found: HeldOutRecordings, spoken: Sequence[Speech], engine: Animator[ModelT], learned: ModelT
) -> list[ComparedClip]:
    """Return the motion that an engine generates for all utterances beside the recorded motion.

    spoken : of ``speech_of_condition``, one for each utterance
    Raises CorpusError: the engine's model has other channels.
    """
    return [
        _clip(engine, learned, found.channels, utterance, speech, reference)
        for utterance, speech, reference in zip(found.utterances, spoken, found.reference, strict=True)
    ]


def _speech(
    engine: Animator[ModelT],
    learned: ModelT,
    found: HeldOutRecordings,
    utterance: Utterance,
    units: Timeline[Unit],
    said: bool,
) -> Speech:
    """Return an utterance as ``animate`` hears it."""
    if said:
        return speech_of(engine, utterance.audio, utterance.features, units)
    return recognised_speech(engine, learned, utterance.audio, utterance.features, found.phones, lambda: units)


def _clip(
    engine: Animator[ModelT],
    learned: ModelT,
    compare_with_recorded: Sequence[str],
    utterance: Utterance,
    heard: Speech,
    reference: Timeline[Unit],
) -> ComparedClip:
    motion = utterance.track.motion
    seen = np.asarray(utterance.track.seen)
    time_s = (np.arange(len(motion.values)) / motion.rate_hz)[seen]
    generated = engine.generate(learned, heard).motion
    _check_channels(generated, compare_with_recorded)
    spoken = tuple((s.start_s, s.end_s, s.label.phone) for s in reference if not is_silent(s.label.phone))
    return ComparedClip(
        original=np.stack([motion[name][seen] for name in compare_with_recorded], axis=1).astype(float),
        generated=np.stack(
            [np.interp(time_s, generated.time_s, generated[name]) for name in compare_with_recorded], axis=1
        ),
        time_s=time_s,
        spoken=spoken,
    )
