"""Arguments of every verb that turns speech into motion."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lipmotion.cli.paths import add_input

LEXICON = "pronunciations: WORD PHONE PHONE ... a line"
MODEL = "trained model (default: the one that ships with the package)"


def add_speech_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording, what ``lipmotion.animate`` may be told about it, and the model."""
    add_hearing_arguments(parser)
    add_model_argument(parser)


def add_hearing_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording, and what may be told about it."""
    add_input(parser, "speech", what="recording", help="audio or video file")
    said: dict[str, Any] = {"type": str, "metavar": "TEXT|FILE", "help": "what is said, if known"}
    add_input(parser, "--transcript", what="transcript", replaceable=True, **said)
    add_lexicon_argument(parser)
    edited = "phones of an earlier .json or .npz, edited or not"
    add_input(parser, "--units", what="units file", replaceable=True, metavar="FILE", help=edited)
    add_recogniser_argument(parser)


def add_lexicon_argument(parser: argparse.ArgumentParser) -> None:
    """Add the pronunciations of words that the dictionary does not have."""
    add_input(parser, "--lexicon", what="lexicon", replaceable=True, metavar="FILE", help=LEXICON)


def add_model_argument(parser: argparse.ArgumentParser) -> None:
    """Add the model, which may be left out."""
    add_input(parser, "--model", what="model", replaceable=True, otherwise=_shipped, help=MODEL)


def _shipped() -> Path:
    from lipmotion.pipeline.model import shipped_path

    return shipped_path()


def add_recogniser_argument(parser: argparse.ArgumentParser) -> None:
    """Add the choice of phone models."""
    explained = "whose phone models: auto, own (the model's), general (those of many voices) (default: auto)"
    parser.add_argument("--recogniser", default="auto", metavar="WHOSE", help=explained)


def speech_arguments(options: argparse.Namespace) -> dict[str, Any]:
    """Return them as ``lipmotion.animate`` takes them, files read."""
    from lipmotion.cli.texts import text_or_file
    from lipmotion.export.base import read_motion
    from lipmotion.pipeline.model import load_model
    from lipmotion.units import Lexicon

    return {
        "transcript": text_or_file(options.transcript) if options.transcript is not None else None,
        "lexicon": Lexicon.from_file(options.lexicon) if options.lexicon else None,
        "model": load_model(options.model),
        "recogniser": options.recogniser,
        "units": read_motion(options.units)[1] if options.units else None,
    }
