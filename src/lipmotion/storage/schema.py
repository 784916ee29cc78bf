"""Schemas of stored arrays: tables of specifications, by which arrays are checked and converted."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ModelFormatError

Arrays = Mapping[str, NDArray[Any]]
POSITIVE, NEGATIVE, BELOW_ONE = 5e-324, -5e-324, math.nextafter(1, 0)
"""The least number over 0, the largest under 0, the largest under 1: limits of ranges that exclude 0 or 1."""
LARGEST_NUMBER = 1e30  # no number of a model is larger, whatever its unit
LARGEST_MEAN = 500.0
"""No mean of standardised values is larger: none of N numbers is more than √N deviations from the mean of all."""
LARGEST_VARIANCE = 1e6  # no variance of standardised values is larger; a component that is switched off has 1
_KINDS = {"f": "fractions", "i": "whole numbers", "U": "texts", "b": "truth values", "u": "whole numbers from 0"}
_SPELLED = {POSITIVE: "more than 0", NEGATIVE: "less than 0", BELOW_ONE: "less than 1"}


@dataclass(frozen=True)
class ArraySpec:
    """The specification of one stored array.

    dtype    : its type after reading; it may be stored in another precision, but not as another kind of number
    shape    : sizes, as "L 3 Q": a letter is one size throughout a table; a lower-case letter may be 0; "" is one value
    minimum, maximum : limits, included; values are infinite only if a limit is
    optional : whether it may be missing
    whole    : whether fractions may be stored as whole numbers
    """

    dtype: type[Any]
    shape: str
    minimum: float = -LARGEST_NUMBER
    maximum: float = LARGEST_NUMBER
    optional: bool = False
    whole: bool = False

    @property
    def kinds(self) -> str:
        """The kinds of NumPy types that it may be stored as."""
        kind = np.dtype(self.dtype).kind
        return kind + "iu" if kind == "f" and self.whole else "iu" if kind == "i" else kind


@dataclass(frozen=True, eq=False)
class CheckedArrays:
    """Arrays that satisfy their table, and the size of each letter in it."""

    arrays: dict[str, NDArray[Any]]
    sizes: dict[str, int]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return one array. Raises KeyError: an optional one that is missing."""
        return self.arrays[name]


@contextmanager
def format_errors(what: str, remedy: str = "train or download it again", *, verb: str = "is") -> Iterator[None]:
    """Turn errors of damaged arrays into a ModelFormatError; ``remedy``: what the user can do; ``verb``: is or are."""
    try:
        yield
    except (KeyError, ValueError, IndexError, TypeError, OverflowError) as error:
        raise ModelFormatError(f"{what} {verb} damaged ({error}); {remedy}") from error


def check_arrays(arrays: Arrays, table: Mapping[str, ArraySpec], **sizes: int) -> CheckedArrays:
    """Return the arrays of a table, in its types; other arrays are ignored (see ``refuse_undeclared``).

    sizes : of letters that are known before
    Raises ValueError: an array of another kind of number, of another shape or out of its range. KeyError: one is
    missing.
    """
    sizes = check_sizes(arrays, table, **sizes)
    with np.errstate(over="ignore"):
        values = {name: arrays[name].astype(member.dtype) for name, member in table.items() if name in arrays}
    return CheckedArrays(values, sizes)


def check_sizes(arrays: Arrays, table: Mapping[str, ArraySpec], **sizes: int) -> dict[str, int]:
    """Return the size of each letter of a table. Raises as ``check_arrays``."""
    for name, member in table.items():
        if name not in arrays and not member.optional:
            raise KeyError(f"{name} is missing")
        if name in arrays:
            array = arrays[name]
            if array.dtype.kind not in member.kinds or (array.dtype.kind != "U" and array.dtype.itemsize > 8):
                raise ValueError(f"{name} holds {array.dtype}, required {_KINDS[np.dtype(member.dtype).kind]}")
            letters = member.shape.split()
            known = dict(zip(letters, array.shape, strict=False))
            known |= {letter: size for letter, size in sizes.items() if letter in known}
            known |= {letter: int(letter) for letter in letters if letter.isdigit()}
            if array.shape != tuple(known.get(letter, 0) for letter in letters):
                required = ", ".join(str(sizes.get(letter, letter)) for letter in letters) + "," * (len(letters) == 1)
                raise ValueError(f"{name} of shape {array.shape}, required ({required})")
            if any(not size and letter.isupper() for letter, size in known.items()):
                raise ValueError(f"{name} of shape {array.shape}, required at least one of each")
            sizes |= {letter: size for letter, size in known.items() if not letter.isdigit()}
            _check_range(name, array, member)
    return sizes


def _check_range(name: str, array: NDArray[Any], member: ArraySpec) -> None:
    if not array.size or array.dtype.kind in "Ub":
        return
    values = array.astype(np.float32) if array.dtype == np.float16 else array  # half precision is slow to compare
    low, high = float(values.min()), float(values.max())
    if not (member.minimum == -math.inf or math.isfinite(low)) or not math.isfinite(high):
        raise ValueError(f"{name} holds values that are not finite")
    if not member.minimum <= low <= high <= member.maximum:
        least, most = (_SPELLED.get(end, f"{end:g}") for end in (member.minimum, member.maximum))
        raise ValueError(f"{name} holds {low:g} to {high:g}, required {least} to {most}")


def refuse_undeclared(arrays: Iterable[str], *names: Iterable[str]) -> None:
    """Raise ValueError if an array is in none of some tables, or lists of names."""
    unknown = sorted(set(arrays).difference(*names))
    if unknown:
        raise ValueError(f"undeclared {unknown[0]!r}")


def check_index(name: str, numbers: NDArray[Any], count: int) -> None:
    """Raise ValueError unless all numbers are from 0 to ``count`` - 1."""
    if len(numbers) and not 0 <= numbers.min() <= numbers.max() < count:
        raise ValueError(f"{name} is {numbers.min()} to {numbers.max()}, required 0 to {count - 1}")


def select_arrays(arrays: Arrays, prefix: str) -> dict[str, NDArray[Any]]:
    """Return the arrays whose names begin with a prefix, by their names without it."""
    return {name[len(prefix) :]: array for name, array in arrays.items() if name.startswith(prefix)}
