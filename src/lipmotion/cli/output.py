"""Standard output that takes no more."""

from __future__ import annotations

import os
import sys

from lipmotion.errors import ExportError


def discard_output() -> None:
    """Throw away what is still to be written: Python tries again when it ends, and nobody could be told then."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def refused(error: OSError) -> ExportError:
    """Return the error that says so, and discard the rest."""
    discard_output()
    return ExportError(f"standard output cannot be written: {error.strerror or error}")
