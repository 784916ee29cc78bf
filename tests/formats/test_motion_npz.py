import json
from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.formats import read_motion, write_motion
from lipmotion.types.generation import ReducedVariance


@pytest.fixture
def path(tmp_path, generation):
    path = tmp_path / "a.npz"
    write_motion(path, generation, source={"file": "Größe.wav"}, model={})
    return path


def test_values_are_not_rounded(path, generation):
    motion, _ = read_motion(path)
    assert (motion.values == generation.motion.values).all()
    assert motion.channels == generation.motion.channels


def test_it_holds_plain_arrays_only(path):
    with np.load(path, allow_pickle=False) as arrays:
        assert set(arrays) == {"values", "standard_deviations", "document"}
        document = json.loads(str(arrays["document"]))
    assert "values" not in document
    assert document["source"] == {"file": "Größe.wav"}


def test_every_value_has_a_standard_deviation(tmp_path, generation):
    spread = np.random.default_rng(3).uniform(0.01, 4, generation.motion.values.shape)
    path = tmp_path / "b.npz"
    write_motion(path, replace(generation, spread=spread), source={}, model={})
    with np.load(path, allow_pickle=False) as arrays:
        np.testing.assert_allclose(arrays["standard_deviations"], np.sqrt(spread), rtol=1e-6)
    reduced = ReducedVariance(spread[:, :1], np.array([[1.0, 4.0]]))
    write_motion(path, replace(generation, spread=reduced), source={}, model={})
    with np.load(path, allow_pickle=False) as arrays:
        np.testing.assert_allclose(arrays["standard_deviations"], np.sqrt(spread[:, :1] * [1, 4]), rtol=1e-6)
    assert (read_motion(path)[0].values == generation.motion.values).all()


def test_a_pickle_is_not_opened(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, values=np.zeros((1, 1)), document=np.array({"format": "lipmotion.motion"}, dtype=object))
    with pytest.raises(InputError, match="not a motion file"):
        read_motion(path)
