"""Speech in, lip motion out.

>>> import lipmotion
>>> result = lipmotion.animate("examples/welcome.flac")
>>> opening = result.motion["opening"]  # 100 values a second, in distances between the outer eye corners
>>> lipmotion.write(result, ["welcome.mp4", "welcome.json"], speech="examples/welcome.flac")  # doctest: +SKIP

A name is imported when it is first used, so that ``import lipmotion`` alone is fast.
"""

from __future__ import annotations

TYPE_CHECKING = False  # as in typing, whose import would delay the answer to Ctrl-C
if TYPE_CHECKING:
    from typing import Any

    from lipmotion.articulation.cue_sheets import CueSheet
    from lipmotion.corpora.store import Corpus, Selection
    from lipmotion.engines import engine_named
    from lipmotion.formats.base import read_motion
    from lipmotion.live.face import LiveFrame
    from lipmotion.live.stream import Stream
    from lipmotion.pipeline.edits import Edits
    from lipmotion.pipeline.generate.animate import animate
    from lipmotion.pipeline.generate.explain import explain, state_runs
    from lipmotion.pipeline.generate.speak import speak
    from lipmotion.pipeline.job import Job
    from lipmotion.pipeline.model import Model, load_model, save_model, with_person
    from lipmotion.pipeline.outputs.cues import cues, write_cues
    from lipmotion.pipeline.outputs.output import write
    from lipmotion.pipeline.request import Outputs, Request
    from lipmotion.pipeline.session import Session
    from lipmotion.pipeline.training.train import Run, adapt, train
    from lipmotion.types import (
        Audio,
        Constraints,
        Delivery,
        Explanation,
        Gain,
        Generation,
        Motion,
        Pin,
        Span,
        SpokenText,
        Staging,
        Timeline,
        Unit,
    )
    from lipmotion.units import Lexicon

__all__ = [
    "Audio",
    "Constraints",
    "Corpus",
    "CueSheet",
    "Delivery",
    "Edits",
    "Explanation",
    "Gain",
    "Generation",
    "Job",
    "Lexicon",
    "LiveFrame",
    "Model",
    "Motion",
    "Outputs",
    "Pin",
    "Request",
    "Run",
    "Selection",
    "Session",
    "Span",
    "SpokenText",
    "Staging",
    "Stream",
    "Timeline",
    "Unit",
    "adapt",
    "animate",
    "cues",
    "engine_named",
    "explain",
    "load_model",
    "read_motion",
    "save_model",
    "speak",
    "state_runs",
    "train",
    "with_person",
    "write",
    "write_cues",
]

_HOMES = {
    "Edits": "lipmotion.pipeline.edits",
    "Run": "lipmotion.pipeline.training.train",
    "Session": "lipmotion.pipeline.session",
    "Selection": "lipmotion.corpora.store",
    "Corpus": "lipmotion.corpora.store",
    "CueSheet": "lipmotion.articulation.cue_sheets",
    "Job": "lipmotion.pipeline.job",
    "Outputs": "lipmotion.pipeline.request",
    "Request": "lipmotion.pipeline.request",
    "Lexicon": "lipmotion.units",
    "LiveFrame": "lipmotion.live.face",
    "Stream": "lipmotion.live.stream",
    "Model": "lipmotion.pipeline.model",
    "adapt": "lipmotion.pipeline.training.train",
    "animate": "lipmotion.pipeline.generate.animate",
    "cues": "lipmotion.pipeline.outputs.cues",
    "engine_named": "lipmotion.engines",
    "explain": "lipmotion.pipeline.generate.explain",
    "load_model": "lipmotion.pipeline.model",
    "read_motion": "lipmotion.formats.base",
    "save_model": "lipmotion.pipeline.model",
    "SpokenText": "lipmotion.types",
    "speak": "lipmotion.pipeline.generate.speak",
    "state_runs": "lipmotion.pipeline.generate.explain",
    "train": "lipmotion.pipeline.training.train",
    "with_person": "lipmotion.pipeline.model",
    "write": "lipmotion.pipeline.outputs.output",
    "write_cues": "lipmotion.pipeline.outputs.cues",
}


_ADDED = (
    *("FilmedFace", "SessionPictures", "analyse_study", "build_face", "compare", "evaluate", "load_face"),
    *("map_onto", "prepare", "save_face"),
)
"""Names that the packages of faces, studio and lab provide (entry points of the group ``lipmotion.names``)."""
_RENAMED = {"FilmOptions": "Outputs", "SpeechRequest": "Request"}
"""Former names, for older scripts."""


def __getattr__(name: str) -> Any:
    present = _RENAMED.get(name, name)
    if present not in __all__ and present not in _ADDED:
        raise AttributeError(f"module 'lipmotion' has no attribute {name!r}")
    from importlib import import_module

    if name in _ADDED:
        from lipmotion.extensions import load_provided

        value = load_provided(name)
    else:
        value = getattr(import_module(_HOMES.get(present, "lipmotion.types")), present)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, *_ADDED]
