"""Whether a transcript is what is said, by the posteriors of a network that hears phones.

The network is trained with connectionist temporal classification (CTC): in a frame it gives the probability of every
phone, and of none (blank). A path through the frames says the phones of the transcript in their order, each in one
frame or several, with blanks before, between and after them. How much worse the best such path is than the best path
that says anything is the loss of the transcript. The loss of a word is what is won where anything may be said in its
place, less what is won where anything may be said beside it. A gap is where something is said between two words, and
much is won if it may be.

Source: Graves, Fernández, Gomez and Schmidhuber 2006, "Connectionist temporal classification". Deviations: the best
path counts, not the sum of all; a phone may be taken for any that is similar to it (``units.SIMILAR_PHONES``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import PHONES, SIMILAR_PHONES, is_silent

DOUBTFUL_LOSS = 1.6
"""A transcript with a higher loss per phone, in nats, is not what is said: right ones have 0 to 1.4, those of other
sentences 1 to 8 (docs/robustness.md)."""
DOUBTFUL_WORD_LOSS = 22.0
"""A word with a higher loss, in nats, is not said: those of right transcripts reach 20."""
MISSING_GAIN, LEAST_GAP_S = 6.0, 0.2
"""Where more is won between two words, in nats, over so long a time, speech is left out: right transcripts reach 5."""
LEAST_LOG_POSTERIOR = -23.0
"""No frame counts for less: what the network holds for impossible is as good as any other mistake."""
LEAST_STRETCH_S, LONGEST_STRETCH_S = 10.0, 30.0
"""A long recording is divided at the first silence after so many seconds, or else at the first word after so many."""

Array = NDArray[np.float64]
Columns = NDArray[np.intp]


class WordLoss(NamedTuple):
    """A word of a transcript, where it was aligned, and its loss in nats."""

    word: str
    start_s: float
    end_s: float
    loss: float


class Gap(NamedTuple):
    """Where something is said that the transcript leaves out, in seconds, and the nats that are won by it."""

    start_s: float
    end_s: float
    gain: float


@dataclass(frozen=True)
class TranscriptEvidence:
    """What the posteriors say of a transcript.

    loss  : mean loss per phone in nats, about 0 or more; infinite where the phones do not fit into the frames
    words : the words in time, each with its loss
    gaps  : the places between words where speech is left out
    """

    loss: float
    words: tuple[WordLoss, ...]
    gaps: tuple[Gap, ...]

    @property
    def doubtful_words(self) -> tuple[WordLoss, ...]:
        """The words that are not said."""
        return tuple(word for word in self.words if word.loss > DOUBTFUL_WORD_LOSS)

    @property
    def is_doubtful(self) -> bool:
        """Whether the transcript as a whole is something else than what is said."""
        return self.loss > DOUBTFUL_LOSS


def transcript_evidence(log_posteriors: Array, frame_s: float, units: Timeline[Unit]) -> TranscriptEvidence:
    """Return what the posteriors say of a transcript.

    log_posteriors : natural logarithms, of ``PHONES`` in their order and of the blank, the last [shape=(T, 48)]
    frame_s : seconds from frame to frame
    units   : the phones of the transcript, aligned with the recording; of their times only the silences count, where a
              long recording is divided, and the words', which are returned
    Raises ValueError: the posteriors are not of all phones, or end before the phones.
    """
    spoken_s = max((span.end_s for span in units if not is_silent(span.label.phone)), default=0.0)
    if (len(log_posteriors) + 1) * frame_s < spoken_s:
        raise ValueError(f"posteriors of {len(log_posteriors) * frame_s:.2f} s, required {spoken_s:.2f}")
    if log_posteriors.shape[1] != len(PHONES) + 1:
        raise ValueError(f"posteriors of {log_posteriors.shape[1]} classes, required {len(PHONES) + 1}")
    total, phones = 0.0, 0
    words: list[WordLoss] = []
    gaps: list[Gap] = []
    for stretch in _parts(units):
        first, stop = round(stretch.start_s / frame_s), round(stretch.end_s / frame_s)
        if stretch.is_last:
            stop = len(log_posteriors)
        losses = _losses(log_posteriors[first:stop], stretch.columns())
        total, phones = total + losses.total, phones + sum(len(spans) for spans in stretch.words)
        words += [
            WordLoss(spans[0].label.word, spans[0].start_s, spans[-1].end_s, float(loss))
            for spans, loss in zip(stretch.words, losses.of_words, strict=True)
        ]
        gaps += [Gap((first + begin) * frame_s, (first + end) * frame_s, gain) for begin, end, gain in losses.gaps]
    return TranscriptEvidence(total / max(phones, 1), tuple(words), _largest(gaps))


def _largest(gaps: Sequence[Gap]) -> tuple[Gap, ...]:
    """Return the gaps that count, in order: of those that overlap, the one where most is won."""
    kept: list[Gap] = []
    long = [gap for gap in gaps if gap.gain > MISSING_GAIN and gap.end_s - gap.start_s >= LEAST_GAP_S]
    for gap in sorted(long, key=lambda gap: -gap.gain):
        if all(gap.end_s <= each.start_s or each.end_s <= gap.start_s for each in kept):
            kept.append(gap)
    return tuple(sorted(kept))


class _Part(NamedTuple):
    """A part of a recording, and the phones of its words in time."""

    start_s: float
    end_s: float
    words: list[list[Span[Unit]]]
    is_last: bool

    def columns(self) -> list[Columns]:
        """Return the columns of the phones of each word."""
        return [np.array([PHONES.index(span.label.phone) for span in spans]) for spans in self.words]


def _parts(units: Timeline[Unit]) -> Iterator[_Part]:
    """Yield a recording in parts that are short enough to be searched, cut in silence where there is some."""
    start_s = before_s = 0.0
    words: list[list[Span[Unit]]] = []
    for (silent, _), group in groupby(units, key=lambda span: (is_silent(span.label.phone), span.label.word)):
        spans = list(group)
        if silent:
            continue
        pause_s, so_far_s = spans[0].start_s - before_s, before_s - start_s
        if words and so_far_s > (LEAST_STRETCH_S if pause_s > 0 else LONGEST_STRETCH_S):
            cut_s = before_s + pause_s / 2
            yield _Part(start_s, cut_s, words, is_last=False)
            start_s, words = cut_s, []
        words.append(spans)
        before_s = spans[-1].end_s
    yield _Part(start_s, units[-1].end_s if len(units) else 0.0, words, is_last=True)


class _Losses(NamedTuple):
    """Losses in nats.

    total    : of the whole stretch
    of_words : of each word [shape=(W,)]
    gaps     : before each word and after the last: first frame, the one after the last, and what is won
    """

    total: float
    of_words: Array
    gaps: list[tuple[int, int, float]]


def _losses(log_posteriors: Array, words: Sequence[Columns]) -> _Losses:
    """Return the losses of the words of a stretch."""
    log_posteriors = np.maximum(log_posteriors, LEAST_LOG_POSTERIOR)
    columns = np.concatenate([np.zeros(0, np.intp), *words])
    spoken = np.log(np.exp(log_posteriors) @ _taken_for())[:, columns]
    silent = np.logaddexp.reduce(log_posteriors[:, _silent_columns()], axis=1)
    before = _best_paths(spoken, silent, columns)
    after = _best_paths(spoken[::-1, ::-1], silent[::-1], columns[::-1])[::-1, ::-1]
    free = np.concatenate([[0.0], np.cumsum(np.maximum(log_posteriors.max(axis=1), silent))])
    path = before[-1, -1]
    edges = np.cumsum([0, *map(len, words)])
    if not np.isfinite(path):
        return _Losses(np.inf, np.full(len(words), np.inf), [])

    def freed(first: int, stop: int) -> tuple[int, int, float]:
        """Return where anything is best said in place of some phones: the frames, and the nats that are won."""
        until = before[:, first] - free
        through = free + after[:, stop] + np.maximum.accumulate(until)
        end = int(through.argmax())
        return int(until[: end + 1].argmax()), end, float(through[end] - path)

    gaps = [freed(edge, edge) for edge in edges]
    won = np.array([gain for *_, gain in gaps])
    of_words = [freed(first, stop)[2] for first, stop in pairwise(edges)]
    return _Losses(float(free[-1] - path), np.array(of_words) - np.maximum(won[:-1], won[1:]), gaps)


def _best_paths(spoken: Array, silent: Array, columns: Columns) -> Array:
    """Return the log probability of the best path through the first t frames that says the first n phones.

    spoken  : log probability of every phone in every frame [shape=(T, N)];  silent : of none [shape=(T,)]
    columns : which phone each is: between two that are the same there is a blank [shape=(N,)]
    Returns [shape=(T + 1, N + 1)]; −∞ where there is no such path.
    """
    paths = np.full((len(spoken) + 1, len(columns) + 1), -np.inf)
    paths[0, 0] = 0.0
    in_blank, in_phone = paths[0].copy(), np.full(len(columns) + 1, -np.inf)
    same = np.concatenate([[False], columns[1:] == columns[:-1]]) if len(columns) else np.zeros(0, bool)
    for t in range(len(spoken)):
        entered = np.maximum(in_blank[:-1], np.where(same, -np.inf, in_phone[:-1]))
        in_blank = np.maximum(in_blank, in_phone) + silent[t]
        in_phone[1:] = np.maximum(in_phone[1:], entered) + spoken[t]
        paths[t + 1] = np.maximum(in_blank, in_phone)
    return paths


@cache
def _taken_for() -> Array:
    """Return for each class and each phone whether the one may be taken for the other [shape=(48, 47)]."""
    taken = np.eye(len(PHONES) + 1, len(PHONES))
    for phone, others in SIMILAR_PHONES.items():
        for other in others:
            taken[PHONES.index(phone), PHONES.index(other)] = taken[PHONES.index(other), PHONES.index(phone)] = 1.0
    return taken


def _silent_columns() -> list[int]:
    """Return the columns of the blank, silence and pause."""
    return [number for number, phone in enumerate(PHONES) if is_silent(phone)] + [len(PHONES)]
