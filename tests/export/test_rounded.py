import time

import numpy as np

from lipmotion.export.rounded import rows


def test_rows_are_the_rounded_values():
    values = np.random.default_rng(0).normal(0, 3, (50, 7))
    parsed = np.array([[float(number) for number in row.split(",")] for row in rows(values)])
    assert (parsed == np.round(values, 5)).all()


def test_numbers_are_plain():
    assert rows(np.array([[0.0, -0.0, -1e-7, 1e-5, 123456.0]])) == ["0.00000,0.00000,0.00000,0.00001,123456.00000"]
    assert rows(np.zeros((0, 3))) == []


def test_a_minute_of_160_channels_takes_less_than_half_a_second():
    values = np.random.default_rng(0).normal(0, 0.3, (6001, 160))
    durations = []
    for _ in range(3):
        start = time.process_time()
        rows(values)
        durations.append(time.process_time() - start)
    assert min(durations) < 0.5
