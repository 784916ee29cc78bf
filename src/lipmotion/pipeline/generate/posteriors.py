"""Posterior probabilities of the chains of a model over time, and their picture."""

from __future__ import annotations

from pathlib import Path

from lipmotion.engines import ENGINES, Engine
from lipmotion.errors import ExportError, InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.edits import Edits
from lipmotion.pipeline.session import Session
from lipmotion.storage.files import check_target, whole_file
from lipmotion.types import Audio, ChainPosteriors, Generation

SUFFIX = ".png"


@one_thread()
def chain_posteriors(session: Session, edits: Edits) -> tuple[Generation, tuple[ChainPosteriors, ...]]:
    """Return the motion of a session with some edits, and the posterior probabilities of every chain of its model.

    Raises InputError: as ``Session.generated``, or the model's engine has no chains of states.
    """
    engine, learned = session.model.engine, session.model.learned
    if type(engine).posteriors is Engine.posteriors:
        having = [name for name in ENGINES.names if ENGINES.load(name).posteriors is not Engine.posteriors]
        raise InputError(
            f"the engine {engine.name!r} has no chains of states whose posteriors could be shown; give a model that "
            f"was trained with --engine {' or '.join(having)}"
        )
    return session.generated(edits), engine.posteriors(learned, session.understood(edits).speech)


def check_picture(path: Path, speech: str | Path | Audio | None = None) -> None:
    """Raise ExportError if a picture cannot be written to a path."""
    if path.suffix.lower() != SUFFIX:
        raise ExportError(f"{path}: unknown format {path.suffix!r}; required: {SUFFIX}")
    check_target(path, None if isinstance(speech, Audio) else speech)


def write_posteriors(path: Path, generation: Generation, posteriors: tuple[ChainPosteriors, ...]) -> None:
    """Write a picture of the posterior probabilities of chains over time (docs/explain.md).

    Raises ExportError: another suffix, or the file cannot be written.
    """
    from lipmotion.export.posterior_plot import draw_posteriors

    check_picture(path)
    with whole_file(path) as unfinished:
        draw_posteriors(generation, posteriors).save(unfinished, optimize=True)
