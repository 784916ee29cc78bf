"""Text that comes from elsewhere, as a terminal may be given it."""

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
