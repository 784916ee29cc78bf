"""What an error means to the caller of a command."""

from __future__ import annotations

from lipmotion.errors import InputError, LipMotionError
from lipmotion.printable import printable

BEGIN, END = 700, 300
"""Letters of a line that are shown at most, from both its ends."""


def outcome(error: BaseException) -> tuple[int, str] | None:
    """Return the exit code and one line about an error that can be expected; None for a bug."""
    if isinstance(error, LipMotionError):
        return error.exit_code, _cut(printable(error))
    if isinstance(error, MemoryError):
        return InputError.exit_code, f"not enough memory ({error}); give a shorter recording or a smaller file"
    if isinstance(error, OSError):  # what the operating system refuses: no permission, a name too long
        return InputError.exit_code, _cut(printable(error))
    return None


def _cut(line: str) -> str:
    """Return a line whose middle is left out where it repeats far too much of a file: its end says what to do."""
    return line if len(line) <= BEGIN + END else f"{line[:BEGIN]} ... {line[-END:]}"
