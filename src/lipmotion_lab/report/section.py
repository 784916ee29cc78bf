"""What a report says of one experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lipmotion.formats.web_page import Html
from lipmotion_lab.report.table import Table

FEW_CLIPS = 10
"""Bootstrap intervals over fewer recordings are too narrow to be believed."""


@dataclass(frozen=True)
class Section:
    """The words, charts and tables of one experiment.

    title    : the paper, or what is compared
    about    : what was trained and compared, in sentences
    verdict  : what was found, in one sentence
    words    : what held and what did not, in sentences, by what they are of
    charts   : drawings
    table    : the most important one
    more     : tables that are folded, each with the sentence above it
    shown    : systems whose motion is shown, by the names that ``ExperimentSettings.receive`` gets
    """

    title: str
    about: str
    verdict: str
    words: Mapping[str, Sequence[str]]
    charts: Sequence[Html]
    table: Table
    more: Sequence[tuple[str, Table]] = ()
    shown: Sequence[str] = ()

    @property
    def tables(self) -> list[Table]:
        """All tables."""
        return [self.table, *(table for _, table in self.more)]


def warning_of(clips: int) -> dict[str, list[str]]:
    """Return a warning, as words of a section, where so few recordings were compared that intervals are too narrow."""
    if clips >= FEW_CLIPS:
        return {}
    return {
        "Beware": [
            f"Only {clips} recordings were compared: intervals over fewer than {FEW_CLIPS} are too narrow, and nothing "
            "here tells systems apart for sure."
        ]
    }


def named(names: Sequence[str]) -> str:
    """Return names as a list in words; ``none`` for an empty one."""
    return ", ".join(names) or "none"


def difference(one: float | None, other: float | None) -> float | None:
    """Return by how much a figure is above another one; None where one of them is not defined."""
    return None if one is None or other is None else one - other
