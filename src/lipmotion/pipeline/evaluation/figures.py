"""The figures of docs/measures.md, of generated beside recorded clips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.measures import curves
from lipmotion.measures.bootstrap import bootstrap_interval
from lipmotion.measures.closures import closure_figures, phone_closures
from lipmotion.motion.rest import away_from_speech
from lipmotion.pipeline.evaluation.conditions import OPENING, ComparedClip, HeldOutRecordings
from lipmotion.units import VISEMES

BILABIAL = VISEMES["bi"]
SILENCE_MARGIN_S = 0.3
"""The mouth may still close, or already open, this close to speech."""


def figures_of(clips: Sequence[ComparedClip], found: HeldOutRecordings, seed: int) -> dict[str, Any]:
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
    pictures = {name: per_channel[name] for name in found.eigenlips_channels}
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


def _opening_figures(
    clips: Sequence[ComparedClip], column: int, threshold: float, rate_hz: float, seed: int
) -> dict[str, Any]:
    """Return what only the opening of the mouth can tell."""
    generated, original = [clip.generated[:, column] for clip in clips], [clip.original[:, column] for clip in clips]
    bilabial = [_on_kept_frames(clip, BILABIAL, rate_hz) for clip in clips]
    other_s = sum(end - start for clip in clips for start, end, phone in clip.spoken if phone not in BILABIAL)
    return {
        "opening_acc_95": bootstrap_interval(_acc, generated, original, seed),
        "closures": asdict(closure_figures(generated, original, threshold, rate_hz)),
        "closures_p_b_m": asdict(phone_closures(generated, original, bilabial, other_s, threshold, rate_hz)),
        "silence": {
            "generated": _silence(clips, generated),
            "original": _silence(clips, original),
        },
    }


def _on_kept_frames(clip: ComparedClip, phones: Sequence[str], rate_hz: float) -> list[tuple[float, float]]:
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


def _silence(clips: Sequence[ComparedClip], values: curves.Clips) -> dict[str, float]:
    """Return mean and standard deviation of the opening in silence away from speech."""
    quiet = np.concatenate(
        [
            v[away_from_speech(clip.time_s, _speech_s(clip), SILENCE_MARGIN_S)]
            for clip, v in zip(clips, values, strict=True)
        ]
    )
    if not len(quiet):
        return {"mean": float("nan"), "std": float("nan"), "frames": 0}
    return {"mean": float(quiet.mean()), "std": float(quiet.std()), "frames": len(quiet)}


def _speech_s(clip: ComparedClip) -> list[tuple[float, float]]:
    return [(start_s, end_s) for start_s, end_s, _ in clip.spoken]
