"""Options of drawn faces, as several verbs have them."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lipmotion.cli.arguments.faces import is_filmed

if TYPE_CHECKING:
    from lipmotion.faces.base import Staging

MOVING = ("blinks", "gaze", "brows", "head")


def add_staging_arguments(parser: argparse.ArgumentParser) -> None:
    """Add how a drawn face is shown (docs/faces.md)."""
    parser.add_argument("--size", type=int, default=0, metavar="PIXELS", help="height of the face's picture")
    still = "what does not move on its own, with commas: blinks,gaze,brows,head"
    parser.add_argument("--still", default="", metavar="NAME,NAME", help=still)
    parser.add_argument("--face-seed", type=int, default=0, metavar="N", help="other blinks, glances and nods")


def staging_of(options: argparse.Namespace) -> Staging:
    """Return how a face is shown. Raises InputError: a value out of its range, or nothing of that name moves."""
    from lipmotion.errors import InputError
    from lipmotion.faces.base import SCENE, Staging

    still = [name for name in options.still.split(",") if name]
    unknown = [name for name in still if name not in MOVING]
    if unknown:
        raise InputError(f"--still names {unknown[0]!r}, required some of: {', '.join(MOVING)}")
    return Staging(
        size=options.size,
        background=SCENE if is_filmed(options) else options.background or SCENE,
        seed=options.face_seed,
        **{name: name not in still for name in MOVING},
    )
