"""The data that flows. Plain frozen values; nothing here computes more than a look-up."""

from lipmotion.types.audio import Audio
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion.types.each import ParallelMap
from lipmotion.types.explanation import (
    ChainPosteriors,
    ChainStates,
    ChannelValue,
    DominantGaussian,
    Explanation,
    NamedProbability,
    RegressedMean,
)
from lipmotion.types.features import FRAME_RATE_HZ, Features, frame_of
from lipmotion.types.generation import Constraints, Example, Generation, Pin, ReducedVariance, Speech, Trace
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
    "ChainPosteriors",
    "ChainStates",
    "Channel",
    "ChannelValue",
    "Configuration",
    "Constraints",
    "DominantGaussian",
    "Example",
    "Explanation",
    "Features",
    "Generation",
    "Item",
    "Monitor",
    "Motion",
    "NamedProbability",
    "ParallelMap",
    "Pin",
    "Progress",
    "ReducedVariance",
    "RegressedMean",
    "Rule",
    "Span",
    "Speech",
    "Timeline",
    "Trace",
    "Track",
    "Unit",
    "Utterance",
    "check_curves",
    "check_magnitude",
    "counted",
    "frame_of",
    "option",
    "part_of",
    "silent_monitor",
]
