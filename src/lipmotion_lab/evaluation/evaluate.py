"""Evaluation: ``evaluate(model, corpus) → figures``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import Animator
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.model import Model
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.storage.json_text import nan_as_null
from lipmotion.types import Monitor, Utterance, silent_monitor
from lipmotion.units import Lexicon
from lipmotion_lab.evaluation.figures import figures_of
from lipmotion_lab.evaluation.held_out import (
    TEST_LIST,
    WITH_TRANSCRIPT,
    HeldOutRecordings,
    compare_with_recorded,
    held_out_recordings,
    speech_of_condition,
)

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
    """Return the figures of docs/measures.md, by name: from audio only and, if all have transcripts, with them.

    selection  : the utterances to compare; by default those of the list ``test``
    lexicon    : pronunciations of words, ahead of those of the dictionary
    recogniser : ``own``, ``general`` or ``auto``, as in ``Request``
    seed       : of the bootstrap interval
    monitor    : called with reports of progress

    Compared are the lip distances or, in a corpus without them, every channel that moves in the recordings; in addition
    or instead, the eigenlips of the model. Figures of closures and of silence need the channel ``opening``. Figures
    that cannot be computed are None. A model of several people generates the motion of each utterance's speaker; of
    speakers whom it does not know, named under ``strangers``, that of the mean person. ``without_words`` is the number
    of utterances without words or labelled phones, if there is one; ``seen_in_training`` is there, and True, if the
    model's header says that it was trained on some of the utterances.
    If the engine makes the lips meet in p, b and m, ``unpinned`` holds the figures of its motion without that.
    The reference for speech and for p, b and m are the labelled phones, or the forced alignment, or the recognised
    phones of utterances without transcript. The threshold of a closed mouth is computed from the corpus's training
    list (without one: from the selection).
    Raises CorpusError: no such utterances, or a model without the compared channels.
    Raises AlignmentError: a transcript cannot be aligned with its recording.
    Source: docs/measures.md; correlation and distance: Xie & Liu 2007, Eqs. 20 and 21.

    >>> import lipmotion, tempfile
    >>> from pathlib import Path
    >>> from lipmotion.testing import toy_utterances
    >>> folder = tempfile.TemporaryDirectory()
    >>> corpus = lipmotion.Corpus.create(Path(folder.name) / "toy")
    >>> corpus.add(toy_utterances(3)[0])
    >>> figures = lipmotion.evaluate(lipmotion.load_model(), corpus, selection=lipmotion.Selection(None))
    >>> figures["clips"], sorted(figures["conditions"])
    (1, ['audio only', 'with transcript'])
    >>> folder.cleanup()
    """
    phones = cached_recogniser(model.phones, recogniser, model.adaptation)
    recordings = held_out_recordings(
        corpus,
        phones,
        selection=selection,
        lexicon=lexicon,
        monitor=monitor,
        visual=model.visual,
        eigenlips=model.eigenlips,
        prior=model.prior,
        speakers=model.speakers,
    )
    figures = {
        "split": "given names" if selection.names is not None else selection.split or "all",
        "clips": len(recordings.utterances),
        "closed_under": recordings.closed_under,
        "still_channels": list(recordings.still),
        "conditions": {
            name: _figures_with_and_without_closures(recordings, name, model.engine, model.learned, seed)
            for name in recordings.conditions
        },
    }
    if WITH_TRANSCRIPT not in recordings.conditions:
        figures["without_words"] = sum(not (each.words or each.phones) for each in recordings.utterances)
    if _was_trained_on(model, recordings.utterances, corpus.path.name):
        figures["seen_in_training"] = True
    if model.speakers is not None:
        figures["strangers"] = list(recordings.strangers)
    return nan_as_null(figures)


def _was_trained_on(model: Model, utterances: Sequence[Utterance], folder: str) -> bool:
    """Return whether a model was trained on some utterances, as far as its header says: corpus, list, speakers.

    folder : name of the corpus, where the recordings do not say of which collection they are
    """
    about = model.about
    split, speakers, corpora = about.get("split"), about.get("speakers"), about.get("corpus", ())
    return any(
        utterance.source.get("collection", folder) in corpora
        and split in (utterance.split, "all")
        and (not speakers or utterance.speaker in speakers)
        for utterance in utterances
    )


def _figures_with_and_without_closures(
    recordings: HeldOutRecordings, condition: str, engine: Animator[ModelT], learned: ModelT, seed: int
) -> dict[str, Any]:
    """Return the figures of one condition; if the engine forces closures, ``unpinned`` holds those without them."""
    speech = speech_of_condition(recordings, condition, engine, learned)
    figures = figures_of(compare_with_recorded(recordings, speech, engine, learned), recordings, seed)
    unpinned = engine.without_closures()
    if unpinned == engine or recordings.closed_under is None:
        return figures
    clips = compare_with_recorded(recordings, speech, unpinned, learned)
    return figures | {"unpinned": figures_of(clips, recordings, seed)}
