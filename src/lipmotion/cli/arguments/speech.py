"""Arguments of the verbs that turn speech into motion."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.paths import add_input

if TYPE_CHECKING:
    from lipmotion.pipeline.model import Model
    from lipmotion.pipeline.understand.request import SpeechRequest

LEXICON = "pronunciations, one per line: WORD PHONE PHONE ..."
MODEL = "trained model (default: the one that ships with the package)"


def add_speech_arguments(parser: argparse.ArgumentParser, *, several: bool = False) -> None:
    """Add the recording, its transcript, lexicon, units, recogniser and speaker, the model, and another person.

    several : there may be several recordings, and folders of them
    """
    add_recording_arguments(parser, several=several)
    add_model_argument(parser)
    add_onto_arguments(parser)


def add_onto_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--onto`` and ``--onto-speaker``: another person, onto whose face the motion is mapped."""
    face = "another person, onto whose face the motion is mapped: a video of them, a prepared corpus or a model"
    add_input(parser, "--onto", what="footage of the other person", metavar="VIDEO|CORPUS|MODEL", help=face)
    which = "which person, if the corpus or the model of --onto has several"
    parser.add_argument("--onto-speaker", default="", metavar="NAME", help=which)


def add_recording_arguments(parser: argparse.ArgumentParser, *, several: bool = False) -> None:
    """Add the recording, its transcript, lexicon, units, recogniser and speaker."""
    many: dict[str, Any] = {"nargs": "+", "help": "audio or video file, -: standard input; several, or a folder"}
    one = {"help": "audio or video file, -: standard input"}
    add_input(parser, "speech", what="recording", **(many if several else one))
    transcript: dict[str, Any] = {
        "type": str,
        "metavar": "TEXT|FILE",
        "help": "the words that are spoken, if known: also subtitles, and what recognisers write",
    }
    add_input(parser, "--transcript", what="transcript", replaceable=True, **transcript)
    add_lexicon_argument(parser)
    edited = "phones in time from an earlier .json, .npz or .TextGrid, edited or not, or from Audacity labels"
    add_input(parser, "--units", what="units file", replaceable=True, metavar="FILE", help=edited)
    add_recogniser_argument(parser)
    add_speaker_argument(parser)
    add_style_arguments(parser)


def add_recognition_arguments(parser: argparse.ArgumentParser) -> None:
    """Add recogniser, model, lexicon, speaker and style, for many recordings."""
    for add_argument in (add_recogniser_argument, add_model_argument, add_lexicon_argument, add_speaker_argument):
        add_argument(parser)
    add_style_arguments(parser)


def add_text_arguments(parser: argparse.ArgumentParser) -> None:
    """Add lexicon, model, speaker, another person and style, for a text."""
    for add_argument in (add_lexicon_argument, add_model_argument, add_speaker_argument, add_onto_arguments):
        add_argument(parser)
    add_style_arguments(parser)


def add_style_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--pauses`` and ``--asymmetry``: what the mouth does between phrases, and whether its sides differ."""
    styles = "rest: lips close softly in pauses (default); natural: as people do, who breathe and hold a sound"
    parser.add_argument("--pauses", choices=("rest", "natural"), default="rest", help=styles)
    lopsided = "0: both sides of the mouth move alike; 1: as on the speaker's own face (default: 0)"
    parser.add_argument("--asymmetry", type=float, default=0.0, metavar="X", help=lopsided)


def style_of(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of ``add_style_arguments`` by their names in ``SpeechRequest``."""
    return {"pauses": options.pauses, "asymmetry": options.asymmetry}


def add_speaker_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--speaker``: one of the people of the model."""
    whose = "whose motion, of the people that the model was trained on (default: the mean person; see lipmotion info)"
    parser.add_argument("--speaker", default="", metavar="NAME", help=whose)


def add_lexicon_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--lexicon``: pronunciations of words that the dictionary does not have."""
    add_input(parser, "--lexicon", what="lexicon", replaceable=True, metavar="FILE", help=LEXICON)


def add_model_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--model``; default: the model that ships with the package."""
    add_input(parser, "--model", what="model", replaceable=True, default_path=_shipped, help=MODEL)


def _shipped() -> Path:
    from lipmotion.pipeline.model import shipped_path

    return shipped_path()


def add_recogniser_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--recogniser``: how speech without a transcript is recognised."""
    kinds = (
        "auto, words (English), fast (phones alone), own (phone models of the model), general (of many voices), or "
        "words by an installed recogniser: whisper, vosk (default: auto)"
    )
    parser.add_argument("--recogniser", default="auto", metavar="KIND", help=kinds)


def request_and_model(options: argparse.Namespace) -> tuple[SpeechRequest, Model]:
    """Return the request of the arguments of ``add_speech_arguments``, files read, and the model."""
    from lipmotion.pipeline.model import load_model

    return spoken_request(options), load_model(options.model)


def model_loader(options: argparse.Namespace) -> Callable[[], Model]:
    """Return a function that loads the model when it is first called."""

    @cache
    def load() -> Model:
        from lipmotion.pipeline.model import load_model

        return load_model(options.model)

    return load


def spoken_request(options: argparse.Namespace, words_beside: bool = False) -> SpeechRequest:
    """Return the request of the arguments of ``add_speech_arguments``, files read.

    words_beside : use the text, subtitles or labels beside the recording, where no words and no phones are given
    """
    from lipmotion.cli.arguments.texts import text_or_file_content
    from lipmotion.corpora.labels import labels_beside
    from lipmotion.pipeline.understand.given_units import read_units
    from lipmotion.pipeline.understand.request import SpeechRequest
    from lipmotion.units import Lexicon

    transcript = text_or_file_content(options.transcript) if options.transcript is not None else None
    units = read_units(options.units) if options.units else None
    labels = labels_beside(options.speech) if words_beside and transcript is None and units is None else None
    if labels is not None:
        transcript, units = labels.transcript, labels.phones if labels.transcript is None else None
    return SpeechRequest(
        options.speech,
        transcript=transcript,
        units=units,
        lexicon=Lexicon.from_file(options.lexicon) if options.lexicon else None,
        recogniser=options.recogniser,
        speaker=options.speaker,
        onto=options.onto,
        onto_speaker=options.onto_speaker,
        **style_of(options),
    )
