"""What a report says of the experiments that no paper printed: all engines, learning curve, folds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.experiments.comparison import sign_of_difference
from lipmotion.experiments.report.charts import Dot, dots, rising
from lipmotion.experiments.report.section import Section, difference, named, warning_of
from lipmotion.experiments.report.table import ELSEWHERE, JERK, OPENING, Column, Table
from lipmotion.measures.evaluation_table import figure_text
from lipmotion.pipeline.evaluation.held_out import AUDIO_ONLY


def engines_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``engines`` say."""
    reference, tables = figures["reference"], {}
    for condition, found in figures["conditions"].items():
        rows = {
            name: {**row, "acc_gain_95": row["acc_gain_95"].get(reference)} for name, row in found["systems"].items()
        }
        name, columns = f"engines-{condition}".replace(" ", "-"), (*OPENING, ELSEWHERE, JERK)
        tables[condition] = Table(name, f"Engines, {condition}", columns, rows, reference)
    main = tables.pop(AUDIO_ONLY)
    signs = {name: sign_of_difference(row["acc_gain_95"]) for name, row in main.rows.items() if name != reference}
    best = max(main.rows, key=lambda name: main.rows[name]["acc"] or 0.0)
    acc = figure_text(main.rows[best]["acc"], ".3f")
    verdict = f"Most alike to the recordings: {best} (ACC {acc}); nothing is in print to compare."
    said = ((1, "higher than that"), (-1, "lower than that"), (0, "not different for sure from that"))
    words = warning_of(figures["clips"]) | {
        "ACC of the opening": [
            f"{what.capitalize()} of the engine {reference}: {named([n for n, each in signs.items() if each == sign])}."
            for sign, what in said
        ]
    }
    minutes = ", ".join(sorted({f"{row['minutes']}" for row in figures["models"].values()}))
    about = (
        f"All engines with their defaults, trained on {minutes} minutes, on {figures['clips']} "
        f"recordings of {figures['split']}, with closed lips forced in p, b and m."
    )
    charts = [dots("ACC of the opening", "ACC", [Dot(n, r["acc"], r["acc_95"]) for n, r in main.rows.items()])]
    more = [(table.caption, table) for table in tables.values()]
    return Section("The engines of this project", about, verdict, words, charts, main, more, list(main.rows))


def learning_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``learning_curve`` say."""
    sizes = {str(row["names"]): row for row in figures["rows"]}
    trained = (
        Column("used", "used", ".0f", "recordings that could be used"),
        Column("minutes", "minutes", ".1f", "of training"),
        Column("seconds", "seconds", ".0f", "that training took"),
    )
    conditions = list(figures["rows"][0]["conditions"])
    tables = {
        condition: Table(
            f"learning-curve-{condition}".replace(" ", "-"),
            f"Learning curve, {condition}",
            (*trained, *OPENING),
            {size: {**row, **row["conditions"][condition]} for size, row in sizes.items()},
            head="recordings",
        )
        for condition in conditions
    }
    main = tables.pop(AUDIO_ONLY)
    first, last = next(iter(main.rows)), list(main.rows)[-1]
    low, high = (figure_text(main.rows[size]["acc"], ".3f") for size in (first, last))
    steps = [size for size, before in zip(list(main.rows)[1:], main.rows, strict=False) if _fell(main, before, size)]
    words = warning_of(figures["clips"]) | {
        "More recordings": [
            f"From {first} to {last} recordings the correlation of the opening goes from {low} to {high}.",
            f"It falls at: {', '.join(steps)}." if steps else "It falls at no step.",
        ]
    }
    lines = {
        condition: [
            (float(size), Dot(size, row["conditions"][condition]["acc"], row["conditions"][condition]["acc_95"]))
            for size, row in sizes.items()
        ]
        for condition in conditions
    }
    about = (
        f"The default engine trained on the first recordings of the training list alone, in a random order, "
        f"compared on {figures['clips']} of {figures['split']}."
    )
    verdict = f"ACC {low} with {first} recordings, {high} with {last}."
    charts = [rising("ACC of the opening over recordings", "recordings", lines)] if len(sizes) > 1 else []
    more = [(table.caption, table) for table in tables.values()]
    shown = [f"{size} recordings" for size in dict.fromkeys((first, last))]
    return Section("Learning curve", about, verdict, words, charts, main, more, shown)


def _fell(table: Table, before: str, after: str) -> bool:
    return (difference(table.rows[after]["acc"], table.rows[before]["acc"]) or 0) < 0


def folds_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``folds`` say."""
    rows = figures["conditions"]
    original = Column("original_per_minute", "recorded elsewhere", ".1f", "the same of the recordings")
    table = Table(
        "folds", f"Cross-validation, {figures['folds']} folds", (*OPENING, ELSEWHERE, original), rows, head="condition"
    )
    row = rows[AUDIO_ONLY]
    acc, clips = figure_text(row["acc"], ".3f"), figures["clips"]
    verdict = f"ACC {acc} on {clips} recordings, each generated by a model of the others."
    about = (
        f"The training list in {figures['folds']} parts: each is generated by a model of the others, "
        f"{min(figures['trained_on'])} to {max(figures['trained_on'])} recordings."
    )
    words = warning_of(figures["clips"]) | {
        "More closings than a test list has": [
            f"Of {row['p_b_m']} p, b and m the lips close in {figure_text(row['recall_p_b_m'], '.1f')} %; of "
            f"{row['closings']} closings {figure_text(row['score'], '.1f')} % are made in time."
        ]
    }
    return Section("Cross-validation", about, verdict, words, [], table)
