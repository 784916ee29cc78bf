"""A model against recordings it has not seen: ``evaluate(model, corpus) → figures``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.store import Corpus
from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.measures import curves
from lipmotion.measures.bootstrap import interval
from lipmotion.measures.closures import closed_threshold, closure_figures, phone_closures
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.train import labels_of
from lipmotion.pipeline.transcribe import report_guesses
from lipmotion.speech.phones import recognise
from lipmotion.types import Monitor, Motion, Speech, Timeline, Unit, Utterance, counted, part_of, silent_monitor
from lipmotion.units import VISEMES, Lexicon, is_silent

DISTANCES = ("opening", "width", "outer")
BILABIAL = VISEMES["bi"]
SILENCE_MARGIN_S = 0.3
"""The mouth may still close, or already open, this close to speech."""


@dataclass(frozen=True, eq=False)
class Clip:
    """One utterance: original and generated distances at the camera's rate, frames without a face left out."""

    original: NDArray[np.float64]
    generated: NDArray[np.float64]
    time_s: NDArray[np.float64]
    spoken: tuple[tuple[float, float, str], ...]


def evaluate(
    model: Model,
    corpus: Corpus,
    *,
    split: str | None = "test",
    lexicon: Lexicon | None = None,
    seed: int = 0,
    monitor: Monitor = silent_monitor,
) -> dict[str, Any]:
    """Return all figures of docs/measures.md: audio only and, where there are transcripts, with them.

    split   : ``train``, ``val`` or ``test``; None: everything
    monitor : hears how far it is

    The reference for what is speech and where its p, b, m are is the forced alignment, or recognition where
    nothing is transcribed. The mouth counts as closed relative to the corpus's own training list (without
    one: to the split itself).
    Raises CorpusError: no utterances of this split, or corpus or model without the channels compared.
    Raises AlignmentError: a transcript does not fit into its recording.
    """
    lexicon = lexicon or Lexicon()
    utterances = [corpus.utterance(name) for name in corpus.required(split)]
    _check_channels("corpus", utterances[0].track.motion)
    report_guesses([word for utterance in utterances for word in utterance.words or ()], lexicon)
    heard = counted(utterances, "finding the phones", part_of(monitor, 0, 0.2))
    reference = [_reference(utterance, model, lexicon) for utterance in heard]
    threshold = closed_threshold([_openings(u) for u in _training(corpus) or utterances])
    heard = counted(utterances, "recognising the phones", part_of(monitor, 0.2, 0.9))
    conditions = {"audio only": [recognise(model.phones, u.features) for u in heard]}
    if all(utterance.words for utterance in utterances):
        conditions["with transcript"] = reference
    return {
        "split": split or "all",
        "clips": len(utterances),
        "closed_under": threshold,
        "conditions": {
            name: _figures(
                [_clip(model, *row) for row in zip(utterances, units, reference, strict=True)], threshold, seed
            )
            for name, units in conditions.items()
        },
    }


def _training(corpus: Corpus) -> list[Utterance]:
    return [corpus.utterance(name) for name in corpus.names("train")]


def _openings(utterance: Utterance) -> NDArray[np.float64]:
    return np.asarray(utterance.track.motion["opening"], float)[np.asarray(utterance.track.seen)]


def _check_channels(owner: str, motion: Motion) -> None:
    missing = [name for name in DISTANCES if name not in motion.names]
    if missing:
        raise CorpusError(f"the {owner} has no channels {', '.join(missing)}: these figures compare lip distances")


def _reference(utterance: Utterance, model: Model, lexicon: Lexicon) -> Timeline[Unit]:
    try:
        return labels_of(utterance, model.phones, lexicon)
    except AlignmentError as error:
        raise AlignmentError(f"{utterance.name}: {error}; correct its transcript, or leave it out") from error


def _clip(model: Model, utterance: Utterance, units: Timeline[Unit], reference: Timeline[Unit]) -> Clip:
    motion = utterance.track.motion
    seen = np.asarray(utterance.track.seen)
    time_s = (np.arange(len(motion.values)) / motion.rate_hz)[seen]
    generated = model.engine.generate(model.learned, Speech(utterance.features, units)).motion
    _check_channels("model", generated)
    spoken = tuple((s.start_s, s.end_s, s.label.phone) for s in reference if not is_silent(s.label.phone))
    return Clip(
        original=np.stack([motion[name][seen] for name in DISTANCES], axis=1).astype(float),
        generated=np.stack([np.interp(time_s, generated.time_s, generated[name]) for name in DISTANCES], axis=1),
        time_s=time_s,
        spoken=spoken,
    )


def _figures(clips: Sequence[Clip], threshold: float, seed: int) -> dict[str, Any]:
    generated, original = [clip.generated for clip in clips], [clip.original for clip in clips]
    rate_hz = float(1 / np.median(np.diff(clips[0].time_s)))
    opening = [g[:, 0] for g in generated], [o[:, 0] for o in original]
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
        for i, name in enumerate(DISTANCES)
    }
    bilabial = [_on_kept_frames(clip, BILABIAL, rate_hz) for clip in clips]
    other_s = sum(end - start for clip in clips for start, end, phone in clip.spoken if phone not in BILABIAL)
    return {
        "channels": per_channel,
        "opening_acc_95": interval(_opening_acc, generated, original, seed),
        "acc": float(acc.mean()),
        "amse": curves.mean_distance(generated, original),
        "lag_ms": curves.lag_ms(generated, original, rate_hz),
        "closures": asdict(closure_figures(*opening, threshold, rate_hz)),
        "closures_p_b_m": asdict(phone_closures(*opening, bilabial, other_s, threshold, rate_hz)),
        "silence": {
            "generated": _silence(clips, [clip.generated for clip in clips]),
            "original": _silence(clips, [clip.original for clip in clips]),
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


def _opening_acc(generated: curves.Clips, original: curves.Clips) -> float:
    return float(curves.pooled_correlation([g[:, :1] for g in generated], [o[:, :1] for o in original])[0])


def _silence(clips: Sequence[Clip], values: curves.Clips) -> dict[str, float]:
    """Return mean and standard deviation of the opening in silence away from speech."""
    quiet = np.concatenate([v[_away_from_speech(clip), 0] for clip, v in zip(clips, values, strict=True)])
    if not len(quiet):
        return {"mean": float("nan"), "std": float("nan"), "frames": 0}
    return {"mean": float(quiet.mean()), "std": float(quiet.std()), "frames": len(quiet)}


def _away_from_speech(clip: Clip) -> NDArray[np.bool_]:
    away = np.ones(len(clip.time_s), bool)
    for start_s, end_s, _ in clip.spoken:
        away &= (clip.time_s < start_s - SILENCE_MARGIN_S) | (clip.time_s > end_s + SILENCE_MARGIN_S)
    return away
