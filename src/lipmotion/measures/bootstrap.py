"""Bootstrap confidence intervals over clips."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Clips = Sequence[NDArray[np.float64]]
DRAWS = 2000
"""Bootstrap samples of an interval."""


def bootstrap_interval(
    figure: Callable[[Clips, Clips], float], generated: Clips, original: Clips, seed: int, draws: int = DRAWS
) -> tuple[float, float]:
    """Return the 95 % bootstrap interval (lower and upper limit) of a figure over clips.

    figure : function of generated and original clips
    """
    draw = np.random.default_rng(seed)
    values = []
    for _ in range(draws):
        chosen = draw.integers(len(generated), size=len(generated))
        values.append(figure([generated[i] for i in chosen], [original[i] for i in chosen]))
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)
