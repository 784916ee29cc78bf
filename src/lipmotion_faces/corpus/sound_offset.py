"""By how much one recording of a sound is later than another one; and the speed of lips that sound predicts."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.speech.features.mfcc import compute_delta
from lipmotion.speech.sound.pauses import STEP_S, average_powers
from lipmotion.types import Audio, Features

Array = NDArray[np.float64]

MIN_OVERLAP_SHARE = 0.5  # share of the shorter recording that the other one must cover, where levels are compared
MIN_LEVEL_CORRELATION, MIN_MARGIN, PEAK_S = 0.5, 0.1, 0.25
"""Least correlation of levels at which the sounds tell their offset, by how much it must exceed all others, and how far
from the best an offset is another one."""
FINE_S, FINE_WINDOW_S = 0.06, 20.0
"""How far the fine search goes around the coarse offset, and how much sound is compared for it."""


class SoundOffset(NamedTuple):
    """The offset of a recording from another one of the same sounds."""

    late_s: float  # what sounds at t in the first sounds at t + ``late_s`` in the second
    alike: float  # correlation of the levels at this offset, −1 to 1


def measure_offset(first: Audio, second: Audio) -> SoundOffset:
    """Return by how much the second recording is later than the first.

    first, second : the same sounds, recorded by two machines that began at different times; at the same rate
    The levels of both are compared at every offset; the best is refined by the waveforms to a fraction of a
    millisecond.
    Raises InputError: sounds that are not alike, or as much so at another offset.
    """
    if first.rate_hz != second.rate_hz:
        raise InputError(f"sounds of {first.rate_hz} and {second.rate_hz} Hz, required one rate")
    scores, zero = _correlate_levels(_measure_levels(first), _measure_levels(second))
    top = int(scores.argmax())
    best, away = float(scores[top]), np.abs(np.arange(len(scores)) - top) > PEAK_S / STEP_S
    if best < MIN_LEVEL_CORRELATION or best - scores[away].max(initial=-1.0) < MIN_MARGIN:
        raise InputError(
            f"the offset of the two sounds is not clear: their levels correlate by {best:.2f} at most, required "
            f"{MIN_LEVEL_CORRELATION}, and {MIN_MARGIN} more than elsewhere; give the offset (--offset-ms, or "
            "offsets.csv)"
        )
    return SoundOffset(_refine(first, second, (top - zero) * STEP_S), best)


def _correlate_levels(first: Array, second: Array) -> tuple[Array, int]:
    """Return the correlation at every offset that leaves ``MIN_OVERLAP_SHARE`` of both, and the number of offset 0."""
    from scipy.signal import fftconvolve

    ones = np.ones(len(first)), np.ones(len(second))
    flipped, ones_flipped = first[::-1], ones[0][::-1]
    count = np.maximum(fftconvolve(ones[1], ones_flipped), 1e-9)
    sums = fftconvolve(ones[1], flipped), fftconvolve(second, ones_flipped)
    squares = fftconvolve(ones[1], flipped**2), fftconvolve(second**2, ones_flipped)
    spread = [np.maximum(square - total**2 / count, 1e-9) for square, total in zip(squares, sums, strict=True)]
    scores = (fftconvolve(second, flipped) - sums[0] * sums[1] / count) / np.sqrt(spread[0] * spread[1])
    long = MIN_OVERLAP_SHARE * min(len(first), len(second))
    # a short overlap is alike by chance; it counts less
    return np.where(count >= long, scores * np.sqrt(1 - long / (2 * np.maximum(count, long))), 0.0), len(first) - 1


def _measure_levels(audio: Audio) -> Array:
    """Return the level of every 10 ms, without what is quieter than the quiet tenth [shape=(N,)]."""
    power = average_powers(audio.samples, round(STEP_S * audio.rate_hz))
    if not len(power):
        raise InputError(f"{audio.duration_s * 1000:.0f} ms of sound, required more than {STEP_S * 1000:.0f}")
    levels = np.log10(power + 1e-10)
    levels = np.maximum(levels, np.percentile(levels, 10))
    return levels - levels.mean()


def _refine(first: Audio, second: Audio, late_s: float) -> float:
    """Return the offset at which the waveforms agree best, near a coarse one, by the loudest part of what both have.

    The spectra are whitened: rooms and microphones change how loud each frequency is, not its time.
    Source: Knapp and Carter 1976, "The generalized correlation method for estimation of time delay" (PHAT).
    """
    rate, low = first.rate_hz, max(0.0, -late_s)
    high = min(first.duration_s, second.duration_s - late_s)
    if high - low > FINE_WINDOW_S:
        power = average_powers(first.samples[round(low * rate) : round(high * rate)], round(STEP_S * rate))
        sums, width = np.concatenate([[0.0], np.cumsum(power)]), round(FINE_WINDOW_S / STEP_S)
        low += int((sums[width:] - sums[:-width]).argmax()) * STEP_S
        high = low + FINE_WINDOW_S
    begin, end, shift, reach = (round(time_s * rate) for time_s in (low, high, late_s, FINE_S))
    one = _cut(first.samples, begin, end)
    other = _cut(second.samples, begin + shift - reach, end + shift + reach)
    size = 1 << int(np.ceil(np.log2(len(one) + len(other))))
    cross = np.fft.rfft(other, size) * np.conj(np.fft.rfft(one, size))
    cross /= np.abs(cross) + 0.05 * np.abs(cross).mean() + 1e-20
    scores = np.fft.irfft(cross, size)[: 2 * reach + 1]
    return (shift - reach + int(scores.argmax())) / rate


def _cut(samples: NDArray[np.float32], begin: int, end: int) -> Array:
    """Return the samples from ``begin`` to ``end``; where there are none, silence."""
    inner = samples[max(begin, 0) : max(end, 0)].astype(np.float64)
    front = max(0, min(-begin, end - begin))
    return np.pad(inner, (front, max(0, end - begin - front - len(inner))))


STATIC_FEATURES = 13
"""The first columns of the features, which are used: c1–c12 and log energy; their context holds the deltas."""
FRAME_OFFSETS = tuple(range(-15, 16, 3))  # the context of a frame, in frames from it: 150 ms before and after
WEIGHTS = "lip-speed.json"


def predict_opening_speed(features: Features) -> Array:
    """Return the predicted opening speed of the lips [shape=(T,)], in arbitrary units.

    It is of no use as lip motion; the shift at which it correlates best with tracked lips is the offset of the video.
    """
    return stack_context(features) @ _load_weights()


def measure_opening_speed(opening: Array) -> Array:
    """Return the opening speed of measured lips: the slope over ±2 frames [shape=(T,)].

    opening : of the lips, frame by frame [shape=(T,)]
    """
    return compute_delta(opening.astype(np.float32)[:, None])[:, 0].astype(float)


def stack_context(features: Features) -> Array:
    """Return the static features of every frame and its context [shape=(T, 143)]; the ends are repeated."""
    static = features.values[:, :STATIC_FEATURES].astype(float)
    frames = np.arange(len(static))[:, None] + np.array(FRAME_OFFSETS)
    return static[np.clip(frames, 0, len(static) - 1)].reshape(len(static), -1)


@cache
def _load_weights() -> Array:
    """Return the shipped weights of the prediction [shape=(143,)]."""
    content = json.loads((resources.files("lipmotion") / "models" / WEIGHTS).read_text(encoding="utf-8"))
    return np.array(content["weights"])
