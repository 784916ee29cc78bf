from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.measures.sync_network import read_sync_network, sync_network
from oracles.syncnet import face_vector, random_state, sound_vector

STATE = random_state(2)


def test_vectors_are_those_of_the_layers_one_by_one() -> None:
    rng = np.random.default_rng(1)
    network = sync_network(STATE)
    pictures = rng.integers(0, 256, (6, 224, 224, 3)).astype(np.uint8)
    cepstra = (5 * rng.normal(size=(27, 13))).astype(np.float32)
    faces, sounds = network.face_vectors(pictures), network.sound_vectors(cepstra)
    assert (faces.shape, sounds.shape) == ((2, 3), (2, 3))
    np.testing.assert_allclose(faces[1], face_vector(STATE, pictures[1:]), rtol=1e-4)
    np.testing.assert_allclose(sounds[1], sound_vector(STATE, cepstra[4:24]), rtol=1e-4)


def test_too_little_has_no_vector() -> None:
    network = sync_network(STATE)
    assert network.face_vectors(np.zeros((4, 224, 224, 3), np.uint8)).shape == (0, 3)
    assert network.sound_vectors(np.zeros((19, 13), np.float32)).shape == (0, 3)


def test_weights_are_read_by_name(tmp_path: Path) -> None:
    np.savez(tmp_path / "weights.npz", **STATE)
    network = read_sync_network(tmp_path / "weights.npz")
    cepstra = np.ones((20, 13), np.float32)
    np.testing.assert_array_equal(network.sound_vectors(cepstra), sync_network(STATE).sound_vectors(cepstra))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"netcnnlip.4.weight": None}, "no array 'netcnnlip.4.weight'; how to convert"),
        (
            {"netcnnlip.0.weight": np.zeros((2, 5, 5, 7, 7))},
            r"netcnnlip.0.weight is an array of float64 of shape \(2, 5, 5, 7, 7\), required finite floats of shape "
            r"\(outputs, 3, 5, 7, 7\)",
        ),
        ({"netcnnaud.9.running_mean": np.zeros(3)}, r"running_mean .* required finite floats of shape \(2\)"),
        ({"netfcaud.0.bias": np.zeros(2, int)}, "netfcaud.0.bias is an array of int64"),
        ({"netfcaud.0.bias": np.full(2, np.nan)}, "netfcaud.0.bias .* required finite floats"),
        ({"netfclip.1.running_var": np.array([1.0, -1.0])}, "netfclip.1.running_var has negative values"),
        (
            {"netfclip.3.weight": np.zeros((4, 2)), "netfclip.3.bias": np.zeros(4)},
            "vectors of 4 and 3 values, required as many of both",
        ),
    ],
)
def test_other_weights_are_refused(tmp_path: Path, changed: dict[str, Any], words: str) -> None:
    arrays = {name: array for name, array in (STATE | changed).items() if array is not None}
    np.savez(tmp_path / "weights.npz", **arrays)
    with pytest.raises(InputError, match=words):
        read_sync_network(tmp_path / "weights.npz")


def test_what_is_no_archive_of_arrays_is_refused(tmp_path: Path) -> None:
    """PyTorch's own files are pickles, in a zip or without."""
    with pytest.raises(InputError, match="no such file"):
        read_sync_network(tmp_path / "weights.npz")
    (tmp_path / "syncnet_v2.model").write_bytes(b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.")
    with pytest.raises(InputError, match=r"not weights in an \.npz file .*; how to convert PyTorch's weights"):
        read_sync_network(tmp_path / "syncnet_v2.model")
