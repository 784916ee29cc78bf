"""Files and folders on a command line: every argument says whether it is read or written, before all work."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lipmotion.storage.files import work_folder
from lipmotion.storage.sources import Source, check_apart, is_folder


@dataclass(frozen=True)
class Reads:
    """An argument that names what is read.

    name        : of the option in the namespace
    what        : what it is, in a word
    replaceable : read whole before anything is written
    is_text     : may be a text instead, or a name that means something: then a folder of that name is not meant
    otherwise   : gives what is read where the argument is left out
    """

    name: str
    what: str
    replaceable: bool
    is_text: bool
    otherwise: Callable[[], Path] | None


@dataclass(frozen=True)
class Writes:
    """An argument that names what is written.

    is_folder : a folder that is filled, not a file
    keeps     : what is finished is kept in a folder beside it (``files.unfinished_work``)
    """

    name: str
    is_folder: bool
    keeps: bool


def add_input(
    parser: argparse.ArgumentParser,
    *names: str,
    what: str,
    replaceable: bool = False,
    otherwise: Callable[[], Path] | None = None,
    **more: Any,
) -> None:
    """Add an argument that names a file or a folder to read; the rest as ``add_argument``."""
    action = parser.add_argument(*names, **({"type": Path} | more))
    _declare(parser, "reads", Reads(action.dest, what, replaceable, action.type is str, otherwise))


def add_output(
    parser: argparse.ArgumentParser,
    *names: str,
    is_folder: bool = False,
    keeps: bool = False,
    force: bool = False,
    **more: Any,
) -> None:
    """Add an argument that names a file or a folder to write, and with ``force`` that option; the rest as there."""
    action = parser.add_argument(*names, **({"type": Path} | more))
    _declare(parser, "writes", Writes(action.dest, is_folder, keeps))
    if force:
        explained = "let an output replace a text, units or model file that is read; never a recording or a corpus"
        parser.add_argument("--force", action="store_true", help=explained)


def check_paths(options: argparse.Namespace) -> None:
    """Raise ExportError if a command would write what it reads."""
    declared: tuple[Writes, ...] = getattr(options, "writes", ())
    written = [(one, path) for one in declared for path in _paths(getattr(options, one.name))]
    if written:
        folders = [path for one, path in written if one.is_folder]
        folders += [work_folder(path) for one, path in written if one.keeps]
        files = [path for one, path in written if not one.is_folder]
        check_apart(files, _sources(options), folders=folders, force=getattr(options, "force", False))


def _sources(options: argparse.Namespace) -> Iterator[Source]:
    for one in options.reads:
        found = _paths(getattr(options, one.name)) or ([one.otherwise()] if one.otherwise else [])
        meant = [path for path in found if not (one.is_text and is_folder(path))]
        yield from (Source(path, one.what, one.replaceable) for path in meant)


def _paths(value: Any) -> list[Path]:
    """Return the paths of an argument; a text that can be no name is none of a file."""
    given = value if isinstance(value, list) else [value]
    return [Path(one) for one in given if one is not None]


def _declare(parser: argparse.ArgumentParser, kind: str, one: Reads | Writes) -> None:
    parser.set_defaults(**{kind: (*(parser.get_default(kind) or ()), one)})
