"""What installed packages add: engines, faces, motion formats and corpus readers, through Python entry points.

A package declares in its ``pyproject.toml``, for instance, ``[project.entry-points."lipmotion.engines"]`` with
``ridge = "my_package:RidgeEngine"``; once it is installed, the name works wherever a built-in one does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module, metadata
from typing import Generic, TypeVar

from lipmotion.errors import InputError

ExtensionT = TypeVar("ExtensionT")


@dataclass(frozen=True)
class Registry(Generic[ExtensionT]):
    """Extensions of one kind by name: the built-in ones, then those of installed packages.

    kind     : what one of them is called in messages, as ``engine``
    group    : the group of entry points that packages use, as ``lipmotion.engines``
    built_in : name to ``module:attribute``; a package cannot replace them
    """

    kind: str
    group: str
    built_in: Mapping[str, str]

    @property
    def names(self) -> tuple[str, ...]:
        """All names: built-in ones in their order, then those of installed packages in alphabetical order."""
        return (*self.built_in, *sorted(set(self._installed) - set(self.built_in)))

    def load(self, name: str) -> ExtensionT:
        """Import and return an extension.

        Raises InputError: there is none of that name, or the package that adds it cannot be imported.
        """
        if name in self.built_in:
            module, _, attribute = self.built_in[name].partition(":")
            found: ExtensionT = getattr(import_module(module), attribute)
            return found
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
