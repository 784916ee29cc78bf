"""Registries of extensions: engines, faces, motion formats and corpus readers that installed packages add.

A package declares extensions as Python entry points in its ``pyproject.toml``: for instance, in the table
``[project.entry-points."lipmotion.engines"]``, ``ridge = "my_package:RidgeEngine"``. When the package is installed,
the name can be used wherever the name of a built-in engine can be used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module, metadata
from typing import Generic, TypeVar

from lipmotion.errors import InputError

ExtensionT = TypeVar("ExtensionT")
SOURCE = "source"
"""What stands for the version where lipmotion is not installed."""


def installed_version() -> str:
    """Return the version of lipmotion; ``source`` where it is not installed."""
    try:
        return metadata.version("lipmotion")
    except metadata.PackageNotFoundError:
        return SOURCE


@dataclass(frozen=True)
class Registry(Generic[ExtensionT]):
    """Extensions of one kind by name: built-in ones, and those of installed packages.

    kind     : the word for such an extension in messages: ``engine``, for instance
    group    : the group of the entry points: ``lipmotion.engines``, for instance
    built_in : ``module:attribute`` of each built-in extension, by name; a package cannot replace it
    """

    kind: str
    group: str
    built_in: Mapping[str, str]

    @property
    def names(self) -> tuple[str, ...]:
        """All names: first the built-in ones, then those of installed packages in alphabetical order."""
        return (*self.built_in, *sorted(set(self._installed) - set(self.built_in)))

    def load(self, name: str) -> ExtensionT:
        """Import an extension and return it.

        Raises InputError: no extension has this name, or the package that adds it cannot be imported.
        """
        if name in self.built_in:
            module, _, attribute = self.built_in[name].partition(":")
            extension: ExtensionT = getattr(import_module(module), attribute)
            return extension
        if name not in self._installed:
            raise InputError(f"no {self.kind} {name!r}; there are: {', '.join(self.names)}")
        entry = self._installed[name]
        try:
            added: ExtensionT = entry.load()
        except Exception as error:
            package = entry.dist.name if entry.dist is not None else entry.module
            raise InputError(
                f"the {self.kind} {name!r} of the package {package!r} cannot be imported: {error}; install a version "
                "of the package that works with this lipmotion, or remove it"
            ) from error
        return added

    @cached_property
    def _installed(self) -> Mapping[str, metadata.EntryPoint]:
        return {entry.name: entry for entry in metadata.entry_points(group=self.group)}
