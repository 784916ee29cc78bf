"""Arguments of the verbs that show a face."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from lipmotion.cli.paths import add_input

if TYPE_CHECKING:
    from lipmotion.pipeline.film.video import FilmOptions


def add_face_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the face of videos, and how a filmed face is shown."""
    face = "face that videos show: portrait, or a filmed face (default: portrait)"
    drawn: dict[str, Any] = {"type": str, "default": "portrait", "metavar": "NAME|FILE.face", "help": face}
    add_input(parser, "--face", what="face", replaceable=True, **drawn)
    footage = "footage of the same person into which a filmed face is stitched (default: the one in its file)"
    add_input(parser, "--background", what="background", metavar="VIDEO", help=footage)
    follows = "what the jaw of a filmed face follows: motion, energy or none (default: motion)"
    parser.add_argument("--jaw", choices=["motion", "energy", "none"], default="motion", help=follows)
    aid = "show the video of the speech with a large mouth of the filmed face, in a corner or over the speaker's own"
    parser.add_argument("--overlay", choices=["inset", "mouth"], help=aid)
    says = "how a video of a filmed face says that it is synthetic (default: metadata; docs/consent.md)"
    parser.add_argument("--mark", choices=["metadata", "visible", "none"], default="metadata", help=says)


def film_options(options: argparse.Namespace) -> FilmOptions:
    """Return how a filmed face is shown."""
    from lipmotion.pipeline.film.video import FilmOptions

    return FilmOptions(options.background, options.jaw, options.overlay, options.mark)
