"""The figures of an evaluation, and of a comparison, as text tables."""

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


def format_figures(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``lipmotion.evaluate`` as text."""
    closed, still = figures["closed_under"], figures["still_channels"]
    lines = [f"split {figures['split']}: {figures['clips']} clips"]
    lines[0] += f"; closed under {closed:.4f}" if closed is not None else ""
    lines += [f"left out, for they do not move: {', '.join(still)}"] if still else []
    unseen = [name or "speakers without a name" for name in figures.get("strangers", ())]
    lines += [f"unknown to the model, compared with the mean person: {', '.join(unseen)}"] if unseen else []
    lines += [SEEN] if figures.get("seen_in_training") else []
    silent = figures.get("without_words", 0)
    lines += [f"no figures with transcript: {silent} of {figures['clips']} clips have no words"] if silent else []
    lines += PINNED if any("unpinned" in condition for condition in figures["conditions"].values()) else []
    for name, condition in figures["conditions"].items():
        means = condition.get("eigenlips")  # over all eigenlips
        rows = condition["channels"] | ({f"{len(means['channels'])} eigenlips": means} if means else {})
        size = max(9, *map(len, rows))
        lines += ["", name, f"  {'channel':{size}}{'ACC':>7}{'per clip':>10}{'nRMSE':>7}{'variance':>10}{'jerk':>7}"]
        forms = {"acc": "7.3f", "acc_per_clip": "10.3f", "nrmse": "7.3f", "global_variance": "10.2f", "jerk": "7.2f"}
        for channel, row in rows.items():
            lines.append(f"  {channel:{size}}" + "".join(format_figure(row[key], form) for key, form in forms.items()))
        lines += _summarise(condition)
    return "\n".join(map(printable, lines))


def _summarise(condition: Mapping[str, Any]) -> list[str]:
    head = f"mean ACC {condition['acc']:.3f}; AMSE {condition['amse']:.4f}; "
    head += f"lag of {condition['leading']} {condition['lag_ms']:+.1f} ms"
    if "closures" in condition:
        low, high = condition["opening_acc_95"]
        head = f"opening ACC 95 % interval {low:.3f} to {high:.3f}; {head}"
    lines = [f"  {head}"]
    if "eigenlips" in condition and condition["channels"]:
        amse = condition["eigenlips"]["amse"]
        lines.append(f"  AMSE of the eigenlips {amse:.1f}, in grey levels and this model's space")
    if "closures" not in condition:
        return lines
    quiet, original = condition["silence"]["generated"], condition["silence"]["original"]
    lines += [
        *_format_closures(condition),
        f"  silence: opening {format_figure(quiet['mean'], '.4f')} ± {format_figure(quiet['std'], '.4f')} "
        f"(original {format_figure(original['mean'], '.4f')} ± {format_figure(original['std'], '.4f')}, "
        f"{quiet['frames']} frames)",
    ]
    if (free := condition.get("unpinned")) is not None:
        acc, (low, high) = format_figure(free["channels"]["opening"]["acc"], ".3f"), free["opening_acc_95"]
        lines.append(f"  without pins: ACC of opening {acc} ({low:.3f} to {high:.3f}), mean ACC {free['acc']:.3f}")
        lines += [f"  {line}" for line in _format_closures(free)]
    return lines


def _format_closures(condition: Mapping[str, Any]) -> list[str]:
    phones = condition["closures_p_b_m"]
    return [
        format_closures(condition["closures"]),
        f"  p b m: recall {format_figure(phones['recall'], '.3f')} of {phones['intervals']}, false closures "
        f"{format_figure(phones['false_per_minute'], '.1f')} a minute (original "
        f"{format_figure(phones['original_per_minute'], '.1f')})",
    ]


def format_closures(closures: Mapping[str, Any]) -> str:
    """Return the line of the figures of closings."""
    return (
        f"  closures: score {format_figure(closures['score'], '.3f')} of {closures['original']}, precision "
        f"{format_figure(closures['precision'], '.3f')} of {closures['generated']}, F1 "
        f"{format_figure(closures['f1'], '.3f')}, timing {format_figure(closures['timing_ms'], '+.0f')} ms"
    )


def format_figure(value: float | None, form: str) -> str:
    """Return a figure as text, formatted by ``form``; None is a dash of the same width."""
    width = form.partition(".")[0].strip("+")
    return f"{'–':>{width or 0}}" if value is None else format(value, form)


COLUMNS = {
    "acc": ("ACC", "7.3f"),
    "rmse": ("RMSE", "9.4f"),
    "nrmse": ("nRMSE", "7.3f"),
    "lag_ms": ("lag ms", "8.1f"),
    "variance": ("variance", "10.2f"),
    "jerk": ("jerk", "7.2f"),
    "modulation_db": ("modulation dB", "15.1f"),
}
"""Head and form of every column, by the name of the figure."""


def format_comparison(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``lipmotion.compare`` as text."""
    lines = [f"reference: {figures['reference']}"]
    for pair in figures["others"]:
        lines += ["", f"{pair['name']}: {pair['frames']} frames at {pair['rate_hz']:g} a second"]
        lines += [f"  {note}" for note in pair["notes"]]
        if pair["channels"]:
            size = max(9, *map(len, pair["channels"]))
            head = "".join(f"{name:>{int(form.partition('.')[0])}}" for name, form in COLUMNS.values())
            lines.append(f"  {'channel':{size}}{head}")
            for channel, row in pair["channels"].items():
                cells = "".join(format_figure(row[name], form) for name, (_, form) in COLUMNS.items())
                lines.append(f"  {channel:{size}}{cells}")
            lines.append(f"  mean ACC {format_figure(pair['acc'], '.3f')}")
        lines += [format_closures(pair["closures"])] if "closures" in pair else []
        if points := pair.get("points"):
            distance = format_figure(points["landmark_distance_mm"], ".2f")
            parts = [f"landmark distance {distance} mm over {points['points']}"]
            if points["lip_points"]:
                error = format_figure(points["lip_vertex_error_mm"], ".2f")
                parts.insert(0, f"lip vertex error {error} mm over {points['lip_points']}")
            if points["upper_points"]:
                deviation = format_figure(points["upper_face_deviation_mm"], "+.2f")
                parts.append(f"upper-face deviation {deviation} mm over {points['upper_points']}")
            lines.append(f"  points: {', '.join(parts)}")
        if "upper_face" in pair:
            deviation = format_figure(pair["upper_face"]["deviation"], "+.4f")
            lines.append(f"  upper face: deviation {deviation} over {pair['upper_face']['curves']} curves")
    return "\n".join(map(printable, lines))
