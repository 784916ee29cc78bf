"""What the chains of a model believe while speech becomes motion, and its picture."""

from __future__ import annotations

from pathlib import Path

from lipmotion.errors import ExportError
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.understand import understand
from lipmotion.speech.read import read_audio
from lipmotion.storage.files import check_target, whole_file
from lipmotion.types import ChainPosteriors, Generation, Timeline, Unit
from lipmotion.units import Lexicon

SUFFIX = ".png"


@one_thread()
def animate_with_posteriors(
    speech: str | Path,
    *,
    model: Model,
    transcript: str | Path | None = None,
    units: Timeline[Unit] | None = None,
    lexicon: Lexicon | None = None,
    recogniser: str = "auto",
) -> tuple[Generation, tuple[ChainPosteriors, ...]]:
    """Return what ``animate`` does, and what every chain of the model believes over time.

    Raises InputError: as ``animate``, or the model's engine has no chains of states.
    """
    engine, learned = model.engine, model.learned
    engine.check_chains()
    told = understand(
        model, read_audio(Path(speech)), transcript=transcript, units=units, lexicon=lexicon, recogniser=recogniser
    )
    return engine.generate(learned, told), engine.beliefs(learned, told)


def check_picture(path: Path, speech: Path | None = None) -> None:
    """Raise ExportError unless a picture can be written there."""
    if path.suffix.lower() != SUFFIX:
        raise ExportError(f"{path}: unknown format {path.suffix!r}; required: {SUFFIX}")
    check_target(path, speech)


def write_posteriors(path: Path, generation: Generation, beliefs: tuple[ChainPosteriors, ...]) -> None:
    """Write a picture of what chains believe over time (docs/explain.md).

    Raises ExportError: another suffix, or the file cannot be written.
    """
    from lipmotion.export.plots import draw

    check_picture(path)
    with whole_file(path) as unfinished:
        draw(generation, beliefs).save(unfinished, optimize=True)
