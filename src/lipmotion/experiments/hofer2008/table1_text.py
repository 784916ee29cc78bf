"""The figures of ``table1.hofer2008`` as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.experiments.comparison import sign_of_difference, significance_mark
from lipmotion.experiments.hofer2008.table1 import REFERENCE_SET
from lipmotion.measures.evaluation_table import figure_text

HEAD = (
    f"  {'set':6} units  paper  {'score (95 %)':22}precision  p b m  timing  {'ACC (95 %)':22}"
    "nRMSE   jerk  variance   K"
)
NOTES = (
    f"* differs from {REFERENCE_SET}: the 95 % interval of the difference on the same clips leaves out 0",
    "paper: its score, of another speaker, corpus and threshold of a closed mouth: only orders compare",
    "score, precision, p b m: %; timing: ms; ACC to variance: of the opening, jerk and variance by the recordings",
)


def table(figures: Mapping[str, Any]) -> str:
    """Return the tables of all conditions, each with a sentence on what held of the paper's order."""
    lines = [
        f"the system of Hofer 2008, trained on {figures['trained_on']} clips; split {figures['split']}: "
        f"{figures['clips']} clips; closed under {figures['closed_under']:.4f}",
        f"K: Gaussians a state for speech, of {', '.join(map(str, figures['mixtures']))}, chosen on val by ACC",
    ]
    for block in figures["tables"]:
        lines += ["", f"{block['states']} states; {block['condition']}; {block['pins']}", HEAD]
        lines += [_line(units, row) for units, row in block["rows"].items()]
        lines += [f"  {what_held(block)}"]
    return "\n".join([*lines, "", *NOTES])


def _line(units: str, row: Mapping[str, Any]) -> str:
    interval = "–".join(figure_text(end, ".1f") for end in row["score_95"])
    score = f"{figure_text(row['score'], '.1f')}{significance_mark(row['score_gain_95'])} ({interval})"
    acc = "{:.3f}{} ({:.3f}–{:.3f})".format(row["acc"], significance_mark(row["acc_gain_95"]), *row["acc_95"])
    return (
        f"  {units:6} {row['units']:5} {row['paper']:6.1f}  {score:22}{figure_text(row['precision'], '9.1f')}"
        f"{figure_text(row['recall_p_b_m'], '7.1f')}{figure_text(row['timing_ms'], '+8.0f')}  {acc:22}"
        f"{row['nrmse']:6.3f}{figure_text(row['jerk'], '7.2f')}{row['global_variance']:10.2f}{row['gaussians']:4}"
    )


def what_held(block: Mapping[str, Any]) -> str:
    """Return how many of the pairs of sets that the paper orders by score are ordered so here, and which is best."""
    signs = [sign_of_difference(pair["score_gain_95"]) for pair in block["paper_order"]]
    against = [
        f"{pair['worse']} over {pair['better']}"
        for pair, sign in zip(block["paper_order"], signs, strict=True)
        if sign < 0
    ]
    best = max(block["rows"], key=lambda units: block["rows"][units]["score"] or 0.0)
    reversed_pairs = f" ({', '.join(against)})" if against else ""
    return (
        f"best: {best}; of the paper's {len(signs)} pairs hold {signs.count(1)}, reversed {len(against)}"
        f"{reversed_pairs}, open {signs.count(0)}"
    )
