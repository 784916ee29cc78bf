"""The figures of ``engines`` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.experiments.comparison import significance_mark
from lipmotion.experiments.engines.models import ENGINES_COMPARED
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
            *_gains(condition["systems"]),
            *_disagreement(condition["disagreement"], list(condition["systems"])),
        ]
    name, condition = next(iter(figures["conditions"].items()))
    lines += [
        "",
        f"* differs from {figures['reference']}: the 95 % interval of the difference on the same clips leaves out 0",
        LEGEND,
        "",
        f"confidence in every second of every clip, {name}: 1 where {_list(ENGINES_COMPARED)} agree, "
        "0 where they are half as far apart as the mouth moves (a deviation)",
        *_confidences(condition["disagreement"]["clips"]),
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


def _gains(systems: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return a line of the differences between the ACC of what is no engine and that of each engine."""
    others = {name: row for name, row in systems.items() if name not in ENGINES_COMPARED}
    lines = []
    for name, row in others.items():
        gains = [
            f"{engine} {figure_text(low, '+.3f')} to {figure_text(high, '+.3f')}"
            for engine, (low, high) in row["acc_gain_95"].items()
        ]
        lines.append(f"  ACC of the {name} minus that of an engine, 95 %: {', '.join(gains)}")
    return lines


def _closures(row: Mapping[str, Any]) -> str:
    return "".join(figure_text(row[name], form) for name, form in CLOSURES)


def _disagreement(found: Mapping[str, Any], systems: Sequence[str]) -> list[str]:
    """Return the lines that say whether disagreement ranks the seconds by error."""
    everywhere, spoken = (
        ", ".join(f"{name} {_correlation(found[where][name])}" for name in systems)
        for where in ("rank_correlation", "in_speech")
    )
    parts = [f"{figure_text(q['disagreement'], '.2f')}: {figure_text(q['error'], '.2f')}" for q in found["quarters"]]
    return [
        f"  rank correlation of disagreement with error, {found['seconds']} seconds: {everywhere}",
        f"  … in the {found['seconds_of_speech']} seconds of which half or more is speech: {spoken}",
        f"  with the error of the mean: movement of the mean {_correlation(found['movement'])}; disagreement at equal "
        f"movement {figure_text(found['beyond_movement'], '.2f')}",
        f"  disagreement: error of the mean, quarters of the seconds, in deviations: {', '.join(parts)}",
    ]


def _correlation(found: Mapping[str, Any]) -> str:
    low, high = (figure_text(end, ".2f") for end in found["95"])
    return f"{figure_text(found['value'], '.2f')} ({low}–{high})"


def _confidences(clips: Mapping[str, Any]) -> list[str]:
    size = max(map(len, clips), default=0)
    return [
        f"  {name:{size}}  " + " ".join(figure_text(value, "4.2f") for value in clip["confidence"])
        for name, clip in clips.items()
    ]


def _list(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"
