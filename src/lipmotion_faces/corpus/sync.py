"""Sound and motion in step: ``measure_offsets(corpus)`` measures the offset, ``remove_offsets(corpus)`` removes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import Corpus, read_entry
from lipmotion.kernels.compiler import limit_threads
from lipmotion.measures.curves import Array, correlation, refine_peak
from lipmotion.motion.space import resample_to_model
from lipmotion.speech.features.mfcc import WINDOW
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.storage.locks import lock_folder
from lipmotion.types import FRAME_RATE_HZ, Audio, Timeline, Utterance
from lipmotion_faces.corpus.sound_offset import measure_opening_speed, predict_opening_speed

REACH_S = 0.4  # largest offset that is considered, in seconds, in both directions
OPENING = "opening"
REMOVED_MS = "offset_removed_ms"  # key in the source of an utterance: milliseconds by which its sound was moved
MIN_MOVE_S = 0.005  # smallest offset in seconds that is removed
MIN_SCORE = 0.5  # least correlation at which the offset of one clip is known
MIN_MARGIN = 0.15  # least difference between the best and the second maximum at which an offset is known
MIN_CLIPS, WIDEST_S = 5, 0.06
"""An offset of so many clips together is known at any correlation if its interval is as narrow: curves of a voice that
the prediction has not learned correlate less, and agree on the offset all the same (docs/robustness.md)."""
PEAK_S = 0.12  # maxima further from the best than this, in seconds, are other ones
MIN_SHARE = 0.5  # least share of the frames that can be compared at a shift
OFFSET_DRAWS = 500  # bootstrap samples of an interval


@dataclass(frozen=True)
class Offset:
    """Offset of the sound from the video.

    late_s : seconds by which the sound is late; negative: early
    score  : correlation of the two curves at this offset
    margin : difference to the highest correlation further than ``PEAK_S`` away
    low_s, high_s : 95 % interval where several clips were pooled, else both ``late_s``
    clips  : how many clips were pooled
    """

    late_s: float
    score: float
    margin: float
    low_s: float
    high_s: float
    clips: int = 1

    @property
    def known(self) -> bool:
        """Whether the correlation has one maximum only, and is high enough or agreed on by enough clips."""
        agreed = self.clips >= MIN_CLIPS and self.high_s - self.low_s <= WIDEST_S
        return self.margin > MIN_MARGIN and (self.score > MIN_SCORE or agreed)


def shift_scores(predicted: Array, measured: Array, valid: NDArray[np.bool_], reach: int) -> Array:
    """Return the correlation of predicted[t + k] with measured[t] for k = -reach … reach [shape=(2·reach + 1,)].

    predicted, measured : curves [shape=(T,)] at one rate;  valid : where ``measured`` is known [shape=(T,)]
    It is 0 where too few frames overlap, or one curve is constant.
    """
    scores = np.zeros(2 * reach + 1)
    for shift in range(-reach, reach + 1):
        count, first = min(len(predicted) - shift, len(measured)), max(-shift, 0)
        compared = valid[first : max(count, first)]
        if compared.sum() >= max(MIN_SHARE * len(measured), 2):
            a, b = predicted[first + shift : count + shift][compared], measured[first:count][compared]
            scores[shift + reach] = correlation(a[:, None], b[:, None])[0]
    return scores


def find_offset(scores: Array, rate_hz: float) -> Offset:
    """Return the offset of the highest score [shape=(2·reach + 1,)], refined by a parabola."""
    late_s, score, margin = _find_highest(scores, rate_hz)
    return Offset(late_s, score, margin, late_s, late_s)


def find_pooled_offset(scores: Sequence[Array], rate_hz: float) -> Offset:
    """Return the common offset of clips: that of the highest mean score, with a bootstrap interval over clips."""
    clips = np.stack(scores)
    late_s, score, margin = _find_highest(clips.mean(axis=0), rate_hz)
    draw = np.random.default_rng(0)
    draws = [
        _find_highest(clips[draw.integers(len(clips), size=len(clips))].mean(axis=0), rate_hz)[0]
        for _ in range(OFFSET_DRAWS)
    ]
    low_s, high_s = np.percentile(draws, [2.5, 97.5])
    return Offset(late_s, score, margin, float(low_s), float(high_s), len(clips))


def _find_highest(scores: Array, rate_hz: float) -> tuple[float, float, float]:
    """Return offset in seconds, score and margin of the highest score (see ``Offset``)."""
    position, peak = refine_peak(scores)
    elsewhere = np.abs(np.arange(len(scores)) - position) > PEAK_S * rate_hz
    return (position - len(scores) // 2) / rate_hz, peak, float(peak - scores[elsewhere].max(initial=-1.0))


@dataclass(frozen=True)
class CorpusOffsets:
    """Offsets of the sound of a corpus from the motion: of utterances, and of collections with their members."""

    clips: Mapping[str, Offset]
    collections: Mapping[str, Offset]
    members: Mapping[str, tuple[str, ...]]

    def list_lines(self) -> list[str]:
        """Return the offsets as text for users, one line a collection."""
        return [f"{name or 'corpus'}: {self._format_line(name)}" for name in sorted(self.collections)]

    def _format_line(self, collection: str) -> str:
        pooled, clips = self.collections[collection], {name: self.clips[name] for name in self.members[collection]}
        counted = f"{len(clips)} clips" if len(clips) > 1 else "1 clip"
        if not pooled.known:
            return (
                f"not measured: {counted} of this voice cannot tell whether the sound is late. Training works without "
                "it: one camera keeps sound and lips in step, as a rule. Where they look out of step, add clips (eight "
                "mostly tell), or give corpus prepare --offset-ms"
            )
        interval = f"95 %: {1000 * pooled.low_s:+.0f} to {1000 * pooled.high_s:+.0f} ms"
        late = f"{1000 * abs(pooled.late_s):.0f} ms {'late' if pooled.late_s >= 0 else 'early'}"
        together = f"sound {late} ({interval}), by {counted} together"
        together += ", which corpus sync removes" if _is_worth_moving(pooled) else ""
        late_ms = {name: 1000 * clip.late_s for name, clip in clips.items() if clip.known}
        if not late_ms:
            return together
        worst = sorted(late_ms, key=lambda name: -abs(late_ms[name] - 1000 * pooled.late_s))[:3]
        furthest = ", ".join(f"{name} {late_ms[name]:+.0f}" for name in worst)
        median_ms = float(np.median(list(late_ms.values())))
        return f"{together}; {len(late_ms)} tell alone: median {median_ms:+.0f} ms, furthest off: {furthest}"


def score_shifts(utterance: Utterance) -> NDArray[np.float64]:
    """Return the agreement of sound and motion at every shift of up to ``REACH_S`` seconds [shape=(81,)]."""
    motion = utterance.track.motion
    predicted = predict_opening_speed(utterance.features)
    curve, seen = np.asarray(motion[OPENING], float)[:, None], np.asarray(utterance.track.seen)
    opening, valid = resample_to_model(curve, seen, motion.rate_hz, len(predicted))
    return shift_scores(predicted, measure_opening_speed(opening[:, 0]), valid, round(REACH_S * FRAME_RATE_HZ))


def measure_offsets(corpus: Corpus) -> CorpusOffsets:
    """Return the offsets of utterances and collections; zero is GRID's. Raises CorpusError: an utterance is damaged."""
    scores: dict[str, NDArray[np.float64]] = {}
    members: dict[str, list[str]] = {}
    for name in corpus.names():
        utterance = corpus.utterance(name)
        if OPENING in utterance.track.motion.names:
            scores[name] = score_shifts(utterance)
            collection = f"{utterance.source.get('collection', '')} {utterance.speaker}".strip()
            members.setdefault(collection, []).append(name)  # speakers are recorded separately, as a rule
    return CorpusOffsets(
        clips={name: find_offset(score, FRAME_RATE_HZ) for name, score in scores.items()},
        collections={
            collection: find_pooled_offset([scores[name] for name in names], FRAME_RATE_HZ)
            for collection, names in members.items()
        },
        members={collection: tuple(names) for collection, names in members.items()},
    )


@limit_threads()
def remove_offsets(corpus: Corpus) -> dict[str, float]:
    """Move the sound of each collection by its offset, if it is known; return the offsets in seconds, by collection.

    The motion is not changed; features are computed again. Late sound loses its beginning, early sound is preceded by
    its own beginning in reverse. The source of each utterance records the moves (``offset_removed_ms``).
    Raises CorpusError: an utterance is damaged. Raises ExportError: it cannot be written, or another process
    is changing the corpus.
    """
    with lock_folder(corpus.path):
        measured = measure_offsets(corpus)
        moved = {name: pooled.late_s for name, pooled in measured.collections.items() if _is_worth_moving(pooled)}
        for collection, late_s in moved.items():
            for name in measured.members[collection]:
                settings = read_entry(corpus.folder(name))["settings"]
                corpus.add(move_sound(corpus.utterance(name), late_s), settings)
    return moved


def _is_worth_moving(pooled: Offset) -> bool:
    """Return whether an offset is known, large enough, and significantly different from zero."""
    return pooled.known and abs(pooled.late_s) >= MIN_MOVE_S and (pooled.low_s > 0 or pooled.high_s < 0)


def move_sound(utterance: Utterance, late_s: float) -> Utterance:
    """Return an utterance whose sound and labels are ``late_s`` seconds earlier."""
    audio = utterance.audio
    shift = min(round(late_s * audio.rate_hz), len(audio.samples) - WINDOW)
    samples = audio.samples[shift:] if shift > 0 else np.pad(audio.samples, (-shift, 0), mode="reflect")
    moved = Audio(np.ascontiguousarray(samples), audio.rate_hz)
    total_ms = float(utterance.source.get(REMOVED_MS, 0)) + 1000 * shift / audio.rate_hz
    source = utterance.source | {REMOVED_MS: f"{total_ms:.1f}"}
    phones = utterance.phones
    if phones:
        earlier = phones.shifted(-shift / audio.rate_hz)
        spans = [replace(span, start_s=max(span.start_s, 0.0)) for span in earlier if span.end_s > 0]
        phones = Timeline((replace(spans[0], start_s=0.0), *spans[1:]))
    return replace(utterance, audio=moved, features=analysed(moved).mfcc(), source=source, phones=phones)
