from __future__ import annotations

import math

import numpy as np
import pytest

from lipmotion.speech.features.framed_cepstra import framed_cepstra
from lipmotion.types import Audio, sixteen_bits
from speech.mfcc_oracle import cepstra, mel

EDGES = [math.floor(513 * 700 * (10 ** (n * mel(8000) / 27 / 2595) - 1) / 16_000) for n in range(28)]


def slow(samples: np.ndarray) -> np.ndarray:
    """One frame, one filter, one coefficient at a time."""
    values = [float(value) for value in sixteen_bits(samples)]
    emphasised = [values[0], *(values[i] - 0.97 * values[i - 1] for i in range(1, len(values)))]
    rows = []
    for n in range(1 + math.ceil((len(values) - 400) / 160)):
        power = np.abs(np.fft.rfft(emphasised[160 * n : 160 * n + 400], 512)) ** 2 / 512
        passed = []
        for left, centre, right in zip(EDGES, EDGES[1:], EDGES[2:], strict=False):
            rising = sum(power[k] * (k - left) / (centre - left) for k in range(left, centre))
            passed.append(rising + sum(power[k] * (right - k) / (right - centre) for k in range(centre, right)))
        rows.append([math.log(power.sum()), *cepstra([math.log(value) for value in passed])])
    return np.array(rows)


@pytest.mark.parametrize("count", [400, 1000, 1041])
def test_they_are_those_of_the_definition(count: int) -> None:
    samples = (0.1 * np.random.default_rng(0).normal(size=count)).astype(np.float32)
    found = framed_cepstra(Audio(samples, 16_000))
    np.testing.assert_allclose(found, slow(samples), rtol=1e-4, atol=1e-3)


def test_silence_has_a_logarithm() -> None:
    found = framed_cepstra(Audio(np.zeros(1600, np.float32), 16_000))
    assert found[:, 0] == pytest.approx(math.log(np.finfo(float).eps))
    assert found[:, 1:] == pytest.approx(0, abs=1e-4)
