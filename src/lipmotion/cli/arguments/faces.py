"""Arguments of the verbs that show a face."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.paths import add_input

if TYPE_CHECKING:
    from lipmotion.pipeline.film.video import FilmOptions


def add_face_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the face of videos, and how a filmed face is shown."""
    face = (
        "face that videos show: woman, man, head, cartoon, a drawing, or a filmed face (default: portrait, the woman)"
    )
    drawn: dict[str, Any] = {"type": str, "default": "portrait", "metavar": "NAME|FILE.svg|FILE.face", "help": face}
    add_input(parser, "--face", what="face", **drawn)
    shown = "footage of the same person (default: that in its file); of a drawn face: transparent, or as #40a0ff"
    behind: dict[str, Any] = {"type": str, "metavar": "VIDEO|COLOUR", "help": shown}
    add_input(parser, "--background", what="background", **behind)
    follows = "what the jaw of a filmed face follows: motion, energy or none (default: motion)"
    parser.add_argument("--jaw", choices=["motion", "energy", "none"], default="motion", help=follows)
    aid = "show the video of the speech with a large mouth of the filmed face, in a corner or over the speaker's own"
    parser.add_argument("--overlay", choices=["inset", "mouth"], help=aid)
    says = "how a video of a filmed face says that it is synthetic (default: metadata; docs/consent.md)"
    parser.add_argument("--mark", choices=["metadata", "visible", "none"], default="metadata", help=says)


def film_options(options: argparse.Namespace) -> FilmOptions:
    """Return how a filmed face is shown."""
    from lipmotion.pipeline.film.video import FilmOptions

    footage = Path(options.background) if options.background and is_filmed(options) else None
    return FilmOptions(footage, options.jaw, options.overlay, options.mark)


def is_filmed(options: argparse.Namespace) -> bool:
    """Return whether the face is a filmed one."""
    return getattr(options.face, "has_own_background", False)  # a batch has the name of a face
