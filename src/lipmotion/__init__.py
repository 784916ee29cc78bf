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
    from lipmotion.articulation.cue_sheets import CueSheet
    from lipmotion.corpora.store import Corpus, Selection
    from lipmotion.engines import engine_named
    from lipmotion.faces.filmed.face import FilmedFace, load_face, save_face
    from lipmotion.formats.base import read_motion
    from lipmotion.pipeline.corpus.prepare import prepare
    from lipmotion.pipeline.edits import Edits
    from lipmotion.pipeline.evaluation.compare import compare
    from lipmotion.pipeline.evaluation.evaluate import evaluate
    from lipmotion.pipeline.film.build import build_face
    from lipmotion.pipeline.film.filmed_video import FilmOptions
    from lipmotion.pipeline.generate.animate import animate
    from lipmotion.pipeline.generate.explain import explain
    from lipmotion.pipeline.generate.speak import speak
    from lipmotion.pipeline.generate.state_runs import state_runs
    from lipmotion.pipeline.generate.transfer import map_onto, with_person
    from lipmotion.pipeline.job import Job, Outputs, Request
    from lipmotion.pipeline.model import Model, load_model, save_model
    from lipmotion.pipeline.outputs.cues import cues, write_cues
    from lipmotion.pipeline.outputs.session_pictures import SessionPictures
    from lipmotion.pipeline.outputs.write import write
    from lipmotion.pipeline.session import Session
    from lipmotion.pipeline.training.adapt import adapt
    from lipmotion.pipeline.training.train import Run, train
    from lipmotion.pipeline.understand.request import SpeechRequest
    from lipmotion.study.analysis.analyse import analyse_study
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
    "FilmOptions",
    "FilmedFace",
    "Gain",
    "Generation",
    "Job",
    "Lexicon",
    "Model",
    "Motion",
    "Outputs",
    "Pin",
    "Request",
    "Run",
    "Selection",
    "Session",
    "SessionPictures",
    "Span",
    "SpeechRequest",
    "SpokenText",
    "Staging",
    "Timeline",
    "Unit",
    "adapt",
    "analyse_study",
    "animate",
    "build_face",
    "compare",
    "cues",
    "engine_named",
    "evaluate",
    "explain",
    "load_face",
    "load_model",
    "map_onto",
    "prepare",
    "read_motion",
    "save_face",
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
    "SessionPictures": "lipmotion.pipeline.outputs.session_pictures",
    "SpeechRequest": "lipmotion.pipeline.understand.request",
    "Selection": "lipmotion.corpora.store",
    "Corpus": "lipmotion.corpora.store",
    "CueSheet": "lipmotion.articulation.cue_sheets",
    "Job": "lipmotion.pipeline.job",
    "Outputs": "lipmotion.pipeline.job",
    "Request": "lipmotion.pipeline.job",
    "Lexicon": "lipmotion.units",
    "Model": "lipmotion.pipeline.model",
    "adapt": "lipmotion.pipeline.training.adapt",
    "analyse_study": "lipmotion.study.analysis.analyse",
    "FilmOptions": "lipmotion.pipeline.film.filmed_video",
    "FilmedFace": "lipmotion.faces.filmed.face",
    "animate": "lipmotion.pipeline.generate.animate",
    "build_face": "lipmotion.pipeline.film.build",
    "compare": "lipmotion.pipeline.evaluation.compare",
    "cues": "lipmotion.pipeline.outputs.cues",
    "engine_named": "lipmotion.engines",
    "evaluate": "lipmotion.pipeline.evaluation.evaluate",
    "explain": "lipmotion.pipeline.generate.explain",
    "load_face": "lipmotion.faces.filmed.face",
    "load_model": "lipmotion.pipeline.model",
    "map_onto": "lipmotion.pipeline.generate.transfer",
    "prepare": "lipmotion.pipeline.corpus.prepare",
    "read_motion": "lipmotion.formats.base",
    "save_face": "lipmotion.faces.filmed.face",
    "save_model": "lipmotion.pipeline.model",
    "SpokenText": "lipmotion.types",
    "speak": "lipmotion.pipeline.generate.speak",
    "state_runs": "lipmotion.pipeline.generate.state_runs",
    "train": "lipmotion.pipeline.training.train",
    "with_person": "lipmotion.pipeline.generate.transfer",
    "write": "lipmotion.pipeline.outputs.write",
    "write_cues": "lipmotion.pipeline.outputs.cues",
}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'lipmotion' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_HOMES.get(name, "lipmotion.types")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
