"""Data types of the whole package: frozen values without files, and without computation beyond interpolation.

A name is imported when it is first used: configurations alone need no arrays, and the command line starts at once.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from lipmotion.types.audio import (
        ENERGY_FEATURE,
        FRAME_RATE_HZ,
        SPECTRUM_BANDS,
        Audio,
        Features,
        JoinedRows,
        Prosody,
        TokenPosteriors,
        VoiceEvent,
        frame_of,
        frames_of,
        from_sixteen_bits,
        to_sixteen_bits,
    )
    from lipmotion.types.configuration import Configuration, Rule, option
    from lipmotion.types.delivery import Delivery, Staging
    from lipmotion.types.explanation import (
        ChainPosteriors,
        ChainStates,
        ChannelValue,
        DominantGaussian,
        Explanation,
        NamedProbability,
        RegressedMean,
    )
    from lipmotion.types.generation import (
        ConditionSpectrum,
        Constraints,
        CurveEdit,
        DrawnCurve,
        Example,
        Gain,
        Generation,
        Hold,
        Outlook,
        Pin,
        PriorOutput,
        ReducedVariance,
        Speech,
        SpeechPart,
        SpokenText,
        StateTrace,
    )
    from lipmotion.types.motion import EYE_DISTANCE, GREY, WEIGHT, Channel, Motion, check_curves, check_magnitude
    from lipmotion.types.progress import (
        Item,
        Monitor,
        ParallelMap,
        Progress,
        silent_monitor,
        sub_monitor,
        with_progress,
    )
    from lipmotion.types.timeline import Span, SpeechKnowledge, Timeline, Unit
    from lipmotion.types.utterance import TimedTranscript, TimedWord, Track, TranscriptLine, Utterance, sort_lines

__all__ = [
    "ENERGY_FEATURE", "EYE_DISTANCE", "FRAME_RATE_HZ", "GREY", "SPECTRUM_BANDS", "WEIGHT", "Audio", "ChainPosteriors",
    "ChainStates", "Channel", "ChannelValue", "ConditionSpectrum", "Configuration", "Constraints", "CurveEdit",
    "Delivery", "DominantGaussian", "DrawnCurve", "Example", "Explanation", "Features", "Gain", "Generation", "Hold",
    "Item", "JoinedRows", "Monitor", "Motion", "NamedProbability", "Outlook", "ParallelMap", "Pin", "PriorOutput",
    "Progress", "Prosody", "ReducedVariance", "RegressedMean", "Rule", "Span", "Speech", "SpeechKnowledge",
    "SpeechPart", "SpokenText", "Staging", "StateTrace", "TimedTranscript", "TimedWord", "Timeline",
    "TokenPosteriors", "Track", "TranscriptLine", "Unit", "Utterance", "VoiceEvent", "check_curves",
    "check_magnitude", "frame_of", "frames_of", "from_sixteen_bits", "option", "silent_monitor", "sort_lines",
    "sub_monitor", "to_sixteen_bits", "with_progress",
]  # fmt: skip

_MODULES = (
    *("configuration", "delivery", "audio", "timeline", "motion"),
    *("generation", "progress", "explanation", "utterance"),
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
