"""The data that flows. Plain frozen values; nothing here computes more than a look-up."""

from lipmotion.types.audio import Audio
from lipmotion.types.each import Each
from lipmotion.types.explanation import (
    ChainBelief,
    ChainStates,
    Explanation,
    Gaussian,
    Likely,
    Regression,
    Value,
)
from lipmotion.types.features import FRAME_RATE_HZ, Features, frame_of
from lipmotion.types.generation import Constraints, Example, Generation, Pin, Speech, Spread, Trace
from lipmotion.types.motion import EYE_DISTANCE, GREY, WEIGHT, Channel, Motion, check_curves, check_magnitude
from lipmotion.types.progress import Item, Monitor, Progress, counted, part_of, silent_monitor
from lipmotion.types.timeline import Span, Timeline, Unit
from lipmotion.types.utterance import Track, Utterance

__all__ = [
    "EYE_DISTANCE",
    "FRAME_RATE_HZ",
    "GREY",
    "WEIGHT",
    "Audio",
    "ChainBelief",
    "ChainStates",
    "Channel",
    "Constraints",
    "Each",
    "Example",
    "Explanation",
    "Features",
    "Gaussian",
    "Generation",
    "Item",
    "Likely",
    "Monitor",
    "Motion",
    "Pin",
    "Progress",
    "Regression",
    "Span",
    "Speech",
    "Spread",
    "Timeline",
    "Trace",
    "Track",
    "Unit",
    "Utterance",
    "Value",
    "check_curves",
    "check_magnitude",
    "counted",
    "frame_of",
    "part_of",
    "silent_monitor",
]
