"""The figures of docs/measures.md, from recorded and generated motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lipmotion.measures import curves
from lipmotion.measures.bootstrap import bootstrap_interval
from lipmotion.measures.closures import closure_figures, phone_closures
from lipmotion.motion.rest import is_away_from_speech
from lipmotion.units import VISEMES
from lipmotion_lab.evaluation.held_out import OPENING, ComparedClip

BILABIAL = VISEMES["bi"]
SILENCE_MARGIN_S = 0.3
"""Seconds before and after speech in which the mouth may still close or already open."""


class Compared(Protocol):
    """What is compared in some recordings: part of ``HeldOutRecordings``."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""

    @property
    def closed_under(self) -> float | None:
        """The opening under which the mouth counts as closed (None: no channel ``opening``)."""

    @property
    def eigenlips_channels(self) -> tuple[str, ...]:
        """Names of the channels that are eigenlips."""


def figures_of(clips: Sequence[ComparedClip], recordings: Compared, seed: int) -> dict[str, Any]:
    """Return the figures of one condition, by name; figures that cannot be computed are NaN.

    recordings : of the clips
    seed       : of the bootstrap interval
    Eigenlips have figures of their own, ``eigenlips``; without other channels, these are also the overall figures.
    """
    compared, threshold = recordings.channels, recordings.closed_under
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
    eigenlips = {name: per_channel[name] for name in recordings.eigenlips_channels}
    is_eigenlips = np.array([name in eigenlips for name in compared])
    overall = ~is_eigenlips if not is_eigenlips.all() else is_eigenlips
    spread = np.where(overall, np.concatenate(original).std(axis=0), 0)
    leading = compared.index(OPENING) if OPENING in compared else int(spread.argmax())
    figures = {
        "channels": {name: row for name, row in per_channel.items() if name not in eigenlips},
        "acc": float(acc[overall].mean()),
        "amse": curves.mean_distance(_columns(generated, overall), _columns(original, overall)),
        "leading": compared[leading],
        "lag_ms": curves.lag_ms(_column(generated, leading), _column(original, leading), rate_hz),
    }
    if eigenlips:
        amse = curves.mean_distance(_columns(generated, is_eigenlips), _columns(original, is_eigenlips))
        figures["eigenlips"] = _means(list(eigenlips.values())) | {"amse": amse, "channels": eigenlips}
    if threshold is None:
        return figures
    return figures | _opening_figures(clips, compared.index(OPENING), threshold, rate_hz, seed)


def _means(rows: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Return the mean of each figure over channels. Source: Xie & Liu 2007, Eq. 21, for the correlation."""
    return {figure: float(np.mean([row[figure] for row in rows])) for figure in rows[0]}


def _opening_figures(
    clips: Sequence[ComparedClip], column: int, threshold: float, rate_hz: float, seed: int
) -> dict[str, Any]:
    """Return the figures of the channel ``opening``: its interval, closures, and silence."""
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
    """Return start and end, in seconds, of some phones, on a clock that stops where the face was not measured."""
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
    """Return mean and standard deviation of the opening in silence away from speech, and the number of its frames."""
    quiet = np.concatenate(
        [
            v[
                is_away_from_speech(
                    clip.time_s, [(start_s, end_s) for start_s, end_s, _ in clip.spoken], SILENCE_MARGIN_S
                )
            ]
            for clip, v in zip(clips, values, strict=True)
        ]
    )
    if not len(quiet):
        return {"mean": float("nan"), "std": float("nan"), "frames": 0}
    return {"mean": float(quiet.mean()), "std": float(quiet.std()), "frames": len(quiet)}
