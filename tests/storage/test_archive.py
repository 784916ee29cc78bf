from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from lipmotion.storage.archive import array_in, check_archive


def test_an_array_comes_back() -> None:
    for array in (
        np.arange(6.0).reshape(2, 3),
        np.zeros((0, 3)),
        np.array(["a", "näher 😀"]),
        np.array("one"),
        np.eye(3).T,
    ):
        stream = io.BytesIO()
        np.save(stream, array)
        found = array_in(stream.getvalue())
        assert found.dtype == array.dtype
        np.testing.assert_array_equal(found, array)


def test_an_array_is_exactly_as_long_as_its_header_says() -> None:
    stream = io.BytesIO()
    np.save(stream, np.arange(6.0))
    for content in (stream.getvalue()[:-1], stream.getvalue() + b"\0", b"", b"\x93NUMPY\x09\x00"):
        with pytest.raises(ValueError, match=r"required 48 bytes|not an array"):
            array_in(content)


def test_letters_beyond_unicode_are_refused() -> None:
    stream = io.BytesIO()
    np.save(stream, np.array(["ab"]))
    with pytest.raises(ValueError, match="characters that do not exist"):
        array_in(stream.getvalue()[:-4] + b"\0\0\x11\0")


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
