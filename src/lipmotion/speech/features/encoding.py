"""What the encoder of a large speech network makes of a recording: features that are alike for every voice.

The network is the encoder of Whisper Tiny (Radford et al. 2022), trained on 680,000 hours of many languages, as Smart
Turn has fine-tuned it and rounded it to eight bits. ``scripts/speech_encoder.py`` makes its file,
``models/speech-encoder.npz``; ``models/speech-encoder.txt`` has the licences. Two of its four layers suffice for the
motion of lips. Activations are not rounded here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import HOP, WINDOW, make_triangles
from lipmotion.storage.archive import read_shipped_arrays
from lipmotion.types import SPEECH_RATE_HZ

Array = NDArray[np.float32]
WEIGHTS = "speech-encoder.npz"
COMPONENTS = 64
"""Principal components that are kept of the 384 values; more serve the voice of the training, fewer all others."""
ROW_FRAMES = 2  # frames of 10 ms from one row of the network to the next
WINDOW_ROWS, OVERLAP_ROWS = 400, 100
"""The network takes 8 s at a time; windows overlap by 2 s, over which one fades into the next."""
LEVEL = 25.0  # factor from samples at the level of all passages to that of speech in the training of the network
BANDS, HEADS, LAYERS = 80, 6, 2
FLOOR = -4.5  # the smallest logarithm of a power, eight powers of ten beneath loud speech, as in Whisper


class WindowedEncoding:
    """The features of a recording, computed window by window, as far as they are asked for.

    read    : returns the samples of the recording from one to before another, at the level of all passages
    samples : their number
    """

    def __init__(self, read: Callable[[int, int], Array], samples: int) -> None:
        self._read, self._samples, self._encoder = read, samples, load_encoder()
        self._windows: dict[int, Array] = {}

    def rows(self, first: int, stop: int) -> NDArray[np.float16]:
        """Return the features of frames of 10 ms [shape=(stop - first, ``COMPONENTS``)], frames as of ``mfcc``.

        Windows begin with the recording, and nothing is normalised over it: silence around speech changes nothing.
        Source: Radford et al. 2022, §2.2 (log mel spectrum, encoder).
        """
        place, odd = np.divmod(np.arange(first, stop), ROW_FRAMES)
        here, after = (self._rows(np.minimum(at, self._samples // HOP // ROW_FRAMES)) for at in (place, place + odd))
        self._windows = dict(sorted(self._windows.items())[-2:])  # those that the next passage may take
        return ((here + after) / 2).astype(np.float16)

    def _rows(self, rows: NDArray[np.intp]) -> Array:
        step = WINDOW_ROWS - OVERLAP_ROWS
        number, inside = np.divmod(rows, step)
        result = np.zeros((len(rows), len(self._encoder.shift)), np.float32)
        for window in np.unique(number).tolist():
            chosen = np.flatnonzero(number == window)
            result[chosen] = self._window(window)[inside[chosen]]
            fading = chosen[inside[chosen] < OVERLAP_ROWS] if window else chosen[:0]
            if len(fading):
                share = ((inside[fading] + 0.5) / OVERLAP_ROWS).astype(np.float32)[:, None]
                result[fading] = share * result[fading] + (1 - share) * self._window(window - 1)[inside[fading] + step]
        return result

    def _window(self, number: int) -> Array:
        if number not in self._windows:
            first = number * (WINDOW_ROWS - OVERLAP_ROWS) * ROW_FRAMES * HOP - WINDOW // 2
            stop = first + (WINDOW_ROWS * ROW_FRAMES - 1) * HOP + WINDOW
            samples = np.zeros(stop - first, np.float32)
            start, end = max(first, 0), min(stop, self._samples)
            samples[start - first : end - first] = self._read(start, end)
            self._windows[number] = encode_window(log_mel_spectrum(samples), self._encoder)
        return self._windows[number]


def log_mel_spectrum(samples: Array) -> Array:
    """Return the log mel spectrum that the network takes, of every whole window of samples [shape=(T, 80)]."""
    window = np.hanning(WINDOW + 1)[:-1].astype(np.float32)
    spectrum = np.fft.rfft(sliding_window_view(samples * np.float32(LEVEL), WINDOW)[::HOP] * window)
    powers = (np.square(spectrum.real) + np.square(spectrum.imag)).astype(np.float32) @ _make_filters()
    result: Array = (np.log10(np.maximum(powers, np.float32(10**FLOOR))) + 4) / 4
    return result


def encode_window(log_mel: Array, encoder: Encoder) -> Array:
    """Return the principal components of what enters the third layer [shape=(400, ``COMPONENTS``)].

    log_mel : of 8 s [shape=(800, 80)]
    """
    x = log_mel
    for stride, (kernel, bias) in enumerate(encoder.convolutions, 1):
        padded = np.pad(x, ((1, 1), (0, 0)))
        columns = [padded[first : first + len(x) : stride] for first in range(3)]
        x = _gelu(np.concatenate(columns, axis=1) @ kernel + bias)
    x += _compute_positions(x.shape)
    for (attend, attend_bias), (merge, merge_bias), (widen, widen_bias), (narrow, narrow_bias) in encoder.layers:
        queries, keys, values = np.split(_standardise(x) @ attend + attend_bias, 3, axis=1)
        q, k, v = (part.reshape(len(x), HEADS, -1).swapaxes(0, 1) for part in (queries, keys, values))
        scores = q @ k.swapaxes(1, 2)
        scores = np.exp(scores - scores.max(axis=2, keepdims=True))
        attended = (scores / scores.sum(axis=2, keepdims=True)) @ v
        x += attended.swapaxes(0, 1).reshape(x.shape) @ merge + merge_bias
        x += _gelu(_standardise(x) @ widen + widen_bias) @ narrow + narrow_bias
    components: Array = _standardise(x) @ encoder.basis + encoder.shift
    return components


def _gelu(x: Array) -> Array:
    """Return the Gaussian error linear unit of values (Hendrycks & Gimpel 2016, the form with tanh)."""
    inner: Array = np.float32(0.044715) * x  # in place: a third of the time of the network was that of new arrays
    inner *= x
    inner *= x
    inner += x
    inner *= np.float32(0.7978845608)
    np.tanh(inner, out=inner)
    inner += 1
    inner *= 0.5 * x
    return inner


def _standardise(x: Array) -> Array:
    """Return rows with mean 0 and variance 1; the gains of layer normalisation are in the weights that follow."""
    centred = x - x.mean(axis=1, keepdims=True)
    result: Array = centred / np.sqrt(np.square(centred).mean(axis=1, keepdims=True) + np.float32(1e-5))
    return result


@cache
def _compute_positions(shape: tuple[int, int]) -> Array:
    """Return what tells the network where in its window a row is: Vaswani et al. 2017, §3.5."""
    angles = np.arange(shape[0])[:, None] * np.exp(-np.log(10_000) / (shape[1] // 2 - 1) * np.arange(shape[1] // 2))
    return np.concatenate([np.sin(angles), np.cos(angles)], axis=1).astype(np.float32)


Linear = tuple[Array, Array]  # a matrix and a bias


class Encoder(NamedTuple):
    """Weights of the network; gains of layer normalisation are in the matrices that follow them."""

    convolutions: tuple[Linear, ...]  # kernels of three taps [shape=(3·inputs, N)]; the second one has stride 2
    layers: tuple[tuple[Linear, ...], ...]  # queries, keys and values; what is attended to; and the two that follow
    basis: Array  # from the normalised output of the last layer to the features [shape=(N, D)]
    shift: Array  # [shape=(D,)]


_read_arrays = cache(read_shipped_arrays)  # the encoder and the background are in one file


@cache
def load_encoder() -> Encoder:
    """Return the network of the package."""
    return find_encoder(_read_arrays(WEIGHTS))


@cache
def read_background() -> tuple[Array, Array]:
    """Return mean and deviation of the features of many voices [shape=(128,)], and what whitens them.

    The whitening is a matrix, of the covariance of recordings of one speaker in many conditions [shape=(128, 128)].
    """
    arrays = _read_arrays(WEIGHTS)
    return arrays["speaker_centre"], arrays["speaker_whitening"].astype(np.float32)


def find_encoder(arrays: Mapping[str, NDArray[Any]]) -> Encoder:
    """Return the network of stored arrays: matrices in eight bits, with a scale for each row and each column."""

    def linear(name: str) -> Linear:
        rows, columns, bias = (arrays[f"{name}_{kind}"] for kind in ("rows", "columns", "bias"))
        return rows[:, None] * arrays[name].astype(np.float32) * columns, bias

    names = ("attend", "join", "widen", "narrow")
    layers = tuple(tuple(linear(f"{name}_{number}") for name in names) for number in range(LAYERS))
    convolutions = tuple(linear(f"convolution_{number}") for number in range(2))
    return Encoder(convolutions, layers, arrays["basis"], arrays["shift"])


@cache
def _make_filters() -> Array:
    """Return Whisper's triangular filters, equally spaced in Slaney's mel and of equal area [shape=(201, 80)]."""
    top = 15 + np.log(SPEECH_RATE_HZ / 2 / 1000) * 27 / np.log(6.4)
    mel = np.linspace(0, top, BANDS + 2)
    edges = np.where(mel < 15, mel * 200 / 3, 1000 * 6.4 ** ((mel - 15) / 27))
    hertz = np.linspace(0, SPEECH_RATE_HZ / 2, WINDOW // 2 + 1)
    filters = make_triangles(hertz, edges) * 2 / (edges[2:] - edges[:-2])
    return filters.astype(np.float32)
