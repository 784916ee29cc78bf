"""The options of Rhubarb Lip Sync, for programs that start it: each is taken.

Source: Rhubarb Lip Sync 1.14, its README and ``main.cpp``. Deviations: a dialogue is aligned word for word, not a hint;
a frame rate counts for every format; exit codes are those of ``lipmotion``.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lipmotion.cli.arguments.options import Version
from lipmotion.cli.arguments.paths import add_output
from lipmotion.cli.terminal.status import LEVELS
from lipmotion.errors import shortened
from lipmotion.storage.sources import is_file
from lipmotion.types.values import whole_of

RECOGNISERS = {"pocketsphinx": "auto", "phonetic": "fast"}
"""The recogniser that takes the place of each of Rhubarb's."""
VERSION = "; takes the options of Rhubarb Lip Sync version 1.14.0"
"""What programs look for that ask whether Rhubarb is there, and which."""
BLANK = b" \t\r\n\0\xef\xbb\xbf\xfe\xff"


def add_rhubarb_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of Rhubarb to the parser of ``cues``, which has those that take their place."""
    group = parser.add_argument_group("options of Rhubarb")
    add = group.add_argument
    unset: dict[str, Any] = {"default": argparse.SUPPRESS}
    add("-d", "--dialogFile", metavar="FILE", dest="transcript", type=_dialogue, help="--transcript FILE", **unset)
    told = "--recogniser: pocketSphinx is auto, phonetic is fast"
    kinds = "pocketSphinx|phonetic"
    add("-r", "--recognizer", metavar=kinds, dest="recogniser", type=_recogniser, help=told, **unset)
    add("--extendedShapes", metavar="GHX", dest="shapes", help="--shapes", **unset)
    told = "--fps, for every format; in .dat shapes have their letters then"
    add("--datFrameRate", metavar="FPS", dest="fps", action=_DatFrameRate, type=float, help=told, **unset)
    told = "Preston Blair's names in .dat, as without --datFrameRate"
    add("--datUsePrestonBlair", action="store_true", dest="blair", help=told)
    add_output(parser, "--logFile", metavar="FILE", dest="log_file", help="a file for warnings and errors")
    level: dict[str, Any] = {"type": str.lower, "choices": tuple(LEVELS), "metavar": "LEVEL"}
    add("--logLevel", dest="log_level", default="debug", help=f"of --logFile, from: {', '.join(LEVELS)}", **level)
    add("--consoleLevel", dest="console_level", default="warning", help="of messages on standard error", **level)
    add("--threads", metavar="N", type=_threads, help="without effect: one recording needs one")
    add("-q", "--quiet", action="store_true", help="without effect: warnings and errors alone are printed")
    add("-v", "--version", action=Version, nargs=0, const=VERSION, help="print the version")


class _DatFrameRate(argparse.Action):
    """Sets the frame rate, and that shapes have their letters."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *given: Any) -> None:  # noqa: ARG002
        namespace.fps, namespace.letters = given[0], True


def _dialogue(path: str) -> str | None:
    """Return the path of a dialogue, which is never taken for the words; None: the file holds none.

    Raises ArgumentTypeError: no such file.
    """
    if not is_file(Path(path)):
        raise argparse.ArgumentTypeError(f"no such file: {shortened(path)!r}; the words themselves: --transcript TEXT")
    with Path(path).open("rb") as file:
        return path if file.read(1 << 16).strip(BLANK) else None


def _recogniser(name: str) -> str:
    """Return our name of a recogniser; one that is not Rhubarb's is taken for ours."""
    return RECOGNISERS.get(name.lower(), name)


def _threads(text: str) -> int:
    """Return a number of threads. Raises ArgumentTypeError: it is none, or under 1."""
    if (count := whole_of(text)) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}, required: 1 or more")
    return count
