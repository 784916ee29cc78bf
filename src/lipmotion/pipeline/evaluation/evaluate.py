"""A model against recordings it has not seen: ``evaluate(model, corpus) → figures``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.appearance.eigenlips import Eigenlips
from lipmotion.corpora.store import Corpus
from lipmotion.engines import Animator
from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.kernels.threads import one_thread
from lipmotion.measures import curves
from lipmotion.measures.bootstrap import interval
from lipmotion.measures.closures import closed_threshold, closure_figures, phone_closures
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.training.channels import GEOMETRY, as_learned
from lipmotion.pipeline.training.train import labels_of
from lipmotion.pipeline.transcribe import report_guesses
from lipmotion.pipeline.understand import hear, hear_unsaid
from lipmotion.speech.recogniser import Recogniser
from lipmotion.speech.recogniser import recogniser as cached_recogniser
from lipmotion.storage.json_text import defined
from lipmotion.types import GREY, Monitor, Motion, Speech, Timeline, Unit, Utterance, counted, part_of, silent_monitor
from lipmotion.units import VISEMES, Lexicon, is_silent

ModelT = TypeVar("ModelT")
OPENING = "opening"
WITH_TRANSCRIPT = "with transcript"
DISTANCES = (OPENING, "width", "outer")
"""What is compared where faces were tracked; all other channels follow from points near these."""
BILABIAL = VISEMES["bi"]
SILENCE_MARGIN_S = 0.3
"""The mouth may still close, or already open, this close to speech."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Recordings to compare with, and what is said in them.

    channels   : names of those that are compared
    still      : of those left out because they do not move
    closed_under : the opening under which the mouth is closed; None where there is no opening
    reference  : what is spoken, utterance by utterance
    conditions : what an engine is told of that, by name: ``audio only``, ``with transcript``
    phones     : what found them
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
    def pictured(self) -> tuple[str, ...]:
        """The channels that are eigenlips."""
        names = {channel.name for channel in self.eigenlips.channels} if self.eigenlips is not None else ()
        return tuple(name for name in self.channels if name in names)


@dataclass(frozen=True, eq=False)
class Clip:
    """One utterance: original and generated curves at the recording's own rate, frames without a face left out."""

    original: NDArray[np.float64]
    generated: NDArray[np.float64]
    time_s: NDArray[np.float64]
    spoken: tuple[tuple[float, float, str], ...]


@one_thread()
def evaluate(
    model: Model,
    corpus: Corpus,
    *,
    split: str | None = "test",
    speakers: Sequence[str] = (),
    lexicon: Lexicon | None = None,
    recogniser: str = "auto",
    seed: int = 0,
    monitor: Monitor = silent_monitor,
) -> dict[str, Any]:
    """Return all figures of docs/measures.md: audio only and, where there are transcripts, with them.

    split    : ``train``, ``val`` or ``test``; None: everything
    speakers : theirs only; all by default
    recogniser : as in ``animate``
    monitor  : hears how far it is

    Compared are the lip distances or, in a corpus without them, every channel that moves in the recordings; beside
    them, or in their place, the eigenlips of a model that has some. Figures of closing, and of silence, need the
    channel ``opening``. What cannot be computed is None.
    Where the engine makes lips meet in p, b and m, ``unpinned`` holds the same figures of what it makes without that.
    The reference for what is speech and where its p, b, m are is the labelled phones, else the forced alignment, or
    recognition where nothing is transcribed. The mouth counts as closed relative to the corpus's own training list
    (without one: to the split itself).
    Raises CorpusError: no utterances of this split, or a model without the channels compared.
    Raises AlignmentError: a transcript does not fit into its recording.
    """
    phones = cached_recogniser(model.phones, recogniser, model.adaptation)
    found = recorded(
        corpus,
        phones,
        split=split,
        speakers=speakers,
        lexicon=lexicon,
        monitor=monitor,
        visual=model.visual,
        eigenlips=model.eigenlips,
    )
    figures = {
        "split": split or "all",
        "clips": len(found.utterances),
        "closed_under": found.closed_under,
        "still_channels": list(found.still),
        "conditions": {
            name: _figures_and_unpinned(found, name, model.engine, model.learned, seed) for name in found.conditions
        },
    }
    plain: dict[str, Any] = defined(figures)
    return plain


def recorded(
    corpus: Corpus,
    phones: Recogniser,
    *,
    split: str | None = "test",
    speakers: Sequence[str] = (),
    names: Sequence[str] | None = None,
    channels: Sequence[str] | None = None,
    lexicon: Lexicon | None = None,
    monitor: Monitor = silent_monitor,
    visual: str = GEOMETRY,
    eigenlips: Eigenlips | None = None,
) -> Recorded:
    """Return the recordings of a split, and their phones as ``phones`` finds them. Raises as ``evaluate``.

    names    : these utterances only, whatever their list
    channels : compare these, whether they move or not
    visual, eigenlips : of the model: which channels it has, and the space of the pictures among them
    """
    lexicon = lexicon or Lexicon()
    chosen = names if names is not None else corpus.required(split, speakers)
    utterances = [as_learned(corpus.utterance(name), visual, eigenlips) for name in chosen]
    compared, still = (tuple(channels), ()) if channels is not None else compared_channels(utterances)
    report_guesses([word for utterance in utterances for word in utterance.words or ()], lexicon)
    heard = counted(utterances, "finding the phones", part_of(monitor, 0, 0.4))
    reference = [_reference(utterance, phones, lexicon) for utterance in heard]
    threshold = None
    if OPENING in compared:
        threshold = closed_threshold([_openings(u) for u in _training(corpus, speakers) or utterances])
    heard = counted(utterances, "recognising the phones", part_of(monitor, 0.4, 0.9))
    conditions = {"audio only": [phones.recognise(u.audio, u.features) for u in heard]}
    if all(utterance.words or utterance.phones for utterance in utterances):
        conditions[WITH_TRANSCRIPT] = reference
    return Recorded(utterances, compared, still, threshold, reference, conditions, phones, eigenlips)


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


def _check_channels(motion: Motion, compared: Sequence[str]) -> None:
    missing = [name for name in compared if name not in motion.names]
    if missing:
        raise CorpusError(
            f"the model has no channels {', '.join(missing[:6])}, which the corpus has: it learned other motion"
        )


def _reference(utterance: Utterance, phones: Recogniser, lexicon: Lexicon) -> Timeline[Unit]:
    try:
        return labels_of(utterance, phones, lexicon)
    except AlignmentError as error:
        raise AlignmentError(f"{utterance.name}: {error}; correct its transcript, or leave it out") from error


def clips(found: Recorded, condition: str, engine: Animator[ModelT], learned: ModelT) -> list[Clip]:
    """Return what an engine makes of recordings, beside the originals. Raises CorpusError: it has other channels."""
    return _clips(found, _all_heard(found, condition, engine, learned), engine, learned)


def _figures_and_unpinned(
    found: Recorded, condition: str, engine: Animator[ModelT], learned: ModelT, seed: int
) -> dict[str, Any]:
    heard = _all_heard(found, condition, engine, learned)
    figures, unpinned = figures_of(_clips(found, heard, engine, learned), found, seed), engine.unpinned()
    if unpinned == engine or found.closed_under is None:
        return figures
    return figures | {"unpinned": figures_of(_clips(found, heard, unpinned, learned), found, seed)}


def _all_heard(found: Recorded, condition: str, engine: Animator[ModelT], learned: ModelT) -> list[Speech]:
    return [
        _heard(engine, learned, found, utterance, units, condition == WITH_TRANSCRIPT)
        for utterance, units in zip(found.utterances, found.conditions[condition], strict=True)
    ]


def _clips(found: Recorded, heard: Sequence[Speech], engine: Animator[ModelT], learned: ModelT) -> list[Clip]:
    return [
        _clip(engine, learned, found.channels, utterance, speech, reference)
        for utterance, speech, reference in zip(found.utterances, heard, found.reference, strict=True)
    ]


def _heard(
    engine: Animator[ModelT], learned: ModelT, found: Recorded, utterance: Utterance, units: Timeline[Unit], said: bool
) -> Speech:
    """Return an utterance as ``animate`` hears it."""
    if said:
        return hear(engine, utterance.audio, utterance.features, units)
    return hear_unsaid(engine, learned, utterance.audio, utterance.features, found.phones, lambda: units)


def _clip(
    engine: Animator[ModelT],
    learned: ModelT,
    compared: Sequence[str],
    utterance: Utterance,
    heard: Speech,
    reference: Timeline[Unit],
) -> Clip:
    motion = utterance.track.motion
    seen = np.asarray(utterance.track.seen)
    time_s = (np.arange(len(motion.values)) / motion.rate_hz)[seen]
    generated = engine.generate(learned, heard).motion
    _check_channels(generated, compared)
    spoken = tuple((s.start_s, s.end_s, s.label.phone) for s in reference if not is_silent(s.label.phone))
    return Clip(
        original=np.stack([motion[name][seen] for name in compared], axis=1).astype(float),
        generated=np.stack([np.interp(time_s, generated.time_s, generated[name]) for name in compared], axis=1),
        time_s=time_s,
        spoken=spoken,
    )


def figures_of(clips: Sequence[Clip], found: Recorded, seed: int) -> dict[str, Any]:
    """Return the figures of one condition; NaN where there is none.

    Channels in grey levels are summed up apart: as ``eigenlips``, or as the whole where there are no others.
    """
    compared, threshold = found.channels, found.closed_under
    generated, original = [clip.generated for clip in clips], [clip.original for clip in clips]
    rate_hz = float(1 / np.median(np.diff(clips[0].time_s)))
    acc, clip_acc = curves.pooled_correlation(generated, original), curves.per_clip_correlation(generated, original)
    error, variance = curves.normalised_rmse(generated, original), curves.global_variance_ratio(generated, original)
    jerk = curves.jerk_ratio(generated, original)
    per_channel = {
        name: {
            "acc": float(acc[i]),
            "acc_per_clip": float(clip_acc[i]),
            "nrmse": float(error[i]),
            "global_variance": float(variance[i]),
            "jerk": float(jerk[i]),
        }
        for i, name in enumerate(compared)
    }
    pictures = {name: per_channel[name] for name in found.pictured}
    pictured = np.array([name in pictures for name in compared])
    whole = ~pictured if not pictured.all() else pictured
    spread = np.where(whole, np.concatenate(original).std(axis=0), 0)
    leading = compared.index(OPENING) if OPENING in compared else int(spread.argmax())
    figures = {
        "channels": {name: row for name, row in per_channel.items() if name not in pictures},
        "acc": float(acc[whole].mean()),
        "amse": curves.mean_distance(_columns(generated, whole), _columns(original, whole)),
        "leading": compared[leading],
        "lag_ms": curves.lag_ms(_column(generated, leading), _column(original, leading), rate_hz),
    }
    if pictures:
        amse = curves.mean_distance(_columns(generated, pictured), _columns(original, pictured))
        figures["eigenlips"] = _means(list(pictures.values())) | {"amse": amse, "channels": pictures}
    if threshold is None:
        return figures
    return figures | _opening_figures(clips, compared.index(OPENING), threshold, rate_hz, seed)


def _means(rows: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Return the mean of each figure over channels. Source: Xie & Liu 2007, Eq. 21, of the correlation."""
    return {figure: float(np.mean([row[figure] for row in rows])) for figure in rows[0]}


def _opening_figures(clips: Sequence[Clip], column: int, threshold: float, rate_hz: float, seed: int) -> dict[str, Any]:
    """Return what only the opening of the mouth can tell."""
    generated, original = [clip.generated[:, column] for clip in clips], [clip.original[:, column] for clip in clips]
    bilabial = [_on_kept_frames(clip, BILABIAL, rate_hz) for clip in clips]
    other_s = sum(end - start for clip in clips for start, end, phone in clip.spoken if phone not in BILABIAL)
    return {
        "opening_acc_95": interval(_acc, generated, original, seed),
        "closures": asdict(closure_figures(generated, original, threshold, rate_hz)),
        "closures_p_b_m": asdict(phone_closures(generated, original, bilabial, other_s, threshold, rate_hz)),
        "silence": {
            "generated": _silence(clips, generated),
            "original": _silence(clips, original),
        },
    }


def _on_kept_frames(clip: Clip, phones: Sequence[str], rate_hz: float) -> list[tuple[float, float]]:
    """Return when some phones are said, on a clock that stands still while no face is seen."""
    clock_s = np.arange(len(clip.time_s)) / rate_hz
    return [
        (float(np.interp(start_s, clip.time_s, clock_s)), float(np.interp(end_s, clip.time_s, clock_s)))
        for start_s, end_s, phone in clip.spoken
        if phone in phones
    ]


def _columns(side: curves.Clips, columns: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    return [clip[:, columns] for clip in side]


def _column(side: curves.Clips, column: int) -> list[NDArray[np.float64]]:
    return [clip[:, column : column + 1] for clip in side]


def _acc(generated: curves.Clips, original: curves.Clips) -> float:
    return float(curves.pooled_correlation([g[:, None] for g in generated], [o[:, None] for o in original])[0])


def _silence(clips: Sequence[Clip], values: curves.Clips) -> dict[str, float]:
    """Return mean and standard deviation of the opening in silence away from speech."""
    quiet = np.concatenate([v[_away_from_speech(clip)] for clip, v in zip(clips, values, strict=True)])
    if not len(quiet):
        return {"mean": float("nan"), "std": float("nan"), "frames": 0}
    return {"mean": float(quiet.mean()), "std": float(quiet.std()), "frames": len(quiet)}


def _away_from_speech(clip: Clip) -> NDArray[np.bool_]:
    away = np.ones(len(clip.time_s), bool)
    for start_s, end_s, _ in clip.spoken:
        away &= (clip.time_s < start_s - SILENCE_MARGIN_S) | (clip.time_s > end_s + SILENCE_MARGIN_S)
    return away
