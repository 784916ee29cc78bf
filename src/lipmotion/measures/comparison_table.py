"""The figures of a comparison as a text table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.measures.evaluation_table import closures_line, figure_text
from lipmotion.printable import printable

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


def comparison_table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``lipmotion.compare`` as text."""
    lines = [f"reference: {figures['reference']}"]
    for pair in figures["others"]:
        lines += ["", f"{pair['name']}: {pair['frames']} frames at {pair['rate_hz']:g} a second"]
        lines += [f"  {note}" for note in pair["notes"]]
        lines += _channel_lines(pair) if pair["channels"] else []
        lines += [closures_line(pair["closures"])] if "closures" in pair else []
        lines += _point_lines(pair["points"]) if "points" in pair else []
        if "upper_face" in pair:
            deviation = figure_text(pair["upper_face"]["deviation"], "+.4f")
            lines.append(f"  upper face: deviation {deviation} over {pair['upper_face']['curves']} curves")
    return "\n".join(map(printable, lines))


def _channel_lines(pair: Mapping[str, Any]) -> list[str]:
    """Return one row for each channel, and the mean correlation."""
    size = max(9, *map(len, pair["channels"]))
    head = "".join(f"{name:>{int(form.partition('.')[0])}}" for name, form in COLUMNS.values())
    lines = [f"  {'channel':{size}}{head}"]
    for channel, row in pair["channels"].items():
        cells = "".join(figure_text(row[name], form) for name, (_, form) in COLUMNS.items())
        lines.append(f"  {channel:{size}}{cells}")
    return [*lines, f"  mean ACC {figure_text(pair['acc'], '.3f')}"]


def _point_lines(points: Mapping[str, Any]) -> list[str]:
    """Return the line of the figures of points."""
    parts = [f"landmark distance {figure_text(points['landmark_distance_mm'], '.2f')} mm over {points['points']}"]
    if points["lip_points"]:
        error = figure_text(points["lip_vertex_error_mm"], ".2f")
        parts.insert(0, f"lip vertex error {error} mm over {points['lip_points']}")
    if points["upper_points"]:
        deviation = figure_text(points["upper_face_deviation_mm"], "+.2f")
        parts.append(f"upper-face deviation {deviation} mm over {points['upper_points']}")
    return [f"  points: {', '.join(parts)}"]
