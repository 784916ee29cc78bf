"""Distance of modulation spectra: whether generated curves move as much at every frequency as recorded ones."""

from __future__ import annotations

import numpy as np

from lipmotion.measures.curves import Array, Clips
from lipmotion.stats.modulation_spectrum import modulation_spectrum
from lipmotion.stats.rounding import varies

HIGHEST_HZ = 12.5
"""Frequencies above it hold noise of trackers rather than speech, and cameras of 25 Hz do not show them."""
FLOOR = 1e-6
"""Power under this share of the largest of the original counts as so much: rounding is no movement."""


def modulation_distance_db(generated: Clips, original: Clips, rate_hz: float) -> Array:
    """Return the root of the mean squared difference of two log modulation spectra, in dB [shape=(P,)].

    The mean is over frequencies up to ``HIGHEST_HZ``. NaN where the original is constant but for rounding.
    Source: Takamichi et al. 2016, who show the spectra; the distance is ours.
    """
    frequencies, reference = modulation_spectrum(original, rate_hz)
    _, made = modulation_spectrum(generated, rate_hz)
    least = np.where(varies(np.concatenate(original)), FLOOR * reference.max(axis=0), np.nan)
    difference = 10 * np.log10(np.maximum(made, least) / np.maximum(reference, least))
    return np.sqrt(np.square(difference[frequencies <= HIGHEST_HZ]).mean(axis=0))
