"""The rate of rows whose times were rounded."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.meshes.files.steady_rate import even_out_rows, exact_rate

NTSC = 30_000 / 1001


def test_a_rounded_rate_of_television_is_meant_exactly() -> None:
    assert exact_rate(29.97003) == NTSC
    assert exact_rate(59.94006) == 60_000 / 1001
    for other in (29.97, 30.0, 25.0, 1e-6):
        assert exact_rate(other) == other
    assert np.isnan(exact_rate(float("nan")))


@pytest.mark.parametrize("rate_hz", [24.0, 24_000 / 1001, NTSC, 30.0, 60_000 / 1001, 60.0])
def test_even_rows_have_their_rate(rate_hz: float) -> None:
    time_s = np.round(np.arange(300) / rate_hz, 5)
    rows, found_hz = even_out_rows(time_s, np.arange(300.0)[:, None])
    assert found_hz == rate_hz
    assert rows[:, 0].tolist() == list(range(300))


def test_other_even_rates_are_measured() -> None:
    for rate_hz in (2.0, 72.0, 71.9):
        assert even_out_rows(np.arange(100) / rate_hz, np.zeros((100, 1)))[1] == pytest.approx(rate_hz, abs=1e-6)
