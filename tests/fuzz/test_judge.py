from __future__ import annotations

import warnings
from functools import partial
from pathlib import Path

import pytest

from fuzz import judge
from fuzz.inputs import Files, Good, Reader
from fuzz.judge import ERROR, MEMORY, REFUSED, Result, read_result
from fuzz.planted import seeds
from lipmotion.errors import InputError

NOWHERE = Good(Path("nowhere"), ())
FILES: Files = {"a.txt": b"x"}


def read_with(error: Exception, folder: Path) -> Result:
    def read(*_: object) -> None:
        raise error

    return read_result(Reader("planted", seeds, read), FILES, folder / "bad", NOWHERE)


def test_a_message_that_is_no_short_printable_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for line, kind in {"short": REFUSED, "x" * 5000: ERROR, "a\nb": ERROR, "\x1b[2J": ERROR, "\x9b2J": ERROR}.items():
        monkeypatch.setattr(judge, "outcome", partial(_told, line))
        assert read_with(InputError("anything"), tmp_path).kind == kind
    assert list(tmp_path.iterdir()) == []


def _told(line: str, _: object) -> tuple[int, str]:
    return 3, line


def test_messages_are_alike_whatever_they_quote(tmp_path: Path) -> None:
    found = {read_with(InputError(f"{path}: line {n} is {path!r}"), tmp_path).where for n, path in enumerate("ab")}
    assert len(found) == 2  # a name without a folder is a word
    assert len({read_with(InputError(f"/x/{n}: line {n} is 'x{n}'"), tmp_path).where for n in range(3)}) == 1


def test_memory_and_warnings_are_defects(tmp_path: Path) -> None:
    def warn(*_: object) -> None:
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)

    assert read_with(MemoryError("no room"), tmp_path).kind == MEMORY
    assert read_result(Reader("planted", seeds, warn), FILES, tmp_path / "bad", NOWHERE).kind == ERROR
