"""The slow, readable twin of the correlations of ``speech.features.f0``: one frame, one lag, one sample at a time.

Written from its description: a windowed-sinc band pass of 255 taps from 50 to 1200 Hz that stops 0 Hz, every fourth
sample; 160 of them centred on the frame, weighted by a Hann window; correlated with itself, normalised. A thousandth of
the power of the slope of the full signal, 10 ms either side, counts as silence.
"""

import math

import numpy as np
from numpy.typing import NDArray

from speech.mfcc_oracle import sample

Array = NDArray[np.float64]


def low_passed(samples: Array, at: int) -> float:
    """Return the band-passed signal, reflected at both ends, at sample ``at``."""
    return sum(tap * sample(samples, at + k) for k, tap in enumerate(TAPS, start=-127))


def taps() -> list[float]:
    hamming = [0.54 - 0.46 * math.cos(2 * math.pi * i / 254) for i in range(255)]
    ideal = [sinc(1200, i - 127) - sinc(50, i - 127) for i in range(255)]
    shaped = [a * b for a, b in zip(hamming, ideal, strict=True)]
    return [value - sum(shaped) / sum(hamming) * weight for value, weight in zip(shaped, hamming, strict=True)]


def sinc(hertz: float, i: int) -> float:
    return 2 * hertz / 16_000 if i == 0 else math.sin(2 * math.pi * hertz * i / 16_000) / (math.pi * i)


def window(position: float) -> float:
    return math.sin(math.pi * (position + 0.5) / 160) ** 2 if -0.5 <= position <= 159.5 else 0.0


TAPS = taps()


def frame(samples: Array, n: int) -> Array:
    """Return 160 low-passed samples, 0.25 ms apart, around 10 · n ms: the middle is between the two in the middle."""
    return np.array([low_passed(samples, 160 * n + 4 * i - 318) for i in range(160)])


def correlation(x: Array, lag: int, silence: float) -> float:
    """Return the correlation of a frame with itself ``lag`` samples later."""
    weights = [window(t) * window(t + lag) for t in range(160 - lag)]
    pairs = list(zip(weights, x[: 160 - lag], x[lag:], strict=True))
    product = sum(w * a * b for w, a, b in pairs)
    energy = sum(w * a * a for w, a, _ in pairs), sum(w * b * b for w, _, b in pairs)
    return product / (math.sqrt(energy[0] * energy[1]) + silence * sum(weights))


def frication(samples: Array, n: int) -> float:
    """Return the power that a frame's frication adds to silence."""
    times = range(160 * n - 160, 160 * n + 160)
    return sum((sample(samples, t) - sample(samples, t - 1)) ** 2 for t in times) / 320 / 1000
