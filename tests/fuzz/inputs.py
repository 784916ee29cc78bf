"""What is fuzzed: files, who reads them, and the good ones that all begins with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

Files = dict[str, bytes]
"""One input: contents by name; a name may have folders in it."""


class ImplausibleError(AssertionError):
    """What was read, or made of it, cannot be."""


@dataclass(frozen=True)
class Good:
    """Good things to read bad ones with.

    corpus : a prepared corpus
    models : trained on it; the first one is of the default engine
    """

    corpus: Path
    models: tuple[Path, ...]


@dataclass(frozen=True)
class Reader:
    """A reader of the package.

    seeds : good inputs
    read  : reads the files of a folder, and looks at what came of it
    """

    name: str
    seeds: Callable[[Good], list[Files]]
    read: Callable[[Path, Good], None]


def digest(files: Files) -> bytes:
    """Return what tells one input from another."""
    found = sha256()
    for name, content in sorted(files.items()):
        found.update(f"{len(name)} {name} {len(content)} ".encode("utf-8", "surrogatepass") + content)
    return found.digest()


def lay_out(files: Files, folder: Path) -> None:
    """Write an input into a folder that is empty."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def picked_up(folder: Path) -> Files:
    """Return all files of a folder."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
