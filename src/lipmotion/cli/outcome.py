"""Exit codes and one-line messages of errors."""

from __future__ import annotations

from lipmotion.errors import InputError, LipMotionError
from lipmotion.printable import printable

BEGIN, END = 700, 300
"""Characters of a long line that are shown from its beginning and from its end."""


def outcome(error: BaseException) -> tuple[int, str] | None:
    """Return the exit code and the one-line message of an expected error; None: the error is a bug."""
    if isinstance(error, LipMotionError):
        return error.exit_code, one_line(error)
    if isinstance(error, MemoryError):
        return InputError.exit_code, f"not enough memory ({error}); give a shorter recording or a smaller file"
    if isinstance(error, OSError):  # what the operating system refuses: no permission, a name too long
        return InputError.exit_code, one_line(error)
    return None


def one_line(message: object) -> str:
    """Return a message as a printable line of limited length; the middle of a longer one is left out, for its end says
    what to do."""
    line = printable(message)
    return line if len(line) <= BEGIN + END else f"{line[:BEGIN]} ... {line[-END:]}"
