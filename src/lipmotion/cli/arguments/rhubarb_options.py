"""The options of Rhubarb Lip Sync, for scripts and add-ons that were written for it: taken, or answered.

Source: Rhubarb Lip Sync 1.13, its README. Deviations: a dialogue is aligned word for word, not a hint; a frame rate
counts for every format; the names in ``.dat`` files are always Preston Blair's.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NoReturn

from lipmotion.errors import shortened
from lipmotion.storage.sources import is_file

RECOGNISERS = {"pocketSphinx": "auto", "phonetic": "fast"}
"""The recogniser that takes the place of each of Rhubarb's."""
WITHOUT_EFFECT = ("--datUsePrestonBlair", "-q", "--quiet")
"""What is so in any case: the names of ``.dat`` files, and nothing on standard error but warnings and errors."""
INSTEAD = {
    "--threads": "leave it out: one recording needs one; 'lipmotion batch --workers N' for many recordings",
    "--logFile": "messages go to standard error: 2> FILE; as JSON lines: --machineReadable",
    "--logLevel": "messages go to standard error: 2> FILE; as JSON lines: --machineReadable",
    "--consoleLevel": "leave it out: warnings and errors alone are printed; as JSON lines: --machineReadable",
}
"""What to do instead of options that have no counterpart."""


def add_rhubarb_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of Rhubarb to the parser of ``cues``, which has those that take their place."""
    group = parser.add_argument_group("options of Rhubarb")
    add = group.add_argument
    unset: dict[str, Any] = {"default": argparse.SUPPRESS}
    add("-d", "--dialogFile", metavar="FILE", dest="transcript", type=_dialogue, help="--transcript FILE", **unset)
    kinds = "|".join(RECOGNISERS)
    told = "--recogniser: " + ", ".join(f"{old} is {new}" for old, new in RECOGNISERS.items())
    add("-r", "--recognizer", metavar=kinds, dest="recogniser", type=_recogniser, help=told, **unset)
    add("--extendedShapes", metavar="GHX", dest="shapes", help="--shapes", **unset)
    add("--datFrameRate", metavar="FPS", dest="fps", type=float, help="--fps, for every format", **unset)
    add(*WITHOUT_EFFECT, action="store_true", dest="without_effect", help="so in any case")
    add(*INSTEAD, action=_Answered, help=argparse.SUPPRESS)


def _dialogue(path: str) -> str:
    """Return the path of a dialogue: it is never taken for the words. Raises ArgumentTypeError: no such file."""
    if not is_file(Path(path)):
        raise argparse.ArgumentTypeError(f"no such file: {shortened(path)!r}; the words themselves: --transcript TEXT")
    return path


def _recogniser(name: str) -> str:
    """Return our name of a recogniser; one that is not Rhubarb's is taken for ours."""
    return RECOGNISERS.get(name, name)


class _Answered(argparse.Action):
    """Says what to do instead of an option."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,  # noqa: ARG002
        values: object,  # noqa: ARG002
        option: str | None = None,
    ) -> NoReturn:
        parser.error(f"{option} is an option of Rhubarb that lipmotion has not; {INSTEAD[str(option)]}")
