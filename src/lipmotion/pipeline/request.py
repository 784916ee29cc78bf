"""What is animated, and what is written: ``Request`` and ``Outputs``, the same values everywhere.

Every option of ``animate`` is a field here, or in another part of a job (``pipeline.job``), and nowhere else: with its
default, its check and what the help says of it (``types.configuration.option``).
"""
# ruff: noqa: RUF009 (``option`` returns the field of a dataclass)

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar, get_args

from lipmotion.errors import InputError, shorten
from lipmotion.extensions import load_provided
from lipmotion.storage.sources import is_file
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion.types.languages import AUTO, ENGLISH, LANGUAGES

if TYPE_CHECKING:
    from lipmotion.types import Audio, TimedTranscript, Timeline, Unit
    from lipmotion.units import Lexicon

Onto: TypeAlias = Any
"""Another person: a video, the folder of a corpus, a model file or a face file, or the value of one of them
(``Corpus``, ``Model``, ``FilmedFace``), or a finished ``SpeakerMap``."""

PartT = TypeVar("PartT", bound=Configuration)
Pauses = Literal["rest", "natural"]
Manner = Literal["detected", "asked"]
DETECTED, ASKED = get_args(Manner)
Jaw = Literal["motion", "energy", "none"]
Overlay = Literal["inset", "mouth"]
Refinement = Literal["steady", "paper"]
Mark = Literal["metadata", "visible", "none"]

RATE = Rule(1, most=1000, unit=" a second")  # frame rates of a file; a mistyped rate must not fill the memory


def _file(reads: str, metavar: str, help: str, **more: Any) -> Any:
    """Return the option of a file that is read, None where there is none; ``reads``: what it is, in messages."""
    more |= {"metavar": metavar} if metavar else {}
    return option(None, kind=Path, reads=reads, help=help, **more)


def _shipped() -> Path:
    from lipmotion.pipeline.model import find_shipped

    return find_shipped()


@dataclass(frozen=True)
class Request(Configuration):
    """What is animated: a recording, with all that its user knows of it, and whose motion it gets.

    A field is the path of a file or the value that such a file holds; ``read_request`` reads the files. Paths that are
    not absolute begin at the working directory.
    recording  : an audio or video file, or samples at 16 kHz
    transcript : the spoken words, a Path of a file with them (plain text, subtitles, what recognisers write, labels),
                 or a ``TimedTranscript``. In a job, a text that is the name of a file is that file. With a transcript,
                 phones are aligned instead of recognised, and within the times that it gives
    lexicon    : pronunciations of words, ahead of those of the dictionary
    language   : that is spoken, a code of ``types.languages.LANGUAGES``; of another one than English, the
                 lexicon pronounces the transcript, or espeak-ng, where it is installed, and the phones become the
                 nearest ones of English. ``auto``: it is found by the transcript and the sound, and named in a warning
    units      : phones in time, for instance those of an earlier generation, edited; with units, phones are neither
                 recognised nor aligned. Gaps between them are silence
    tier       : which tier or speaker of a file of labels is read
    edits      : a file with what is changed of the motion, for jobs and ``animate``
    recogniser : how speech without a transcript is recognised. ``auto``: English words where they fit the sound, phones
                 elsewhere; ``fast``: phones alone, by the phone models of the model and those of many voices, weighted
                 by the speaker similarity score; ``own``, ``general``: by one of these alone
    speaker    : whose motion is generated, of the people whom the model was trained on; empty: the mean person, or the
                 only one
    pauses     : ``rest``: lips close softly in pauses from 0.25 s, and part no earlier than 0.12 s before a phrase;
                 ``natural``: the mouth does in pauses what the model learned
    manner     : ``detected``: the mouth opens for laughter and breaths (docs/expression.md); ``asked``: not
    asymmetry  : 0 to 1: the share that is left of the difference between both sides of the speaker's own mouth, in the
                 lip and jaw points; the mouth of another person (``onto``) stays as it is
    model      : the model file, where no other model is given beside the request; None: the shipped one
    onto       : another person, onto whose face the motion is mapped (``map_onto``): a video of them, a prepared
                 corpus, another model, or a map that was made before. None: the motion is that of the speaker
    onto_speaker : which person, where the corpus or the other model has several
    spoken_so  : whether a synthesiser has spoken the units: they are not compared with the sound
    Raises InputError: a value that is not allowed.

    >>> import lipmotion
    >>> request = lipmotion.Request("examples/welcome.flac", recogniser="general")
    >>> lipmotion.animate(request).units[0].label.phone
    'sil'
    """

    recording: str | Path | Audio | None = _file(
        "recording",
        "",
        "audio or video file, -: standard input",
        flags=("speech",),
        values={"Audio": "samples as lipmotion.Audio(samples, rate_hz)"},
    )
    transcript: str | Path | TimedTranscript | None = option(
        None,
        kind=str,
        values={"Path": "a Path of a file", "TimedTranscript": "a TimedTranscript"},
        reads="transcript",
        replaceable=True,
        metavar="TEXT|FILE",
        help="the words that are spoken, if known: also subtitles, and what recognisers write",
    )
    lexicon: str | Path | Lexicon | None = _file(
        "lexicon",
        "FILE",
        "pronunciations, one per line: WORD PHONE PHONE ...",
        replaceable=True,
        values={"Lexicon": "a Lexicon"},
    )
    language: str = option(
        ENGLISH,
        Rule(choices=(*LANGUAGES, AUTO)),
        metavar="CODE",
        help="that is spoken: en, es, fr, de, it, pt, nl, ja, ko, zh, ... or auto (default: en; docs/transcripts.md)",
    )
    units: str | Path | Timeline[Unit] | None = _file(
        "units file",
        "FILE",
        "phones in time from an earlier .json, .npz or .TextGrid, edited or not, or from Audacity labels",
        replaceable=True,
        values={"Timeline": "a Timeline of spans of units"},
    )
    tier: str = option(
        "",
        metavar="NAME",
        help="of labels with several tiers or speakers, the tier or the speaker that is read (default: all speakers)",
    )
    edits: Path | None = _file("edits", "FILE", "file of edits from lipmotion edit (docs/edit.md)", replaceable=True)
    recogniser: str = option(
        "auto",
        metavar="KIND",
        help="auto, fast (phones alone), own (phone models of the model), general (of many voices) (default: auto)",
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
        omit_default=True,
        help="detected: laughter and breaths in the sound move the mouth (default); asked: none does",
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
    onto: Onto | None = _file(
        "footage of the other person",
        "VIDEO|CORPUS|MODEL",
        "another person, onto whose face the motion is mapped: a video of them, a prepared corpus or a model",
        values={"object": ""},
    )
    onto_speaker: str = option(
        "", metavar="NAME", help="which person, if the corpus or the model of --onto has several"
    )
    spoken_so: bool = option(False, omit_default=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.units, str | Path | None):
            from lipmotion.types import Unit

            for span in self.units:
                if not isinstance(span.label, Unit):
                    raise InputError(f"a unit is {shorten(repr(span.label))}, required a Unit: Unit('p')")


SpeechInput: TypeAlias = "str | Path | Audio | Request"  # a recording alone, or a request


def as_request(
    speech: SpeechInput, transcript: str | Path | TimedTranscript | None = None, language: str | None = None
) -> Request:
    """Return a request for a recording, or the given request; with the transcript and the language that are given.

    Raises InputError: a transcript is given, and the request has one already.
    """
    if not isinstance(speech, Request):
        return Request(speech, transcript, language=language or ENGLISH)
    speech = speech if language is None else replace(speech, language=language)
    if transcript is None:
        return speech
    if speech.transcript is not None:
        raise InputError("two transcripts, in the request and beside it; give one")
    return replace(speech, transcript=transcript)


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
    background: str | Path | None = option(
        None,
        kind=str,
        values={"Path": "a Path of a file"},
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
        help="what motion files hold: arkit, face, visemes, held-visemes, vowels, fap, or the controls of a rig "
        "(FILE.csv; docs/meshes.md)",
    )
    kinds: tuple[str, ...] = option(
        ("json",),
        flags=("--to",),
        metavar="KIND,KIND",
        help="what is written of each recording, as json,mp4 (default: json)",
    )

    @property
    def motion_hz(self) -> float | None:
        """Frame rate of motion files: that of videos, where no other is given; None: the model's."""
        return self.fps if self.rate_hz is None else self.rate_hz


def locate_paths(part: PartT, folder: Path) -> PartT:
    """Return a part with paths that begin at a folder; a text that is no file there, or folder of drawings, stays."""
    changed: dict[str, Any] = {}
    for each in fields(part):
        value = getattr(part, each.name)
        if isinstance(value, Path) and str(value) != "-":
            changed[each.name] = folder / value
        elif not isinstance(value, str) or ("reads" not in each.metadata and each.name != "curves"):
            continue
        elif is_file(folder / value) or (each.name == "face" and load_provided("is_drawings")(value, folder)):
            changed[each.name] = str(folder / value)
    return replace(part, **changed)
