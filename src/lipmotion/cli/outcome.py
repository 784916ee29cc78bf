"""What an error means to the caller of a command."""

from __future__ import annotations

from lipmotion.errors import InputError, LipMotionError
from lipmotion.printable import printable


def outcome(error: BaseException) -> tuple[int, str] | None:
    """Return the exit code and one line about an error that can be expected; None for a bug."""
    if isinstance(error, LipMotionError):
        return error.exit_code, printable(error)
    if isinstance(error, MemoryError):
        return InputError.exit_code, f"not enough memory ({error}); give a shorter recording or a smaller file"
    if isinstance(error, OSError):  # what the operating system refuses: no permission, a name too long
        return InputError.exit_code, printable(error)
    return None
