"""The figures of ``engines`` as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.experiments.comparison import significance_mark
from lipmotion.measures.evaluation_table import figure_text
from lipmotion.printable import printable

NAME_WIDTH = 19
HEAD = (
    f"  {'system':{NAME_WIDTH}}{'ACC (95 %)':23}  nRMSE  variance  jerk  width | score  precision  p b m  false |"
    "  no pins: score  precision  p b m  false"
)
LEGEND = (
    "variance, jerk: by those of the recordings; width: its ACC; score, precision, p b m: %; false: closings outside "
    "p b m, a minute of speech; no pins: lips not made to meet"
)
CLOSURES = (("score", "6.1f"), ("precision", "11.1f"), ("recall_p_b_m", "7.1f"), ("false_per_minute", "7.0f"))


def table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``comparison.engines`` as text."""
    minutes = {row["minutes"] for row in figures["models"].values()}
    lines = [
        f"split {figures['split']}: {figures['clips']} clips; models of {' and '.join(map(str, sorted(minutes)))} "
        f"minutes of train; closed under {figures['closed_under']:.4f}"
    ]
    for name, condition in figures["conditions"].items():
        row = next(iter(condition["systems"].values()))
        lines += [
            "",
            f"{name}: opening, with {row['p_b_m']} p b m and {row['closings']} closings recorded, "
            f"{figure_text(row['original_per_minute'], '.0f')} a minute outside p b m",
            HEAD,
            *(_line(system, each, figures["reference"]) for system, each in condition["systems"].items()),
        ]
    lines += [
        "",
        f"* differs from {figures['reference']}: the 95 % interval of the difference on the same clips leaves out 0",
        LEGEND,
    ]
    return "\n".join(map(printable, lines))


def _line(name: str, row: Mapping[str, Any], reference: str) -> str:
    acc = "{}{} ({}–{})".format(
        figure_text(row["acc"], ".3f"),
        significance_mark(row["acc_gain_95"][reference]),
        *(figure_text(end, ".3f") for end in row["acc_95"]),
    )
    opening = figure_text(row["nrmse"], "7.3f") + figure_text(row["global_variance"], "10.2f")
    opening += figure_text(row["jerk"], "6.2f")
    return (
        f"  {name:{NAME_WIDTH}}{acc:23}{opening}{figure_text(row['width_acc'], '7.3f')} |{_closures(row)} |"
        f"{'':9}{_closures(row['unpinned'])}"
    )


def _closures(row: Mapping[str, Any]) -> str:
    return "".join(figure_text(row[name], form) for name, form in CLOSURES)
