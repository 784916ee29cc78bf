"""Votes of blind comparisons: which of two motions of a line somebody found better, without knowing which was which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.storage.files import read_text_file
from lipmotion.storage.json_text import as_json, from_json

LONGEST_NAME = 200
"""Most characters of the name of a motion."""


@dataclass(frozen=True)
class Vote:
    """One answer of a blind comparison.

    line   : name of the line
    shown  : names of the two motions, in the order in which they were shown
    better : name of the one that was found better; empty: neither
    edits  : digest of the line's edits as they were
    Raises InputError: these are not two, or the better one is neither.
    """

    line: str
    shown: tuple[str, ...]
    better: str = ""
    edits: str = ""

    def __post_init__(self) -> None:
        if len(set(self.shown)) != 2 or len(self.shown) != 2 or not all(self.shown):
            raise InputError(f"{len(self.shown)} motions were shown, required the names of two that differ")
        if self.better and self.better not in self.shown:
            raise InputError(
                f"better is {self.better!r}, required {' or '.join(self.shown)}, or nothing: no difference"
            )


def votes_text(votes: Sequence[Vote]) -> str:
    """Return votes as the text of their file."""
    return as_json([asdict(vote) for vote in votes]) + "\n"


def read_votes(path: Path) -> tuple[Vote, ...]:
    """Return the votes in a file; none, where it is not there. Raises InputError: it cannot be read."""
    if not path.exists():
        return ()
    try:
        rows = from_json(read_text_file(path, "votes"))
        named = ({name: str(row[name]) for name in ("line", "better", "edits")} for row in rows)
        return tuple(Vote(shown=tuple(map(str, row["shown"])), **texts) for row, texts in zip(rows, named, strict=True))
    except (ValueError, TypeError, KeyError) as error:  # InputError is a ValueError
        raise InputError(f"{path}: {error}; put it right, or take it away") from error
