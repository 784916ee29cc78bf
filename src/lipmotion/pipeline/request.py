"""What is animated, and what is written: ``Request`` and ``Outputs``, the same values everywhere.

Every option of ``animate`` is a field here, or in another part of a job (``pipeline.job``), and nowhere else: with its
default and its check (``types.configuration.option``). What the help says of it is in ``options.csv``.
"""
# ruff: noqa: RUF009 (``option`` returns the field of a dataclass)

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar, get_args

from lipmotion.errors import InputError
from lipmotion.extensions import load_provided
from lipmotion.storage.sources import is_file, read_shipped_table
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion.types.languages import AUTO, ENGLISH, LANGUAGES
from lipmotion.types.values import check_class

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


def _file(reads: str, **more: Any) -> Any:
    """Return the option of a file that is read, None where there is none; ``reads``: what it is, in messages."""
    return option(None, kind=Path, reads=reads, **more)


def _add_help(part: type[PartT]) -> type[PartT]:
    """Give the options of a part their texts for the command line, from ``options.csv``."""
    texts_of = {row["option"]: row for row in read_shipped_table("lipmotion.pipeline", "options.csv")}
    for each in fields(part):
        texts = texts_of.get(f"{part.__name__}.{each.name}", {})
        shown = {name: texts[name] for name in ("metavar", "help") if texts.get(name)}
        each.metadata = MappingProxyType({**each.metadata, **shown})
    return part


def _shipped() -> Path:
    from lipmotion.pipeline.model import find_shipped

    return find_shipped()


@_add_help
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
    manner     : ``detected``: the mouth opens for laughter and breaths (docs/expression.md); ``asked``: for neither
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
        "recording", flags=("speech",), values={"Audio": "samples as lipmotion.Audio(samples, rate_hz)"}
    )
    transcript: str | Path | TimedTranscript | None = option(
        None,
        kind=str,
        values={"Path": "a Path of a file", "TimedTranscript": "a TimedTranscript"},
        reads="transcript",
        replaceable=True,
    )
    lexicon: str | Path | Lexicon | None = _file("lexicon", replaceable=True, values={"Lexicon": "a Lexicon"})
    language: str = option(ENGLISH, Rule(choices=(*LANGUAGES, AUTO)))
    units: str | Path | Timeline[Unit] | None = _file(
        "units file", replaceable=True, values={"Timeline": "a Timeline of spans of units"}
    )
    tier: str = option("")
    edits: Path | None = _file("edits", replaceable=True)
    recogniser: str = option("auto")
    speaker: str = option("")
    pauses: Pauses = option("rest", Rule(choices=get_args(Pauses)))
    manner: Manner = option("detected", Rule(choices=get_args(Manner)), omit_default=True)
    asymmetry: float = option(0.0, Rule(0, most=1))
    model: Path | None = _file("model", replaceable=True, default_path=_shipped)
    onto: Onto | None = _file("footage of the other person", values={"object": ""})
    onto_speaker: str = option("")
    spoken_so: bool = option(False, omit_default=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.units, str | Path | None):
            from lipmotion.types import Unit

            for span in self.units:
                check_class(span.label, Unit, "label of a unit", "a Unit: Unit('p')")


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


@_add_help
@dataclass(frozen=True)
class Outputs(Configuration):
    """What is written: files, their rates and channels, the face of videos and the character of curves.

    >>> Outputs(("a.json", "a.mp4"), fps=30).motion_hz
    30
    """

    files: tuple[str, ...] = option((), flags=("-o", "--output"), writes=True)
    rate_hz: float | None = option(None, RATE, kind=float, what="frame rate", flags=("--rate",))
    channels: tuple[str, ...] = option(())
    fps: float | None = option(None, RATE, kind=float, what="frame rate")
    articulation: bool = option(False)
    face: str = option("portrait", reads="face")
    background: str | Path | None = option(None, kind=str, values={"Path": "a Path of a file"}, reads="background")
    jaw: Jaw = option("motion", Rule(choices=get_args(Jaw)))
    refinement: Refinement = option("steady", Rule(choices=get_args(Refinement)))
    overlay: Overlay | None = option(None, Rule(choices=get_args(Overlay)), kind=str)
    mark: Mark = option("metadata", Rule(choices=get_args(Mark)))
    character: Path | None = _file("character")
    lip_points: Path | None = _file("table of lip points")
    binding: Path | None = _file("binding")
    control_points: bool = option(False)
    curves: str = option("")
    kinds: tuple[str, ...] = option(("json",), flags=("--to",))

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
