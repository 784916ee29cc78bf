import logging
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.storage.archive import Checkpoint, array_in, check_archive
from robustness.case import npy


def test_an_array_comes_back() -> None:
    texts = np.array(["a", "näher 😀"]), np.array("one")
    for array in (np.arange(6.0).reshape(2, 3), np.zeros((0, 3)), *texts, np.eye(3).T):
        found = array_in(npy(array))
        assert found.dtype == array.dtype
        np.testing.assert_array_equal(found, array)


def test_an_array_is_exactly_as_long_as_its_header_says_and_of_letters_that_exist() -> None:
    whole = npy(np.arange(6.0))
    for content in (whole[:-1], whole + b"\0", b"", b"\x93NUMPY\x09\x00"):
        with pytest.raises(ValueError, match=r"required 48 bytes|not an array"):
            array_in(content)
    with pytest.raises(ValueError, match="characters that do not exist"):
        array_in(npy(np.array(["ab"]))[:-4] + b"\0\0\x11\0")


def test_a_zip_may_not_grow_without_end(tmp_path: Path) -> None:
    for size, fits in ((1 << 20, True), (1 << 27, False)):
        with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("a", bytes(size))
        with zipfile.ZipFile(tmp_path / "a.zip") as file:
            if fits:
                check_archive(file)
            else:
                with pytest.raises(ValueError, match="would grow to 134217728 bytes, required at most 67108864"):
                    check_archive(file)


ARRAYS: dict[str, NDArray[Any]] = {
    "single": np.array([[1 / 3, np.nan], [-0.0, np.inf]], np.float32),
    "double": np.array([np.pi, np.nextafter(1, 2)]),
    "names": np.array(["b.0<ih", "ä"]),
    "count": np.array(7),
    "empty": np.zeros((0, 3)),
}


def test_every_bit_comes_back(tmp_path: Path) -> None:
    Checkpoint(tmp_path, "a").save("stage", ARRAYS)
    found = Checkpoint(tmp_path, "a").load("stage")
    assert found is not None
    assert found.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert (found[name].dtype, found[name].shape) == (array.dtype, array.shape)
        assert found[name].tobytes() == array.tobytes()


def test_the_last_state_of_the_same_job_counts(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    checkpoint = Checkpoint(tmp_path, "a")
    for number in range(3):
        checkpoint.save("stage", {"n": np.array(number)})
    found = checkpoint.load("stage")
    assert found is not None
    assert found["n"] == 2
    assert checkpoint.load("other") is None
    assert [path.name for path in tmp_path.iterdir()] == ["stage.checkpoint"]
    caplog.set_level(logging.INFO)
    assert Checkpoint(tmp_path, "b").load("stage") is None
    assert "of another corpus, configuration or version; not used" in caplog.text


def test_any_damaged_byte_of_an_array_is_noticed(tmp_path: Path) -> None:
    checkpoint = Checkpoint(tmp_path, "a")
    values = np.random.default_rng(0).normal(size=100)
    checkpoint.save("stage", {"values": values})
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    start = whole.index(values.tobytes())
    for position in (start, start + 400, start + 799):
        path.write_bytes(whole[:position] + bytes([whole[position] ^ 1]) + whole[position + 1 :])
        assert checkpoint.load("stage") is None
    for length in (0, 10, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        assert checkpoint.load("stage") is None
    path.write_bytes(whole)
    assert checkpoint.load("stage") is not None
