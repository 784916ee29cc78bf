"""Arguments of every verb that turns speech into motion."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_speech_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording, what ``lipmotion.animate`` may be told about it, and the model."""
    add_hearing_arguments(parser)
    parser.add_argument("--model", type=Path, help="trained model (default: the one that ships with the package)")


def add_hearing_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording, and what may be told about it."""
    parser.add_argument("speech", type=Path, help="audio or video file")
    parser.add_argument("--transcript", metavar="TEXT|FILE", help="what is said, if known")
    parser.add_argument("--lexicon", type=Path, metavar="FILE", help="pronunciations: WORD PHONE PHONE ... a line")
    parser.add_argument("--units", type=Path, metavar="FILE", help="phones of an earlier .json or .npz, edited or not")
    add_recogniser_argument(parser)


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
