"""What is known of a recording before it is animated: one value instead of many arguments."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.types import Audio, Timeline, Unit
from lipmotion.units import Lexicon


@dataclass(frozen=True, eq=False)
class SpeechRequest:
    """A recording, and what its user knows of it.

    recording  : an audio or video file, or samples at 16 kHz
    transcript : what is said, or a Path to a text file: phones are then aligned instead of recognised
    units      : phones in time, for instance edited ones of an earlier result: nothing is recognised then
    lexicon    : pronunciations of words that the dictionary does not have
    recogniser : ``own``: the phone models of the animating model; ``general``: those of many voices; ``auto``: both,
                 the own ones as far as the similarity of the speaker allows

    >>> request = SpeechRequest("hello.wav", transcript="Hello there")
    >>> request.recogniser
    'auto'
    """

    recording: str | Path | Audio
    transcript: str | Path | None = None
    units: Timeline[Unit] | None = None
    lexicon: Lexicon | None = None
    recogniser: str = "auto"


SpeechInput = str | Path | Audio | SpeechRequest
"""What ``animate`` and ``explain`` take: a recording alone, or with what is known of it."""


def request_of(speech: SpeechInput, transcript: str | Path | None = None) -> SpeechRequest:
    """Return the request for a recording, or the request itself, with a transcript where one is given.

    Raises InputError: a request that has a transcript, and another one.
    """
    if not isinstance(speech, SpeechRequest):
        return SpeechRequest(speech, transcript)
    if transcript is None:
        return speech
    if speech.transcript is not None:
        raise InputError("two transcripts, in the request and beside it; give one")
    return replace(speech, transcript=transcript)
