import numpy as np
import pytest

from lipmotion.storage.schema import (
    BELOW_ONE,
    NEGATIVE,
    POSITIVE,
    ArraySpec,
    check_arrays,
    check_index,
    refuse_undeclared,
)

TABLE = {
    "means": ArraySpec(np.float32, "G 3 D", -500, 500),
    "variances": ArraySpec(np.float32, "G 3 D", POSITIVE),
    "log_weights": ArraySpec(np.float32, "G", -np.inf, 0),
    "share": ArraySpec(np.float64, "G", POSITIVE, BELOW_ONE),
    "log_stay": ArraySpec(np.float64, "G", -10, NEGATIVE),
    "rows": ArraySpec(np.int32, "n", -1, 9),
    "names": ArraySpec(np.str_, "D"),
    "weights": ArraySpec(np.float64, "D", 0, whole=True, optional=True),
}


def good() -> dict[str, np.ndarray]:
    return {
        "means": np.linspace(-2, 2, 24).reshape(4, 3, 2).astype(np.float16),
        "variances": np.ones((4, 3, 2)),
        "log_weights": np.array([0, -np.inf, -1, -2]),
        "share": np.full(4, 0.5, np.float32),
        "log_stay": np.full(4, -0.1),
        "rows": np.array([], np.int64),
        "names": np.array(["a", "b"]),
    }


def test_arrays_become_what_the_table_says() -> None:
    found = check_arrays(good(), TABLE)
    assert found.sizes == {"G": 4, "D": 2, "n": 0}
    assert {name: found[name].dtype.kind for name in found.arrays} == dict.fromkeys(TABLE.keys() - {"weights"}) | {
        "means": "f", "variances": "f", "log_weights": "f", "share": "f", "log_stay": "f", "rows": "i", "names": "U",
    }  # fmt: skip
    assert (found["means"].dtype, found["share"].dtype, found["rows"].dtype) == (np.float32, np.float64, np.int32)
    assert np.array_equal(found["means"], good()["means"])
    assert check_arrays(good() | {"weights": np.array([1, 2])}, TABLE)["weights"].tolist() == [1.0, 2.0]


def put(name: str, value: float) -> dict[str, np.ndarray]:
    array = good()[name].copy()
    array.flat[-1] = value
    return {name: array}


def test_what_is_refused() -> None:
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
            check_arrays(good() | changes, TABLE)
        assert "\n" not in str(caught.value)


def test_a_missing_array_is_named() -> None:
    for name in sorted(TABLE.keys() - {"weights"}):
        with pytest.raises(KeyError, match=f"{name} is missing"):
            check_arrays({key: array for key, array in good().items() if key != name}, TABLE)


def test_known_sizes_hold() -> None:
    assert check_arrays(good(), TABLE, G=4).sizes["G"] == 4
    with pytest.raises(ValueError, match=r"required \(5, 3, D\)"):
        check_arrays(good(), TABLE, G=5)
    tiny = np.full((4, 3, 2), np.float16(6e-8))  # the smallest number of half precision is more than 0
    assert (check_arrays(good() | {"variances": tiny}, TABLE)["variances"] > 0).all()


def test_arrays_that_no_table_has() -> None:
    refuse_undeclared(good(), TABLE, ["other"])
    with pytest.raises(ValueError, match="undeclared 'other'"):
        refuse_undeclared([*good(), "other"], TABLE)


def test_numbers_of_what_there_is() -> None:
    check_index("rows", np.array([0, 2]), 3)
    check_index("rows", np.array([], int), 0)
    for numbers in ([0, 3], [-1]):
        with pytest.raises(ValueError, match=r"rows is .* required 0 to 2"):
            check_index("rows", np.array(numbers), 3)
