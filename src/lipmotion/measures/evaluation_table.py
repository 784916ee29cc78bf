"""The figures of an evaluation as a text table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.printable import printable

PINNED = (
    "p, b and m are pinned: lips are made to meet where the recogniser, with transcript the alignment that places the",
    "reference, too, puts them. What the model does by itself stands under 'without pins'",
)
"""Two lines of the table."""
SEEN = "the model was trained on some of these recordings: figures of recordings that it does not know are lower"


def figures_table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``lipmotion.evaluate`` as text."""
    closed, still = figures["closed_under"], figures["still_channels"]
    lines = [f"split {figures['split']}: {figures['clips']} clips"]
    lines[0] += f"; closed under {closed:.4f}" if closed is not None else ""
    lines += [f"left out, for they do not move: {', '.join(still)}"] if still else []
    strangers = [name or "speakers without a name" for name in figures.get("strangers", ())]
    lines += [f"unknown to the model, compared with the mean person: {', '.join(strangers)}"] if strangers else []
    lines += [SEEN] if figures.get("seen_in_training") else []
    silent = figures.get("without_words", 0)
    lines += [f"no figures with transcript: {silent} of {figures['clips']} clips have no words"] if silent else []
    lines += PINNED if any("unpinned" in condition for condition in figures["conditions"].values()) else []
    for name, condition in figures["conditions"].items():
        rows = condition["channels"] | _eigenlips_row(condition)
        size = max(9, *map(len, rows))
        lines += ["", name, f"  {'channel':{size}}{'ACC':>7}{'per clip':>10}{'nRMSE':>7}{'variance':>10}{'jerk':>7}"]
        for channel, row in rows.items():
            lines.append(
                f"  {channel:{size}}{figure_text(row['acc'], '7.3f')}{figure_text(row['acc_per_clip'], '10.3f')}"
                f"{figure_text(row['nrmse'], '7.3f')}{figure_text(row['global_variance'], '10.2f')}"
                f"{figure_text(row['jerk'], '7.2f')}"
            )
        lines += _summary(condition)
    return "\n".join(map(printable, lines))


def _eigenlips_row(condition: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of the means over all eigenlips; empty without eigenlips."""
    means = condition.get("eigenlips")
    return {f"{len(means['channels'])} eigenlips": means} if means else {}


def _summary(condition: Mapping[str, Any]) -> list[str]:
    """Return the lines of figures over all channels."""
    lines = [
        f"  mean ACC {condition['acc']:.3f}; AMSE {condition['amse']:.4f}; "
        f"lag of {condition['leading']} {condition['lag_ms']:+.1f} ms"
    ]
    if "eigenlips" in condition and condition["channels"]:
        lines.append(
            f"  AMSE of the eigenlips {condition['eigenlips']['amse']:.1f}, in grey levels and this model's space"
        )
    if "closures" not in condition:
        return lines
    low, high = condition["opening_acc_95"]
    quiet, original = condition["silence"]["generated"], condition["silence"]["original"]
    return [
        f"  opening ACC 95 % interval {low:.3f} to {high:.3f};{lines[0][1:]}",
        *lines[1:],
        *_closure_lines(condition),
        f"  silence: opening {figure_text(quiet['mean'], '.4f')} ± {figure_text(quiet['std'], '.4f')} "
        f"(original {figure_text(original['mean'], '.4f')} ± {figure_text(original['std'], '.4f')}, "
        f"{quiet['frames']} frames)",
        *_unpinned(condition),
    ]


def _closure_lines(condition: Mapping[str, Any]) -> list[str]:
    """Return the lines of closure figures."""
    phones = condition["closures_p_b_m"]
    return [
        closures_line(condition["closures"]),
        f"  p b m: recall {figure_text(phones['recall'], '.3f')} of {phones['intervals']}, false closures "
        f"{figure_text(phones['false_per_minute'], '.1f')} a minute (original "
        f"{figure_text(phones['original_per_minute'], '.1f')})",
    ]


def closures_line(closures: Mapping[str, Any]) -> str:
    """Return the line of the figures of closings."""
    return (
        f"  closures: score {figure_text(closures['score'], '.3f')} of {closures['original']}, precision "
        f"{figure_text(closures['precision'], '.3f')} of {closures['generated']}, F1 "
        f"{figure_text(closures['f1'], '.3f')}, timing {figure_text(closures['timing_ms'], '+.0f')} ms"
    )


def _unpinned(condition: Mapping[str, Any]) -> list[str]:
    """Return the lines of figures without pins; none where they were not computed."""
    free = condition.get("unpinned")
    if free is None:
        return []
    low, high = free["opening_acc_95"]
    acc = figure_text(free["channels"]["opening"]["acc"], ".3f")
    head = f"  without pins: ACC of opening {acc} ({low:.3f} to {high:.3f}), mean ACC {free['acc']:.3f}"
    return [head, *(f"  {line}" for line in _closure_lines(free))]


def figure_text(value: float | None, form: str) -> str:
    """Return a figure as text, formatted by ``form``; None is a dash of the same width."""
    width = form.partition(".")[0].strip("+")
    return f"{'–':>{width or 0}}" if value is None else format(value, form)
