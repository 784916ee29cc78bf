"""The fundamental frequency (F0) of voiced speech, frame by frame.

Three steps: the signal is low-passed and sampled at 4 kHz; around every frame its autocorrelation is computed at all
lags of the range; dynamic programming finds the cheapest sequence of one of the few best lags, or unvoiced, a frame.
Source: the candidates, costs and search of D. Talkin, "A robust algorithm for pitch tracking (RAPT)", in Kleijn and
Paliwal (eds.), Speech Coding and Synthesis, 1995. Deviations: one correlation, weighted around the centre of the frame
and computed from its power spectrum, at half samples; silence is relative to the recording; no cost of the spectrum.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lipmotion.kernels.paths import find_cheapest, trace_back
from lipmotion.speech.features.mfcc import HOP, check_samples, count_frames, reflect_ends
from lipmotion.types import SPEECH_RATE_HZ, Audio, Prosody

LOWEST_HZ, HIGHEST_HZ = 60.0, 400.0
BLOCK = 1024  # frames searched at a time: memory stays bounded for any length

UNVOICED_COST = 0.52  # cost of an unvoiced frame; a voiced one costs 1 − its correlation, weighted
VOICING_CHANGE_COST = 0.25
JUMP_COST = 0.4  # cost of a change of F0 by a factor of e; an octave costs 0.28
LONG_LAG_SHARE = 0.2
"""The correlation of the longest lag is reduced by this share: that of two periods is as high as that of one."""
SILENCE_POWER = 2e-4
"""Power that is added to every frame's, as a share of that of loud frames (−37 dB): it makes silence uncorrelated."""
FRICATION_SHARE = 1e-3
"""Share of the power of the full signal's slope that is added too: the low frequencies of an s may seem periodic."""
ROUNDING_POWER = 1e-10
"""Power that is added too, as a share of that of the highest sample: a constant's rounding error has a period."""
CANDIDATES = 4  # lags considered in a frame

_STEP = 4  # samples at 16 kHz for one of the low-passed signal
_RATE_HZ = SPEECH_RATE_HZ // _STEP
_HOP = HOP // _STEP
_PASSED_HZ = (50.0, 1200.0)  # below is rumble; above, harmonics carry as much noise as information
_TAPS = 255
_WINDOW = 160  # 40 ms, Hann: half of the weight lies within ±5.3 ms
_REACH = _STEP * (_WINDOW - 1) // 2 + _TAPS // 2  # samples at 16 kHz before the centre of a frame that it depends on

Floats = NDArray[np.float32]


def log_f0(audio: Audio) -> Floats:
    """Return the natural logarithm of F0 in Hz, NaN in unvoiced frames [shape=(T,)].

    Frame n is centred at n · 10 ms, the signal reflected at both ends; T is that of ``features.mfcc``. F0 is searched
    from ``LOWEST_HZ`` to ``HIGHEST_HZ``. The level of the recording changes nothing.
    Memory: under 5 MB, and 55 bytes a frame: 20 MB for an hour.
    Raises InputError: as ``speech.features.mfcc`` says.
    """
    samples = check_samples(audio)
    power, square = 0.0, 0.0  # of frames, each weighted by itself: pauses count little, a click does not count much
    for start in range(0, len(samples) // HOP + 1, BLOCK):
        low = _filter_low(samples, start * HOP, min(BLOCK, len(samples) // HOP + 1 - start))
        powers = np.square(low).reshape(-1, _HOP).mean(axis=1).astype(np.float64)
        power, square = power + powers.sum(), square + np.square(powers).sum()
    silence = SILENCE_POWER * (square / power if power else 0.0)
    silence += ROUNDING_POWER * float(max(samples.max(), -samples.min())) ** 2
    frames = count_frames(samples)
    pitch = np.empty((CANDIDATES + 1, frames), np.float32)
    pointers = np.empty((frames, CANDIDATES + 1), np.uint8)
    arrival, pitch[-1] = np.zeros(CANDIDATES + 1), np.nan
    for start in range(0, frames, BLOCK):
        block = slice(start, min(start + BLOCK, frames))
        pitch[:-1, block], cost = find_candidates(correlate_frames(samples, block, silence))
        # from every candidate, the last being unvoiced, to those of the next frame; the first frame continues itself
        earlier = np.concatenate([pitch[:-1, max(start - 1, 0), None], pitch[:-1, block][:, :-1]], axis=1)
        steps = np.full((CANDIDATES + 1, CANDIDATES + 1, cost.shape[1]), VOICING_CHANGE_COST)
        steps[:-1, :-1] = JUMP_COST * np.abs(pitch[:-1, block] - earlier[:, None])
        steps[-1, -1] = 0
        steps[:, :-1] += cost
        steps[:, -1] += UNVOICED_COST
        arrival, pointers[block] = find_cheapest(arrival - arrival.min(), steps)
    return pitch[trace_back(pointers, int(arrival.argmin())), np.arange(frames)]


def correlate_frames(samples: Floats, block: slice, silence: float) -> Floats:
    """Return the normalised autocorrelation around every frame of a block, at the lags of ``list_lags`` [shape=(n, L)].

    silence : power below which correlations become smaller
    With x the low-passed signal, w the window, both around the frame, and s = ``silence`` + the frame's frication:
    Σ w(t) x(t) w(t+k) x(t+k) / (√(Σ w(t) w(t+k) x²(t) · Σ w(t) w(t+k) x²(t+k)) + s · Σ w(t) w(t+k)), at most 1.
    """
    tables = _make_tables()
    low = _filter_low(samples, block.start * HOP - _REACH, block.stop - block.start + _WINDOW // _HOP)
    x = sliding_window_view(low, _WINDOW)[: len(low) - _WINDOW : _HOP].copy()
    spectrum = x @ tables.fourier
    bins = spectrum.shape[1] // 2
    correlation = (np.square(spectrum[:, :bins]) + np.square(spectrum[:, bins:])) @ tables.inverse
    np.square(x, out=x)
    energy = np.sqrt(x @ tables.early)
    energy *= np.sqrt(x @ tables.late)
    slope = np.diff(reflect_ends(samples, (block.start - 1) * HOP - 1, block.stop * HOP))
    np.square(slope, out=slope)
    power = slope.reshape(-1, HOP).mean(axis=1)
    frication = np.float32(FRICATION_SHARE / 2) * (power[1:] + power[:-1])
    energy += tables.mass * (frication + np.float32(silence))[:, None] + np.finfo(np.float32).tiny
    correlation /= energy
    return correlation


def find_candidates(correlation: Floats) -> tuple[Floats, Floats]:
    """Return the logarithm of F0 at the best peaks of every frame, and their costs [shapes=(CANDIDATES, n)].

    correlation : from ``correlate_frames`` [shape=(n, L)]
    In a frame with fewer peaks the others have infinite cost.
    """
    middle = correlation[:, 1:-1]
    is_maximum = (middle > correlation[:, :-2]) & (middle >= correlation[:, 2:]) & (middle > 0)
    weighted = np.where(is_maximum, middle * _weigh_lag(list_lags()[1:-1]), 0).astype(np.float32)
    rows = np.arange(len(weighted))
    peaks = np.empty((CANDIDATES, len(weighted)), np.intp)
    is_peak = np.empty((CANDIDATES, len(weighted)), bool)
    for peak, exists in zip(peaks, is_peak, strict=True):
        weighted.argmax(axis=1, out=peak)
        np.greater(weighted[rows, peak], 0, out=exists)
        weighted[rows, peak] = 0
    left, top, right = (correlation[rows, peaks + side] for side in (0, 1, 2))
    bend = np.where(is_peak, 2 * top - left - right, 1)
    offset = np.where(is_peak, (right - left) / (2 * bend), 0)  # of the top of the parabola through the three
    lag = np.clip(list_lags()[peaks + 1] + 0.5 * offset, _RATE_HZ / HIGHEST_HZ, _RATE_HZ / LOWEST_HZ)
    height = (top + (right - left) * offset / 4) * _weigh_lag(lag)
    return np.log(_RATE_HZ / lag).astype(np.float32), np.where(is_peak, 1 - height, np.inf).astype(np.float32)


def _weigh_lag(lag: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1 - LONG_LAG_SHARE * lag * LOWEST_HZ / _RATE_HZ


def _filter_low(samples: Floats, first: int, hops: int) -> Floats:
    """Return ``hops`` · 10 ms at 4 kHz, the first sample centred ``_TAPS // 2`` after sample ``first``."""
    low_pass = _make_tables().low_pass
    parts = low_pass.shape[1] // _HOP
    padded = reflect_ends(samples, first, first + (hops + parts - 1) * HOP)
    products = padded.reshape(-1, HOP) @ low_pass  # what every 10 ms add to the same 10 ms and to those before
    low = products[:hops, :_HOP].copy()
    for part in range(1, parts):
        low += products[part : part + hops, part * _HOP : (part + 1) * _HOP]
    return low.reshape(-1)


def list_lags() -> NDArray[np.float64]:
    """Return the lags in samples at 4 kHz, half samples apart, one more at either end than the range [shape=(L,)]."""
    return np.arange(2 * _RATE_HZ / HIGHEST_HZ - 1, 2 * _RATE_HZ / LOWEST_HZ + 2) // 1 / 2


class _Tables(NamedTuple):
    """Matrices that signals are multiplied by; x is the low-passed signal, w the window, k the lag."""

    low_pass: Floats  # 10 ms → what they add to the same 10 ms at 4 kHz, and to the two before [shape=(160, 3 · 40)]
    fourier: Floats  # a frame → its windowed spectrum, real parts and then imaginary ones [shape=(_WINDOW, 2 · bins)]
    inverse: Floats  # powers of the spectrum → Σ w(t) x(t) w(t+k) x(t+k) [shape=(bins, L)]
    early: Floats  # squares of a frame → Σ w(t) w(t+k) x²(t) [shape=(_WINDOW, L)]
    late: Floats  # and of x²(t+k)
    mass: Floats  # Σ w(t) w(t+k) [shape=(L,)]


@cache
def _make_tables() -> _Tables:
    time, size = np.arange(float(_WINDOW))[:, None], _WINDOW + int(list_lags()[-1]) + 1
    bins = np.arange(int(1.5 * _PASSED_HZ[1] / _RATE_HZ * size))
    angle = 2 * np.pi * time * bins / size
    fourier = np.concatenate([np.cos(angle), np.sin(angle)], axis=1) * _make_window(time)
    inverse = np.cos(2 * np.pi / size * bins[:, None] * list_lags()) * np.where(bins == 0, 1, 2)[:, None] / size
    early, late = (_make_window(time) * _make_window(time + side * list_lags()) for side in (1, -1))
    at = np.arange(_TAPS) - _TAPS // 2
    low, high = (2 * hertz / SPEECH_RATE_HZ * np.sinc(2 * hertz / SPEECH_RATE_HZ * at) for hertz in _PASSED_HZ)
    taps = (high - low) * np.hamming(_TAPS)
    taps -= np.hamming(_TAPS) * taps.sum() / np.hamming(_TAPS).sum()
    table = np.zeros((3 * HOP, _HOP))
    for output in range(_HOP):
        table[_STEP * output : _STEP * output + _TAPS, output] = taps
    arrays = (np.concatenate(np.split(table, 3), axis=1), fourier, inverse, early, late, early.sum(axis=0))
    return _Tables(*(array.astype(np.float32) for array in arrays))


def _make_window(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.abs(time + 0.5 - _WINDOW / 2) < _WINDOW / 2, np.sin(np.pi * (time + 0.5) / _WINDOW) ** 2, 0)


MIN_POWER = 1e-9  # power that is added to every frame's: digital silence is at -90 dB


def find_prosody(audio: Audio) -> Prosody:
    """Return loudness and pitch of a sound at 16 kHz. Raises InputError: as ``speech.features.mfcc`` says."""
    samples = check_samples(audio)
    frames = count_frames(samples)
    hops = samples[: (frames - 1) * HOP].reshape(-1, HOP)
    rest = samples[hops.size :].astype(np.float64)
    energy = np.append(np.einsum("ij,ij->i", hops, hops, dtype=np.float64), rest @ rest)  # from frame to frame
    centre = np.arange(frames) * HOP
    length = np.minimum(centre + HOP, len(samples)) - np.maximum(centre - HOP, 0)
    mean = (energy + np.concatenate([[0.0], energy[:-1]])) / np.maximum(length, 1)
    return Prosody(10 * np.log10(mean + MIN_POWER), log_f0(Audio(audio.samples, SPEECH_RATE_HZ)))
