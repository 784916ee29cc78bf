"""The modulation filter: generated motion moves as much at every frequency as recorded motion.

Means of states and regressions are averages, so that fast movement is missing in what is generated from them.
Source: Takamichi, Toda, Black, Neubig, Sakti & Nakamura 2016.  Deviations: one filter without delay for all utterances,
instead of a transform of each whole one, so that long recordings are filtered block by block; the tracker's noise is
taken out of the spectrum that is aimed at.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.frame_labels import find_runs, mark_distant
from lipmotion.stats.curves import measure_modulation_spectrum
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays
from lipmotion.types import FRAME_RATE_HZ, Example, Rule

Array = NDArray[np.float64]
REACH = 24  # frames before and after a frame that determine it
HIGHEST_HZ, UNCHANGED_HZ = 12.5, 20.0
"""Frequencies up to which cameras of 25 Hz show movement, and from which on it is left as it is."""
MIN_GAIN, MAX_GAIN = 0.3, 6.0
MIN_SHARE = 0.02  # at least this share of recorded power counts as movement, however strong the noise
RESTING_MARGIN_S = 0.3  # a mouth rests so far from speech, in seconds
RESTING_FRAMES = 500  # without so many frames of a resting mouth the noise is not known, and not taken out
HOLD_FRAMES = 5  # frames on both sides of a held one over which the filter fades in
STRENGTH = Rule(least=0, most=2)  # strengths that the engines' option ``modulation_filter`` allows


class ModulationFilter(NamedTuple):
    """Filters without delay, symmetrical, of sum 1, so that a mouth at rest stays there [shape=(2 · REACH + 1, Q)]."""

    taps: Array

    def scale_to(self, strength: float) -> ModulationFilter:
        """Return a filter between none (0) and this one (1), or beyond it."""
        none = np.zeros_like(self.taps)
        none[REACH] = 1
        return ModulationFilter(none + strength * (self.taps - none))

    def apply(self, values: Array, held: Collection[int] = (), pins: Collection[tuple[int, int]] = ()) -> Array:
        """Return filtered motion [shape=(T, Q)].

        values : generated motion at 100 Hz [shape=(T, Q)]; before its start and after its end it stands still
        held   : frames that stay exactly as they are: closed lips
        pins   : frames and dimensions that stay exactly as they are
        """
        padded = np.pad(values, ((REACH, REACH), (0, 0)), mode="edge")
        change, weight = -values, np.ones_like(values)
        for tap in range(2 * REACH + 1):
            change += self.taps[tap] * padded[tap : tap + len(values)]
        frames = np.arange(len(values))[:, None]
        for frame, dimensions in [*((f, slice(None)) for f in held), *((f, slice(q, q + 1)) for f, q in pins)]:
            near = slice(max(frame - HOLD_FRAMES, 0), frame + HOLD_FRAMES)
            weight[near, dimensions] = np.minimum(weight[near, dimensions], np.abs(frames[near] - frame) / HOLD_FRAMES)
        return values + weight * change


def learn_filter(
    strength: float,
    compared: Iterable[tuple[NDArray[Any], NDArray[Any]]],
    examples: Sequence[Example],
    values: Sequence[Array],
) -> ModulationFilter | None:
    """Return the filter that an engine learns in training; None: it has no strength.

    strength : 0: none; 1: generated motion gets the modulation spectrum of recorded motion; more goes beyond it
    compared : recorded and generated motion of clips [each shape=(T_i, Q)]; not asked for where there is no strength.
               Without any, the filter changes nothing
    examples : all of the training, which show the tracker's noise
    values   : their motion in the motion space [each shape=(T, Q)]
    """
    if not strength:
        return None
    pairs = list(compared)
    if not pairs:
        return fit_modulation_filter(values, values)
    resting = list[Array]()
    for example, x in zip(examples, values, strict=True):
        far = example.valid & mark_distant(example.speech.units, len(x), RESTING_MARGIN_S)
        resting += [x[start:stop] for start, stop in find_runs(far)]
    recorded, generated = zip(*pairs, strict=True)
    return fit_modulation_filter(recorded, generated, resting).scale_to(strength)


def fit_modulation_filter(
    recorded: Sequence[NDArray[Any]], generated: Sequence[NDArray[Any]], resting: Sequence[NDArray[Any]] = ()
) -> ModulationFilter:
    """Return the filter that gives generated motion the modulation spectrum of recorded motion.

    recorded, generated : motion of the same clips at 100 Hz [each shape=(T_i, Q)]
    resting : recorded motion in silence, ``RESTING_MARGIN_S`` from speech: noise [each shape=(N_i, Q)]
    """

    def spectrum(clips: Sequence[NDArray[Any]]) -> tuple[Array, Array]:
        return measure_modulation_spectrum([clip.astype(float) for clip in clips], FRAME_RATE_HZ)

    frequencies, wanted = spectrum(recorded)
    _, made = spectrum(generated)
    quiet = [clip for clip in resting if len(clip) > REACH]
    if sum(map(len, quiet)) >= RESTING_FRAMES:
        noise = spectrum(quiet)[1]
        wanted = np.maximum(wanted - noise, MIN_SHARE * wanted)
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = np.where(made > 0, np.sqrt(wanted / made), 1.0)
    passed = frequencies <= HIGHEST_HZ
    logs = np.log(np.clip(gains[passed], MIN_GAIN, MAX_GAIN))
    padded = np.pad(logs, ((1, 1), (0, 0)), mode="edge")
    smooth = 0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:]
    size, window = 256, np.hanning(2 * REACH + 3)[1:-1]  # the window method of filter design
    grid, known = np.fft.rfftfreq(size, 1 / FRAME_RATE_HZ), np.array([0.0, *frequencies[passed], UNCHANGED_HZ])
    columns = []
    for log_gains in smooth.T:
        response = np.fft.irfft(np.exp(np.interp(grid, known, np.array([0.0, *log_gains, 0.0]))), size)
        taps = np.fft.fftshift(response)[size // 2 - REACH : size // 2 + REACH + 1] * window
        columns.append(taps + (1 - taps.sum()) / window.sum() * window)
    return ModulationFilter(np.stack(columns, axis=1))


MODULATION = {"modulation": ArraySpec(np.float64, "N Q", -2 * MAX_GAIN, 2 * MAX_GAIN)}
"""Filters up to twice their strength."""


def filter_to_arrays(modulation: ModulationFilter | None) -> dict[str, NDArray[Any]]:
    """Serialise a filter; None has no arrays."""
    return {} if modulation is None else {"modulation": modulation.taps}


def filter_from_arrays(arrays: Arrays, dimensions: int, *, needed: bool = False) -> ModulationFilter | None:
    """Deserialise a filter, which may be ``needed``. Raises KeyError, ValueError: it is missing, or damaged."""
    if "modulation" not in arrays and not needed:
        return None
    return ModulationFilter(check_arrays(arrays, MODULATION, N=2 * REACH + 1, Q=dimensions)["modulation"])
