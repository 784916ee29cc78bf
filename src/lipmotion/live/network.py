"""The sound of a stream, at any rate, and the network that follows it: to articulators and visemes.

At every step of 20 ms it says what the mouth is about to do, and, better, what it did a while ago: whoever can wait
takes the later answer. It was taught by what ``animate`` makes of whole recordings
(``scripts/live_network.py``); its articulators are in standard deviations, so that any model's face can follow them.
"""

from __future__ import annotations

import copy
from collections import deque
from functools import cache
from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.meshes.model.shape_names import VISEMES_15
from lipmotion.motion.articulation import ARTICULATORS
from lipmotion.motion.network_steps import shape_convolutional
from lipmotion.speech.features.mfcc import BANDS, FFT_SIZE, HOP, WINDOW, mel_filters
from lipmotion.speech.sound.audio_files import MAX_CHANNELS
from lipmotion.stats.networks import ConvolutionalNetwork
from lipmotion.storage.archive import read_shipped_arrays
from lipmotion.types import FRAME_RATE_HZ, SPECTRUM_BANDS, SPEECH_RATE_HZ

TAPS, BLOCK = 16, 160
"""Zero crossings of the resampling filter on either side; and samples that are resampled at a time, 10 ms."""
FILE_STARTS = (b"RIFF", b"OggS", b"fLaC", b"ID3\3", b"ID3\4", b"\x1aE\xdf\xa3")  # of WAV, Ogg, FLAC, MP3, WebM
LARGEST_SAMPLE = 1e6  # samples beyond this are no sound, also where full scale is not 1


class Resampler:
    """Sound at 16 kHz, block by block, with a windowed sinc (Kaiser); how it is cut into pieces changes no bit."""

    def __init__(self, rate_hz: int) -> None:
        shared = gcd(rate_hz, SPEECH_RATE_HZ)
        self._up, self._down, self._rate_hz = SPEECH_RATE_HZ // shared, rate_hz // shared, rate_hz
        slower = max(1.0, rate_hz / SPEECH_RATE_HZ)
        self._reach = int(np.ceil(TAPS * slower))
        x = np.arange(1 - self._reach, self._reach + 1) - np.arange(self._up)[:, None] / self._up
        window = np.i0(8.0 * np.sqrt(np.maximum(1 - np.square(x / self._reach), 0))) / np.i0(8.0)
        self._filters = (np.sinc(0.95 * x / slower) * 0.95 / slower * window).astype(np.float32)
        self._pending = np.zeros(self._reach - 1, np.float32)  # beginning at the sample ``_reach`` - 1 before the next
        self._made, self._taken, self.pushed = 0, 0, 0

    @property
    def seconds(self) -> float:
        """Seconds of sound that were pushed."""
        return self.pushed / self._rate_hz

    def push(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return what is known of the sound at 16 kHz now."""
        self.pushed += len(samples)
        if self._up == self._down:
            return samples
        self._pending = np.concatenate([self._pending, samples])
        blocks = []
        while True:
            numbers = np.arange(self._made, self._made + BLOCK)
            first, phase = np.divmod(numbers * self._down, self._up)
            if first[-1] - self._taken + 2 * self._reach > len(self._pending):
                break
            rows = self._pending[(first - self._taken)[:, None] + np.arange(2 * self._reach)]
            blocks.append(np.einsum("nt,nt->n", rows, self._filters[phase]))
            self._made += BLOCK
            drop = int(first[-1]) - self._taken
            self._pending, self._taken = self._pending[drop:], self._taken + drop
        return np.concatenate([*blocks, np.zeros(0, np.float32)])

    def finish(self) -> NDArray[np.float32]:
        """Return the rest, with silence after it."""
        seconds, pushed = self.seconds, self.pushed
        rest = self.push(np.zeros(2 * self._reach + self._rate_hz // 50, np.float32))
        self.pushed = pushed
        return rest[: max(int(np.ceil(seconds * SPEECH_RATE_HZ)) - (self._made - len(rest)), 0)]


def mono_samples(samples: Any) -> NDArray[np.float32]:
    """Return samples as floats of one channel, full scale 1. Raises InputError: as ``Stream.push``."""
    if isinstance(samples, bytes | bytearray) or (isinstance(samples, memoryview) and samples.itemsize == 1):
        if (start := bytes(samples[:4])) in FILE_STARTS:
            raise InputError(f"bytes of a file, which begin with {start!r}; required its samples: decode it first")
        if len(samples) % 2:
            raise InputError(f"{len(samples)} bytes of sound, required whole samples of 16 bits")
        samples = np.frombuffer(bytes(samples), "<i2")
    try:
        values = np.asarray(samples)
    except ValueError as error:
        raise InputError(f"no samples ({error}), required an array of shape (N,) or (N, C)") from error
    is_number = not np.ma.is_masked(samples) and (values.dtype.kind == "f" or values.dtype.str[1:] == "i2")
    if not is_number or values.ndim not in (1, 2) or not all(0 < count <= MAX_CHANNELS for count in values.shape[1:]):
        found = f"samples of shape {values.shape} and type {values.dtype}"
        raise InputError(f"{found}, required (N,) or (N, C), C at most {MAX_CHANNELS}, floats or int16, none masked")
    with np.errstate(over="ignore"):
        floats = values.astype(np.float32) / np.float32(32768 if values.dtype.kind == "i" else 1)
    if not (np.abs(floats) <= LARGEST_SAMPLE).all():
        raise InputError(f"samples not finite, or beyond {LARGEST_SAMPLE:g}, required full scale 1; put 0 there")
    return floats.mean(axis=1, dtype=np.float32) if floats.ndim == 2 else floats


Array = NDArray[np.float32]
STEP_FRAMES = 2  # frames of 10 ms in a step
STEP_S = STEP_FRAMES / FRAME_RATE_HZ
LAGS = (-1, 2, 6, 14, 30)
"""How many steps ago the answers of a step are about: for look-aheads of 0, 80, 160, 320 and 640 ms."""
HEARD_S = (STEP_FRAMES - 1) / FRAME_RATE_HZ + WINDOW / 2 / SPEECH_RATE_HZ
"""So much after its time the sound of a step has come."""
OUTPUTS = len(ARTICULATORS) + len(VISEMES_15)  # values of an answer: articulators, and how probable each viseme is
SHAPE = shape_convolutional("live", "live-network", STEP_FRAMES * (SPECTRUM_BANDS + 1), 256, (1, 2, 4, 8, 16, 1, 2, 4))
"""It hears the last 1.5 s."""
START_LEVEL, QUIETEST_LEVEL = 1.0, -2.0
"""Natural logarithm of the power of loud speech that is assumed at first, and the least: quieter sound stays quiet."""
FALL = 2.3 / (6 * FRAME_RATE_HZ)
"""The level that is assumed falls by so much a frame, 10 dB in 6 s: who begins too loud is not lost afterwards."""
ATTACK = 0.25  # share of a frame in the power that raises the level: a click does not count as loud speech
RISE, TOP = 0.5, 1.5  # the level rises by so much a frame, powers end so far above it: after a bump, speech is heard
RANGE = 14.0  # powers are floored so far below the level, 60 dB
SPEECH_RANGE = 7.0  # frames down to 30 dB under the level are speech, and teach how each band sounds in it
KNOWN_FRAMES, REMEMBERED_FRAMES = 40, 300
"""So many frames of speech the typical spectrum counts, to begin with; and so many are remembered."""
SCALE = 4.0


class SoundFeatures:
    """The log mel spectrum of sound as it comes, relative to how loud speech has been, and to how each band sounds.

    Samples are at 16 kHz, full scale 1. Frames are computed one by one: how the sound is cut into pieces changes no
    bit. Frame n is heard when 25 ms around 10 · n ms have come; before the sound there is silence.
    typical : the mean of every band in speech, relative to the level [shape=(40,)]
    """

    def __init__(self, typical: Array, warp: float = 1.0) -> None:
        self._filters = mel_filters(warp, *BANDS)
        self._window = np.hamming(WINDOW).astype(np.float32)
        self._level, self._bands = START_LEVEL, BandMeans(typical)
        self.restart()

    def restart(self) -> None:
        """Begin to hear other sound of the same voice and microphone."""
        self._pending = np.zeros(WINDOW // 2 + 1, np.float32)
        self._power = 0.0

    def push(self, samples: Array) -> list[Array]:
        """Return the features of every frame that is complete [each shape=(41,)]."""
        return [self._bands.push(row) for row in self.list_levels(samples)]

    def list_levels(self, samples: Array) -> list[Array]:
        """Return bands and the whole of every frame that is complete, relative to the level [each shape=(41,)]."""
        self._pending = np.concatenate([self._pending, samples])
        rows, start = [], 0
        while start + WINDOW < len(self._pending):
            rows.append(self._frame(self._pending[start : start + WINDOW + 1]))
            start += HOP
        self._pending = self._pending[start:]
        return rows

    def _frame(self, samples: Array) -> Array:
        spectrum = np.fft.rfft((samples[1:] - np.float32(0.97) * samples[:-1]) * self._window, FFT_SIZE)
        powers = (np.square(spectrum.real) + np.square(spectrum.imag)).astype(np.float32) @ self._filters
        total = float(powers.sum()) + 1e-12
        self._power += ATTACK * (min(total, float(np.exp(self._level + TOP))) - self._power)
        self._level = max(self._level - FALL, QUIETEST_LEVEL, min(float(np.log(self._power)), self._level + RISE))
        row = np.log(np.append(powers + np.float32(1e-12), np.float32(total))) - np.float32(self._level)
        result: Array = np.clip(row, np.float32(-RANGE), np.float32(TOP))
        return result


class BandMeans:
    """Bands relative to their means in the speech that was heard: microphones and rooms differ in these.

    typical : the means that are assumed before anything is heard [shape=(40,)]
    """

    def __init__(self, typical: Array) -> None:
        self._means: Array = typical.astype(np.float32)
        self._frames = KNOWN_FRAMES

    def push(self, row: Array) -> Array:
        """Return the features of a frame [shape=(41,)], from its levels, which also change the means."""
        if row[-1] > -SPEECH_RANGE:
            self._frames = min(self._frames + 1, REMEMBERED_FRAMES)
            change: Array = ((row[:-1] - self._means) / np.float32(self._frames)).astype(np.float32)
            self._means = self._means + change
        return (np.append(row[:-1] - self._means, row[-1] + SPEECH_RANGE) / SCALE).astype(np.float32)


def silent_step(typical: Array) -> Array:
    """Return the features of a step of silence before any speech [shape=(82,)]."""
    silent = np.full(SPECTRUM_BANDS + 1, -RANGE, np.float32)
    return np.tile(BandMeans(typical).push(silent), STEP_FRAMES)


class CausalSteps:
    """A convolutional network that is run step by step: each layer keeps the inputs that it will still need.

    It begins as after silence for ever: steps of ``silent`` [shape=(82,)].
    """

    def __init__(self, network: ConvolutionalNetwork, silent: Array) -> None:
        self._network = network
        widths = [len(layer.weights) // 3 for layer in network.layers]
        self._waiting = [
            deque([np.zeros(width, np.float32)] * (2 * dilation + 1), 2 * dilation + 1)
            for width, dilation in zip(widths, network.dilations, strict=True)
        ]
        self._steps = 0
        for _ in range(2 * network.reach):
            self.push(silent)

    def __deepcopy__(self, memo: dict[int, Any]) -> CausalSteps:
        result = copy.copy(self)
        result._waiting = [deque(each, each.maxlen) for each in self._waiting]
        return result

    def push(self, inputs: Array) -> Array:
        """Return the answers of this step: the network's outputs where it has heard all of it."""
        states, heard = inputs, self._steps
        self._steps += 1
        for number, (layer, dilation) in enumerate(zip(self._network.layers, self._network.dilations, strict=True)):
            waiting = self._waiting[number]
            waiting.append(states)
            heard -= dilation
            if heard < 0:  # zeros stand before the first step
                states = np.zeros(len(layer.biases), np.float32)
                continue
            stacked = np.concatenate([waiting[0], waiting[dilation], waiting[-1]])
            result = np.maximum(stacked @ layer.weights + layer.biases, 0)
            states = result if number == 0 else waiting[dilation] + result
        outputs: Array = states @ self._network.output.weights + self._network.output.biases
        return outputs


class LiveNetwork(NamedTuple):
    """The network, and what is known of its errors.

    network      : its outputs are an answer for each of ``LAGS``
    variances    : of the error of each articulator at each lag [shape=(5, 8)]
    acceleration : variance of the second difference of each articulator from step to step, in people [shape=(8,)]
    gains        : what makes the movements of each articulator at each lag as large as people's [shape=(5, 8)]
    typical      : the mean of every band of the sound in speech, relative to its level [shape=(40,)]
    curves       : from 1, articulators and visemes to ARKit's weights of the mouth [shape=(24, 28)]
    """

    network: ConvolutionalNetwork
    variances: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    gains: NDArray[np.float64]
    typical: Array
    curves: NDArray[np.float64]


@cache
def live_network() -> LiveNetwork:
    """Return the network of the package."""
    arrays = read_shipped_arrays("live.npz")
    network = SHAPE.from_arrays({name: arrays[name] for name in SHAPE.specs}, len(LAGS) * OUTPUTS)
    values = {name: arrays[name].astype(float) for name in LiveNetwork._fields[1:]}
    return LiveNetwork(network, **{**values, "typical": arrays["typical"].astype(np.float32)})


@cache
def hear_silence() -> tuple[CausalSteps, Array]:
    """Return the network of the package after nothing but silence, to be copied, and its answers [shape=(5, 23)]."""
    silent = silent_step(live_network().typical)
    steps = CausalSteps(live_network().network, silent)
    return steps, copy.deepcopy(steps).push(silent).reshape(len(LAGS), -1)
