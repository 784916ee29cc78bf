"""Figures as a table that people read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``lipmotion.evaluate`` as text."""
    lines = [f"split {figures['split']}: {figures['clips']} clips; closed under {figures['closed_under']:.4f}"]
    for name, condition in figures["conditions"].items():
        lines += ["", name, f"  {'channel':9}{'ACC':>7}{'per clip':>10}{'nRMSE':>7}{'variance':>10}{'jerk':>7}"]
        for channel, row in condition["channels"].items():
            lines.append(
                f"  {channel:9}{row['acc']:7.3f}{row['acc_per_clip']:10.3f}{row['nrmse']:7.3f}"
                f"{row['global_variance']:10.2f}{row['jerk']:7.2f}"
            )
        lines += _rest(condition)
    return "\n".join(lines)


def _rest(condition: Mapping[str, Any]) -> list[str]:
    low, high = condition["opening_acc_95"]
    closures, phones = condition["closures"], condition["closures_p_b_m"]
    quiet, original = condition["silence"]["generated"], condition["silence"]["original"]
    return [
        f"  opening ACC 95 % interval {low:.3f} to {high:.3f}; mean ACC {condition['acc']:.3f}; "
        f"AMSE {condition['amse']:.4f}; lag {condition['lag_ms']:+.1f} ms",
        f"  closures: score {closures['score']:.3f} of {closures['original']}, precision {closures['precision']:.3f} "
        f"of {closures['generated']}, timing {closures['timing_ms']:+.0f} ms",
        f"  p b m: recall {phones['recall']:.3f} of {phones['intervals']}, false closures "
        f"{phones['false_per_minute']:.1f} a minute (original {phones['original_per_minute']:.1f})",
        f"  silence: opening {quiet['mean']:.4f} ± {quiet['std']:.4f} "
        f"(original {original['mean']:.4f} ± {original['std']:.4f}, {quiet['frames']} frames)",
    ]
