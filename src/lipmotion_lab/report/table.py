"""Tables of a report: figures with intervals and paired differences, as CSV, as JSON and on the page."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lipmotion.formats.web_page import Html, element, joined
from lipmotion.measures.evaluation_table import figure_text
from lipmotion.storage.text_table import as_field
from lipmotion_lab.comparison import significance_mark

INTERVAL, DIFFERENCE = "_95", "_gain_95"
"""Endings of the keys under which a row has the interval of a figure, and that of its difference from a reference."""
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """A figure of every row.

    key   : of the figure in a row; its interval and difference, where there are any, are beside it
    title : above the column
    form  : how numbers are written; empty: a text
    note  : what the figure is, in words; empty: the title says it
    """

    key: str
    title: str
    form: str = ""
    note: str = ""


ACC = Column("acc", "ACC", ".3f", "correlation of the opening with the recording")
NRMSE = Column("nrmse", "nRMSE", ".3f")
SCORE = Column("score", "score", ".1f", "closings of the recording that the motion makes within two frames, in %")
PRECISION = Column("precision", "precision", ".1f", "generated closings that are of the recording, in %")
RECALL = Column("recall_p_b_m", "p b m", ".1f", "p, b and m in which the lips close, in %")
VARIANCE = Column("global_variance", "variance", ".2f", "of the opening, by that of the recording")
JERK = Column("jerk", "jerk", ".2f", "of the opening, by that of the recording")
ELSEWHERE = Column("false_per_minute", "elsewhere", ".1f", "closings outside p, b and m, a minute of speech")
OPENING = (ACC, NRMSE, SCORE, PRECISION, RECALL, VARIANCE)
"""What the experiments that no paper printed say of the opening."""


@dataclass(frozen=True)
class Table:
    """A table of a report.

    name      : of its files
    caption   : above it
    columns   : after the names of the rows
    rows      : by name
    reference : the row that differences are from; empty: there are no differences
    head      : what the rows are
    """

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Mapping[str, Row]
    reference: str = ""
    head: str = "system"

    def records(self) -> list[dict[str, Any]]:
        """Return the rows as flat records with the same keys in each; intervals as two figures."""
        return [{self.head: name} | self._record(row) for name, row in self.rows.items()]

    def as_csv(self) -> str:
        """Return the records as CSV; what is not defined is empty."""
        text, records = io.StringIO(), self.records()
        rows = csv.DictWriter(text, list(records[0]) if records else [self.head])
        rows.writeheader()
        for record in records:
            rows.writerow({key: as_field(value) if isinstance(value, str) else value for key, value in record.items()})
        return text.getvalue()

    def as_content(self) -> dict[str, Any]:
        """Return the table as content of a JSON file."""
        columns = {column.key: column.note or column.title for column in self.columns}
        about = {"caption": self.caption, "reference": self.reference or None, "columns": columns}
        return about | {"rows": self.records()}

    def as_html(self, folder: str) -> Html:
        """Return the table on the page; where it is wider than the screen, it scrolls by itself.

        folder : beside the page, that has the folder ``tables`` with its files
        """
        heads = [element("th", self.head, scope="col"), *map(_head, self.columns)]
        lines = [
            element("tr", element("th", name, scope="row"), *(_cell(column, row) for column in self.columns))
            for name, row in self.rows.items()
        ]
        table = element(
            "table",
            element("caption", self.caption),
            element("thead", element("tr", *heads)),
            element("tbody", *lines),
        )
        scrolls = element("div", table, class_="scroll", tabindex="0", role="region", aria_label=self.caption)
        return joined(scrolls, element("div", *self._notes(folder), class_="note"))

    def _record(self, row: Row) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for column in self.columns:
            found[column.key] = row.get(column.key)
            for ending, name in ((INTERVAL, ""), (DIFFERENCE, "_difference")):
                if any(column.key + ending in each for each in self.rows.values()):
                    low, high = row.get(column.key + ending) or (None, None)
                    found |= {f"{column.key}{name}_low": low, f"{column.key}{name}_high": high}
        return found

    def _notes(self, folder: str) -> list[Html]:
        """Return the star, the files, and what the columns are."""
        files = [element("a", kind.upper(), href=f"{folder}/tables/{self.name}.{kind}") for kind in ("csv", "json")]
        star = f"*: the 95 % interval of the difference from {self.reference} leaves out 0. " if self.reference else ""
        notes = [joined(element("dt", each.title), element("dd", each.note)) for each in self.columns if each.note]
        return [
            element("p", star, "This table as ", files[0], " and ", files[1], "."),
            element("details", element("summary", "What the columns are"), element("dl", *notes)),
        ]


def _head(column: Column) -> Html:
    return element("th", column.title, scope="col", class_="number" if column.form else None)


def _cell(column: Column, row: Row) -> Html:
    value = row.get(column.key)
    if not column.form:
        return element("td", "–" if value is None else str(value))
    mark = significance_mark(row.get(column.key + DIFFERENCE) or (None, None))
    text: list[str] = [figure_text(value, column.form).strip() + mark]
    low, high = row.get(column.key + INTERVAL) or (None, None)
    if low is not None and high is not None:
        form = column.form.replace("+", "")
        text += [" ", element("small", f"{low:{form}}–{high:{form}}")]
    return element("td", *text, class_="number")
