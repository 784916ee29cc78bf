"""Measures of the similarity of generated and recorded curves and points, and bootstrap intervals over clips.

A set of clips is a list of arrays at the frame rate of the video, generated and original alike: of curves
[shape=(T_i, P)], or of places of V vertices, landmarks or curves [shape=(T_i, V, D)].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.curves import measure_modulation_spectrum, varies

Array = NDArray[np.float64]
Clips = Sequence[Array]
HIGHEST_HZ = 12.5
"""Frequencies above it hold noise of trackers rather than speech, and cameras of 25 Hz do not show them."""
FLOOR = 1e-6  # power under this share of the largest of the original counts as so much: rounding is no movement


def measure_modulation_distance(generated: Clips, original: Clips, rate_hz: float) -> Array:
    """Return the root of the mean squared difference of two log modulation spectra, in dB [shape=(P,)].

    The mean is over frequencies up to ``HIGHEST_HZ``. NaN where the original is constant but for rounding.
    Source: Takamichi et al. 2016, who show the spectra; the distance is ours.
    """
    frequencies, reference = measure_modulation_spectrum(original, rate_hz)
    _, made = measure_modulation_spectrum(generated, rate_hz)
    floor = np.where(varies(np.concatenate(original)), FLOOR * reference.max(axis=0), np.nan)
    difference = 10 * np.log10(np.maximum(made, floor) / np.maximum(reference, floor))
    return np.sqrt(np.square(difference[frequencies <= HIGHEST_HZ]).mean(axis=0))


STILL_SHARE = 0.01  # curves that move by less than this share of the widest of the same unit are rounding or noise


def correlation(generated: Array, original: Array) -> Array:
    """Return the correlation of channels over all frames, 0 for constant ones [shape=(P,)] (Xie & Liu 2007, Eq. 21)."""
    a, b = generated - generated.mean(axis=0), original - original.mean(axis=0)
    scale = np.sqrt((a * a).sum(axis=0) * (b * b).sum(axis=0))
    moves = varies(generated) & varies(original) & (scale > 0)
    return (a * b).sum(axis=0) / np.where(moves, scale, np.inf)


def select_moving(original: Clips, units: Sequence[str]) -> NDArray[np.bool_]:
    """Return which channels move [shape=(P,)]: by more than ``STILL_SHARE`` of the widest of their unit."""
    values = np.concatenate(original)
    extents: Array = np.ptp(values, axis=0)
    widest = {unit: max(e for e, other in zip(extents, units, strict=True) if other == unit) for unit in set(units)}
    return varies(values) & (extents > STILL_SHARE * np.array([widest[unit] for unit in units]))


def correlate_pooled(generated: Clips, original: Clips) -> Array:
    """Return the ``correlation`` over the frames of all clips together [shape=(P,)]."""
    return correlation(np.concatenate(generated), np.concatenate(original))


def correlate_clips(generated: Clips, original: Clips) -> Array:
    """Return the mean over clips of each clip's ``correlation`` [shape=(P,)]."""
    return np.mean([correlation(g, o) for g, o in zip(generated, original, strict=True)], axis=0)


def measure_mean_distance(generated: Clips, original: Clips) -> float:
    """Return the mean over frames of the Euclidean distance, in the channels' unit. Source: Xie & Liu, Eq. 20."""
    return float(np.linalg.norm(np.concatenate(generated) - np.concatenate(original), axis=1).mean())


def rmse(generated: Clips, original: Clips) -> Array:
    """Return the root of the mean squared error over all frames, in each channel's unit [shape=(P,)]."""
    return np.sqrt(np.square(np.concatenate(generated) - np.concatenate(original)).mean(axis=0))


def measure_nrmse(generated: Clips, original: Clips) -> Array:
    """Return the RMSE of channels in standard deviations of the original; NaN where that is constant [shape=(P,)]."""
    return rmse(generated, original) / _mark_moving(original, np.concatenate(original).std(axis=0))


def measure_variance_ratio(generated: Clips, original: Clips) -> Array:
    """Return mean over clips of std(generated) / mean over clips of std(original) [shape=(P,)]."""
    spread = np.mean([o.std(axis=0) for o in original], axis=0)
    return np.mean([g.std(axis=0) for g in generated], axis=0) / _mark_moving(original, spread)


def measure_jerk_ratio(generated: Clips, original: Clips) -> Array:
    """Return mean |third difference|, generated over original [shape=(P,)]."""

    def jerk(clips: Clips) -> Array:
        return np.abs(np.concatenate([np.diff(clip, 3, axis=0) for clip in clips if len(clip) > 3])).mean(axis=0)

    return jerk(generated) / _mark_moving(original, jerk(original))


def _mark_moving(original: Clips, divisor: Array) -> Array:
    """Return the divisor [shape=(P,)], NaN for channels that do not move, and where it is 0."""
    return np.where(varies(np.concatenate(original)) & (divisor > 0), divisor, np.nan)


def measure_lag(generated: Clips, original: Clips, rate_hz: float, reach_s: float = 0.4) -> float:
    """Return the lag of the first channel in ms, positive where it is late.

    It is the maximum of the cross-correlation within ``reach_s`` seconds, refined by a parabola.
    """
    reach = round(reach_s * rate_hz)
    scores = np.zeros(2 * reach + 1)  # of generated[t + shift] with original[t]; 0 where no clip is long enough
    for number, shift in enumerate(range(-reach, reach + 1)):
        pairs = [
            (g[max(shift, 0) : len(g) + min(shift, 0), :1], o[max(-shift, 0) : len(o) - max(shift, 0), :1])
            for g, o in zip(generated, original, strict=True)
            if len(g) > abs(shift) + 1
        ]
        if pairs:
            scores[number] = correlate_pooled([g for g, _ in pairs], [o for _, o in pairs])[0]
    return (refine_peak(scores)[0] - reach) / rate_hz * 1000


def refine_peak(scores: Array) -> tuple[float, float]:
    """Return the place of the highest score, by a parabola through it and those beside it, and the score."""
    best = int(np.clip(scores.argmax(), 1, len(scores) - 2))
    before, peak, after = scores[best - 1 : best + 2].tolist()
    curvature = before - 2 * peak + after
    return best + (0.5 * (before - after) / curvature if curvature < 0 else 0.0), peak


DRAWS = 2000  # bootstrap samples of an interval


def compute_interval(
    figure: Callable[[Clips, Clips], float], generated: Clips, original: Clips, seed: int, draws: int = DRAWS
) -> tuple[float, float]:
    """Return the 95 % bootstrap interval over clips, lower and upper limit, of a figure of generated and original."""
    draw = np.random.default_rng(seed)
    values = []
    for _ in range(draws):
        chosen = draw.integers(len(generated), size=len(generated))
        values.append(figure([generated[i] for i in chosen], [original[i] for i in chosen]))
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def measure_lip_error(generated: Clips, original: Clips) -> float:
    """Return the mean over frames of the largest distance of a lip vertex (Richard et al. 2021, Fan et al. 2022)."""
    return float(np.concatenate([each.max(axis=1) for each in _distances(generated, original)]).mean())


def measure_landmarks(generated: Clips, original: Clips) -> float:
    """Return the mean distance of landmarks over frames, in the unit of the places (LMD: Chen et al. 2018)."""
    return float(np.concatenate([each.mean(axis=1) for each in _distances(generated, original)]).mean())


def measure_upper_face(generated: Clips, original: Clips, rest: Array) -> float:
    """Return by how much more the vertices of the upper face vary in the original, in the unit of the places.

    rest : their places in a face at rest [shape=(V, D)]
    The variation of a vertex is the standard deviation over time of its distance from its place at rest; the result is
    the mean over vertices of the original's less the generated one's: negative where the generated face moves more.
    Source: Xing et al. 2023 (CodeTalker, FDD).
    """
    return float((_variation(original, rest) - _variation(generated, rest)).mean())


def _distances(generated: Clips, original: Clips) -> list[Array]:
    """Return the distances of all vertices [each shape=(T_i, V)]."""
    return [np.linalg.norm(g - o, axis=2) for g, o in zip(generated, original, strict=True)]


def _variation(clips: Clips, rest: Array) -> Array:
    return np.linalg.norm(np.concatenate(clips) - rest, axis=2).std(axis=0)
