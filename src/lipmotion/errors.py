"""Every error that lipmotion raises on purpose.

A message says what was found, what is required and what to do next. ``exit_code`` is what the
command line returns for the class; 2 is kept for a wrong command line and 1 for a bug.
"""

from __future__ import annotations


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
