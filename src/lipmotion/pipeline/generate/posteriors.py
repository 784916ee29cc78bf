"""Posterior probabilities of the chains of a model over time, and their picture."""

from __future__ import annotations

from pathlib import Path

from lipmotion.engines import ENGINES, Engine
from lipmotion.errors import ExportError, InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.edit_files import EditFile, edit_file
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.understand.request import SpeechInput, request_of
from lipmotion.storage.files import check_target, whole_file
from lipmotion.types import ChainPosteriors, Generation

SUFFIX = ".png"


@one_thread()
def animate_with_posteriors(
    speech: SpeechInput, *, model: Model, edits: EditFile | None = None
) -> tuple[Generation, tuple[ChainPosteriors, ...]]:
    """Return generated motion as ``animate`` does, and the posterior probabilities of every chain of the model.

    edits : what is changed of the motion; None: nothing

    Raises InputError: as ``animate``, or the model's engine has no chains of states.
    """
    engine, learned = model.engine, model.learned
    if type(engine).posteriors is Engine.posteriors:
        having = [name for name in ENGINES.names if ENGINES.load(name).posteriors is not Engine.posteriors]
        raise InputError(
            f"the engine {engine.name!r} has no chains of states whose posteriors could be shown; give a model that "
            f"was trained with --engine {' or '.join(having)}"
        )
    file = edit_file(edits)
    session = file.session(request_of(speech), model=model)
    return session.generated(file.edits), engine.posteriors(learned, session.understood(file.edits).speech)


def check_picture(path: Path, speech: Path | None = None) -> None:
    """Raise ExportError if a picture cannot be written to a path."""
    if path.suffix.lower() != SUFFIX:
        raise ExportError(f"{path}: unknown format {path.suffix!r}; required: {SUFFIX}")
    check_target(path, speech)


def write_posteriors(path: Path, generation: Generation, posteriors: tuple[ChainPosteriors, ...]) -> None:
    """Write a picture of the posterior probabilities of chains over time (docs/explain.md).

    Raises ExportError: another suffix, or the file cannot be written.
    """
    from lipmotion.pipeline.generate.posterior_plot import draw_posteriors

    check_picture(path)
    with whole_file(path) as unfinished:
        draw_posteriors(generation, posteriors).save(unfinished, optimize=True)
