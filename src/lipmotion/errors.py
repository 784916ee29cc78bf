"""The errors that lipmotion raises on purpose.

A message says what is wrong, what is required and what to do next. ``exit_code`` is the exit code of the command line
for each class; exit code 2 means a wrong command line, exit code 1 a bug.
"""

from __future__ import annotations

SHOWN_CHARACTERS = 80  # largest number of characters of a text from a user that a message repeats


def shorten(text: str) -> str:
    """Return a text, or its first ``SHOWN_CHARACTERS`` characters and ``...``, for a message."""
    return text if len(text) <= SHOWN_CHARACTERS else text[:SHOWN_CHARACTERS] + "..."


def shorten_list(names: list[str] | tuple[str, ...], count: int = 5) -> str:
    """Return the first names of a list, each shortened, and how many more there are, for a message."""
    more = f" and {len(names) - count} more" if len(names) > count else ""
    return ", ".join(map(shorten, names[:count])) + more


class LipMotionError(Exception):
    """Base class of all errors that are raised on purpose."""

    exit_code = 1


class InputError(LipMotionError, ValueError):
    """A recording, a text, a file or an argument is not usable."""

    exit_code = 3


class CorpusError(LipMotionError):
    """A corpus is missing or incomplete, or contains nothing that can be used for the task."""

    exit_code = 4


class AlignmentError(LipMotionError):
    """A transcript could not be aligned with its recording."""

    exit_code = 5


class ModelFormatError(LipMotionError):
    """A file is not a model, or it is damaged, or its version is unknown."""

    exit_code = 6


class ExportError(LipMotionError):
    """An output cannot be written, or its format is unknown."""

    exit_code = 7


class MissingDependencyError(LipMotionError, ImportError):
    """An optional package is required and not installed."""

    exit_code = 8
