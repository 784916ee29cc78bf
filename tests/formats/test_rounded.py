import numpy as np

from lipmotion.formats import base
from lipmotion.formats.base import format_rows


def test_rows_are_the_rounded_values(monkeypatch):
    for block, precision in ((1, "f4"), (7, "f8"), (50, "f8"), (2000, "f4")):
        monkeypatch.setattr(base, "BLOCK_ROWS", block)
        values = np.random.default_rng(0).normal(0, 3, (50, 7)).astype(precision)
        parsed = np.array([[float(number) for number in row.split(",")] for row in format_rows(values)])
        assert (parsed == np.round(values.astype(float), 5)).all()


def test_numbers_are_plain():
    assert list(format_rows(np.array([[0.0, -0.0, -1e-7, 1e-5, 123456.0]]))) == [
        "0.00000,0.00000,0.00000,0.00001,123456.00000"
    ]
    assert list(format_rows(np.zeros((0, 3)))) == []
