"""The figures of ``minnis2000`` as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.experiments.comparison import significance_mark
from lipmotion.measures.evaluation_table import figure_text
from lipmotion.pipeline.evaluation.held_out import DISTANCES

WIDTH = 36
HEAD = f"  {'':{WIDTH}}{'ACC (95 %)':23}p b m  elsewhere  joins  hard  smooth  variance and jerk: opening, width, outer"
NOTE = (
    "* differs from the system as printed: the 95 % interval of the difference on the same clips leaves out 0\n"
    "p b m: share closed, without pins, %; elsewhere: closings outside p b m a minute; joins: a clip; hard: share that "
    "abuts, %;\nsmooth: share where the velocity changes by no more than the speaker's own 95th percentile, %; "
    "variance and jerk: by those of the recordings\nThe paper prints no figures of its own."
)


def table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``minnis2000`` as text."""
    quick = "; quick: few clips, few epochs, only to see that it runs" if figures["quick"] else ""
    lines = [f"trained on {figures['utterances']} clips, {figures['minutes']} minutes{quick}"]
    for split, found in figures["lists"].items():
        for condition, systems in found["conditions"].items():
            lines += ["", f"{split}, {found['clips']} clips, {condition}", HEAD]
            lines += [_line(name, row) for name, row in systems.items()]
    return "\n".join([*lines, "", NOTE])


def _line(name: str, row: Mapping[str, Any]) -> str:
    joins, channels = row["joins"], [row["channels"].get(each) for each in DISTANCES]
    acc = "{:.3f}{} ({:.3f}–{:.3f})".format(row["acc"], significance_mark(row["acc_gain_95"]), *row["acc_95"])
    shares = [_percent(joins["hard"]), _percent(joins["smooth"])]
    ratios = ["/".join(figure_text(each[key], ".2f") for each in channels if each) for key in RATIOS]
    return (
        f"  {name:{WIDTH}}{acc:23}{figure_text(row['recall_p_b_m'], '5.1f')}"
        f"{figure_text(row['false_per_minute'], '11.1f')}{joins['per_clip']:7.1f}{shares[0]:>6}{shares[1]:>8}  "
        f"{'  '.join(ratios)}"
    )


RATIOS = ("global_variance", "jerk")


def _percent(share: float | None) -> str:
    return figure_text(None if share is None else 100 * share, ".0f")
