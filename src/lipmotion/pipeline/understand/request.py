"""Requests: a recording, with all that its user knows of it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from lipmotion.articulation.pauses import REST
from lipmotion.errors import InputError, shortened
from lipmotion.pipeline.job import DETECTED, Request
from lipmotion.types import Audio, TimedTranscript, Timeline, Unit
from lipmotion.types.configuration import check_value
from lipmotion.types.languages import ENGLISH
from lipmotion.units import Lexicon

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.motion.speaker_maps import SpeakerMap
    from lipmotion.pipeline.model import Model

Onto: TypeAlias = "str | Path | Corpus | Model | SpeakerMap | Any"
"""Another person: a video, the folder of a corpus, a model file or a face file, or the value of one of them (a
``FilmedFace`` too), or a finished map."""


@dataclass(frozen=True, eq=False)
class SpeechRequest:
    """A recording, with all that its user knows of it: the input of ``animate`` and ``explain``.

    recording  : an audio or video file, or samples at 16 kHz
    transcript : the spoken words, a Path of a file with them (plain text, subtitles, what recognisers write, labels),
                 or a ``TimedTranscript``; with a transcript, phones are aligned instead of recognised, and within the
                 times that it gives
    units      : phones in time, for instance those of an earlier generation, edited; with units, phones are neither
                 recognised nor aligned. Gaps between them are silence
    lexicon    : pronunciations of words, ahead of those of the dictionary
    language   : that is spoken, a code of ``types.languages.LANGUAGES``; of another one than English, the
                 lexicon pronounces the transcript, or espeak-ng, where it is installed, and the phones become the
                 nearest ones of English. ``auto``: it is found by the transcript and the sound, and named in a warning
    recogniser : how speech without a transcript is recognised. ``auto``: English words where they fit the sound, phones
                 elsewhere; ``words``: words alone; ``fast``: phones alone, by the phone models of the model and those
                 of many voices, weighted by the speaker similarity score; ``own``, ``general``: by one of these alone;
                 ``whisper``, ``vosk``: words, by what is installed (``installed_recognisers``), aligned as a
                 transcript is
    speaker    : whose motion is generated, of the people whom the model was trained on; empty: the mean person, or the
                 only one
    onto       : another person, onto whose face the motion is mapped (``map_onto``): a video of them, a prepared
                 corpus, another model, or a map that was made before. None: the motion is that of the speaker
    onto_speaker : which person, where the corpus or the other model has several
    pauses     : ``rest``: lips close softly in pauses from 0.25 s, and part no earlier than 0.12 s before a phrase;
                 ``natural``: the mouth does in pauses what the model learned
    manner     : ``detected``: the mouth opens for laughter and breaths in the sound, and moves as far as whispered and
                 shouted phrases ask for, unless a mood or a manner is asked for (docs/expression.md); ``asked``: not
    spoken_so  : whether a synthesiser has spoken the units: they are not compared with the sound
    asymmetry  : 0 to 1: the share that is left of the difference between both sides of the speaker's own mouth, in the
                 lip and jaw points; the mouth of another person (``onto``) stays as it is

    >>> import lipmotion
    >>> request = lipmotion.SpeechRequest("examples/welcome.flac", recogniser="general")
    >>> lipmotion.animate(request).units[0].label.phone
    'sil'
    """

    recording: str | Path | Audio
    transcript: str | Path | TimedTranscript | None = None
    units: Timeline[Unit] | None = None
    lexicon: Lexicon | None = None
    language: str = ENGLISH
    recogniser: str = "auto"
    speaker: str = ""
    onto: Onto | None = None
    onto_speaker: str = ""
    pauses: str = REST
    asymmetry: float = 0.0
    manner: str = DETECTED
    spoken_so: bool = False

    def __post_init__(self) -> None:
        for each in fields(Request):
            if each.name in ("language", "pauses", "asymmetry", "manner"):
                check_value(each, getattr(self, each.name))
        if not isinstance(self.units, Timeline | None):
            kind = type(self.units).__name__
            raise InputError(f"the units are a {kind}, required a Timeline of spans of units")
        for span in self.units or ():
            if not isinstance(span.label, Unit):
                raise InputError(f"a unit is {shortened(repr(span.label))}, required a Unit: Unit('p')")


SpeechInput = str | Path | Audio | SpeechRequest
"""A recording alone, or a request."""


def request_of(
    speech: SpeechInput, transcript: str | Path | TimedTranscript | None = None, language: str | None = None
) -> SpeechRequest:
    """Return a request for a recording, or the given request; with the transcript and the language that are given.

    Raises InputError: a transcript is given, and the request has one already.
    """
    if not isinstance(speech, SpeechRequest):
        return SpeechRequest(speech, transcript, language=language or ENGLISH)
    speech = speech if language is None else replace(speech, language=language)
    if transcript is None:
        return speech
    if speech.transcript is not None:
        raise InputError("two transcripts, in the request and beside it; give one")
    return replace(speech, transcript=transcript)
