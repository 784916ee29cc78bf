import json
import logging
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.errors import ExportError
from lipmotion.storage import schema
from lipmotion.storage.archive import Checkpoint, check_archive, take_array
from lipmotion.storage.json_text import as_json, from_json, replace_nan
from robustness.case import npy


def test_an_array_comes_back() -> None:
    texts = np.array(["a", "näher 😀"]), np.array("one")
    for array in (np.arange(6.0).reshape(2, 3), np.zeros((0, 3)), *texts, np.eye(3).T):
        found = take_array(npy(array))
        assert found.dtype == array.dtype
        np.testing.assert_array_equal(found, array)


def test_an_array_is_exactly_as_long_as_its_header_says_and_of_letters_that_exist() -> None:
    whole = npy(np.arange(6.0))
    for content in (whole[:-1], whole + b"\0", b"", b"\x93NUMPY\x09\x00"):
        with pytest.raises(ValueError, match=r"required 48 bytes|not an array"):
            take_array(content)
    with pytest.raises(ValueError, match="characters that do not exist"):
        take_array(npy(np.array(["ab"]))[:-4] + b"\0\0\x11\0")


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
    "double": np.array([np.pi, np.nextafter(1, 2)]), "names": np.array(["b.0<ih", "ä"]), "count": np.array(7),
    "empty": np.zeros((0, 3)),
}  # fmt: skip


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


NAN, INFINITE = float("nan"), float("inf")


def test_there_and_back() -> None:
    content = {"a": [1, 2.5, "é", None], "b": {"c": True}}
    assert from_json(as_json(content)) == content
    assert as_json(content, indent=1, ensure_ascii=False) == json.dumps(content, indent=1, ensure_ascii=False)
    for text in ("\ud800", {"a": ["é\udfff"]}, "é", "😀"):  # every text is written as UTF-8
        written = as_json(text, ensure_ascii=False)
        assert from_json(written.encode()) == text
        assert ("é" in written) == (text == "é")


def test_numbers_that_json_does_not_have_are_refused_or_null() -> None:
    for content in (NAN, {"a": [1.0, INFINITE]}, [-INFINITE]):
        with pytest.raises(ExportError, match="every number must be finite"):
            as_json(content)
    nested = {"a": [1.5, NAN, (INFINITE, "b", -INFINITE)], "c": 2, "d": "nan", "e": None, "f": True}
    assert replace_nan(nested) == {"a": [1.5, None, (None, "b", None)], "c": 2, "d": "nan", "e": None, "f": True}


def test_what_is_refused() -> None:
    for text, says in (
        ("{", "Expecting"),
        ('{"a": 1, "b": 2, "a": 1}', "the key 'a' occurs twice"),
        ('{"a": {"b": 1, "b": 2}}', "the key 'b' occurs twice"),
        ('{"a": NaN}', "the number NaN, required a finite one"),
        ("[-Infinity]", "the number -Infinity"),
        ("[1e999]", "the number 1e999"),
    ):
        with pytest.raises(ValueError, match=says):
            from_json(text)


TABLE = {
    "means": schema.ArraySpec(np.float32, "G 3 D", -500, 500),
    "variances": schema.ArraySpec(np.float32, "G 3 D", schema.POSITIVE),
    "log_weights": schema.ArraySpec(np.float32, "G", -np.inf, 0),
    "share": schema.ArraySpec(np.float64, "G", schema.POSITIVE, schema.BELOW_ONE),
    "log_stay": schema.ArraySpec(np.float64, "G", -10, schema.NEGATIVE),
    "rows": schema.ArraySpec(np.int32, "n", -1, 9),
    "names": schema.ArraySpec(np.str_, "D"),
    "weights": schema.ArraySpec(np.float64, "D", 0, whole=True, optional=True),
}


def good() -> dict[str, np.ndarray]:
    return {
        "means": np.linspace(-2, 2, 24).reshape(4, 3, 2).astype(np.float16), "variances": np.ones((4, 3, 2)),
        "log_weights": np.array([0, -np.inf, -1, -2]), "share": np.full(4, 0.5, np.float32),
        "log_stay": np.full(4, -0.1), "rows": np.array([], np.int64), "names": np.array(["a", "b"]),
    }  # fmt: skip


def test_arrays_become_what_the_table_says() -> None:
    found = schema.check_arrays(good(), TABLE)
    assert found.sizes == {"G": 4, "D": 2, "n": 0}
    assert {name: found[name].dtype.kind for name in found.arrays} == dict.fromkeys(TABLE.keys() - {"weights"}) | {
        "means": "f", "variances": "f", "log_weights": "f", "share": "f", "log_stay": "f", "rows": "i", "names": "U",
    }  # fmt: skip
    assert (found["means"].dtype, found["share"].dtype, found["rows"].dtype) == (np.float32, np.float64, np.int32)
    assert np.array_equal(found["means"], good()["means"])
    assert schema.check_arrays(good() | {"weights": np.array([1, 2])}, TABLE)["weights"].tolist() == [1.0, 2.0]


def put(name: str, value: float) -> dict[str, np.ndarray]:
    array = good()[name].copy()
    array.flat[-1] = value
    return {name: array}


def test_arrays_that_are_refused() -> None:
    for changes, says in (
        ({"means": np.ones((4, 3, 2), complex)}, "means holds complex128, required fractions"),
        ({"means": np.zeros((4, 3, 2), "M8[s]")}, r"means holds datetime64\[s\], required fractions"),
        ({"means": np.ones((4, 3, 2), int)}, "means holds int64, required fractions"),
        ({"means": np.ones((4, 3, 2), np.longdouble)}, "means holds .*, required fractions"),
        ({"rows": np.zeros(3)}, "rows holds float64, required whole numbers"),
        ({"names": np.array([b"a", b"b"])}, "names holds .S1, required texts"),
        ({"weights": np.array([True, False])}, "weights holds bool, required fractions"),
        ({"means": np.ones((4, 3, 3))}, r"variances of shape \(4, 3, 2\), required \(4, 3, 3\)"),
        ({"means": np.ones((4, 2, 2))}, r"means of shape \(4, 2, 2\), required \(G, 3, D\)"),
        ({"means": np.ones((4, 3))}, "means of shape"),
        ({"share": np.full(3, 0.5)}, r"share of shape \(3,\), required \(4,\)"),
        ({"means": np.ones((0, 3, 2))}, "means of shape .* at least one of each"),
        (put("means", np.nan), "means holds values that are not finite"),
        (put("means", np.inf), "means holds values that are not finite"),
        (put("log_weights", np.nan), "log_weights holds values that are not finite"),
        (put("log_weights", np.inf), "log_weights holds values that are not finite"),
        (put("means", 501), "means holds -2 to 501, required -500 to 500"),
        (put("variances", 0), "variances holds 0 to 1, required more than 0 to"),
        (put("variances", -1), "required more than 0 to"),
        (put("share", 1), "share holds 0.5 to 1, required more than 0 to less than 1"),
        (put("log_stay", 0), "required -10 to less than 0"),
        ({"rows": np.array([3, 10])}, "rows holds 3 to 10, required -1 to 9"),
        ({"rows": np.array([2**63], np.uint64)}, "rows holds"),
    ):
        with pytest.raises(ValueError, match=says) as caught:
            schema.check_arrays(good() | changes, TABLE)
        assert "\n" not in str(caught.value)


def test_a_missing_array_is_named() -> None:
    for name in sorted(TABLE.keys() - {"weights"}):
        with pytest.raises(KeyError, match=f"{name} is missing"):
            schema.check_arrays({key: array for key, array in good().items() if key != name}, TABLE)


def test_known_sizes_hold() -> None:
    assert schema.check_arrays(good(), TABLE, G=4).sizes["G"] == 4
    with pytest.raises(ValueError, match=r"required \(5, 3, D\)"):
        schema.check_arrays(good(), TABLE, G=5)
    tiny = np.full((4, 3, 2), np.float16(6e-8))  # the smallest number of half precision is more than 0
    assert (schema.check_arrays(good() | {"variances": tiny}, TABLE)["variances"] > 0).all()


def test_arrays_that_no_table_has() -> None:
    schema.refuse_undeclared(good(), TABLE, ["other"])
    with pytest.raises(ValueError, match="undeclared 'other'"):
        schema.refuse_undeclared([*good(), "other"], TABLE)


def test_numbers_of_what_there_is() -> None:
    schema.check_index("rows", np.array([0, 2]), 3)
    schema.check_index("rows", np.array([], int), 0)
    for numbers in ([0, 3], [-1]):
        with pytest.raises(ValueError, match=r"rows is .* required 0 to 2"):
            schema.check_index("rows", np.array(numbers), 3)
