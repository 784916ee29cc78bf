"""Inputs of the fuzzer, the readers that are fuzzed, and the good inputs from which all others are made."""

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

Files = dict[str, bytes]
"""One input: contents of files by name; a name may include folders."""


class ImplausibleError(AssertionError):
    """A reader accepted an input, but its result is implausible."""


@dataclass(frozen=True)
class Good:
    """A good corpus and good models, which readers of other inputs need.

    corpus : a prepared corpus
    models : trained on it; the first one is of the default engine
    """

    corpus: Path
    models: tuple[Path, ...]


@dataclass(frozen=True)
class Reader:
    """A reader of the package.

    seeds : returns good inputs
    read  : reads the files of a folder, and checks the result
    """

    name: str
    seeds: Callable[[Good], list[Files]]
    read: Callable[[Path, Good], None]


def digest(files: Files) -> bytes:
    found = sha256()
    for name, content in sorted(files.items()):
        found.update(f"{len(name)} {name} {len(content)} ".encode("utf-8", "surrogatepass") + content)
    return found.digest()


def lay_out(files: Files, folder: Path) -> None:
    """Write the files of an input into an empty folder."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def picked_up(folder: Path) -> Files:
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
