"""What a report says of Table 1 of Hofer 2008."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.experiments.hofer2008.table1 import PAPER_SCORES, PINS, REFERENCE_SET, what_held
from lipmotion.experiments.report.charts import Dot, dots
from lipmotion.experiments.report.order import PaperOrder, PaperPair
from lipmotion.experiments.report.section import Section, difference, warning_of
from lipmotion.experiments.report.table import ACC, JERK, NRMSE, PRECISION, RECALL, SCORE, VARIANCE, Column, Table
from lipmotion.pipeline.evaluation.held_out import AUDIO_ONLY

AS_PRINTED = next(iter(PINS))
COLUMNS = (
    Column("paper", "paper: score", ".1f", "the paper's Table 1, in %: another speaker, corpus and threshold"),
    SCORE,
    PRECISION,
    RECALL,
    Column("timing_ms", "timing", "+.0f", "by how much closings are late, in ms"),
    ACC,
    NRMSE,
    JERK,
    VARIANCE,
    Column("units", "units", ".0f", "how many the set has"),
    Column("gaussians", "K", ".0f", "Gaussians a state for speech, chosen on val"),
)


def section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``hofer2008`` say; the paper's own case is audio alone, as printed, most states."""
    blocks = list(figures["tables"])
    most = max(block["states"] for block in blocks)
    main = next(
        block
        for block in blocks
        if (block["states"], block["condition"], block["pins"]) == (most, AUDIO_ONLY, AS_PRINTED)
    )
    order, others = _order(main), [block for block in blocks if block is not main]
    table = _table(main)
    charts = [
        dots(
            "Score of closings",
            "% of the recording's closings",
            [
                Dot(name, row["score"], row["score_95"], row["paper"])
                for name, row in sorted(table.rows.items(), key=lambda item: -item[1]["paper"])
            ],
        )
    ]
    closed = figures["closed_under"]
    about = (
        f"Which set of units predicts closings of the mouth best: the system of the paper, trained on "
        f"{figures['trained_on']} recordings with each of {len(main['rows'])} sets, compared on {figures['clips']} of "
        f"{figures['split']}. The mouth is closed under {closed:.4f} eye distances; the recordings close it "
        f"{next(iter(main['rows'].values()))['closings']} times. Shown first: sound alone, {AS_PRINTED}, {most} states."
    )
    words = warning_of(figures["clips"]) | {"The paper's order": order.sentences()}
    more = [(f"{_case(block)}: {what_held(block)}.", _table(block)) for block in others]
    shown = [f"{units}, {most} states" for units in table.rows]
    title = "Hofer, Yamagishi & Shimodaira 2008, Table 1: unit sets"
    return Section(title, about, order.verdict(), words, charts, table, more, shown)


def _order(block: Mapping[str, Any]) -> PaperOrder:
    rows = block["rows"]
    pairs = [
        PaperPair(
            pair["better"],
            pair["worse"],
            difference(rows[pair["better"]]["score"], rows[pair["worse"]]["score"]),
            pair["score_gain_95"],
        )
        for pair in block["paper_order"]
    ]
    paper = {name: PAPER_SCORES[name] for name in rows}
    return PaperOrder("Score of closings", paper, {name: row["score"] for name, row in rows.items()}, pairs, "+.1f")


def _table(block: Mapping[str, Any]) -> Table:
    name = f"hofer2008-{block['states']}-states-{block['condition']}-{block['pins']}".replace(" ", "-")
    return Table(name, f"Unit sets, {_case(block)}", COLUMNS, block["rows"], REFERENCE_SET, "unit set")


def _case(block: Mapping[str, Any]) -> str:
    return f"{block['states']} states, {block['condition']}, {block['pins']}"
