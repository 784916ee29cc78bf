"""What a report says of Table 3 of Xie & Liu 2007."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.experiments.report.charts import Dot, dots
from lipmotion.experiments.report.order import PaperOrder, PaperPair
from lipmotion.experiments.report.section import Section, warning_of
from lipmotion.experiments.report.table import RECALL, SCORE, VARIANCE, Column, Table
from lipmotion.experiments.xie_liu2007.systems import PAPER_FIGURES, REFERENCE_SYSTEM, TUNED
from lipmotion.pipeline.evaluation.held_out import AUDIO_ONLY

COLUMNS = (
    Column("paper_acc", "paper: ACC", ".3f", "the paper's Table 3, of eigenlips of another speaker"),
    Column("acc", "ACC", ".3f", "mean correlation of the channels with the recording"),
    Column("paper_amse", "paper: AMSE", ".3f", "in the paper's units of eigenlips, which do not compare"),
    Column("amse", "AMSE", ".4f", "mean distance from the recording, smaller is better"),
    Column("opening_acc", "opening", ".3f", "correlation of the opening alone"),
    SCORE,
    RECALL,
    VARIANCE,
    Column("lag_ms", "lag", "+.0f", "in ms"),
    Column("parameters", "numbers", ".0f", "what the chains have learned"),
    Column("seconds", "seconds", ".1f", "of a processor, for training"),
)
MEASURES = (("acc", "ACC", "+.3f", False), ("amse", "AMSE", "+.4f", True))


def section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``xieliu2007`` say, of the largest number of recordings."""
    size = figures["rows"][-1]
    tables = {
        condition: Table(
            f"xieliu2007-{condition}".replace(" ", "-"),
            f"Structures of chains, {condition}",
            COLUMNS,
            _rows(size, rows),
            REFERENCE_SYSTEM,
        )
        for condition, rows in size["conditions"].items()
    }
    main = tables.pop(AUDIO_ONLY)
    words, verdict, by_amse = warning_of(figures["clips"]), "", []
    for ending, called in (("", "as printed"), (TUNED, "as tuned on val")):
        pairs = [pair for pair in size["pairs"] if pair["better"].endswith(TUNED) == bool(ending)]
        if pairs:
            acc, amse = (_order(main.rows, pairs, ending, measure) for measure in MEASURES)
            words[f"Systems {called}, by ACC"] = [*([acc.verdict()] if verdict else []), *acc.sentences()]
            by_amse.append(f"Systems {called}: {amse.verdict()}")
            verdict = verdict or acc.verdict()
    words["By AMSE"] = by_amse
    channels = figures["channels"]
    about = (
        f"Which structure of chains predicts lips best: {len(main.rows)} systems trained on {size['used']} recordings, "
        f"compared on {figures['clips']} of {figures['split']}, by {len(channels)} channels "
        f"({', '.join(channels[:3])}{', …' if len(channels) > 3 else ''})."
    )
    if figures["tuning"]["tried"]:
        about += " Tuned systems have what the print leaves open as it was best on val; nothing was chosen on test."
    shown = [Dot(name, row["acc"], row["acc_95"], row["paper_acc"]) for name, row in main.rows.items()]
    charts = [dots("ACC of every system", "ACC", shown)]
    title = "Xie & Liu 2007, Table 3: structures of chains"
    more = [(table.caption, table) for table in tables.values()]
    return Section(
        title, about, verdict, words, charts, main, more, [name for name in PAPER_FIGURES if name in main.rows]
    )


def _rows(size: Mapping[str, Any], rows: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the rows of a table, with what stands elsewhere: the paper's figures, the opening, the training."""
    found = {}
    for name, row in rows.items():
        amse, acc = PAPER_FIGURES.get(name.removesuffix(TUNED), (None, None))
        training = {key: size["training"][name][key] for key in ("parameters", "seconds")}
        found[name] = {**(row["opening"] or {}), **row, **training, "paper_amse": amse, "paper_acc": acc}
    return found


def _order(
    rows: Mapping[str, Mapping[str, Any]],
    pairs: Sequence[Mapping[str, Any]],
    ending: str,
    measure: tuple[str, str, str, bool],
) -> PaperOrder:
    """Return the paper's order of systems by one measure.

    ending : of their names here
    """
    key, name, form, is_error = measure
    compared = [
        PaperPair(
            pair["better"].removesuffix(ending),
            pair["worse"].removesuffix(ending),
            _turned([pair[key]], is_error)[0],
            _turned(pair[f"{key}_95"], is_error),
        )
        for pair in pairs
    ]
    names = [each for each in PAPER_FIGURES if each + ending in rows]
    paper = {each: PAPER_FIGURES[each][0 if is_error else 1] for each in names}
    here = {each: rows[each + ending][key] for each in names}
    return PaperOrder(name, paper, here, compared, form, is_error)


def _turned(values: Sequence[float | None], is_error: bool) -> tuple[float | None, ...]:
    """Return differences, or the ends of an interval, such that positive ones are better."""
    return tuple(None if value is None else -value for value in reversed(values)) if is_error else tuple(values)
