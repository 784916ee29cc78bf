"""Acoustic features: 12 MFCC and log energy with Δ and ΔΔ, as in the papers; the log mel spectrum of networks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import ENERGY_FEATURE, FRAME_RATE_HZ, SPECTRUM_BANDS, SPEECH_RATE_HZ, Audio, Features

WINDOW = 400  # 25 ms
HOP = 160  # 10 ms
FFT_SIZE = 512
FILTERS = 26
CEPSTRA = 12
FEATURES = 39  # 12 cepstra and the log energy, their Δ and ΔΔ
LOG_ENERGY = ENERGY_FEATURE  # the column of the features that holds the log energy
LIFTER = 22
PRE_EMPHASIS = 0.97
DYNAMIC_RANGE = 1e-8
"""Powers are floored this far below the loudest of the recording (80 dB): digital silence has a logarithm."""
ROUNDING_SHARE = 1e-5
"""Features that deviate by less than this share of the largest log power are constant but for rounding. In silence and
in a constant they deviate by up to 4e-7 of it, on every processor by another amount; in speech by 8e-4 or more."""
LARGEST_SAMPLE = 1e6  # samples beyond are damage, whatever their full scale was; their squares would not be finite
KNEE_HZ = 6500.0  # frequencies are warped in full up to here, or until they are as high as this
BLOCK = 256  # frames transformed at a time: they fit into the cache, and memory stays bounded for any length


def mfcc(audio: Audio, warp: float = 1.0) -> Features:
    """Return 39 normalised features of every frame: c1–c12, log energy, their Δ and ΔΔ.

    warp : factor by which frequencies are stretched before the filters, to make vocal tracts of other lengths alike
    Frame n is centred at n · 10 ms, the signal reflected at both ends: T = floor(duration · 100) + 1.
    Mean and variance are normalised over the recording.
    Raises InputError: not 16 kHz, shorter than one window, or not one channel of finite samples.
    Source: Xie & Liu 2007, §5.1; details in the project's conventions.
    """
    (features,) = mfcc_of_warps(audio, (warp,), log_energy(check_samples(audio)))
    return features


def mfcc_of_warps(audio: Audio, warps: Sequence[float], energy: NDArray[np.float32]) -> list[Features]:
    """Return the features of ``mfcc`` for every warp; the spectra are computed once for all of them.

    energy : ``log_energy`` of the recording [shape=(T,)]
    Raises InputError: as ``mfcc``.
    """
    log_powers = log_mels(check_samples(audio), [mel_filters(warp) for warp in warps])
    features = []
    while log_powers:
        powers = log_powers.pop(0)
        rounding = ROUNDING_SHARE * max(float(powers.max()), -float(powers.min()))  # constant but for that
        static = np.concatenate([powers @ build_cosine(FILTERS, 1, CEPSTRA + 1), energy[:, None]], axis=1)
        del powers  # those of a long recording are freed here
        width = static.shape[1]
        values = np.empty((len(static), 3 * width), np.float32)
        values[:, :width] = static
        for first in (width, 2 * width):
            values[:, first : first + width] = compute_delta(values[:, first - width : first])
        features.append(Features(normalise_rows(values, rounding), audio.duration_s))
    return features


def check_samples(audio: Audio) -> NDArray[np.float32]:
    """Return the samples of a recording [shape=(N,)]. Raises InputError: as ``mfcc`` says."""
    if audio.rate_hz != SPEECH_RATE_HZ:
        raise InputError(f"speech features need {SPEECH_RATE_HZ} Hz, found {audio.rate_hz} Hz; resample first")
    if len(audio.samples) < WINDOW:
        raise InputError(f"speech features need {WINDOW} samples of one channel, found shape {audio.samples.shape}")
    peak = float(np.maximum(audio.samples.max(), -audio.samples.min()))  # no copy of an hour
    if not peak < LARGEST_SAMPLE:
        raise InputError(f"speech features need finite samples, full scale 1, found a peak of {peak:g}")
    return audio.samples.astype(np.float32, copy=False)


def compute_delta(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the slope of the regression line through ±2 frames around every frame [shape=(T, D)].

    values : [shape=(T, D)]; the first and the last frame are repeated beyond the ends
    """
    padded = np.pad(values, ((2, 2), (0, 0)), mode="edge")
    slope = padded[4:] - padded[:-4]
    slope *= 2
    slope += padded[3:-1] - padded[1:-3]
    slope /= 10
    return slope


def normalise_rows(values: NDArray[np.float32], rounding: float) -> NDArray[np.float32]:
    """Return the columns with mean 0 and standard deviation 1 [shape=(T, D)]; a constant column becomes exactly 0."""
    scaled = values - values.mean(axis=0, dtype=np.float64).astype(np.float32)
    deviation = np.sqrt(np.square(scaled).mean(axis=0, dtype=np.float64))  # single precision loses count in an hour
    moves = deviation > rounding
    scaled /= np.where(moves, deviation, 1).astype(np.float32)
    scaled[:, ~moves] = 0
    return scaled


def log_mel(samples: NDArray[np.float32], filters: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the log power in every filter, floored 80 dB under the loudest [shape=(T, F)].

    filters : weights of the powers from 0 to 8 kHz [shape=(257, F)]
    """
    (log_powers,) = log_mels(samples, [filters])
    return log_powers


def log_mels(samples: NDArray[np.float32], filter_banks: Sequence[NDArray[np.float32]]) -> list[NDArray[np.float32]]:
    """Return ``log_mel`` of every filter bank [each shape=(T, F)]; the spectra are computed once for all of them."""
    window = np.hamming(WINDOW).astype(np.float32)
    powers = [np.empty((count_frames(samples), filters.shape[1]), np.float32) for filters in filter_banks]
    for block in _iterate_blocks(count_frames(samples)):
        padded = _pad_block(samples, block)
        emphasised = padded[1:] - np.float32(PRE_EMPHASIS) * padded[:-1]
        spectrum = np.fft.rfft(_cut_frames(emphasised) * window, FFT_SIZE)
        power_spectrum = np.square(spectrum.real) + np.square(spectrum.imag)
        for power, filters in zip(powers, filter_banks, strict=True):
            power[block] = power_spectrum @ filters
    return [_log_power(power) for power in powers]


def log_energy(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the logarithm of the energy around every frame, floored 80 dB under the loudest [shape=(T,)]."""
    energy = np.empty(count_frames(samples), np.float32)
    for block in _iterate_blocks(len(energy)):
        energy[block] = np.square(_cut_frames(_pad_block(samples, block)[1:])).sum(axis=1)
    return _log_power(energy)


def _pad_block(samples: NDArray[np.float32], block: slice) -> NDArray[np.float32]:
    """Return the samples under a block of frames, and the one before; beyond both ends the signal is reflected."""
    half = WINDOW // 2
    return reflect_ends(samples, block.start * HOP - half - 1, (block.stop - 1) * HOP + half)


def reflect_ends(samples: NDArray[np.float32], first: int, end: int) -> NDArray[np.float32]:
    """Return samples ``first``..``end`` - 1 of a signal, reflected at both ends as often as needed."""
    if first >= 0 and end <= len(samples):
        return samples[first:end]
    last = len(samples) - 1
    return samples[last - np.abs(last - np.abs(np.arange(first, end)) % (2 * last))]


def count_frames(samples: NDArray[np.float32]) -> int:
    """Return the number of frames of a recording: T = floor(duration · 100) + 1."""
    return int(len(samples) / SPEECH_RATE_HZ * FRAME_RATE_HZ + 1e-9) + 1


def _iterate_blocks(frames: int) -> Iterator[slice]:
    return (slice(start, min(start + BLOCK, frames)) for start in range(0, frames, BLOCK))


def _cut_frames(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the windows of samples, one every 10 ms [shape=(n, 400)]; a view."""
    return sliding_window_view(samples, WINDOW)[::HOP]


def _log_power(power: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the natural logarithm of powers, floored 80 dB under the largest; it overwrites them."""
    floor = np.float32(max(DYNAMIC_RANGE * float(power.max()), 1e-30))
    return np.log(np.maximum(power, floor, out=power), out=power)


@cache
def mel_filters(
    warp: float, count: int = FILTERS, lowest_hz: float = 0.0, highest_hz: float = SPEECH_RATE_HZ / 2
) -> NDArray[np.float32]:
    """Return triangular filters, equally spaced in mel, of warped frequencies [shape=(257, count)].

    Frequencies are stretched by ``warp`` up to a knee, then along a straight line to 8 kHz, which stays.
    """
    hertz = np.arange(FFT_SIZE // 2 + 1) * SPEECH_RATE_HZ / FFT_SIZE
    knee, top = KNEE_HZ * min(1.0, 1 / warp), SPEECH_RATE_HZ / 2
    warped = np.where(hertz <= knee, hertz * warp, warp * knee + (top - warp * knee) * (hertz - knee) / (top - knee))
    return make_triangles(mel(warped), _list_edges(count, lowest_hz, highest_hz)).astype(np.float32)


def _list_edges(count: int, lowest_hz: float, highest_hz: float) -> NDArray[np.float64]:
    """Return where bands begin, are most sensitive, and end, in mel [shape=(count + 2,)]."""
    return np.linspace(mel(np.array(lowest_hz)), mel(np.array(highest_hz)), count + 2)


def make_triangles(bins: NDArray[np.floating[Any]], edges: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return triangular filters [shape=(bins, F)]: each rises from one edge to the next and falls to the one after."""
    rising = (bins[:, None] - edges[:-2]) / (edges[1:-1] - edges[:-2])
    falling = (edges[2:] - bins[:, None]) / (edges[2:] - edges[1:-1])
    return np.maximum(0, np.minimum(rising, falling))


def mel(hertz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return frequencies in mel."""
    return 1127 * np.log1p(hertz / 700)


@cache
def build_cosine(filters: int, first: int, end: int) -> NDArray[np.float32]:
    """Return the orthonormal DCT-II to cepstra ``first``..``end`` - 1, liftered [shape=(filters, end - first)]."""
    order = np.arange(first, end)
    basis = np.cos(np.pi * (np.arange(filters)[:, None] + 0.5) * order / filters) * np.sqrt(2 / filters)
    basis /= np.where(order == 0, np.sqrt(2), 1)
    return (basis * (1 + LIFTER / 2 * np.sin(np.pi * order / LIFTER))).astype(np.float32)


BANDS = SPECTRUM_BANDS, 60.0, 7600.0  # the bands of spectra: their number, lowest and highest frequency in Hz
DYNAMIC_RANGE_DB = 60.0
"""Powers are floored this far below the loudest of the recording: what is under the noise of most rooms is the same."""
MIN_DEVIATION = 1e-3


def spectrum(audio: Audio, warp: float = 1.0) -> NDArray[np.float32]:
    """Return the log power in ``SPECTRUM_BANDS`` mel bands [shape=(T, 40)], frames as in ``mfcc``.

    warp : factor by which frequencies are stretched, as in ``mfcc``
    Each band has mean 0 over the recording; it is divided by the mean of its own standard deviation and that of the
    whole spectrum, so that bands without speech stay small.
    Raises InputError: as ``mfcc``.
    """
    powers = log_bands(check_samples(audio), warp)
    powers = np.maximum(powers, powers.max() - np.float32(DYNAMIC_RANGE_DB / 10 * np.log(10)))
    powers -= powers.mean(axis=0, dtype=float).astype(np.float32)
    squares = np.square(powers).mean(axis=0, dtype=float)
    powers /= (np.sqrt(squares) / 2 + np.sqrt(squares.mean()) / 2 + MIN_DEVIATION).astype(np.float32)
    return powers


def log_bands(samples: NDArray[np.float32], warp: float = 1.0) -> NDArray[np.float32]:
    """Return the natural log power in ``SPECTRUM_BANDS`` mel bands, not normalised [shape=(T, 40)]; as ``spectrum``."""
    return log_mel(samples, mel_filters(warp, *BANDS))


@cache
def find_centres() -> NDArray[np.float64]:
    """Return the frequencies in Hz at which the bands of ``log_bands`` are most sensitive [shape=(40,)]."""
    hertz = np.arange(SPEECH_RATE_HZ / 2 + 1)
    return np.interp(_list_edges(*BANDS)[1:-1], mel(hertz), hertz)


GENERAL_FILTERS, GENERAL_CEPSTRA = 25, 13
LOWEST_HZ, HIGHEST_HZ = 130.0, 6800.0  # of the filters of pocketsphinx's phone models


def general_features(audio: Audio) -> NDArray[np.float32]:
    """Return the features of the general models: c0–c12 less their mean, Δ over ±2 frames, Δ of Δ [shape=(T, 39)].

    Frames are as in ``mfcc``. Raises InputError: as ``mfcc``.
    Source: the model's own feat.params and CMU Sphinx's ``1s_c_d_dd``. Deviations: windows of 25 instead of
    25.6 ms, centred on their time; no noise removal.
    """
    cepstra = log_mel(check_samples(audio), _general_filters()) @ build_cosine(GENERAL_FILTERS, 0, GENERAL_CEPSTRA)
    cepstra -= cepstra.mean(axis=0, dtype=np.float64).astype(np.float32)
    features = np.empty((len(cepstra), 3 * GENERAL_CEPSTRA), np.float32)
    features[:, :GENERAL_CEPSTRA] = cepstra
    padded = np.pad(cepstra, ((3, 3), (0, 0)), mode="edge")
    del cepstra

    def shifted(frames: int) -> NDArray[np.float32]:
        return padded[3 + frames : 3 + frames + len(features)]

    delta, of_delta = (features[:, start : start + GENERAL_CEPSTRA] for start in (GENERAL_CEPSTRA, 2 * GENERAL_CEPSTRA))
    np.subtract(shifted(2), shifted(-2), out=delta)
    np.subtract(shifted(3), shifted(-1), out=of_delta)
    of_delta -= shifted(1) - shifted(-3)
    return features


@cache
def _general_filters() -> NDArray[np.float32]:
    """Return triangular filters of equal area, equally spaced in mel, with corners on the bins [shape=(257, 25)]."""
    bin_hz = SPEECH_RATE_HZ / FFT_SIZE
    mel = np.linspace(2595 * np.log10(1 + LOWEST_HZ / 700), 2595 * np.log10(1 + HIGHEST_HZ / 700), GENERAL_FILTERS + 2)
    edges = (np.round(700 * (10 ** (mel / 2595) - 1) / bin_hz) * bin_hz).astype(np.float64)
    hertz = np.arange(FFT_SIZE // 2 + 1) * bin_hz
    return (make_triangles(hertz, edges) * 2 / (edges[2:] - edges[:-2])).astype(np.float32)
