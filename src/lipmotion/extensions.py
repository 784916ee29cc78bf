"""Registries of extensions: engines, faces, motion formats and more that installed packages add.

A package declares extensions as Python entry points in its ``pyproject.toml``: for instance, in the table
``[project.entry-points."lipmotion.engines"]``, ``ridge = "my_package:RidgeEngine"``. When the package is installed,
the name can be used wherever the name of a built-in engine can be used.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module, metadata
from pathlib import Path
from traceback import walk_tb
from typing import Any, Generic, TypeVar

from lipmotion.errors import InputError

ExtensionT = TypeVar("ExtensionT")
GROUPS = (
    *("lipmotion.engines", "lipmotion.faces", "lipmotion.exporters", "lipmotion.corpus_readers"),
    *("lipmotion.outputs", "lipmotion.predictors", "lipmotion.trackers", "lipmotion.motion_readers"),
    *("lipmotion.live", "lipmotion.verbs", "lipmotion.names"),
)
"""Every group of entry points that is read."""
PACKAGE = "lipmotion"
OWN = {PACKAGE, "lipmotion_faces", "lipmotion_studio", "lipmotion_lab", "argparse"}
SOURCE = "source"  # what stands for the version where lipmotion is not installed


def find_version() -> str:
    """Return the version of lipmotion; ``source`` where it is not installed."""
    try:
        return metadata.version(PACKAGE)
    except metadata.PackageNotFoundError:
        return SOURCE


def install_command(extra: str) -> str:
    """Return the command that installs an extra of lipmotion, as a shell takes it.

    It names the folder or wheel that lipmotion was installed from, as pip has recorded it (PEP 610), or runs in, where
    that is there: an index need not have lipmotion.
    """
    import json
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    try:
        record = metadata.distribution(PACKAGE).read_text("direct_url.json") or "{}"
        url = urlsplit(json.loads(record).get("url", ""))
        origin = url2pathname(url.path) if url.scheme == "file" else ""
        is_there = origin and Path(origin).exists()
    except metadata.PackageNotFoundError:
        origin = str(Path(__file__).parents[2])
        is_there = (Path(origin) / "pyproject.toml").is_file()
    return f'pip install "{origin if is_there else PACKAGE}[{extra}]"'


@dataclass(frozen=True)
class Registry(Generic[ExtensionT]):
    """Extensions of one kind by name: built-in ones, and those of installed packages.

    kind     : the word for such an extension in messages: ``engine``, for instance
    group    : the group of the entry points: ``lipmotion.engines``, for instance
    built_in : ``module:attribute`` of each built-in extension, by name; a package cannot replace it, nor what this
               distribution itself declares as entry points (faces, studio, lab)
    base     : extensions are classes of it, if it is given; ``named``: their attribute ``name`` is the name
    """

    kind: str
    group: str
    built_in: Mapping[str, str]
    base: type[Any] | None = None
    named: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """All names: first those of this distribution, then those of installed packages in alphabetical order."""
        listed = dict.fromkeys((*self.built_in, *self._own))
        return (*listed, *sorted(set(self._installed) - set(listed)))

    def load(self, name: str) -> ExtensionT:
        """Import an extension and return it; what it prints while it loads goes to standard error.

        Raises InputError: none has this name, the package that adds it cannot be imported, or it is of another kind.
        """
        if name in self.built_in:
            module, _, attribute = self.built_in[name].partition(":")
            loaded: ExtensionT = getattr(import_module(module), attribute)
        elif name in self._own:
            loaded = self._own[name].load()
        elif name not in self._installed:
            raise InputError(f"no {self.kind} {name!r}; there are: {', '.join(self.names)}")
        else:
            entry = self._installed[name]
            try:
                with redirect_stdout(sys.stderr):
                    loaded = entry.load()
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # also sys.exit(), which would end the program without a word
                what = f"the {self.kind} {name!r} cannot be imported from the {_locate(entry)}: {_describe(error)};"
                raise InputError(f"{what} install a version that works with this lipmotion, or remove it") from error
        if self.base is not None:
            fits = isinstance(loaded, type) and issubclass(loaded, self.base)
            if not fits or (self.named and getattr(loaded, "name", "") != name):
                required = f"a class of {self.base.__name__}{' of this name' * self.named}"
                raise InputError(f"the {self.kind} {name!r} of an installed package is {loaded!r}, required {required}")
        return loaded

    @cached_property
    def _own(self) -> Mapping[str, metadata.EntryPoint]:
        """Those of the packages beside the core, in this distribution; they are found without a look at others."""
        try:
            entries = metadata.distribution(PACKAGE).entry_points
        except metadata.PackageNotFoundError:
            return {}
        return {entry.name: entry for entry in entries if entry.group == self.group}

    @cached_property
    def _installed(self) -> Mapping[str, metadata.EntryPoint]:
        return {entry.name: entry for entry in _entries(self.group)}


def load_provided(name: str) -> Any:
    """Return what a package beside the core (faces, studio, lab) provides by a name, as ``shown_face``.

    They declare such names as entry points of the group ``lipmotion.names``; the core imports none of them itself.
    Raises InputError: no package that is installed provides it.
    """
    return NAMES.load(name)


NAMES: Registry[Any] = Registry("name", "lipmotion.names", {})


def describe_failed_extension(error: BaseException) -> str | None:
    """Return a message for an error that came out of the code of an extension; None: it did not.

    An extension is recognised by the first part of its module's name.
    """
    frames = [
        (str(frame.f_globals.get("__name__")).partition(".")[0], frame.f_code.co_filename, line)
        for frame, line in walk_tb(error.__traceback__)
    ]
    modules = {module for module, _, _ in frames} - OWN
    for entry in (entry for group in GROUPS if modules for entry in _entries(group)):
        package = entry.value.partition(":")[0].partition(".")[0].strip()
        if package in modules:
            _, file, line = next(frame for frame in reversed(frames) if frame[0] == package)
            what = f"the {_locate(entry)} failed: {_describe(error)} ({file}, line {line})"
            return f"{what}; tell its authors, or remove it"
    return None


def _entries(group: str) -> Iterator[metadata.EntryPoint]:
    """Yield the entry points of a group. Raises InputError: those of a package cannot be read."""
    try:
        yield from metadata.entry_points(group=group)
    except Exception as error:  # what importlib says does not name the package
        for distribution in metadata.distributions():
            try:
                list(distribution.entry_points)
            except Exception as reason:
                what = f"entry_points.txt of the package {distribution.metadata['Name']!r} cannot be read"
                raise InputError(f"{what}: {_describe(reason)}; install the package again, or remove it") from error
        raise


def _locate(entry: metadata.EntryPoint) -> str:
    """Return what tells an entry point from all others: its package, its name and its value."""
    package = "" if entry.dist is None else f" {entry.dist.metadata['Name']!r}"
    return f"package{package} (entry point {entry.name} = {entry.value} of {entry.group})"


def _describe(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
