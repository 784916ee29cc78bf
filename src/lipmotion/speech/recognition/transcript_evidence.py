"""Which words of a transcript are said, and where something else is, by the posteriors of a network that hears phones.

The network is trained with connectionist temporal classification (CTC): in a frame it gives the probability of every
phone, and of none (blank). A path through the frames says the phones of the transcript in their order, each in one
frame or several, with blanks before, between and after them. Before, between and after the words it may also say
anything, at a cost, and leave out words there, at a further cost. The best path decides: a word that it leaves out is
not said, and where it says anything, speech is left out of the transcript.

Source: Graves, Fernández, Gomez and Schmidhuber 2006, "Connectionist temporal classification". Deviations: the best
path counts, not the sum of all; a phone may be taken for any that is similar to it (``units.SIMILAR_PHONES``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import PHONES, SIMILAR_PHONES, is_silent

GAP_COST, WORD_COST, PHONE_COST = 6.0, 9.0, 1.0
"""What it costs, in nats, that anything is said; that words are left out there; and each phone of these words."""
WORD_COSTS, SURE_COSTS = (WORD_COST, PHONE_COST), (4.0, 0.5)
"""The last two; and where a recogniser is sure of what it hears, so that a single wrong word is noticed."""
MIN_HEARD = 1.0  # something is said in a frame in which any phone is so many nats more probable than none
MIN_GAP_S = 0.1  # where something else is said for a shorter time, no speech is missing
MIN_SAID_SHARE = 0.25  # a transcript of which so small a share of the phones is said is not that of the recording
MIN_LOG_POSTERIOR = -23.0
"""No frame counts for less: what the network holds for impossible is as good as any other mistake."""
LARGEST_SEARCH = 20_000_000  # frames times phones that are searched at once, about three minutes of speech
MIN_STRETCH_S, LONGEST_STRETCH_S = 10.0, 30.0
"""A longer recording is divided at the first silence after so many seconds, or else at the first word after so many."""

LABEL_REACH_S, COMPARED, MIN_AGREEING = 0.1, 9, 0.4
"""Given phones are compared with what is heard so near to them; of so many together fewer agree if they are wrong."""
NEAR_S, MIN_RUN, MIN_DOUBT_S = 0.5, 3, 0.3
"""Places in time that are nearer are one stretch; phones are doubted if they are so many and so long together."""

SILENT = [*(number for number, phone in enumerate(PHONES) if is_silent(phone)), len(PHONES)]
"""The columns of silence, of pauses and of none of the phones."""
Array = NDArray[np.float64]
Columns = NDArray[np.intp]


class WordEvidence(NamedTuple):
    """A word of a transcript, its phones, and its times: where it is heard, or was aligned if it is not said."""

    word: str
    phones: tuple[str, ...]
    start_s: float
    end_s: float
    is_said: bool


class OtherSpeech(NamedTuple):
    """Where something else is said than the transcript has: times in seconds, and words that are left out there.

    first, stop : numbers of these words; the same where speech is added alone
    If nothing at all is said in place of the words, it has no duration.
    """

    start_s: float
    end_s: float
    first: int
    stop: int


@dataclass(frozen=True)
class TranscriptEvidence:
    """What the posteriors say of a transcript: its words, and where something else is said, in their order."""

    words: tuple[WordEvidence, ...]
    others: tuple[OtherSpeech, ...]

    @property
    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Where speech is left out of the transcript, in seconds."""
        return tuple((each.start_s, each.end_s) for each in self.others if each.end_s - each.start_s >= MIN_GAP_S)

    @property
    def unsaid(self) -> tuple[WordEvidence, ...]:
        """The words that are not said."""
        return tuple(word for word in self.words if not word.is_said)

    @property
    def spoken_share(self) -> float:
        """The share of the transcript's phones whose words are said, 0 to 1; 1 without words."""
        count = sum(len(word.phones) for word in self.words)
        return sum(len(word.phones) for word in self.words if word.is_said) / count if count else 1.0

    @property
    def is_doubtful(self) -> bool:
        """Whether the transcript as a whole is something else than what is said."""
        return self.spoken_share < MIN_SAID_SHARE


def find_evidence(
    log_posteriors: Array, frame_s: float, units: Timeline[Unit], costs: tuple[float, float] = WORD_COSTS
) -> TranscriptEvidence:
    """Return what the posteriors say of a transcript.

    log_posteriors : natural logarithms, of ``PHONES`` in their order and of the blank, the last [shape=(T, 48)]
    frame_s : seconds from frame to frame
    units   : the phones of the transcript, aligned with the recording; of their times only the silences count, where a
              long recording is divided, and those of words that are not said
    costs   : of words that are left out, and of each of their phones
    """
    log_posteriors = np.maximum(log_posteriors, MIN_LOG_POSTERIOR)
    words: list[WordEvidence] = []
    others: list[OtherSpeech] = []
    for first_s, stop_s, spans_of_words in _divide(units, divided=len(log_posteriors) * len(units) > LARGEST_SEARCH):
        at, stop = round(first_s / frame_s), None if stop_s is None else round(stop_s / frame_s)
        columns = [np.array([PHONES.index(span.label.phone) for span in spans]) for spans in spans_of_words]
        frames_of_words, free = _find_best_path(log_posteriors[at:stop], columns, costs)
        for (begin, end), (left, back) in free:
            start_s, end_s = (at + begin) * frame_s, (at + end) * frame_s
            others.append(OtherSpeech(start_s, end_s, len(words) + left, len(words) + back))
        for spans, heard in zip(spans_of_words, frames_of_words, strict=True):
            phones, (start_s, end_s) = tuple(span.label.phone for span in spans), (spans[0].start_s, spans[-1].end_s)
            if heard is not None:
                start_s, end_s = (at + heard[0]) * frame_s, (at + heard[1]) * frame_s
            words.append(WordEvidence(spans[0].label.word, phones, start_s, end_s, heard is not None))
    return TranscriptEvidence(tuple(words), tuple(others))


def _divide(units: Timeline[Unit], divided: bool) -> Iterator[tuple[float, float | None, list[list[Span[Unit]]]]]:
    """Yield start, end (None: the last) and words of a recording, or of parts that are short enough to be searched."""
    start_s = before_s = 0.0
    words: list[list[Span[Unit]]] = []
    for (silent, _), group in groupby(units, key=lambda span: (is_silent(span.label.phone), span.label.word)):
        spans = list(group)
        if silent:
            continue
        pause_s, so_far_s = spans[0].start_s - before_s, before_s - start_s
        if divided and words and so_far_s > (MIN_STRETCH_S if pause_s > 0 else LONGEST_STRETCH_S):
            cut_s = before_s + pause_s / 2
            yield start_s, cut_s, words
            start_s, words = cut_s, []
        words.append(spans)
        before_s = spans[-1].end_s
    yield start_s, None, words


Range = tuple[int, int]  # the first of some frames or words, and the one after the last
Path = tuple[list[Range | None], list[tuple[Range, Range]]]
"""The frames of each word, None where it is left out; and those in which anything is said, with the words left out."""
BLANK, PHONE, FREE, INSTEAD = range(4)
"""How a path is after n phones: in a blank; in the nth of them; it says anything between words, or in place of some."""
STAYED, BEGAN, SKIPPED = range(3)
"""How it came to say anything there: it did before; it begins; a word more is left out."""


def _find_best_path(log_posteriors: Array, words: Sequence[Columns], costs: tuple[float, float] = WORD_COSTS) -> Path:
    """Return the best path that says words, leaves some of them out, and says anything between them."""
    word_cost, phone_cost = costs
    columns = np.concatenate([np.zeros(0, np.intp), *words])
    frames, count = len(log_posteriors), len(columns)
    edges = np.cumsum([0, *map(len, words)])
    spoken = np.log(np.exp(log_posteriors) @ _count_taken())[:, columns]
    silent = np.logaddexp.reduce(log_posteriors[:, SILENT], axis=1)
    anything = np.maximum(log_posteriors.max(axis=1), silent)
    same = np.concatenate([[False], columns[1:] == columns[:-1]])[:count] & ~np.isin(np.arange(count), edges)
    entered = np.zeros((frames, count), bool)
    arrivals = np.zeros((frames + 1, count + 1), np.int8)
    ways = np.zeros((frames, 2, len(edges)), np.int8)
    blank, phone = np.full(count + 1, -np.inf), np.full(count + 1, -np.inf)
    free, instead = np.full(len(edges), -np.inf), np.full(len(edges), -np.inf)
    blank[0] = 0.0
    for t in range(frames + 1):
        arrived = np.maximum(blank, phone)
        arrivals[t] = np.where(phone >= blank, PHONE, BLANK)
        either, way = np.maximum(free, instead), np.where(free > instead, FREE, INSTEAD)
        arrivals[t, edges] = np.where(either > arrived[edges], way, arrivals[t, edges])
        arrived[edges] = np.maximum(arrived[edges], either)
        if t == frames:
            break
        begun = arrived[edges] - GAP_COST
        ways[t, 0] = np.where(begun > free, BEGAN, STAYED)
        free = np.maximum(free, begun)
        first = np.append(-np.inf, free[:-1] + phone_cost * edges[:-1] - word_cost)  # one word is left out
        going = instead + phone_cost * edges
        further = np.maximum.accumulate(np.maximum(going, first))
        ways[t, 1] = np.where(going >= further, STAYED, np.where(first >= further, BEGAN, SKIPPED))
        instead = further - phone_cost * edges + anything[t]
        free = free + anything[t]
        before = np.where(same, blank[:-1], arrived[:-1])
        entered[t] = before > phone[1:]
        phone[1:] = np.maximum(phone[1:], before) + spoken[t]
        blank = arrived + silent[t]
    return _trace(arrivals, entered, ways, same, edges, anything - silent)


def _trace(
    arrivals: NDArray[np.int8],
    entered: NDArray[np.bool_],
    ways: NDArray[np.int8],
    same: NDArray[np.bool_],
    edges: Columns,
    heard: Array,
) -> Path:
    place, how = int(edges[-1]), int(arrivals[-1, -1])
    words: list[Range | None] = [None] * (len(edges) - 1)
    free: list[tuple[Range, Range]] = []
    last: Range | None = None  # the end of a free stretch: its frame, the word after it
    for t in reversed(range(len(heard))):
        word = int(np.searchsorted(edges, place))  # the one that ends at this place is before it
        if how == BLANK:
            how = int(arrivals[t, place])
        elif how == PHONE:
            words[word - 1] = (t, (words[word - 1] or (t, t + 1))[1])
            if entered[t, place - 1]:
                place -= 1
                how = BLANK if same[place] else int(arrivals[t, place])
        else:
            last = last or (t + 1, word)
            while how == INSTEAD and ways[t, 1, word] != STAYED:
                how = FREE if ways[t, 1, word] == BEGAN else INSTEAD
                word -= 1
            place = int(edges[word])
            if how == FREE and ways[t, 0, word] == BEGAN:
                loud = t + np.flatnonzero(heard[t : last[0]] > MIN_HEARD)
                where = (int(loud[0]), int(loud[-1]) + 1) if len(loud) else (t, t)
                free.append((where, (word, last[1])))
                last, how = None, int(arrivals[t, place])
    return words, free[::-1]


class LabelEvidence(NamedTuple):
    """Where phones with given times are not what is said [each: starts and ends in seconds]."""

    missing: tuple[tuple[float, float], ...]  # something is said where they have silence
    idle: tuple[tuple[float, float], ...]  # nothing is said where they have phones
    wrong: tuple[tuple[float, float], ...]  # other phones are said


def label_evidence(log_posteriors: Array, frame_s: float, units: Timeline[Unit]) -> LabelEvidence:
    """Return where the posteriors contradict phones with given times (as of ``transcript_evidence``).

    A phone is compared with what is heard at most ``LABEL_REACH_S`` away from it.
    """
    spoken = [span for span in units if not is_silent(span.label.phone)]
    starts_s = np.array([span.start_s for span in spoken], float)
    ends_s = np.array([span.end_s for span in spoken], float)
    phones = np.array([PHONES.index(span.label.phone) for span in spoken], np.intp)
    best = log_posteriors.argmax(axis=1)
    heard = np.flatnonzero(~np.isin(best, SILENT) & (np.diff(best, prepend=-1) != 0))
    times_s: Array = ((heard + 0.5) * frame_s).astype(float)
    first = np.searchsorted(ends_s, times_s - LABEL_REACH_S)
    stop = np.searchsorted(starts_s, times_s + LABEL_REACH_S, "right")
    is_near, agrees = np.zeros(len(spoken), bool), np.zeros(len(spoken), bool)
    confirmed = np.zeros(len(heard), bool)
    for number, column in enumerate(best[heard]):
        nearby = slice(first[number], stop[number])
        alike = _count_taken()[column, phones[nearby]] > 0
        is_near[nearby], agrees[nearby], confirmed[number] = True, agrees[nearby] | alike, alike.any()
    alone = first >= stop
    middles_s: Array = (starts_s + ends_s) / 2
    compared_s = np.concatenate([times_s[~alone], middles_s[is_near]])
    order = compared_s.argsort()
    right = np.concatenate([confirmed[~alone], agrees[is_near]])[order].astype(float)
    share, window = right, np.ones(min(COMPARED, max(len(right), 1)))
    if len(right):
        share = np.convolve(right, window, "same") / np.convolve(np.ones(len(right)), window, "same")
    doubted_s = compared_s[order][share < MIN_AGREEING]
    idle = join_near(starts_s[~is_near], ends_s[~is_near], MIN_RUN, MIN_DOUBT_S)
    wrong = join_near(doubted_s, doubted_s, MIN_RUN, MIN_DOUBT_S)
    return LabelEvidence(join_near(times_s[alone], times_s[alone], MIN_RUN, MIN_GAP_S), idle, wrong)


def join_near(
    starts_s: ArrayLike, ends_s: ArrayLike, count: int = 1, min_s: float = 0.0
) -> tuple[tuple[float, float], ...]:
    """Return places in time, those near one another as one, as far as they are so many together and last so long."""
    starts, ends = np.asarray(starts_s, float), np.asarray(ends_s, float)
    cuts = np.flatnonzero(starts[1:] - ends[:-1] > NEAR_S) + 1
    runs = zip(np.split(starts, cuts), np.split(ends, cuts), strict=True)
    spans = [(float(first[0]), float(last[-1])) for first, last in runs if len(first) >= count]
    return tuple((start_s, end_s) for start_s, end_s in spans if end_s - start_s >= min_s)


@cache
def _count_taken() -> Array:
    """Return for each class and each phone whether the one may be taken for the other [shape=(48, 47)]."""
    taken = np.eye(len(PHONES) + 1, len(PHONES))
    for phone, others in SIMILAR_PHONES.items():
        for other in others:
            taken[PHONES.index(phone), PHONES.index(other)] = taken[PHONES.index(other), PHONES.index(phone)] = 1.0
    return taken
