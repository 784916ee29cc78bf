"""Every error that lipmotion raises on purpose.

A message says what was found, what is required and what to do next. ``exit_code`` is what the
command line returns for the class; 2 is kept for a wrong command line and 1 for a bug.
"""

from __future__ import annotations

import re

_UNPRINTABLE = re.compile(
    "[\x00-\x1f\x7f-\x9f\xad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff"
    "\U000e0000-\U000e0fff]"
)
"""What a terminal obeys instead of showing it, or shows as nothing: control characters of both sets, ends of lines,
changes of direction, half characters. Not the joiners that some scripts and emoji need."""


def printable(text: object) -> str:
    """Return text as one line that a terminal can only show: ``\\x1b``, ``\\n``, ``\\u202e`` for what it would obey."""
    return _UNPRINTABLE.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), str(text))


class LipMotionError(Exception):
    """Base of all errors raised on purpose."""

    exit_code = 1


class InputError(LipMotionError, ValueError):
    """A recording, a text, a file or an argument is not usable."""

    exit_code = 3


class CorpusError(LipMotionError):
    """A corpus is missing, incomplete, or has nothing that fits the request."""

    exit_code = 4


class AlignmentError(LipMotionError):
    """A transcript could not be aligned with its recording."""

    exit_code = 5


class ModelFormatError(LipMotionError):
    """A model file is not one, is damaged, or has an unknown version."""

    exit_code = 6


class ExportError(LipMotionError):
    """An output could not be written, or its format is unknown."""

    exit_code = 7


class MissingDependencyError(LipMotionError, ImportError):
    """An optional package is needed for this and is not installed."""

    exit_code = 8
