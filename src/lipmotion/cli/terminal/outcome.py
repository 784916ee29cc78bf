"""Exit codes and one-line messages of errors."""

from __future__ import annotations

import errno
import os

from lipmotion.errors import InputError, LipMotionError
from lipmotion.extensions import failed_extension
from lipmotion.printable import printable

GONE = "the current folder has been deleted; go to one that exists"
HEAD_CHARACTERS, TAIL_CHARACTERS = 700, 300
"""Characters of a long line that are shown from its beginning and from its end."""


def outcome(error: BaseException) -> tuple[int, str] | None:
    """Return the exit code and the one-line message of an expected error, or one of an extension; None: a bug."""
    if isinstance(error, LipMotionError):
        return error.exit_code, one_line(error)
    if isinstance(error, MemoryError):
        return InputError.exit_code, f"not enough memory ({error}); give a shorter recording or a smaller file"
    if isinstance(error, OSError):  # what the operating system refuses: no permission, a name too long
        return InputError.exit_code, one_line(GONE if _is_nameless(error) else error)
    failed = failed_extension(error)
    return None if failed is None else (InputError.exit_code, one_line(failed))


def _is_nameless(error: OSError) -> bool:
    """Return whether something without a name is missing: the current folder."""
    return (error.errno, error.strerror, error.filename) == (errno.ENOENT, os.strerror(errno.ENOENT), None)


def one_line(message: object) -> str:
    """Return a message as a printable line of limited length; the middle of a longer one is left out, for its end says
    what to do."""
    line = printable(message)
    return (
        line
        if len(line) <= HEAD_CHARACTERS + TAIL_CHARACTERS
        else f"{line[:HEAD_CHARACTERS]} ... {line[-TAIL_CHARACTERS:]}"
    )
