"""One experiment in a report: words, tables, and whether the order in the paper held."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lipmotion.printable import printable
from lipmotion.storage.files import atomic_file, make_folder
from lipmotion.storage.sources import read_shipped_table
from lipmotion.storage.text_table import as_field
from lipmotion_lab.evaluation.evaluate import find_sign, mark_significance
from lipmotion_lab.evaluation.table import format_figure
from lipmotion_lab.report.html import Html, element, joined

INTERVAL, DIFFERENCE = "_95", "_gain_95"
"""Endings of the keys under which a row has the interval of a figure, and that of its difference from a reference."""
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """A figure of every row.

    key   : of the figure in a row; its interval and difference, where there are any, are beside it
    form  : how numbers are written; empty: a text
    note  : what the figure is, in words; empty: the title says it
    """

    key: str
    title: str
    form: str = ""
    note: str = ""


def read_columns(table: str) -> tuple[Column, ...]:
    """Return the columns of a table of ``columns.csv``, in order."""
    rows = read_shipped_table(__package__, "columns.csv")
    return tuple(Column(row["key"], row["title"], row["form"], row["note"]) for row in rows if row["table"] == table)


@dataclass(frozen=True)
class Table:
    """A table of a report.

    columns   : after the names of the rows
    reference : the row that differences are from; empty: there are no differences
    head      : what the rows are
    heading   : a sentence that stands above it, where it is not the first; empty: its caption
    """

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Mapping[str, Row]
    reference: str = ""
    head: str = "system"
    heading: str = ""

    def list_records(self) -> list[dict[str, Any]]:
        """Return the rows as flat records with the same keys in each; intervals as two figures."""
        endings = ((INTERVAL, ""), (DIFFERENCE, "_difference"))
        records = []
        for head, row in self.rows.items():
            record: dict[str, Any] = {self.head: head}
            for column in self.columns:
                record[column.key] = row.get(column.key)
                for ending, name in endings:
                    if any(column.key + ending in each for each in self.rows.values()):
                        low, high = row.get(column.key + ending) or (None, None)
                        record |= {f"{column.key}{name}_low": low, f"{column.key}{name}_high": high}
            records.append(record)
        return records

    def as_csv(self) -> str:
        """Return the records as CSV; what is not defined is empty."""
        text, records = io.StringIO(), self.list_records()
        rows = csv.DictWriter(text, list(records[0]) if records else [self.head])
        rows.writeheader()
        for record in records:
            rows.writerow({key: as_field(value) if isinstance(value, str) else value for key, value in record.items()})
        return text.getvalue()

    @property
    def star(self) -> str:
        """What the star beside a figure says."""
        return f"*: the 95 % interval of the difference from {self.reference} leaves out 0. " if self.reference else ""

    def as_lines(self) -> list[str]:
        """Return the table as lines of text; intervals are in brackets."""
        texts = [[self.head, *(column.title for column in self.columns)]]
        for name, row in self.rows.items():
            cells = (_format_cell(column, row) for column in self.columns)
            texts.append([name, *(f"{figure} ({interval})" if interval else figure for figure, interval in cells)])
        widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
        return ["  ".join(map(str.ljust, line, widths)).rstrip() for line in texts]

    def as_html(self, folder: str) -> Html:
        """Return the table on the page; where it is wider than the screen, it scrolls by itself."""
        heads = [
            element("th", self.head, scope="col"),
            *(element("th", each.title, scope="col", class_="number" if each.form else None) for each in self.columns),
        ]
        lines = []
        for name, row in self.rows.items():
            cells = [element("th", name, scope="row")]
            for column in self.columns:
                figure, interval = _format_cell(column, row)
                small = (" ", element("small", interval)) if interval else ()
                cells.append(element("td", figure, *small, class_="number" if column.form else None))
            lines.append(element("tr", *cells))
        table = element(
            "table", element("caption", self.caption), element("thead", element("tr", *heads)), element("tbody", *lines)
        )
        file = element("a", "CSV", href=f"{folder}/tables/{self.name}.csv")
        notes = [joined(element("dt", each.title), element("dd", each.note)) for each in self.columns if each.note]
        about = element(
            "div",
            element("p", self.star, "This table as ", file, "."),
            element("details", element("summary", "What the columns are"), element("dl", *notes)),
            class_="note",
        )
        scrolls = element("div", table, class_="scroll", tabindex="0", role="region", aria_label=self.caption)
        return joined(scrolls, about)


def _format_cell(column: Column, row: Row) -> tuple[str, str]:
    """Return a figure with its star, and its interval; empty texts where there is none."""
    value = row.get(column.key)
    if not column.form:
        return "–" if value is None else str(value), ""
    mark = mark_significance(row.get(column.key + DIFFERENCE) or (None, None))
    low, high = row.get(column.key + INTERVAL) or (None, None)
    form = column.form.replace("+", "")
    interval = "" if low is None or high is None else f"{low:{form}}–{high:{form}}"
    return format_figure(value, column.form).strip() + mark, interval


FEW_CLIPS = 10  # bootstrap intervals over fewer recordings are too narrow to be believed


@dataclass(frozen=True)
class Section:
    """The words and tables of one experiment.

    about    : what was trained and compared, in sentences
    verdict  : what was found, in one sentence
    words    : by heading, sentences on what held and what did not
    table    : the most important one
    shown    : systems whose motion is shown, by the names that ``ExperimentSettings.receive`` gets
    """

    title: str
    about: str
    verdict: str
    words: Mapping[str, Sequence[str]]
    table: Table
    more: Sequence[Table] = ()
    shown: Sequence[str] = ()

    @property
    def tables(self) -> list[Table]:
        """All tables."""
        return [self.table, *self.more]

    def write_tables(self, folder: Path) -> None:
        """Write all tables to a folder, as CSV."""
        make_folder(folder)
        for table in self.tables:
            write_text(folder / f"{table.name}.csv", table.as_csv())

    def as_text(self) -> str:
        """Return what a terminal shows: what was compared, the tables, what their columns are, and what was found."""
        lines = [self.about]
        for table in self.tables:
            lines += ["", table.heading or table.caption, *table.as_lines()]
        notes = {f"{column.title}: {column.note}" for table in self.tables for column in table.columns if column.note}
        lines += ["", *dict.fromkeys(table.star for table in self.tables if table.star), *sorted(notes)]
        for title, sentences in self.words.items():
            lines += ["", title, *sentences]
        return "\n".join(printable(line).rstrip() for line in [*lines, "", self.verdict])


def write_text(path: Path, text: str) -> None:
    """Write a text file as it is, whole or not at all."""
    with atomic_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8", newline="")


def warn_of_few(clips: int) -> dict[str, list[str]]:
    """Return a warning, as words of a section, where so few recordings were compared that intervals are too narrow."""
    warning = (
        f"Only {clips} recordings were compared: intervals over fewer than {FEW_CLIPS} are too narrow, and nothing "
        "here tells systems apart for sure."
    )
    return {"Beware": [warning]} if clips < FEW_CLIPS else {}


CHANCE = 0.05  # share of 95 % intervals that leave out 0 where nothing differs


@dataclass(frozen=True)
class PaperPair:
    """Two systems, the first better in print, and their difference here, positive as in print (None: undefined)."""

    better: str
    worse: str
    difference: float | None
    interval: Sequence[float | None]

    @property
    def sign(self) -> int:
        """1: it holds here; -1: it is reversed; 0: the interval contains 0, so these recordings leave it open."""
        return find_sign(self.interval)


@dataclass(frozen=True)
class PaperOrder:
    """The order of some systems by a figure, in a paper and here.

    pairs    : every two systems
    form     : how a difference is written
    is_error : whether the smallest value is the best
    """

    figure: str
    paper: Mapping[str, float]
    here: Mapping[str, float | None]
    pairs: Sequence[PaperPair]
    form: str
    is_error: bool = False

    def judge(self) -> str:
        """Return in two sentences whether the paper's order held, and which system is best."""
        signs = [pair.sign for pair in self.pairs]
        held, reverse = signs.count(1), signs.count(-1)
        verdict = f"{self.figure}: of the paper's {len(signs)} pairs {held} held, {reverse} reversed, "
        verdict += f"{signs.count(0)} open: "
        if held or reverse:
            outcomes = ("as many held as reversed", "more held than reversed", "more reversed than held")
            verdict += "all held" if held == len(signs) else outcomes[(held > reverse) - (held < reverse)]
        else:
            verdict += "these recordings say nothing of its order"
        here = ", ".join(self._list_best(self.here)) or "none"
        return f"{verdict}. Best in print: {self._list_best(self.paper)[0]}; here: {here}."

    def describe(self) -> list[str]:
        """Return what held and what did not, sentence by sentence."""
        sentences = [f"In print: {self._list(self.paper)}.", f"Here: {self._list(self.here)}."]
        best, here = self._list_best(self.paper)[0], self._list_best(self.here)
        pair = next((each for each in self.pairs if here and {each.better, each.worse} == {best, here[0]}), None)
        if best not in here and pair is not None and pair.difference is not None:
            low, high = pair.interval
            lies = "" if low is None or high is None else f", 95 % interval {low:{self.form}} to {high:{self.form}}"
            sentences.append(
                f"The paper's best is {-pair.difference:{self.form.replace('+', '')}} behind the best here: {best} "
                f"against {here[0]} {pair.difference:{self.form}}{lies}, where print has it above 0."
            )
        outcomes = {
            1: "Held: the interval of the difference is on the paper's side of 0",
            -1: "Reversed: it is on the other side",
            0: "Open: it contains 0",
        }
        for sign, what in outcomes.items():
            grouped: dict[str, list[str]] = {}  # pairs of the same first system together; the better one here first
            pairs = [pair for pair in self.pairs if pair.sign == sign]
            for pair in pairs:
                first, second = (pair.worse, pair.better) if sign < 0 else (pair.better, pair.worse)
                grouped.setdefault(first, []).append(second)
            if pairs:
                joint = "over" if sign else "and"
                names = "; ".join(f"{first} {joint} {', '.join(others)}" for first, others in grouped.items())
                sentences.append(f"{what} ({len(pairs)} of {len(self.pairs)} pairs): {names}.")
        agreeing = sum((pair.difference or 0) > 0 for pair in self.pairs)
        sentences.append(
            f"Intervals aside, {agreeing} of {len(self.pairs)} differences have the paper's sign. Of {len(self.pairs)} "
            f"intervals about {CHANCE * len(self.pairs):.1f} would leave out 0 by chance if nothing differed."
        )
        return sentences

    def _list(self, values: Mapping[str, float | None]) -> str:
        """Return names with their values, from the best to the worst; those without a value are left out."""
        known = [(name, value) for name, value in values.items() if value is not None]
        form = self.form.replace("+", "")
        known.sort(key=lambda pair: pair[1], reverse=not self.is_error)
        return ", ".join(f"{name} {value:{form}}" for name, value in known)

    def _list_best(self, values: Mapping[str, float | None]) -> list[str]:
        known = {name: value for name, value in values.items() if value is not None}
        best = (min if self.is_error else max)(known.values(), default=None)
        return [name for name, value in known.items() if value == best]
