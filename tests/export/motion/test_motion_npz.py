import json

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.export import read_motion, write_motion


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
        assert set(arrays) == {"values", "document"}
        document = json.loads(str(arrays["document"]))
    assert "values" not in document
    assert document["source"] == {"file": "Größe.wav"}


def test_a_pickle_is_not_opened(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, values=np.zeros((1, 1)), document=np.array({"format": "lipmotion.motion"}, dtype=object))
    with pytest.raises(InputError, match="not a motion file"):
        read_motion(path)


def test_other_arrays_are_not_motion(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, values=np.zeros((1, 1)))
    with pytest.raises(InputError, match="not a motion file"):
        read_motion(path)
