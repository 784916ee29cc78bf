from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks

from lipmotion.speech.features.voice_events import risen_peaks


@pytest.mark.parametrize("prominence", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("count", [3, 10, 500])
def test_peaks_are_those_of_scipy(count: int, prominence: float) -> None:
    for seed in range(5):
        curve = np.cumsum(np.random.default_rng(seed).normal(size=count))
        found = find_peaks(curve, prominence=prominence)[0]
        assert risen_peaks(curve, prominence).tolist() == found.tolist()


def test_no_peak() -> None:
    assert risen_peaks(np.arange(10.0), 1.0).tolist() == []
    assert risen_peaks(np.zeros(3), 1.0).tolist() == []
