"""Data types of the whole package: frozen values without files, and without computation beyond interpolation.

A name is imported when it is first used: configurations alone need no arrays, and the command line starts at once.
"""

# ruff: noqa: F403, F405 (what a type checker sees; a program imports each name by itself)
from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from lipmotion.types.audio import *
    from lipmotion.types.configuration import *
    from lipmotion.types.delivery import *
    from lipmotion.types.edits import *
    from lipmotion.types.generation import *
    from lipmotion.types.motion import *
    from lipmotion.types.progress import *
    from lipmotion.types.speech import *
    from lipmotion.types.timeline import *

__all__ = [
    "ENERGY_FEATURE", "EYE_DISTANCE", "FRAME_RATE_HZ", "GREY", "SPECTRUM_BANDS", "SPEECH_RATE_HZ", "WEIGHT", "Audio",
    "ChainPosteriors",
    "ChainStates", "Channel", "ChannelValue", "ConditionSpectrum", "Configuration", "Constraints", "CurveEdit",
    "Delivery", "DominantGaussian", "DrawnCurve", "Example", "Explanation", "Features", "Gain", "Generation", "Hold",
    "Item", "JoinedRows", "Monitor", "Motion", "NamedProbability", "Outlook", "ParallelMap", "Pin", "PriorOutput",
    "Progress", "Prosody", "ReducedVariance", "Rule", "SlopedPin", "Span", "Speech",
    "SpeechKnowledge", "SpeechPart", "SpokenText", "Staging", "StateTrace", "TimedTranscript", "TimedWord", "Timeline",
    "TokenPosteriors", "Track", "TranscriptLine", "Unit", "Utterance", "VoiceEvent", "check_curves",
    "check_magnitude", "frame_of", "frames_of", "from_sixteen_bits", "option", "silent_monitor", "sort_lines",
    "sub_monitor", "to_sixteen_bits", "with_progress",
]  # fmt: skip
_MODULES = (
    *("configuration", "delivery", "audio", "timeline", "motion"),
    *("edits", "speech", "generation", "progress"),
)
"""Where the names are looked for, in this order."""


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'lipmotion.types' has no attribute {name!r}")
    from importlib import import_module

    modules = (import_module(f"lipmotion.types.{module}") for module in _MODULES)
    value = next(getattr(module, name) for module in modules if hasattr(module, name))
    globals()[name] = value
    return value
