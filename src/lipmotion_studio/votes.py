"""Votes of blind comparisons: which of two motions of a recording somebody found better."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lipmotion.errors import InputError, shorten
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.storage.sources import read_text_file
from lipmotion.types.values import as_tuple, items, members, optional, text, value_of, whole

DIGEST = re.compile(r"[0-9a-f]{64}|")


@dataclass(frozen=True)
class Side:
    """One of two motions of a recording.

    model : digest of the model's file (SHA-256); empty: it was not kept
    edits : digest of the edits it was made with; empty: it was not kept
    Raises InputError: no name, or no digests.
    """

    name: str
    model: str
    edits: str

    def __post_init__(self) -> None:
        if not self.name or not DIGEST.fullmatch(self.model) or not DIGEST.fullmatch(self.edits):
            raise InputError(f"{shorten(repr(self))}: required a name, and digests as hexadecimal figures")

    @property
    def motion(self) -> tuple[str, str]:
        """What identifies the motion: the model (its name where no digest is known), and the edits."""
        return self.model or self.name, self.edits


@dataclass(frozen=True)
class Vote:
    """One answer of a blind comparison.

    shown  : the two motions, in the order in which they were shown
    better : place of the one that was found better, 0 or 1; None: neither
    Raises InputError: not two motions that differ, or ``better`` is none of them.
    """

    line: str
    shown: tuple[Side, ...]
    better: int | None = None

    def __post_init__(self) -> None:
        if len(self.shown) != 2 or self.shown[0].motion == self.shown[1].motion:
            raise InputError("these are not two motions that differ: required two models, or other edits")
        if self.better not in (0, 1, None):
            raise InputError(f"better is {shorten(repr(self.better))}, required 0, 1, or null: no difference")

    @property
    def compared(self) -> tuple[tuple[str, str], ...]:
        """The two, comparable over recordings: edits that both share belong to the recording and are left out."""
        first, second = (side.motion for side in self.shown)
        return ((first[0], ""), (second[0], "")) if first[1] == second[1] else (first, second)


def tally(votes: Sequence[Vote], vote: Vote) -> dict[str, Any]:
    """Return how often all votes found each of the two in ``vote`` ``better``, in its order, and ``neither``."""
    of_both = [each for each in votes if set(each.compared) == set(vote.compared)]
    better = [each.compared[each.better] for each in of_both if each.better is not None]
    return {"better": [better.count(side) for side in vote.compared], "neither": len(of_both) - len(better)}


def write_votes(path: Path, votes: Sequence[Vote]) -> None:
    """Write votes to a file. Raises ExportError: it cannot be written."""
    with atomic_file(path) as temporary:
        temporary.write_text(as_json([asdict(vote) for vote in votes]) + "\n", encoding="utf-8")


def read_votes(path: Path) -> tuple[Vote, ...]:
    """Return the votes in a file; none, where it is not there. Raises InputError: it cannot be read."""
    if not path.exists():
        return ()
    content = read_text_file(path, "votes")
    try:
        return tuple(items(_parse_vote)(from_json(content)))
    except ValueError as error:  # InputError is one
        raise InputError(f"{path}: {error}; put it right, or take it away") from error


_TEXT = text(4096)
_OLD_VOTE = {"line": _TEXT, "shown": items(_TEXT, 2, 2), "better": optional(_TEXT), "edits": text(64)}
_SIDE = {"name": _TEXT, "model": text(64), "edits": text(64)}
_VOTE = {"line": _TEXT, "shown": as_tuple(items(value_of(Side, _SIDE, _SIDE), 2, 2)), "better": optional(whole(0, 1))}


def _parse_vote(row: Any) -> Vote:
    """Return a vote; older files have no digests of models: two names, and one digest of the edits."""
    if not isinstance(row, dict) or "edits" not in row:
        return value_of(Vote, _VOTE, _VOTE)(row)
    old = members(_OLD_VOTE, _OLD_VOTE)(row)
    sides = tuple(Side(name, "", old["edits"]) for name in old["shown"])
    return Vote(old["line"], sides, old["shown"].index(old["better"]) if old["better"] else None)
