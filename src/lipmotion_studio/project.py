"""Projects as values: the lines that are worked on, what was decided of them, and what was exported."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import partial
from hashlib import sha256
from typing import Any

from lipmotion.errors import InputError, shorten
from lipmotion.extensions import installed_version
from lipmotion.pipeline.batch.lines import BatchLine, check_names
from lipmotion.types.values import (
    SchemaError,
    any_members,
    described,
    items,
    members,
    number,
    one_of,
    optional,
    path,
    text,
    tupled,
    value_of,
    whole,
)

FORMAT, VERSION = "lipmotion.project", 1
NO_MARK, APPROVED, REDO = MARKS = ("none", "approved", "redo")
MAX_LINES, LONGEST_TEXT = 100_000, 1 << 24
MOST_VERSIONS = 100
"""Versions that are kept of a line."""
EDITS_SUFFIX = "edits.json"
"""How files of edits end, after the name of the line and a dot."""


@dataclass(frozen=True)
class ExportRecord:
    """What was exported of a line.

    preset  : the preset that was used; empty: files were chosen
    files   : digest of each file (SHA-256), by its path from the folder of the project
    edits   : path of the file of edits that the files were made from: a copy, which gives the same files again
    steps   : digest of the edits as they were
    model   : digest of the model
    version : of lipmotion
    """

    preset: str
    files: Mapping[str, str]
    edits: str
    steps: str
    model: str
    version: str


@dataclass(frozen=True)
class KeptVersion:
    """Edits of a line as they once were, to compare with and to go back to.

    number : of the version, unique in its line, from 1
    steps  : its edits, as sentences
    """

    number: int
    steps: tuple[str, ...]

    @property
    def name(self) -> str:
        """What requests call it."""
        return f"version-{self.number}"

    @property
    def digest(self) -> str:
        """The digest of its edits."""
        return digest_of(self.steps)


@dataclass(frozen=True)
class ProjectLine:
    """A recording that is worked on.

    number     : of the line in the project; never used again
    name       : path of its files without suffix, with ``/`` between folders; unique
    sound      : path of the recording from the folder of the project, or absolute
    sha256     : digest of the recording; empty: of an earlier version's project, until the line is opened
    transcript : its words, where they were given here; empty: those of a file beside it, or it is recognised
    duration_s : of the sound; None: not known yet
    doubt      : how unsure the motion of its speech is, 0 to 1; None: not known yet
    mark       : one of ``MARKS``
    marked     : digest of the edits when it was marked; empty: not known
    exports    : in their order
    versions   : that were kept, in their order
    """

    number: int
    name: str
    sound: str
    sha256: str
    transcript: str = ""
    duration_s: float | None = None
    doubt: float | None = None
    mark: str = NO_MARK
    marked: str = ""
    exports: tuple[ExportRecord, ...] = ()
    versions: tuple[KeptVersion, ...] = ()

    def __post_init__(self) -> None:
        if self.mark not in MARKS:
            raise InputError(f"the mark is {shorten(repr(self.mark))}, required one of: {', '.join(MARKS)}")

    def with_version(self, steps: tuple[str, ...]) -> ProjectLine:
        """Return the line with a version of these edits; as it is, where there is one. Raises InputError: too many."""
        if any(version.steps == steps for version in self.versions):
            return self
        if len(self.versions) >= MOST_VERSIONS:
            raise InputError(f"{len(self.versions)} versions are kept, required fewer than {MOST_VERSIONS}; remove one")
        kept = KeptVersion(self.versions[-1].number + 1 if self.versions else 1, steps)
        return replace(self, versions=(*self.versions, kept))

    def without_version(self, name: str) -> ProjectLine:
        """Return the line without a version. Raises InputError: as ``version``."""
        gone = self.version(name)
        return replace(self, versions=tuple(version for version in self.versions if version != gone))

    def version(self, name: str) -> KeptVersion:
        """Return a version. Raises InputError: none of that name is kept."""
        for version in self.versions:
            if version.name == name:
                return version
        known = ", ".join(version.name for version in self.versions) or "nothing: none is kept"
        raise InputError(f"no version {shorten(repr(name))} of the line, required one of: {known}")


@dataclass(frozen=True)
class Project:
    """The lines that are worked on, by their numbers.

    model      : path of the model from the folder of the project; empty: the one that ships
    language, recogniser : of new lines, as of ``Request``
    preset     : that was used last for an export
    characters : paths of characters, by their names
    recordings : path of a folder of recordings that a voice or a face can be made of; empty: none
    given_model : path of the model that was used before one that was trained here; empty: the one that ships
    next_number : of the next line
    """

    lines: Mapping[int, ProjectLine] = field(default_factory=dict)
    model: str = ""
    language: str = "en"
    recogniser: str = "auto"
    preset: str = ""
    characters: Mapping[str, str] = field(default_factory=dict)
    recordings: str = ""
    given_model: str = ""
    next_number: int = 1

    def with_lines(self, lines: Sequence[ProjectLine]) -> Project:
        """Return the project with lines that are new, or in place of those of their numbers."""
        together = {**self.lines, **{line.number: line for line in lines}}
        return replace(self, lines=together, next_number=max([self.next_number, *(n.number + 1 for n in lines)]))

    def without_line(self, number: int) -> Project:
        """Return the project without a line."""
        return replace(self, lines={key: line for key, line in self.lines.items() if key != number})


def check_lines(project: Project) -> None:
    """Raise InputError or ExportError if two lines have one name, or one lies outside the folder of the project."""
    if len(project.lines) > MAX_LINES:
        raise InputError(f"{len(project.lines)} lines, required at most {MAX_LINES} in a project; divide it")
    check_names((BatchLine(line.name, line.sound) for line in project.lines.values()), (EDITS_SUFFIX,))


def project_document(project: Project) -> dict[str, Any]:
    """Return a project as an object of JSON."""
    rows = [_without_usual(line) for line in project.lines.values()]
    settings = {each.name: getattr(project, each.name) for each in fields(project) if each.name != "lines"}
    made_by = {"lipmotion": installed_version()}
    return {"format": FORMAT, "version": VERSION, "made_by": made_by, **settings, "lines": rows}


def _without_usual(line: ProjectLine) -> dict[str, Any]:
    usual = {each.name: each.default for each in fields(line)}
    values = {each.name: getattr(line, each.name) for each in fields(line)}
    kept = {name: value for name, value in values.items() if value != usual[name]}
    return kept | {name: [asdict(each) for each in kept[name]] for name in ("exports", "versions") if name in kept}


def project_from(content: Any) -> Project:
    """Return the project of an object of JSON. Raises InputError, ExportError: it is none, or of a later version."""
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f'not a project: required "format": "{FORMAT}"')
    if content.get("version") != VERSION:
        version = described(content.get("version"))
        raise InputError(f"a project of version {version}, required {VERSION}; update lipmotion")
    given = {name: value for name, value in content.items() if name not in ("format", "version", "made_by")}
    try:
        found = _PROJECT(given)
    except SchemaError as error:
        raise InputError(f"not a project that can be read ({error})") from error
    lines = found.pop("lines", [])
    if len({line.number for line in lines}) < len(lines):
        raise InputError("not a project that can be read (two lines of one number)")
    project = Project(**found).with_lines(lines)
    check_lines(project)
    return project


_TEXT, _STEPS, _NUMBERED = text(1000), tupled(items(text(LONGEST_TEXT))), whole(1, 1 << 53)
_EXPORT = {"files": any_members(_TEXT)} | dict.fromkeys(("preset", "edits", "steps", "model", "version"), _TEXT)
_VERSION = {"number": _NUMBERED, "steps": _STEPS}
_LINE = {
    **{"number": _NUMBERED, "name": path, "sound": path, "sha256": text(64), "transcript": text(LONGEST_TEXT)},
    **{"duration_s": optional(number(0, 1e6)), "doubt": optional(number(-1, 1)), "mark": one_of(MARKS)},
    **{"marked": text(64), "exports": tupled(items(value_of(ExportRecord, _EXPORT, _EXPORT)))},
    "versions": tupled(items(value_of(KeptVersion, _VERSION, _VERSION), most=MOST_VERSIONS)),
}
_PROJECT = members(
    {
        "lines": items(value_of(partial(ProjectLine, sha256=""), _LINE, ("number", "name", "sound"))),
        **dict.fromkeys(("model", "recordings", "given_model"), path),
        **dict.fromkeys(("language", "recogniser", "preset"), _TEXT),
        **{"characters": any_members(path), "next_number": _NUMBERED},
    },
    alone=True,
)


def digest_of(sentences: Iterable[str]) -> str:
    """Return the digest of edits, by their sentences.

    >>> digest_of(["phone 2 is p"])[:8]
    '2a0d1f5a'
    """
    return sha256("\n".join(sentences).encode("utf-8", "surrogatepass")).hexdigest()
