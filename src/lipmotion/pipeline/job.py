"""A job: a recording, what is made of it, and how; the same value from the command line, a file and Python.

Every option of ``animate`` is a field here, or in a part of the job, and nowhere else: with its default, its check and
what the help says of it (``types.configuration.option``). Nothing is read or imported before the job runs.
"""
# ruff: noqa: RUF009 (``option`` returns the field of a dataclass)

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args

from lipmotion.errors import InputError
from lipmotion.extensions import provided
from lipmotion.storage.json_text import read_toml
from lipmotion.storage.sources import is_file
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion.types.delivery import Delivery
from lipmotion.types.languages import AUTO, ENGLISH, LANGUAGES
from lipmotion.types.staging import Staging

if TYPE_CHECKING:
    from lipmotion.types import Generation

PartT = TypeVar("PartT", bound=Configuration)
Pauses = Literal["rest", "natural"]
Manner = Literal["detected", "asked"]
DETECTED, ASKED = get_args(Manner)
Jaw = Literal["motion", "energy", "none"]
Overlay = Literal["inset", "mouth"]
Refinement = Literal["steady", "paper"]
Mark = Literal["metadata", "visible", "none"]

RATE = Rule(1, most=1000, unit=" a second")
"""Frame rates of a file; a mistyped rate must not fill the memory."""


def _file(reads: str, metavar: str, says: str, **told: Any) -> Any:
    """Return the option of a file that is read, None where there is none; ``reads``: what it is, in messages."""
    told |= {"metavar": metavar} if metavar else {}
    return option(None, kind=Path, reads=reads, help=says, **told)


def _shipped() -> Path:
    from lipmotion.pipeline.model import shipped_path

    return shipped_path()


@dataclass(frozen=True)
class Request(Configuration):
    """What is animated: a recording, files of what is known of it, and whose motion it gets.

    Paths that are not absolute begin at the working directory. What the fields mean is said by their help, and by
    ``SpeechRequest``, which holds what the files hold (``pipeline.understand.read_request``).

    >>> Request("welcome.flac", recogniser="fast").recording.name
    'welcome.flac'
    """

    recording: Path | None = _file("recording", "", "audio or video file, -: standard input", flags=("speech",))
    transcript: str | None = option(
        None,
        kind=str,
        reads="transcript",
        replaceable=True,
        metavar="TEXT|FILE",
        help="the words that are spoken, if known: also subtitles, and what recognisers write",
    )
    lexicon: Path | None = _file(
        "lexicon", "FILE", "pronunciations, one per line: WORD PHONE PHONE ...", replaceable=True
    )
    language: str = option(
        ENGLISH,
        Rule(choices=(*LANGUAGES, AUTO)),
        metavar="CODE",
        help="that is spoken: en, es, fr, de, it, pt, nl, ja, ko, zh, ... or auto (default: en; docs/transcripts.md)",
    )
    units: Path | None = _file(
        "units file",
        "FILE",
        "phones in time from an earlier .json, .npz or .TextGrid, edited or not, or from Audacity labels",
        replaceable=True,
    )
    tier: str = option(
        "",
        metavar="NAME",
        help="of labels with several tiers or speakers, the tier or the speaker that is read (default: all speakers)",
    )
    edits: Path | None = _file(
        "edits", "FILE", "what is changed of the motion: of lipmotion edit (docs/edit.md)", replaceable=True
    )
    recogniser: str = option(
        "auto",
        metavar="KIND",
        help="auto, words (English), fast (phones alone), own (phone models of the model), general (of many voices), "
        "or words by an installed recogniser: whisper, vosk (default: auto)",
    )
    speaker: str = option(
        "",
        metavar="NAME",
        help="whose motion, of the people that the model was trained on (default: the mean person; see lipmotion info)",
    )
    pauses: Pauses = option(
        "rest",
        Rule(choices=get_args(Pauses)),
        help="rest: lips close softly in pauses (default); natural: as people do, who breathe and hold a sound",
    )
    manner: Manner = option(
        "detected",
        Rule(choices=get_args(Manner)),
        later=True,
        help="detected: laughter, breaths, whispers and shouts in the sound move the mouth (default); asked: none does",
    )
    asymmetry: float = option(
        0.0,
        Rule(0, most=1),
        metavar="X",
        help="0: both sides of the mouth move alike; 1: as on the speaker's own face (default: 0)",
    )
    model: Path | None = _file(
        "model",
        "",
        "trained model (default: the one that ships with the package)",
        replaceable=True,
        default_path=_shipped,
    )
    onto: Path | None = _file(
        "footage of the other person",
        "VIDEO|CORPUS|MODEL",
        "another person, onto whose face the motion is mapped: a video of them, a prepared corpus or a model",
    )
    onto_speaker: str = option(
        "", metavar="NAME", help="which person, if the corpus or the model of --onto has several"
    )


@dataclass(frozen=True)
class Outputs(Configuration):
    """What is written: files, their rates and channels, the face of videos and the character of curves.

    >>> Outputs(("a.json", "a.mp4"), fps=30).motion_hz
    30
    """

    files: tuple[str, ...] = option((), flags=("-o", "--output"), writes=True, help="files of motion and videos")
    rate_hz: float | None = option(
        None,
        RATE,
        kind=float,
        what="frame rate",
        flags=("--rate",),
        metavar="HZ",
        help="frames per second of motion files (default: --fps, or 100)",
    )
    channels: tuple[str, ...] = option(
        (), metavar="NAME,NAME", help="write only these to motion files: opening,width,..."
    )
    fps: float | None = option(
        None,
        RATE,
        kind=float,
        what="frame rate",
        help="frames per second of videos (default: 25; of filmed faces, those of the footage)",
    )
    articulation: bool = option(
        False, help="add tongue, lip_tuck, protrusion, spread, lip_press, teeth to motion files"
    )
    face: str = option(
        "portrait",
        reads="face",
        metavar="NAME|FILE.svg|FILE.face|FOLDER",
        help="face that videos show: woman, man, head, cartoon, a drawing, a filmed face, or a folder of one drawing a "
        "mouth shape (default: portrait, the woman)",
    )
    background: str | None = option(
        None,
        kind=str,
        reads="background",
        metavar="VIDEO|COLOUR",
        help="footage of the same person (default: that in its file); of a drawn face: transparent, or as #40a0ff",
    )
    jaw: Jaw = option(
        "motion",
        Rule(choices=get_args(Jaw)),
        help="what the jaw of a filmed face follows: motion, energy or none (default: motion)",
    )
    refinement: Refinement = option(
        "steady",
        Rule(choices=get_args(Refinement)),
        help="detail of a filmed mouth: steady, or of the nearest picture, as in the paper (default: steady)",
    )
    overlay: Overlay | None = option(
        None,
        Rule(choices=get_args(Overlay)),
        kind=str,
        help="show the video of the speech with a large mouth of the filmed face, in a corner or over the speaker's "
        "own",
    )
    mark: Mark = option(
        "metadata",
        Rule(choices=get_args(Mark)),
        help="how a video of a filmed face says that it is synthetic (default: metadata; docs/consent.md)",
    )
    character: Path | None = _file(
        "character",
        "FILE",
        "your own character in videos: FILE.glb .gltf .vrm .obj, or a folder of .obj; motion files get its weights",
    )
    lip_points: Path | None = _file(
        "table of lip points",
        "FILE.csv",
        "the vertices of lip points: point,vertex (default: found by the blendshape that opens the mouth)",
    )
    binding: Path | None = _file("binding", "FILE", "weights of control points: stored (.binding) or painted (.csv)")
    control_points: bool = option(False, help="move it by control points, though it has blendshapes")
    curves: str = option(
        "",
        metavar="SET",
        help="what motion files hold: arkit, face, visemes, vowels, fap, or the controls of a rig (FILE.csv; "
        "docs/meshes.md)",
    )
    posteriors: Path | None = option(
        None, kind=Path, writes=True, metavar="FILE.png", help="draw the posteriors of units over time (coupled)"
    )
    kinds: tuple[str, ...] = option(
        ("json",),
        flags=("--to",),
        metavar="KIND,KIND",
        help="what is written into an output folder, as json,mp4 (default: json)",
    )

    @property
    def motion_hz(self) -> float | None:
        """Frame rate of motion files: that of videos, where no other is given; None: the model's."""
        return self.fps if self.rate_hz is None else self.rate_hz


@dataclass(frozen=True)
class Job(Configuration):
    """A recording, what is made of it, and how (docs/api.md); of a batch, of every one of its recordings.

    >>> import lipmotion, tempfile
    >>> request = lipmotion.Request("examples/welcome.flac", recogniser="fast")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     lipmotion.Job(request, lipmotion.Outputs((f"{folder}/a.csv",))).run().motion.rate_hz
    100.0
    """

    request: Request = option(Request())
    outputs: Outputs = option(Outputs())
    delivery: Delivery = option(Delivery())
    staging: Staging = option(Staging())

    @classmethod
    def from_file(cls, path: str | Path) -> Job:
        """Return the job of a TOML file: a table for each part, with the names of its fields (docs/api.md).

        Paths begin at the folder of the file.
        Raises InputError: no such file, no TOML, an unknown name, a value that is not allowed, or Python 3.10.
        """
        members = read_toml(Path(path), "job", "give the options themselves")
        try:
            return cls.parsed(members).at(Path(path).parent)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    def of(self, recording: Path | None, files: tuple[str, ...] | None = None) -> Job:
        """Return the same job for another recording; with other output files, if some are given."""
        outputs = self.outputs if files is None else replace(self.outputs, files=files)
        return replace(self, request=replace(self.request, recording=recording), outputs=outputs)

    def at(self, folder: Path) -> Job:
        """Return the same job with paths that begin at a folder."""
        files = [file if file == "-" else f"{folder / file}{'/' * file.endswith('/')}" for file in self.outputs.files]
        outputs = replace(located(self.outputs, folder), files=tuple(files))
        return replace(self, request=located(self.request, folder), outputs=outputs)

    def run(self, *, workers: int = 1) -> Generation:
        """Animate the recording and write the files, as ``lipmotion animate``; return the motion.

        workers : as of ``animate``
        Raises InputError, ExportError and more: as ``animate`` and ``write``, or there is no recording.
        """
        from lipmotion.pipeline.opened_job import opened

        return opened(self).run(workers=workers)


DETAILS = {
    "film": Job(),
    "game": Job(outputs=Outputs(rate_hz=30.0), delivery=Delivery(key_tolerance=0.01)),
    "mobile": Job(
        outputs=Outputs(rate_hz=30.0),
        delivery=Delivery(key_tolerance=0.04),
        staging=Staging(gaze=False, brows=False),
    ),
}
"""Levels of detail, and the options that each sets; what each loses: docs/controls.md."""


def located(part: PartT, folder: Path) -> PartT:
    """Return a part with paths that begin at a folder; a text that is no file there, or folder of drawings, stays."""
    found: dict[str, Any] = {}
    for each in fields(part):
        value = getattr(part, each.name)
        if isinstance(value, Path) and str(value) != "-":
            found[each.name] = folder / value
        elif isinstance(value, str) and ("reads" in each.metadata or each.name == "curves"):
            is_read = is_file(folder / value) or (each.name == "face" and provided("is_drawings")(value, folder))
            found |= {each.name: str(folder / value)} if is_read else {}
    return replace(part, **found)
