"""The packages that lipmotion declares: its own metadata is read, so that they are listed in one place only.

Of the language of requirements (Python packaging, dependency specifiers) what the metadata uses is understood: one
name, versions of whole numbers, and markers of comparisons, ``and`` and ``or``.
"""

from __future__ import annotations

import ast
import operator
import os
import platform
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

EXTRA = re.compile(r"\s*(?:\band\b)?\s*extra == '([\w-]+)'")
REQUIREMENT = re.compile(r"\s*([\w.-]+)\s*((?:\(?[<>=!][^;@]*)?)\s*(?:;\s*(.*))?")
SPECIFIER = re.compile(r"(==|>=|<=|!=|<|>)\s*([\w.]+)")
COMPARISONS: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}
_OF_NODES: Mapping[type, str] = {ast.Eq: "==", ast.NotEq: "!=", ast.GtE: ">=", ast.LtE: "<=", ast.Gt: ">", ast.Lt: "<"}


@dataclass(frozen=True)
class Requirement:
    """A package that lipmotion declares.

    name     : of the package
    versions : that are required, as ``>=2.1``
    marker   : the condition of the Python and the system under which it is required; empty: none
    extra    : the extra that it belongs to; empty: it is always required
    """

    name: str
    versions: str
    marker: str = ""
    extra: str = ""

    @property
    def applies(self) -> bool:
        """Whether this Python and this system have it."""
        return not self.marker or _holds(ast.parse(self.marker, mode="eval").body)

    @property
    def installed(self) -> str:
        """The installed version; empty: it is not installed."""
        try:
            return metadata.version(self.name)
        except metadata.PackageNotFoundError:
            return ""

    @property
    def is_met(self) -> bool:
        """Whether a version is installed that is required."""
        found = _numbers(self.installed)
        return bool(found) and all(
            COMPARISONS[sign](found, _numbers(version)) for sign, version in SPECIFIER.findall(self.versions)
        )


def requirement(text: str) -> Requirement:
    """Return a requirement from its text in the metadata of a package: ``NAME>=1 ; MARKER``."""
    found = REQUIREMENT.fullmatch(text)
    if found is None:
        raise ValueError(f"not a requirement: {text!r}")
    name, versions, marker = found[1], found[2].strip("() "), found[3] or ""
    extra = EXTRA.search(marker)
    return Requirement(name, versions, EXTRA.sub("", marker).strip(), extra[1] if extra else "")


def declared_requirements() -> tuple[Requirement, ...]:
    """Return all requirements of the installed lipmotion; none where it runs from its sources, without metadata."""
    try:
        return tuple(map(requirement, metadata.requires("lipmotion") or ()))
    except metadata.PackageNotFoundError:
        return ()


def _numbers(version: str) -> tuple[int, ...]:
    """Return the whole numbers of a version, zeros at its end left out, so that 2.1 is 2.1.0."""
    numbers = [int(part) for part in re.match(r"[\d.]*", version)[0].split(".") if part]  # type: ignore[index] # matches
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)


def _holds(node: ast.expr) -> bool:
    """Return whether a marker holds here."""
    if isinstance(node, ast.BoolOp):
        return (all if isinstance(node.op, ast.And) else any)(map(_holds, node.values))
    if not isinstance(node, ast.Compare):
        raise ValueError(f"not a comparison: {ast.unparse(node)}")
    here = {
        "python_version": "{}.{}".format(*sys.version_info),
        "python_full_version": platform.python_version(),
        "sys_platform": sys.platform,
        "platform_machine": platform.machine(),
        "platform_system": platform.system(),
        "os_name": os.name,
    }
    sides = (node.left, node.comparators[0])
    one, other = (here[side.id] if isinstance(side, ast.Name) else ast.literal_eval(side) for side in sides)
    compare = COMPARISONS[_OF_NODES[type(node.ops[0])]]
    is_version = any(isinstance(side, ast.Name) and "version" in side.id for side in sides)
    return compare(_numbers(one), _numbers(other)) if is_version else compare(one, other)
