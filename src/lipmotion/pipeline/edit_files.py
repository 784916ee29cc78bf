"""Files of edits: what was changed, of which recording, and the phones in time that were edited."""

from __future__ import annotations

import logging
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from lipmotion.errors import InputError
from lipmotion.formats.motion_document import list_unit_rows, parse_units
from lipmotion.pipeline.analysis.read_request import read_request
from lipmotion.pipeline.edits import Edits, MoodStep, Step
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.request import Request, locate_paths
from lipmotion.pipeline.session import Session
from lipmotion.storage.files import atomic_file, sound_reference
from lipmotion.storage.json_text import as_json_rows, from_json
from lipmotion.storage.sources import LARGEST_TEXT_BYTES, check_source, hash_file, read_text_file
from lipmotion.types import Generation, Outlook, Timeline, Unit
from lipmotion.types.values import as_tuple, describe_value, items, number, optional, require, text, value_of

LOG = logging.getLogger("lipmotion")
FORMAT, VERSION = "lipmotion.edits", 1
SUFFIX = ".json"
DIGEST = "recording_sha256"
HELD = ("recording", "model", "lexicon", "language", "recogniser", "speaker", "pauses", "asymmetry")
"""What of a request such a file holds; words and phones that were given are in the phones in time."""
_SHARE, _TEXT = number(0, 1), text(1000)
_OF_OUTLOOK = {"words": _TEXT, "confidence": _SHARE, "range_db": number(), "advice": as_tuple(items(_TEXT))}
_OUTLOOK = optional(value_of(partial(Outlook, voice=None), _OF_OUTLOOK | {"voice": _SHARE}, _OF_OUTLOOK))


@dataclass(frozen=True, eq=False)
class EditFile:
    """The content of a file of edits.

    edits   : what was changed
    named   : the recording and what else the file says of it (``HELD``)
    units   : its phones in time before the edits, so that no recogniser changes what they mean; None: not known
    outlook : what to expect of the motion; None: not known
    undone  : edits that were taken back and can be made again, the last one that was taken back first
    sha256  : digest of the recording's file, of which the phones are; empty: not known, as in files of earlier versions
    """

    edits: Edits = field(default_factory=Edits)
    named: Request = field(default_factory=Request)
    units: Timeline[Unit] | None = None
    outlook: Outlook | None = None
    undone: tuple[Step, ...] = ()
    sha256: str = ""

    def undo(self, count: int = 1) -> EditFile:
        """Return the file with its last edits taken back. Raises InputError: there are fewer."""
        steps, left = self.edits.steps, len(self.edits.steps) - count
        if not 0 <= count <= len(steps):
            raise InputError(f"{count} edits to take back, required 0 to {len(steps)}: the number of edits")
        return replace(self, edits=Edits(steps[:left]), undone=(*steps[left:], *self.undone))

    def redo(self, count: int = 1) -> EditFile:
        """Return the file with edits made again that were taken back. Raises InputError: there are fewer."""
        if not 0 <= count <= len(self.undone):
            raise InputError(f"{count} edits to make again, required 0 to {len(self.undone)}: the number taken back")
        return replace(self, edits=Edits(self.edits.steps + self.undone[:count]), undone=self.undone[count:])

    def then(self, *edits: str | Step) -> EditFile:
        """Return the file with some more edits; what was taken back is gone. Raises InputError: as ``Edits.then``."""
        return replace(self, edits=self.edits.then(*edits), undone=()) if edits else self

    def session(self, request: Request | None = None, *, model: Model | None = None, **more: Any) -> Session:
        """Return a session of the recording; or of a given request, with the phones of the file if it has none.

        more : of ``Session``; who gives its ``audio`` has checked whose it is
        Raises InputError: the file names no recording, and there is no other request; or its phones are those of
        another recording. Others as ``load_model``.
        """
        if request is None:
            if self.named.recording is None:
                raise InputError("the edits name no recording; give it: lipmotion animate RECORDING --edits FILE")
            request = read_request(self.named)
        if self.units is not None and (request.units is not None or request.transcript is not None):
            LOG.warning("the phones that were edited are not used: words or phones are given; numbers may mean others")
        elif self.units is not None:
            if self.sha256 and "audio" not in more and isinstance(request.recording, str | Path):
                check_sound(Path(request.recording), self.sha256)
            request = replace(request, units=self.units)
            more |= {"outlook": self.outlook, "lasts_s": max((span.end_s for span in self.units), default=0.0)}
        return Session(request, model=model or load_model(self.named.model), **more)


def create_edit_file(request: Request, session: Session | None = None) -> tuple[EditFile, Generation]:
    """Return a file of a recording, and its motion; its only edits are the moods that tags in the words ask for.

    session : of the recording, where there is one; None: its phones are recognised or aligned now
    Raises as ``animate``.
    """
    session = session or Session(read_request(request), model=load_model(request.model))
    named = Request(**{name: getattr(request, name) for name in HELD})
    if not (isinstance(named.recording, Path | None) and isinstance(named.lexicon, Path | None)):
        raise InputError("a file of edits names its recording and lexicon, required paths of files, not values")
    generation = session.generate()
    moods = (MoodStep(key.label, key.time_s) for key in generation.moods)  # of tags in the words, which are not stored
    digest = hash_file(named.recording) if named.recording else ""
    return EditFile(Edits(tuple(moods)), named, session.units(), generation.outlook, sha256=digest), generation


def check_sound(recording: Path, sha256: str) -> None:
    """Raise InputError unless a recording is the one of a digest, whose phones were found, or it cannot be read."""
    check_source(recording, "recording")
    if (digest := hash_file(recording)) != sha256:
        found = f"another recording than the edited one (SHA-256 {digest[:12]}, required {sha256[:12]})"
        raise InputError(f"{recording}: is {found}; put that back, or begin anew under another name")


def edit_file(edits: EditFile | Edits | str | Path | None) -> EditFile:
    """Return edits as the content of a file: of its path, or of a value; None: there are none. Raises InputError."""
    if isinstance(edits, EditFile):
        return edits
    if not isinstance(edits, Edits | str | Path | None):
        raise InputError(f"the edits: found {describe_value(edits)}, required Edits().then('EDIT')")
    return EditFile(edits or Edits()) if isinstance(edits, Edits | None) else read_edits(edits)


def is_edit_file(path: Path) -> bool:
    """Return whether a file is one of edits, by its suffix and how it begins."""
    if path.suffix.lower() != SUFFIX or not path.is_file():
        return False
    with path.open("rb") as file:
        return FORMAT.encode() in file.read(100)


def read_edits(path: str | Path, *, phones: bool = True) -> EditFile:
    """Return the content of a file of edits.

    phones : whether its phones in time are read, too: they take most of the time
    Raises InputError: no such file, another suffix, or not a file of edits of this version.
    """
    path = Path(path)
    _check_suffix(path)
    try:
        members: Any = from_json(read_text_file(path, "edits"))
    except ValueError as error:
        raise InputError(f"{path}: not a file of edits ({error})") from error
    if not isinstance(members, dict) or members.get("format") != FORMAT:
        raise InputError(f'{path}: not a file of edits; it must begin with "format": "{FORMAT}"')
    if (version := members.get("version")) != VERSION:
        raise InputError(f"{path}: edits of version {describe_value(version)}, required {VERSION}; update lipmotion")
    if not phones:
        members.pop("units", None)
    try:
        known = {"format", "version", *HELD, DIGEST, "steps", "undone", "units", "recognised", "outlook"}
        if unknown := sorted(set(members) - known):
            raise InputError(f"unknown member {unknown[0]!r}; required some of: {', '.join(sorted(known))}")
        commands = items(text(LARGEST_TEXT_BYTES))
        steps, undone = (require(commands, members.get(name, []), name) for name in ("steps", "undone"))
        named = locate_paths(Request.parsed({name: members[name] for name in HELD if name in members}), path.parent)
        units = parse_units(members["units"], members.get("recognised")) if "units" in members else None
        outlook, sha256 = _OUTLOOK(members.get("outlook")), require(_TEXT, members.get(DIGEST, ""), DIGEST)
        return EditFile(Edits().then(*steps), named, units, outlook, Edits().then(*undone).steps, sha256)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _check_suffix(path: Path) -> None:
    if path.suffix.lower() != SUFFIX:
        raise InputError(f"{path}: no file of edits, as FILE.json; write one: lipmotion edit FILE.json --of RECORDING")


def write_edits(file: EditFile, path: str | Path) -> None:
    """Write a file of edits. Raises InputError: another suffix.  Raises ExportError: it cannot be written."""
    path = Path(path)
    _check_suffix(path)
    members: dict[str, Any] = {"format": FORMAT, "version": VERSION}
    for name in HELD:
        value = getattr(file.named, name)
        if value != getattr(Request(), name):
            members[name] = sound_reference(value, path) if isinstance(value, Path) else value
    if file.sha256:
        members[DIGEST] = file.sha256
    members["steps"] = list(file.edits.sentences)
    if file.undone:
        members["undone"] = list(map(str, file.undone))
    if file.units is not None:
        members |= list_unit_rows(file.units)
    if file.outlook is not None:
        members["outlook"] = {name: value for name, value in asdict(file.outlook).items() if value is not None}
    with atomic_file(path) as temporary:
        temporary.write_text(as_json_rows(members), encoding="utf-8")
