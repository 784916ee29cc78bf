"""Evaluation: ``evaluate(model, corpus) → figures``, the figures of docs/measures.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.kernels.threads import one_thread
from lipmotion.measures import curves
from lipmotion.measures.closures import closure_figures, phone_closures
from lipmotion.measures.curves import bootstrap_interval
from lipmotion.motion.rest import is_away_from_speech
from lipmotion.pipeline.model import Model
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.storage.json_text import nan_as_null
from lipmotion.types import Monitor, Utterance, silent_monitor
from lipmotion.units import VISEMES, Lexicon
from lipmotion_lab.evaluation.held_out import (
    OPENING,
    TEST_LIST,
    WITH_TRANSCRIPT,
    ComparedClip,
    generate_compared,
    load_held_out,
    make_speech,
)

BILABIAL = VISEMES["bi"]
SILENCE_MARGIN_S = 0.3
"""Seconds before and after speech in which the mouth may still close or already open."""


class Compared(Protocol):
    """What is compared in some recordings: part of ``HeldOutRecordings``."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""

    @property
    def closed_under(self) -> float | None:
        """The opening under which the mouth counts as closed (None: no channel ``opening``)."""

    @property
    def eigenlips_channels(self) -> tuple[str, ...]:
        """Names of the channels that are eigenlips."""


def figures_of(clips: Sequence[ComparedClip], recordings: Compared, seed: int) -> dict[str, Any]:
    """Return the figures of one condition, by name; figures that cannot be computed are NaN.

    Eigenlips have figures of their own, ``eigenlips``; without other channels, these are also the overall figures.
    """
    compared, threshold = recordings.channels, recordings.closed_under
    generated, original = [clip.generated for clip in clips], [clip.original for clip in clips]
    rate_hz = float(1 / np.median(np.diff(clips[0].time_s)))
    acc, clip_acc = curves.pooled_correlation(generated, original), curves.per_clip_correlation(generated, original)
    error, variance = curves.normalised_rmse(generated, original), curves.global_variance_ratio(generated, original)
    jerk = curves.jerk_ratio(generated, original)
    per_channel = {
        name: {
            "acc": float(acc[i]),
            "acc_per_clip": float(clip_acc[i]),
            "nrmse": float(error[i]),
            "global_variance": float(variance[i]),
            "jerk": float(jerk[i]),
        }
        for i, name in enumerate(compared)
    }
    eigenlips = {name: per_channel[name] for name in recordings.eigenlips_channels}
    is_eigenlips = np.array([name in eigenlips for name in compared])
    overall = ~is_eigenlips if not is_eigenlips.all() else is_eigenlips
    spread = np.where(overall, np.concatenate(original).std(axis=0), 0)
    leading = compared.index(OPENING) if OPENING in compared else int(spread.argmax())

    def distance(columns: NDArray[np.bool_]) -> float:
        return curves.mean_distance([clip[:, columns] for clip in generated], [clip[:, columns] for clip in original])

    figures = {
        "channels": {name: row for name, row in per_channel.items() if name not in eigenlips},
        "acc": float(acc[overall].mean()),
        "amse": distance(overall),
        "leading": compared[leading],
        "lag_ms": curves.lag_ms(
            [clip[:, leading : leading + 1] for clip in generated],
            [clip[:, leading : leading + 1] for clip in original],
            rate_hz,
        ),
    }
    if eigenlips:  # means over channels: Xie & Liu 2007, Eq. 21, for the correlation
        rows = list(eigenlips.values())
        means = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
        figures["eigenlips"] = means | {"amse": distance(is_eigenlips), "channels": eigenlips}
    if threshold is None:
        return figures
    return figures | _opening_figures(clips, compared.index(OPENING), threshold, rate_hz, seed)


def _opening_figures(
    clips: Sequence[ComparedClip], column: int, threshold: float, rate_hz: float, seed: int
) -> dict[str, Any]:
    """Return the figures of the channel ``opening``: its interval, closures, and silence."""
    generated, original = [clip.generated[:, column] for clip in clips], [clip.original[:, column] for clip in clips]
    bilabial: list[list[tuple[float, float]]] = []
    for clip in clips:  # on a clock that stops where the face was not measured
        clock_s = np.arange(len(clip.time_s)) / rate_hz
        ends = [span[:2] for span in clip.spoken if span[2] in BILABIAL]
        bilabial.append([tuple(np.interp(pair, clip.time_s, clock_s).tolist()) for pair in ends])
    other_s = sum(end - start for clip in clips for start, end, phone in clip.spoken if phone not in BILABIAL)

    def acc(generated: curves.Clips, original: curves.Clips) -> float:
        return float(curves.pooled_correlation([g[:, None] for g in generated], [o[:, None] for o in original])[0])

    return {
        "opening_acc_95": bootstrap_interval(acc, generated, original, seed),
        "closures": asdict(closure_figures(generated, original, threshold, rate_hz)),
        "closures_p_b_m": asdict(phone_closures(generated, original, bilabial, other_s, threshold, rate_hz)),
        "silence": {"generated": _silence(clips, generated), "original": _silence(clips, original)},
    }


def _silence(clips: Sequence[ComparedClip], values: curves.Clips) -> dict[str, float]:
    """Return mean and standard deviation of the opening in silence away from speech, and the number of its frames."""
    quiet = np.concatenate(
        [
            v[
                is_away_from_speech(
                    clip.time_s, [(start_s, end_s) for start_s, end_s, _ in clip.spoken], SILENCE_MARGIN_S
                )
            ]
            for clip, v in zip(clips, values, strict=True)
        ]
    )
    mean, deviation = (float(quiet.mean()), float(quiet.std())) if len(quiet) else (float("nan"), float("nan"))
    return {"mean": mean, "std": deviation, "frames": len(quiet)}


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
    recogniser : ``own``, ``general`` or ``auto``, as in ``Request``

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
    recordings = load_held_out(
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
    engine, conditions = model.engine, {}
    without = engine.without_closures()
    for name in recordings.conditions:
        speech = make_speech(recordings, name, engine, model.learned)
        row = figures_of(generate_compared(recordings, speech, engine, model.learned), recordings, seed)
        if without != engine and recordings.closed_under is not None:
            clips = generate_compared(recordings, speech, without, model.learned)
            row["unpinned"] = figures_of(clips, recordings, seed)
        conditions[name] = row
    figures = {
        "split": "given names" if selection.names is not None else selection.split or "all",
        "clips": len(recordings.utterances),
        "closed_under": recordings.closed_under,
        "still_channels": list(recordings.still),
        "conditions": conditions,
    }
    if WITH_TRANSCRIPT not in recordings.conditions:
        figures["without_words"] = sum(not (each.words or each.phones) for each in recordings.utterances)
    if _was_trained_on(model, recordings.utterances, corpus.path.name):
        figures["seen_in_training"] = True
    if model.speakers is not None:
        figures["strangers"] = list(recordings.strangers)
    return nan_as_null(figures)


def _was_trained_on(model: Model, utterances: Sequence[Utterance], folder: str) -> bool:
    """Return whether a model was trained on some utterances, as far as its header says: corpus, list, speakers."""
    about = model.about
    split, speakers, corpora = about.get("split"), about.get("speakers"), about.get("corpus", ())
    return any(
        utterance.source.get("collection", folder) in corpora
        and split in (utterance.split, "all")
        and (not speakers or utterance.speaker in speakers)
        for utterance in utterances
    )
