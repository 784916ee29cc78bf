"""Options of how motion is delivered, the same for every output."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lipmotion.articulation.delivery import Delivery


def add_delivery_arguments(parser: argparse.ArgumentParser, *, steps: bool = True) -> None:
    """Add intensity, anticipation, offset and held poses (docs/controls.md).

    steps : also add ``--stepped``; cues are held always
    """
    add = parser.add_argument
    add("--intensity", type=float, default=1.0, metavar="X", help="movements of the mouth X times as large, 0 to 3")
    earlier = "the mouth moves N ms before the sound"
    add("--anticipation-ms", type=float, default=0.0, metavar="N", help=earlier)
    later = "everything in motion, label and cue files comes N ms later; negative: earlier"
    add("--offset-ms", type=float, default=0.0, metavar="N", help=later)
    hold = "hold every pose for at least N ms" if steps else "hold every shape for at least N ms, as --hold FRAMES"
    add("--min-hold-ms", type=float, default=0.0, metavar="N", help=hold)
    if steps:
        add("--stepped", action="store_true", help="hold poses instead of moving smoothly, each for at least 83 ms")


def delivery_of(options: argparse.Namespace) -> Delivery:
    """Return how motion is delivered. Raises InputError: a value out of its range."""
    from lipmotion.articulation.delivery import Delivery

    return Delivery(
        options.intensity,
        options.anticipation_ms,
        options.offset_ms,
        options.min_hold_ms,
        stepped=getattr(options, "stepped", False),
    )
