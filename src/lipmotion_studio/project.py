"""Projects as values: recordings, what was decided of them, what was exported, and the presets of exports."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from hashlib import sha256
from typing import Any

from lipmotion.errors import InputError, shorten
from lipmotion.extensions import find_version
from lipmotion.pipeline.batch.lines import BatchLine, check_names
from lipmotion.pipeline.outputs.output import OutputSettings, list_outputs
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import values
from lipmotion_faces.outputs.shown_faces import shown_face

FORMAT, VERSION = "lipmotion.project", 1
HEADER = ("format", "version", "made_by")
NO_MARK, APPROVED, REDO = MARKS = ("none", "approved", "redo")
MAX_RECORDINGS, MAX_TEXT = 100_000, 1 << 24
MAX_VERSIONS = 100
EDITS_SUFFIX = "edits.json"  # how files of edits end, after the name of the recording and a dot


@dataclass(frozen=True)
class ExportRecord:
    """What was exported of a recording.

    preset  : the preset that was used; empty: files were chosen
    edits   : path of the file of edits that the files were made from: a copy, which gives the same files again
    steps   : digest of the edits as they were
    version : of lipmotion
    """

    preset: str
    files: Mapping[str, str]
    edits: str
    steps: str
    model: str
    version: str


@dataclass(frozen=True)
class EditVersion:
    """Edits of a recording as they once were, as commands; ``number`` is unique in the recording, from 1."""

    number: int
    steps: tuple[str, ...]

    @property
    def name(self) -> str:
        """What requests call it."""
        return f"version-{self.number}"

    @property
    def digest(self) -> str:
        """The digest of its edits."""
        return digest_edits(self.steps)


@dataclass(frozen=True)
class ProjectRecording:
    """A recording that is worked on.

    name       : path of its files without suffix, with ``/`` between folders; unique
    sound      : path of its sound from the folder of the project, or absolute
    sha256     : digest of the sound
    transcript : its words, where they were given here; empty: those of a file beside it, or it is recognised
    duration_s : of the sound; None: not known yet
    doubt      : how unsure the motion of its speech is, 0 to 1; None: not known yet
    mark       : one of ``MARKS``
    marked     : digest of the edits when it was marked; empty: not known
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
    versions: tuple[EditVersion, ...] = ()

    def __post_init__(self) -> None:
        if self.mark not in MARKS:
            raise InputError(f"the mark is {shorten(repr(self.mark))}, required one of: {', '.join(MARKS)}")

    def with_version(self, steps: tuple[str, ...]) -> ProjectRecording:
        """Return it with a version of these edits; as it is, where there is one. Raises InputError: too many."""
        if any(version.steps == steps for version in self.versions):
            return self
        if len(self.versions) >= MAX_VERSIONS:
            raise InputError(f"{len(self.versions)} versions are kept, required fewer than {MAX_VERSIONS}; remove one")
        version = EditVersion(self.versions[-1].number + 1 if self.versions else 1, steps)
        return replace(self, versions=(*self.versions, version))

    def find_version(self, name: str) -> EditVersion:
        """Return a version. Raises InputError: none of that name is kept."""
        for version in self.versions:
            if version.name == name:
                return version
        known = ", ".join(version.name for version in self.versions) or "nothing: none is kept"
        raise InputError(f"no version {shorten(repr(name))} of the recording, required one of: {known}")


@dataclass(frozen=True)
class Project:
    """The recordings that are worked on, by their numbers.

    model      : path of the model from the folder of the project; empty: the one that ships
    language, recogniser : of new recordings, as of ``Request``
    preset     : that was used last for an export
    given_model : path of the model that was used before one that was trained here; empty: the one that ships
    next_number : of the next recording
    """

    lines: Mapping[int, ProjectRecording] = field(default_factory=dict)
    model: str = ""
    language: str = "en"
    recogniser: str = "auto"
    preset: str = ""
    characters: Mapping[str, str] = field(default_factory=dict)
    recordings: str = ""
    given_model: str = ""
    next_number: int = 1

    def with_recordings(self, recordings: Sequence[ProjectRecording]) -> Project:
        """Return the project with recordings that are new, or in place of those of their numbers."""
        together = {**self.lines, **{recording.number: recording for recording in recordings}}
        return replace(self, lines=together, next_number=max([self.next_number, *(n.number + 1 for n in recordings)]))


def check_recordings(project: Project) -> None:
    """Raise InputError or ExportError if two recordings have one name, or one lies outside the project's folder."""
    if len(project.lines) > MAX_RECORDINGS:
        raise InputError(f"{len(project.lines)} recordings, required at most {MAX_RECORDINGS} in a project; divide it")
    check_names((BatchLine(recording.name, recording.sound) for recording in project.lines.values()), (EDITS_SUFFIX,))


def describe_project(project: Project) -> dict[str, Any]:
    """Return a project as an object of JSON."""
    defaults = {each.name: each.default for each in fields(ProjectRecording)}
    rows = [
        {
            name: [asdict(each) for each in value] if isinstance(value, tuple) else value
            for name, value in vars(recording).items()
            if value != defaults[name]
        }
        for recording in project.lines.values()
    ]
    settings = {each.name: getattr(project, each.name) for each in fields(project) if each.name != "lines"}
    made_by = {"lipmotion": find_version()}
    return {"format": FORMAT, "version": VERSION, "made_by": made_by, **settings, "lines": rows}


def parse_project(content: Any) -> Project:
    """Return the project of an object of JSON. Raises InputError, ExportError: it is none, or of a later version."""
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f'not a project: required "format": "{FORMAT}"')
    if content.get("version") != VERSION:
        version = values.describe_value(content.get("version"))
        raise InputError(f"a project of version {version}, required {VERSION}; update lipmotion")
    try:
        members = _PROJECT({name: value for name, value in content.items() if name not in HEADER})
    except values.SchemaError as error:
        raise InputError(f"not a project that can be read ({error})") from error
    recordings = members.pop("lines", [])
    if len({recording.number for recording in recordings}) < len(recordings):
        raise InputError("not a project that can be read (two recordings of one number)")
    project = Project(**members).with_recordings(recordings)
    check_recordings(project)
    return project


_TEXT, _NUMBERED = values.text(1000), values.whole(1, 1 << 53)
_EXPORT = {"files": values.any_members(_TEXT)} | dict.fromkeys(("preset", "edits", "steps", "model", "version"), _TEXT)
_VERSION = {"number": _NUMBERED, "steps": values.as_tuple(values.items(values.text(MAX_TEXT)))}
_RECORDING = {
    "number": _NUMBERED,
    **dict.fromkeys(("name", "sound"), values.path),
    **dict.fromkeys(("sha256", "marked"), values.text(64)),
    "transcript": values.text(MAX_TEXT),
    "duration_s": values.optional(values.number(0, 1e6)),
    "doubt": values.optional(values.number(-1, 1)),
    "mark": values.one_of(MARKS),
    "exports": values.as_tuple(values.items(values.value_of(ExportRecord, _EXPORT, _EXPORT))),
    "versions": values.as_tuple(values.items(values.value_of(EditVersion, _VERSION, _VERSION), most=MAX_VERSIONS)),
}
_RECORDINGS = values.items(values.value_of(ProjectRecording, _RECORDING, ("number", "name", "sound", "sha256")))
_PROJECT = values.members(
    {
        "lines": _RECORDINGS,
        **dict.fromkeys(("model", "recordings", "given_model"), values.path),
        **dict.fromkeys(("language", "recogniser", "preset"), _TEXT),
        "characters": values.any_members(values.path),
        "next_number": _NUMBERED,
    },
    alone=True,
)


def digest_edits(sentences: Iterable[str]) -> str:
    """Return the digest of edits, by their sentences.

    >>> digest_edits(["phone 2 is p"])[:8]
    '2a0d1f5a'
    """
    return sha256("\n".join(sentences).encode("utf-8", "surrogatepass")).hexdigest()


@dataclass(frozen=True)
class Preset:
    """Files that a program reads.

    title  : programs that read the files
    curves : what motion files hold, as of ``Outputs.curves``
    fps    : frames a second of motion files and videos; 0: as usual
    """

    name: str
    title: str
    files: tuple[str, ...]
    curves: str = ""
    fps: float = 0.0


PRESETS = {
    row["name"]: Preset(row["name"], row["title"], tuple(row["files"].split()), row["curves"], float(row["fps"] or 0))
    for row in read_shipped_table("lipmotion_studio", "presets.csv")
}
_SUFFIX = re.compile(r"(?:\.[A-Za-z0-9]{1,10}){1,3}")


def find_preset(name: str, files: tuple[str, ...]) -> Preset:
    """Return a preset of a name, or, of an empty one, of suffixes. Raises InputError: there is none."""
    if name:
        if name not in PRESETS:
            raise InputError(f"no preset {shorten(repr(name))}; required one of: {', '.join(PRESETS)}")
        return PRESETS[name]
    known = list_export_suffixes()
    for suffix in files:
        if suffix not in known or not _SUFFIX.fullmatch(suffix):
            raise InputError(f"nothing is written as {shorten(repr(suffix))}; required some of: {' '.join(known)}")
    if not files:
        raise InputError("no preset and no files; required one of both")
    return Preset("", "", tuple(dict.fromkeys(files)))


def list_export_suffixes() -> tuple[str, ...]:
    """Return the suffixes of all files that can be exported."""
    return tuple(filter(_SUFFIX.fullmatch, list_outputs(OutputSettings(shown_face("head")))))
