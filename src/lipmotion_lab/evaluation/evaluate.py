"""Evaluation: ``evaluate(model, corpus) → figures``, those of docs/measures.md, and comparisons of systems."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import Corpus, Selection
from lipmotion.kernels.compiler import limit_threads
from lipmotion.measures import curves
from lipmotion.measures.closures import count_matches, find_closings, measure_closures, measure_phones
from lipmotion.measures.curves import Clips, compute_interval
from lipmotion.motion.frame_labels import is_away_from_speech
from lipmotion.pipeline.model import Model
from lipmotion.speech.recognition.recogniser import open_recogniser
from lipmotion.stats.curves import varies
from lipmotion.storage.json_text import replace_nan
from lipmotion.types import Monitor, Utterance, silent_monitor
from lipmotion.units import VISEMES, Lexicon
from lipmotion_lab.evaluation import held_out

BILABIAL = VISEMES["bi"]
SILENCE_MARGIN_S = 0.3  # seconds before and after speech in which the mouth may still close or already open


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


def measure_clips(clips: Sequence[held_out.ComparedClip], recordings: Compared, seed: int) -> dict[str, Any]:
    """Return the figures of one condition, by name; figures that cannot be computed are NaN.

    Eigenlips have figures of their own, ``eigenlips``; without other channels, these are also the overall figures.
    """
    compared, threshold = recordings.channels, recordings.closed_under
    generated, original = [clip.generated for clip in clips], [clip.original for clip in clips]
    rate_hz = float(1 / np.median(np.diff(clips[0].time_s)))
    measured = {
        "acc": curves.correlate_pooled(generated, original),
        "acc_per_clip": curves.correlate_clips(generated, original),
        "nrmse": curves.measure_nrmse(generated, original),
        "global_variance": curves.measure_variance_ratio(generated, original),
        "jerk": curves.measure_jerk_ratio(generated, original),
    }
    per_channel = {name: {key: float(of[i]) for key, of in measured.items()} for i, name in enumerate(compared)}
    eigenlips = {name: per_channel[name] for name in recordings.eigenlips_channels}
    is_eigenlips = np.array([name in eigenlips for name in compared])
    overall = ~is_eigenlips if not is_eigenlips.all() else is_eigenlips
    spread = np.where(overall, np.concatenate(original).std(axis=0), 0)
    leading = compared.index(held_out.OPENING) if held_out.OPENING in compared else int(spread.argmax())
    column = slice(leading, leading + 1)
    led = [clip[:, column] for clip in generated], [clip[:, column] for clip in original]

    def measure_distance(columns: NDArray[np.bool_]) -> float:
        return curves.measure_mean_distance(*([clip[:, columns] for clip in part] for part in (generated, original)))

    figures = {
        "channels": {name: row for name, row in per_channel.items() if name not in eigenlips},
        "acc": float(measured["acc"][overall].mean()),
        "amse": measure_distance(overall),
        "leading": compared[leading],
        "lag_ms": curves.measure_lag(*led, rate_hz),
    }
    if eigenlips:  # means over channels: Xie & Liu 2007, Eq. 21, for the correlation
        rows = list(eigenlips.values())
        means = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
        figures["eigenlips"] = means | {"amse": measure_distance(is_eigenlips), "channels": eigenlips}
    if threshold is None:
        return figures
    return figures | _measure_opening(clips, compared.index(held_out.OPENING), threshold, rate_hz, seed)


def _measure_opening(
    clips: Sequence[held_out.ComparedClip], column: int, threshold: float, rate_hz: float, seed: int
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
        return float(curves.correlate_pooled([g[:, None] for g in generated], [o[:, None] for o in original])[0])

    return {
        "opening_acc_95": compute_interval(acc, generated, original, seed),
        "closures": asdict(measure_closures(generated, original, threshold, rate_hz)),
        "closures_p_b_m": asdict(measure_phones(generated, original, bilabial, other_s, threshold, rate_hz)),
        "silence": {"generated": _measure_silence(clips, generated), "original": _measure_silence(clips, original)},
    }


def _measure_silence(clips: Sequence[held_out.ComparedClip], values: curves.Clips) -> dict[str, float]:
    """Return mean and standard deviation of the opening in silence away from speech, and the number of its frames."""
    away = (is_away_from_speech(each.time_s, [span[:2] for span in each.spoken], SILENCE_MARGIN_S) for each in clips)
    quiet = np.concatenate([curve[frames] for curve, frames in zip(values, away, strict=True)])
    mean, deviation = (float(quiet.mean()), float(quiet.std())) if len(quiet) else (float("nan"), float("nan"))
    return {"mean": mean, "std": deviation, "frames": len(quiet)}


@limit_threads()
def evaluate(
    model: Model,
    corpus: Corpus,
    *,
    selection: Selection = held_out.TEST_LIST,
    lexicon: Lexicon | None = None,
    recogniser: str = "auto",
    seed: int = 0,
    monitor: Monitor = silent_monitor,
) -> dict[str, Any]:
    """Return the figures of docs/measures.md, by name: from audio only and, if all have transcripts, with them.

    selection  : the utterances to compare; by default those of the list ``test``
    recogniser : ``own``, ``general`` or ``auto``, as in ``Request``

    Compared are the lip distances or, in a corpus without them, every channel that moves in the recordings; of an
    engine with the option ``channels`` those alone; in addition or instead, the eigenlips of the model.
    Figures of closures and of silence need the channel ``opening``. Figures that cannot be computed are None. A model
    of several people generates the motion of each utterance's speaker; of speakers whom it does not know, named under
    ``strangers``, that of the mean person. ``without_words`` is the number of utterances without words or labelled
    phones, if there is one; ``seen_in_training`` is there, and True, if the model's header says that it was trained on
    some of the utterances.
    If the engine makes the lips meet in p, b and m, ``unpinned`` holds the figures of its motion without that.
    The reference for speech and for p, b and m are the labelled phones, or the forced alignment, or the recognised
    phones of utterances without transcript. The threshold of a closed mouth is computed from the corpus's training
    list (without one: from the selection).
    Raises CorpusError: no such utterances, or a model without the compared channels.
    Raises AlignmentError: a transcript cannot be aligned with its recording.
    Source: docs/measures.md; correlation and distance: Xie & Liu 2007, Eqs. 20 and 21.

    >>> import lipmotion
    >>> corpus = lipmotion.Corpus.open("my-corpus")
    >>> figures = lipmotion.evaluate(lipmotion.load_model(), corpus)
    >>> sorted(figures["conditions"])
    ['audio only', 'with transcript']
    """
    phones = open_recogniser(model.phones, recogniser, model.adaptation)
    modelled = getattr(model.engine.config, "channels", "").split()  # some alone: what else moves is not compared
    recordings = held_out.load_held_out(
        corpus,
        phones,
        selection=selection,
        channels=modelled or None,
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
        speech = held_out.make_speech(recordings, name, engine, model.learned)
        row = measure_clips(held_out.generate_compared(recordings, speech, engine, model.learned), recordings, seed)
        if without != engine and recordings.closed_under is not None:
            clips = held_out.generate_compared(recordings, speech, without, model.learned)
            row["unpinned"] = measure_clips(clips, recordings, seed)
        conditions[name] = row
    figures = {
        "split": "given names" if selection.names is not None else selection.split or "all",
        "clips": len(recordings.utterances),
        "closed_under": recordings.closed_under,
        "still_channels": list(recordings.still),
        "conditions": conditions,
    }
    if held_out.WITH_TRANSCRIPT not in recordings.conditions:
        figures["without_words"] = sum(not (each.words or each.phones) for each in recordings.utterances)
    if _was_trained_on(model, recordings.utterances, corpus.path.name):
        figures["seen_in_training"] = True
    if model.speakers is not None:  # the others are compared with the mean person
        speakers = {utterance.speaker for utterance in recordings.utterances}
        figures["strangers"] = sorted(speakers - set(model.speakers))
    return replace_nan(figures)


def _was_trained_on(model: Model, utterances: Sequence[Utterance], folder: str) -> bool:
    """Return whether a model, or its prior, was trained on some utterances, as far as its header says."""
    return any(
        utterance.source.get("collection", folder) in about.get("corpus", ())
        and about.get("split") in (utterance.split, "all")
        and utterance.speaker in (about.get("speakers") or [utterance.speaker])
        for about in [each.about for each in (model, model.prior) if each is not None]
        for utterance in utterances
    )


Array = NDArray[np.float64]
MIN_DIFFERENCE = 1e-6  # a smaller difference of correlations, or of lengths in eye distances, is rounding


@dataclass(frozen=True, eq=False)
class ClipStatistic:
    """A function ``from_total`` of the sum of each clip's contribution, so that bootstrap samples are cheap."""

    sums: Sequence[Array]
    from_total: Callable[[Array], float]

    @property
    def value(self) -> float:
        """The statistic over all clips."""
        return self._value(self.sums)

    def compute_interval(self, seed: int) -> tuple[float, float]:
        """Return the 95 % bootstrap interval over clips."""
        return compute_interval(lambda own, _: self._value(own), self.sums, self.sums, seed)

    def compute_gain(self, other: ClipStatistic, seed: int) -> tuple[float, float]:
        """Return the paired 95 % bootstrap interval of this statistic minus that of another system."""
        return compute_interval(
            lambda own, others: self._value(own) - other._value(others), self.sums, other.sums, seed
        )

    def _value(self, sums: Sequence[Array]) -> float:
        return self.from_total(np.sum(sums, axis=0))


def divide_sums(total: Array) -> float:
    """Return the first of two sums by the second; NaN where there is none."""
    return float(total[0] / total[1]) if total[1] else float("nan")


def sum_correlations(generated: Clips, original: Clips) -> ClipStatistic:
    """Return the mean over channels of ``curves.correlate_pooled`` of clips [each shape=(T_i, P)]."""
    middle, everything = np.concatenate(original).mean(axis=0), np.concatenate(generated)
    still = ~varies(everything)

    def sum_moments(g: Array, o: Array) -> Array:
        a, b = np.where(still, 0, g - middle), o - middle
        return np.stack([np.full(a.shape[1], float(len(a))), *(x.sum(axis=0) for x in (a, b, a * a, b * b, a * b))])

    def average_correlation(total: Array) -> float:
        count, a, b, aa, bb, ab = total
        squares = np.maximum(aa - a * a / count, 0) * np.maximum(bb - b * b / count, 0)
        correlations = (ab - a * b / count) / np.where(squares > 0, np.sqrt(squares), np.inf)
        return float(correlations.mean())

    return ClipStatistic([sum_moments(g, o) for g, o in zip(generated, original, strict=True)], average_correlation)


def sum_distances(generated: Clips, original: Clips) -> ClipStatistic:
    """Return ``curves.measure_mean_distance`` of clips [each shape=(T_i, P)]."""
    errors = [np.linalg.norm(g - o, axis=1) for g, o in zip(generated, original, strict=True)]
    sums = [np.array([error.sum(), len(error)]) for error in errors]
    return ClipStatistic(sums, divide_sums)


def sum_closings(generated: Clips, original: Clips, threshold: float) -> ClipStatistic:
    """Return the share, in %, of original closings found in generated openings; NaN where there are none."""
    sides = ((find_closings(side[:, 0], threshold) for side in pair) for pair in zip(generated, original, strict=True))
    sums = [np.array([100.0 * count_matches(of, made), len(of)]) for made, of in sides]
    return ClipStatistic(sums, divide_sums)


def pair_curves(
    recordings: Compared, made: Sequence[held_out.ComparedClip], channel: str = held_out.OPENING
) -> tuple[list[Array], list[Array]]:
    """Return the generated and the original opening, or another channel, of every clip [each shape=(T, 1)]."""
    n = recordings.channels.index(channel)
    return [clip.generated[:, n : n + 1] for clip in made], [clip.original[:, n : n + 1] for clip in made]


def list_statistics(recordings: Compared, made: Sequence[held_out.ComparedClip]) -> dict[str, ClipStatistic]:
    """Return AMSE and ACC of geometry, or of eigenlips if there is no geometry; ACC and score of the opening."""
    pictured = np.array([name in recordings.eigenlips_channels for name in recordings.channels])
    parts = {"": pictured} if pictured.all() else {"": ~pictured, "eigenlips_": pictured}
    statistics: dict[str, ClipStatistic] = {}
    for part, columns in parts.items():
        if columns.any():
            both = [clip.generated[:, columns] for clip in made], [clip.original[:, columns] for clip in made]
            statistics |= {f"{part}amse": sum_distances(*both), f"{part}acc": sum_correlations(*both)}
    if recordings.closed_under is not None:
        opening = pair_curves(recordings, made)
        statistics["opening_acc"] = sum_correlations(*opening)
        statistics["score"] = sum_closings(*opening, recordings.closed_under)
    return statistics


def find_sign(interval: Sequence[float | None]) -> int:
    """Return 1 or -1 for a difference whose interval leaves out 0, by ``MIN_DIFFERENCE`` for rounding, else 0."""
    low, high = interval
    if low is None or high is None:
        return 0
    return int(low > MIN_DIFFERENCE) - int(high < -MIN_DIFFERENCE)


def mark_significance(gain: Sequence[float | None]) -> str:
    """Return ``*`` if the interval of a difference does not contain 0, else an empty text."""
    return "*" if find_sign(gain) else ""
