"""Texts from files and users, made safe for terminals and spreadsheets."""

from __future__ import annotations

import re
from unicodedata import normalize

_UNPRINTABLE = re.compile(
    "[\x00-\x1f\x7f-\x9f\xad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ufffe\uffff\ud800-\udfff"
    "\U000e0000-\U000e0fff]"
)
"""Characters that control a terminal or are invisible: both sets of control characters, line ends, changes of
direction, surrogates. The joiners that some scripts and emoji need are not among them."""
_NOT_IN_LINES = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff]")
"""Characters that a line of a text file cannot hold: control characters, line ends, surrogates and no characters."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""First characters of a field that a spreadsheet executes as a formula; full-width forms count as well."""


def is_line(text: str) -> bool:
    """Return whether text files of any format can hold a text in one line, perhaps with marks of direction."""
    return not _NOT_IN_LINES.search(text)


def is_formula(text: str) -> bool:
    """Return whether a spreadsheet would execute a text as a formula."""
    return text.startswith(FORMULA) or normalize("NFKC", text.lstrip()[:1]).startswith(FORMULA)


def printable(text: object) -> str:
    """Return a text as one line that cannot control a terminal: ``\\x1b``, ``\\n``, ``\\u202e`` for such characters."""
    return _UNPRINTABLE.sub(lambda match: match[0].encode("unicode_escape").decode("ascii"), str(text))
