"""The text form of USD (``.usda``): prims, names, and values of attributes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError, shorten
from lipmotion.printable import is_line
from lipmotion.storage.files import as_text

INDENT = "    "
_CONTROL = re.compile("[\x00-\x1f\x7f]")


def prim(schema: str, name: str, inside: Iterable[str], *, schemas: Sequence[str] = (), **about: str) -> Iterator[str]:
    """Yield the lines of a prim.

    schema  : ``Mesh``, for instance
    name    : as of ``prim_names``
    inside  : the lines of its attributes and of its own prims
    schemas : API schemas that are applied to it
    about   : further metadata, as ``kind``

    >>> print("\\n".join(prim("Scope", "Looks", ["token purpose"], kind="group")))
    def Scope "Looks" (
        kind = "group"
    )
    {
        token purpose
    }
    """
    lines = [f'{INDENT}{key} = "{value}"' for key, value in about.items()]
    if schemas:
        lines.insert(0, f"{INDENT}prepend apiSchemas = {tokens(schemas)}")
    yield f'def {schema} "{name}"' + (" (" if lines else "")
    if lines:
        yield from (*lines, ")")
    yield "{"
    yield from (INDENT + line for line in inside)
    yield "}"


def prim_names(names: Iterable[str]) -> list[str]:
    """Return names of letters, digits and low lines, as prims need them, none twice.

    >>> prim_names(["mouthSmile_L", "head.mouthSmile_L", "head mouthSmile_L", "2"])
    ['mouthSmile_L', 'head_mouthSmile_L', 'head_mouthSmile_L_2', '_2']
    """
    taken: dict[str, None] = {}
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name) or "part"
        plain = f"_{plain}" if plain[0].isdigit() else plain
        number, found = 1, plain
        while found in taken:
            number += 1
            found = f"{plain}_{number}"
        taken[found] = None
    return list(taken)


def tokens(names: Iterable[str]) -> str:
    """Return names as an array of tokens; control characters are escaped, surrogates as in Python.

    >>> print(tokens(['a"b', "c\\nd"]))
    ["a\\"b", "c\\x0ad"]
    """
    escaped = (as_text(name).replace("\\", "\\\\").replace('"', '\\"') for name in names)
    return "[" + ", ".join(f'"{_CONTROL.sub(_hexadecimal, name)}"' for name in escaped) + "]"


def _hexadecimal(found: re.Match[str]) -> str:
    return f"\\x{ord(found[0]):02x}"


def asset(path: str) -> str:
    """Return a path from the folder of the file, with slashes, as a reference to a file.

    Raises ExportError: a name with a line end or another control character, which USD cannot refer to.

    >>> asset("welcome.flac"), asset("../a@b.wav"), asset("a@@@b.wav")
    ('@./welcome.flac@', '@@@../a@b.wav@@@', '@@@./a\\\\@@@b.wav@@@')
    """
    if not is_line(path):
        raise ExportError(f"the name {shorten(path)!r} has a character that .usda cannot refer to; rename the file")
    mark = "@@@" if "@" in path else "@"
    absolute = path.startswith(("/", "../")) or ":" in path
    return mark + ("" if absolute else "./") + path.replace("@@@", "\\@@@") + mark


def whole(values: NDArray[Any]) -> str:
    """Return whole numbers as an array [shape=(N,)]."""
    return "[" + ", ".join(map(str, values.tolist())) + "]"


def numbers(values: NDArray[np.floating[Any]]) -> str:
    """Return numbers as an array [shape=(N,)], with seven digits, as single precision has."""
    return "[" + ", ".join([f"{value:.7g}" for value in (values + 0.0).tolist()]) + "]"


def triple(values: NDArray[np.floating[Any]]) -> str:
    """Return numbers as one tuple [shape=(N,)]."""
    return "(" + ", ".join([f"{value:.7g}" for value in (values + 0.0).tolist()]) + ")"


def rows_of(values: NDArray[np.floating[Any]]) -> str:
    """Return rows of three numbers as an array of tuples [shape=(N, 3)]."""
    return "[" + ", ".join([f"({x:.7g}, {y:.7g}, {z:.7g})" for x, y, z in (values + 0.0).tolist()]) + "]"


def matrix(values: NDArray[np.floating[Any]]) -> str:
    """Return a matrix [shape=(4, 4)], its rows one after another; USD multiplies rows from the left."""
    return "( " + ", ".join(triple(row) for row in values) + " )"
