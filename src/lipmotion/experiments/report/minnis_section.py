"""What a report says of the unit selection of Minnis & Breen 2000."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from lipmotion.experiments.comparison import sign_of_difference
from lipmotion.experiments.minnis_breen2000.minnis2000 import ADDITIONS, EVERYTHING, PRINTED, UNGUIDED, VARIANTS
from lipmotion.experiments.report.charts import Dot, dots
from lipmotion.experiments.report.section import Section, difference, named, warning_of
from lipmotion.experiments.report.table import ACC, ELSEWHERE, NRMSE, RECALL, SCORE, VARIANCE, Column, Row, Table
from lipmotion.measures.evaluation_table import figure_text
from lipmotion.pipeline.evaluation.held_out import AUDIO_ONLY

COLUMNS = (
    ACC,
    replace(RECALL, note="p, b and m in which the lips close, without pins, in %"),
    SCORE,
    ELSEWHERE,
    NRMSE,
    VARIANCE,
    Column("joins_per_clip", "joins", ".1f", "a recording"),
    Column("joins_hard", "hard", ".0f", "joins at which units abut, in %"),
    Column("joins_smooth", "smooth", ".0f", "joins no rougher than 95 % of the speaker's own motion, in %"),
)


def section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``minnis2000`` say, on the last of its lists, which is ``test``."""
    tables = [
        Table(
            f"minnis2000-{split}-{condition}".replace(" ", "-"),
            f"Unit selection, {split}, {condition}",
            COLUMNS,
            _rows(rows),
            PRINTED,
        )
        for split, found in figures["lists"].items()
        for condition, rows in found["conditions"].items()
    ]
    split, last = list(figures["lists"].items())[-1]
    main = next(table for table in tables if table.caption == f"Unit selection, {split}, {AUDIO_ONLY}")
    rows, everything = main.rows, main.rows[EVERYTHING]
    acc = figure_text(rows[PRINTED]["acc"], ".3f"), figure_text(everything["acc"], ".3f")
    gained = difference(everything["acc"], rows[PRINTED]["acc"])
    sign = sign_of_difference(everything["acc_gain_95"])
    effect = ("leave open whether they change", "raise", "lower")[sign]
    verdict = (
        f"The paper prints no figures. All additions together {effect} the correlation of the opening: "
        f"{acc[0]} as printed, {acc[1]} with them ({_interval(gained, everything)})."
    )
    words = warning_of(last["clips"]) | {
        "Each addition alone": _effects(rows, ADDITIONS),
        "Other readings of the print": _effects(rows, VARIANTS),
        "Lips in p, b and m": [
            f"As printed, the lips close in {_percent(rows[PRINTED]['recall_p_b_m'])} of {rows[PRINTED]['p_b_m']} p, b "
            f"and m; with all additions in {_percent(everything['recall_p_b_m'])}; nothing is pinned."
        ],
    }
    about = (
        f"The system of the paper as printed, each addition of this project alone, and other readings of the print: "
        f"units of {figures['utterances']} recordings ({figures['minutes']} minutes), compared on {last['clips']} "
        f"recordings of {split}, sound alone."
    )
    shown = [Dot(name, row["acc"], row["acc_95"]) for name, row in rows.items()]
    charts = [dots("ACC of the opening", "ACC", shown)]
    more = [(table.caption, table) for table in tables if table is not main]
    title, compared = "Minnis & Breen 2000: unit selection", (PRINTED, UNGUIDED, EVERYTHING)
    return Section(title, about, verdict, words, charts, main, more, compared)


def _rows(rows: Mapping[str, Row]) -> dict[str, dict[str, Any]]:
    """Return the rows with the figures of their joins beside the others."""
    found = {}
    for name, row in rows.items():
        joins = row["joins"]
        shares = {f"joins_{key}": None if joins[key] is None else 100 * joins[key] for key in ("hard", "smooth")}
        found[name] = {**row, "joins_per_clip": joins["per_clip"], **shares}
    return found


def _effects(rows: Mapping[str, Row], names: Iterable[str]) -> list[str]:
    """Return which of some rows are better than the system as printed, worse, and neither for sure."""
    signs = {name: sign_of_difference(rows[name]["acc_gain_95"]) for name in names}
    printed = rows[PRINTED]["acc"]
    described = {name: f"{name} ({figure_text(difference(rows[name]['acc'], printed), '+.3f')})" for name in signs}
    said = ((1, "ACC is higher"), (-1, "ACC is lower"), (0, "The interval of the difference contains 0"))
    return [
        f"{what}: {named([described[name] for name, each in signs.items() if each == sign])}." for sign, what in said
    ]


def _interval(gained: float | None, row: Row) -> str:
    low, high = row["acc_gain_95"]
    told = figure_text(gained, "+.3f")
    return told if low is None else f"{told}, 95 % interval {low:+.3f} to {high:+.3f}"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{share:.1f} %"
