"""Mutations of ``.npy`` files: of the header, and of the values."""

import io
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fuzz.mutators import raw
from robustness.case import npy

TYPES = "<f8 >f8 <f4 <f2 <i8 <i4 >i4 <i2 |i1 |u1 <u4 <c16 <M8[s] <m8[ns] |b1 <U3 |S4 |V8 |O <f16".split()
VALUES = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e-320, 1e9, 1e30, 1e38, -1e38, 1e300, -1e300, 0.5, 255.0)
SHAPES = (0, 1, -1, 2, 3, 1000, 10**6, 10**9, 2**31, 2**62, 2**64, 10**30)


def change(chance: Random, content: bytes) -> bytes:
    """Change the header alone, or the array with its header."""
    header = chance.random() < 0.4
    try:
        array = np.load(io.BytesIO(content), allow_pickle=False)
    except Exception:  # it was damaged before
        return _head(chance, content)
    return _head(chance, content) if header else npy(_array(chance, array))


def _head(chance: Random, content: bytes) -> bytes:
    """Change type, shape, order or version in the header, or its bytes."""
    end = content.find(b"\n") + 1
    if end < 12:
        return raw.change(chance, content)
    head, body = content[10:end], content[end:]
    entry = chance.choice((b"'descr': ", b"'shape': ", b"'fortran_order': ", b"{", b"}"))
    shape = ", ".join(str(chance.choice(SHAPES)) for _ in range(chance.choice((0, 1, 1, 2, 2, 3, 40))))
    values = (
        f"'{chance.choice(TYPES)}'", f"({shape},)", f"({shape})", "True", "[('a', '<f8'), ('b', '<i4')]", "None",
        "-" * 500,
    )  # fmt: skip
    before, found, after = head.partition(entry)
    changed = before + found + chance.choice(values).encode() + (b", " + after.partition(b", ")[2] if found else b"")
    new = chance.choice((changed, changed, raw.change(chance, head)))
    if chance.random() < 0.7:
        new = new.rstrip() + b"\n"
    version = chance.choice((content[6:8], content[6:8], b"\2\0", b"\3\0", b"\0\0"))
    width = 2 if version[0] < 2 else 4
    return content[:6] + version + len(new).to_bytes(4, "little")[:width] + new + body


def _array(chance: Random, array: NDArray[Any]) -> NDArray[Any]:
    kind = chance.choice(("type", "type", "scale", "value", "value", "shape", "rows", "constant", "order"))
    if kind == "type" or array.dtype.kind not in "fiub" or not array.size:
        return _cast(array, chance.choice(TYPES))
    with np.errstate(all="ignore"):
        if kind == "scale":
            return (array * chance.choice((0.5, 2.0, 10.0, 1e3, -1.0, 1e30, 1e-30, 0.0))).astype(array.dtype)
        if kind == "value":
            array.reshape(-1)[chance.randrange(array.size) :: chance.choice((array.size, 7, 1))] = _fitting(
                chance, array
            )
        elif kind == "constant":
            array[...] = _fitting(chance, array)
    if kind == "shape":
        return array.reshape(chance.choice(((-1,), (1, *array.shape), (*array.shape, 1), array.shape[::-1])))
    if kind == "rows":
        rows = np.atleast_1d(array)
        return chance.choice((rows[:0], rows[:1], rows[:-1], rows[::-1], np.concatenate([rows, rows]), rows.T))
    return np.asfortranarray(array) if kind == "order" else array


def _fitting(chance: Random, array: NDArray[Any]) -> Any:
    """Return a value that the array can hold."""
    if array.dtype.kind == "f":
        return array.dtype.type(chance.choice(VALUES))
    limits = (0, 1) if array.dtype.kind == "b" else (np.iinfo(array.dtype).min, np.iinfo(array.dtype).max, 0, 1)
    return array.dtype.type(chance.choice(limits))


def _cast(array: NDArray[Any], descr: str) -> NDArray[Any]:
    with np.errstate(all="ignore"):
        try:
            return (array.real if array.dtype.kind == "c" else array).astype(descr)
        except (TypeError, ValueError):
            return np.zeros(array.shape, descr)
