"""What the file of a character may hold and cost: a hostile or mistaken file must not fill the memory.

docs/meshes.md states the same table.
"""

from __future__ import annotations

from codecs import BOM_UTF8
from collections import Counter
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.storage.sources import check_source, read_shipped_table

_ROWS = read_shipped_table("lipmotion_faces.characters", "file_limits.csv")
ALLOWANCE = {row["what"]: int(row["most"]) for row in _ROWS}
"""The most that one character may have, all of its files, nodes and parts together."""
MAX_VERTICES = ALLOWANCE["vertices"]


class Budget:
    """What the files of one character add up to so far."""

    def __init__(self) -> None:
        self._spent: Counter[str] = Counter()

    def spend(self, what: str, count: int) -> None:
        """Count something before it is made. Raises InputError: more of it than ``ALLOWANCE``."""
        self._spent[what] += count
        if self._spent[what] > ALLOWANCE[what]:
            raise InputError(
                f"{self._spent[what]} {what}, required at most {ALLOWANCE[what]}; reduce the mesh, or pictures"
            )

    def read_bytes(self, path: Path, kind: str) -> bytes:
        """Return the content of a file, which counts. Raises InputError: no file, empty, too large, unreadable."""
        check_source(path, kind)
        size = path.stat().st_size
        try:
            self.spend("bytes of files", size)
            with path.open("rb") as file:
                return file.read(size).removeprefix(BOM_UTF8)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
