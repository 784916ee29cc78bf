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
    from lipmotion.corpora import Corpus, Selection
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
    "Audio", "Constraints", "Corpus", "CueSheet", "Delivery", "Edits", "Explanation", "Gain", "Generation", "Job",
    "Lexicon", "LiveFrame", "Model", "Motion", "Outputs", "Pin", "Request", "Run", "Selection", "Session", "Span",
    "SpokenText", "Staging", "Stream", "Timeline", "Unit", "adapt", "animate", "cues", "engine_named", "explain",
    "load_model", "read_motion", "save_model", "speak", "state_runs", "train", "with_person", "write", "write_cues",
]  # fmt: skip
_HOMES = {
    name: f"lipmotion.{home}"
    for home, names in {
        "articulation.cue_sheets": "CueSheet",
        "corpora": "Corpus Selection",
        "engines": "engine_named",
        "formats.base": "read_motion",
        "live.face": "LiveFrame",
        "live.stream": "Stream",
        "pipeline.edits": "Edits",
        "pipeline.generate.animate": "animate",
        "pipeline.generate.explain": "explain state_runs",
        "pipeline.generate.speak": "speak",
        "pipeline.job": "Job",
        "pipeline.model": "Model load_model save_model with_person",
        "pipeline.outputs.cues": "cues write_cues",
        "pipeline.outputs.output": "write",
        "pipeline.request": "Outputs Request",
        "pipeline.session": "Session",
        "pipeline.training.train": "Run adapt train",
        "units": "Lexicon",
    }.items()
    for name in names.split()
}
"""Where names are, but those of ``lipmotion.types``."""
_ADDED = (
    *("FilmedFace", "SessionPictures", "analyse_study", "build_face", "compare", "evaluate", "load_face"),
    *("map_onto", "prepare", "save_face"),
)
"""Names that the packages of faces, studio and lab provide (entry points of the group ``lipmotion.names``)."""


def __getattr__(name: str) -> Any:
    if name not in __all__ and name not in _ADDED:
        raise AttributeError(f"module 'lipmotion' has no attribute {name!r}")
    from importlib import import_module

    if name in _ADDED:
        from lipmotion.extensions import load_provided

        value = load_provided(name)
    else:
        value = getattr(import_module(_HOMES.get(name, "lipmotion.types")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, *_ADDED]
