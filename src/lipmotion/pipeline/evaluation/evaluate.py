"""A model against held-out recordings: ``evaluate(model, corpus) → figures``."""

from __future__ import annotations

from typing import Any, TypeVar

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import Animator
from lipmotion.engines.base import ForcesClosures
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.evaluation.conditions import (
    TEST_LIST,
    HeldOutRecordings,
    compare_with_recorded,
    held_out_recordings,
    speech_of_condition,
)
from lipmotion.pipeline.evaluation.figures import figures_of
from lipmotion.pipeline.model import Model
from lipmotion.speech.recogniser import cached_recogniser
from lipmotion.storage.json_text import nan_as_null
from lipmotion.types import Monitor, silent_monitor
from lipmotion.units import Lexicon

ModelT = TypeVar("ModelT")


@one_thread()
def evaluate(
    model: Model,
    corpus: Corpus,
    *,
    selection: Selection = TEST_LIST,
    lexicon: Lexicon | None = None,
    recogniser: str = "auto",
    seed: int = 0,
    monitor: Monitor = silent_monitor,
) -> dict[str, Any]:
    """Return all figures of docs/measures.md: audio only and, where there are transcripts, with them.

    selection : the utterances to compare; the list ``test`` by default
    recogniser : as in ``animate``
    monitor  : hears how far it is

    Compared are the lip distances or, in a corpus without them, every channel that moves in the recordings; beside
    them, or in their place, the eigenlips of a model that has some. Figures of closing, and of silence, need the
    channel ``opening``. What cannot be computed is None.
    Where the engine makes lips meet in p, b and m, ``unpinned`` holds the same figures of what it makes without that.
    The reference for what is speech and where its p, b, m are is the labelled phones, else the forced alignment, or
    recognition where nothing is transcribed. The mouth counts as closed relative to the corpus's own training list
    (without one: to the split itself).
    Raises CorpusError: no utterances of this split, or a model without the channels compared.
    Raises AlignmentError: a transcript does not fit into its recording.
    """
    phones = cached_recogniser(model.phones, recogniser, model.adaptation)
    found = held_out_recordings(
        corpus,
        phones,
        selection=selection,
        lexicon=lexicon,
        monitor=monitor,
        visual=model.visual,
        eigenlips=model.eigenlips,
    )
    figures = {
        "split": "given names" if selection.names is not None else selection.split or "all",
        "clips": len(found.utterances),
        "closed_under": found.closed_under,
        "still_channels": list(found.still),
        "conditions": {
            name: _figures_with_and_without_closures(found, name, model.engine, model.learned, seed)
            for name in found.conditions
        },
    }
    plain: dict[str, Any] = nan_as_null(figures)
    return plain


def _figures_with_and_without_closures(
    found: HeldOutRecordings, condition: str, engine: Animator[ModelT], learned: ModelT, seed: int
) -> dict[str, Any]:
    heard = speech_of_condition(found, condition, engine, learned)
    figures, unpinned = (
        figures_of(compare_with_recorded(found, heard, engine, learned), found, seed),
        engine.without_closures() if isinstance(engine, ForcesClosures) else engine,
    )
    if unpinned == engine or found.closed_under is None:
        return figures
    return figures | {"unpinned": figures_of(compare_with_recorded(found, heard, unpinned, learned), found, seed)}
