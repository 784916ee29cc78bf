"""Files of edits: what was changed, of which recording, and the phones in time that were edited."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from lipmotion.articulation.pauses import REST
from lipmotion.errors import InputError, shortened
from lipmotion.export.motion.document import parse_units, unit_rows
from lipmotion.pipeline.edits import FORMS, Edits
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outputs.scenes import sound_reference
from lipmotion.pipeline.session import Session
from lipmotion.pipeline.understand.request import SpeechRequest
from lipmotion.storage.files import read_text_file, whole_file
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.types import Outlook, Timeline, Unit
from lipmotion.units import Lexicon

FORMAT, VERSION = "lipmotion.edits", 1
JSON, TOML = SUFFIXES = (".json", ".toml")
"""Suffixes of files of edits."""
OPTIONS = ("recogniser", "speaker", "pauses", "asymmetry")
"""Options of a ``SpeechRequest`` that such a file holds."""


@dataclass(frozen=True, eq=False)
class EditFile:
    """The content of a file of edits.

    edits     : what was changed
    recording : the recording; None: the file does not say which
    units     : its phones in time before the edits, so that no recogniser changes what they mean; None: not known
    outlook   : what to expect of the motion; None: not known
    model     : the model file; None: the shipped model
    lexicon   : pronunciations of words; None: those of the dictionary
    options   : of the request, by name (``OPTIONS``)
    """

    edits: Edits = field(default_factory=Edits)
    recording: Path | None = None
    units: Timeline[Unit] | None = None
    outlook: Outlook | None = None
    model: Path | None = None
    lexicon: Path | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def request(self, asked: SpeechRequest | None = None) -> SpeechRequest:
        """Return the request of the recording; or a given one, with the phones that were edited, if it has none.

        Raises InputError: the file names no recording, and there is no other request.
        """
        if asked is None:
            if self.recording is None:
                raise InputError("the edits name no recording; give it: lipmotion animate RECORDING --edits FILE")
            lexicon = Lexicon.from_file(self.lexicon) if self.lexicon else None
            asked = SpeechRequest(self.recording, lexicon=lexicon, **self.options)
        given = asked.units is not None or asked.transcript is not None
        return asked if given or self.units is None else replace(asked, units=self.units)

    def session(self, asked: SpeechRequest | None = None, *, model: Model | None = None, **more: Any) -> Session:
        """Return a session of the request. more : of ``Session``.  Raises as ``request``, ``load_model``."""
        request = self.request(asked)
        outlook = self.outlook if request.units is self.units else None
        return Session(request, model=model or load_model(self.model), outlook=outlook, **more)


def begun(request: SpeechRequest, recording: Path, model: Path | None, lexicon: Path | None) -> EditFile:
    """Return a file without edits of a recording, whose phones are recognised or aligned now. Raises as ``animate``."""
    session = Session(request, model=load_model(model))
    options = {name: getattr(request, name) for name in OPTIONS}
    return EditFile(Edits(), recording, session.units(), session.generated().outlook, model, lexicon, options)


def is_edit_file(path: Path) -> bool:
    """Return whether a file is one of edits, by its suffix and how it begins."""
    if path.suffix.lower() not in SUFFIXES or not path.is_file():
        return False
    with path.open("rb") as file:
        return FORMAT.encode() in file.read(100)


def read_edits(path: str | Path) -> EditFile:
    """Return the content of a file of edits: ``.json``, or ``.toml`` (Python 3.11 or newer).

    Raises InputError: no such file, another suffix, or not a file of edits of this version.
    """
    path = Path(path)
    text = read_text_file(path, "edits")
    try:
        members = _parsed(path, text)
    except ValueError as error:
        raise InputError(f"{path}: not a file of edits ({error})") from error
    if not isinstance(members, dict) or members.get("format") != FORMAT:
        raise InputError(f'{path}: not a file of edits; it must begin with "format": "{FORMAT}"')
    if members.get("version") != VERSION:
        found = shortened(repr(members.get("version")))
        raise InputError(f"{path}: edits of version {found}, required {VERSION}; update lipmotion")
    try:
        return _content(members, path.parent)
    except (InputError, TypeError, KeyError) as error:
        raise InputError(f"{path}: {error}") from error


def _parsed(path: Path, text: str) -> Any:
    """Return the content of JSON or TOML. Raises ValueError: it is none. InputError: another suffix, an old Python."""
    kind = path.suffix.lower()
    if kind == JSON:
        return from_json(text)
    if kind != TOML:
        raise InputError(f"{path}: a file of edits ends in one of: {', '.join(SUFFIXES)}")
    if sys.version_info < (3, 11):
        raise InputError(f"{path}: {TOML} is read by Python 3.11 or newer; use {JSON}")
    import tomllib

    return tomllib.loads(text)


def _content(members: dict[str, Any], folder: Path) -> EditFile:
    known = {"format", "version", "recording", "model", "lexicon", *OPTIONS, "steps", "units", "recognised", "outlook"}
    if unknown := sorted(set(members) - known):
        raise InputError(f"unknown member {unknown[0]!r}; required some of: {', '.join(sorted(known))}")
    steps, outlook = members.get("steps", []), members.get("outlook")
    if not isinstance(steps, list) or not all(isinstance(step, str) for step in steps):
        raise InputError(f"the steps are {shortened(repr(steps))}, required a list of sentences: {FORMS[0]!r}")
    files = {name: folder / members[name] if members.get(name) else None for name in ("recording", "model", "lexicon")}
    units = parse_units(members["units"], members.get("recognised", ())) if "units" in members else None
    if outlook is not None:
        outlook = Outlook(**{"voice": None} | outlook | {"advice": tuple(outlook["advice"])})
    options = {name: members[name] for name in OPTIONS if name in members}
    return EditFile(Edits().then(*steps), units=units, outlook=outlook, options=options, **files)


def write_edits(file: EditFile, path: str | Path) -> None:
    """Write a file of edits. Raises InputError: another suffix.  Raises ExportError: it cannot be written."""
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a file of edits ends in one of: {', '.join(SUFFIXES)}")
    members: dict[str, Any] = {"format": FORMAT, "version": VERSION}
    named = {"recording": file.recording, "model": file.model, "lexicon": file.lexicon}
    members |= {name: sound_reference(source, path) for name, source in named.items() if source is not None}
    usual = {"recogniser": "auto", "speaker": "", "pauses": REST, "asymmetry": 0.0}
    members |= {name: value for name, value in file.options.items() if value != usual[name]}
    members["steps"] = list(file.edits.sentences)
    if file.units is not None:
        members |= unit_rows(file.units)
    if file.outlook is not None:
        members["outlook"] = {name: value for name, value in asdict(file.outlook).items() if value is not None}
    text = _as_toml(members) if path.suffix.lower() == TOML else as_json(members, indent=1) + "\n"
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _as_toml(members: dict[str, Any]) -> str:
    """Return members as TOML: a line each, and lists with a line for each of their members."""
    lines = []
    for name, value in members.items():
        if isinstance(value, list | tuple):
            rows = "".join(f"  {_toml_value(row)},\n" for row in value)
            lines.append(f"{name} = [\n{rows}]\n")
        else:
            lines.append(f"{name} = {_toml_value(value)}\n")
    return "".join(lines)


def _toml_value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name} = {_toml_value(each)}" for name, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
