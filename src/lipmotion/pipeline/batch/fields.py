"""Texts as fields of CSV files that people open with spreadsheets: none of them is computed as a formula."""

from __future__ import annotations

from lipmotion.storage.files import as_text

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What makes a field a formula for spreadsheets, at its beginning."""
QUOTE = "'"


def as_field(text: str) -> str:
    """Return a text as a field; one that a spreadsheet would compute gets an apostrophe first."""
    text = as_text(text)
    return QUOTE + text if _is_formula(text) else text


def from_field(field: str) -> str:
    """Return the text of a field that ``as_field`` made."""
    return field[1:] if field.startswith(QUOTE) and _is_formula(field) else field


def _is_formula(text: str) -> bool:
    """Return whether a text is a formula, or one behind apostrophes."""
    return text.lstrip(QUOTE).startswith(FORMULA)
