"""What was recognised in a recording: phones in time, words with their confidence, and which recogniser decided."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.align import align_states, place_words
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import penalise, wrap_log_likelihoods
from lipmotion.speech.recognition.general import NOISES
from lipmotion.speech.sound.analysed_audio import SILENT_ENERGY, AnalysedAudio, Passage
from lipmotion.speech.sound.voice_activity import Stretch
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units import PAUSE, PHONES, SILENCE, Lexicon, find_similar_phone, is_silent
from lipmotion.units.phones import FULL_FORMS, SHORT_PAUSE_S

COMPARED_FORMS = FULL_FORMS | {PAUSE: SILENCE} | dict.fromkeys(NOISES, SILENCE)
"""Phones that count as another one when phones of words and phones without words are compared."""


@dataclass(frozen=True, eq=False)
class AlignedWords:
    """Words aligned with a stretch of N frames."""

    words: tuple[str, ...]
    phones: tuple[str, ...]  # phones, pauses and silences, in order
    of_word: NDArray[np.intp]  # the word of each phone, by number; -1: none [shape=(len(phones),)]
    bounds: NDArray[np.intp]  # each phone's first frame, from that of the stretch, and N [shape=(len(phones) + 1,)]
    densities: NDArray[np.intp]  # the density of every frame [shape=(N,)]

    @property
    def of_frame(self) -> NDArray[np.intp]:
        """The phone of every frame, by number [shape=(N,)]."""
        return np.repeat(np.arange(len(self.phones)), np.diff(self.bounds))

    def fits(self, log_density: NDArray[np.float32], free: NDArray[np.intp]) -> tuple[NDArray[np.float64], float]:
        """Return by how much each word is less probable than freely recognised phones [shape=(W,)], and all together.

        log_density : of the stretch [shape=(N, G)]
        free        : the density of every frame on the best path of phones without words [shape=(N,)]
        A fit is the mean over frames of the difference of log densities: a log likelihood ratio in nats, seldom over 0.
        """
        frames = np.arange(len(free))
        gain = log_density[frames, self.densities].astype(float) - log_density[frames, free]
        word = self.of_word[self.of_frame]
        spoken = word >= 0
        count = np.bincount(word[spoken], minlength=len(self.words))
        total = np.bincount(word[spoken], gain[spoken], minlength=len(self.words))
        return total / np.maximum(count, 1), float(gain.mean())


def align_recognised_words(
    hmm: UnitHmm, values: NDArray[np.float32], loud: NDArray[np.bool_], words: Sequence[str], lexicon: Lexicon
) -> AlignedWords | None:
    """Return words aligned with a stretch, as a transcript is; None: there is not room for them all.

    values : log likelihoods of the stretch [shape=(N, G)]
    loud   : frames that are too loud for silence [shape=(N,)]
    """
    log_likelihoods = penalise(hmm, wrap_log_likelihoods(values), loud, silent=True)
    modelled = [unit for unit in hmm.table.units if not is_silent(unit)]
    variants = {word: lexicon.pronunciations(word) for word in set(words)}
    units = {
        word: [tuple(find_similar_phone(phone, modelled) for phone in variant) for variant in of_word]
        for word, of_word in variants.items()
    }
    try:
        placed = place_words(hmm, log_likelihoods, [units[word] for word in words], PAUSE)
        spoken = [item.spoken for item in placed]
        sequence = [unit for item in spoken for unit in item.units]
        states, path = align_states(hmm, log_likelihoods, sequence)
    except AlignmentError:
        return None
    phones = [(phone, item.word) for item in spoken for phone in (
        variants[words[item.word]][item.variant] if item.word >= 0 else item.units)]  # fmt: skip
    bounds = np.searchsorted(states.positions[path], np.arange(len(sequence) + 1)).astype(np.intp)
    names, of_word = tuple(phone for phone, _ in phones), np.array([word for _, word in phones], np.intp)
    return AlignedWords(tuple(words), names, of_word, bounds, states.densities[path])


def weigh_densities(hmm: UnitHmm, present: NDArray[np.float32], bonus: float, reach: int) -> NDArray[np.float32]:
    """Return what is added to the log densities of a stretch, so that phones become more probable [shape=(N, G)].

    present : how far each of ``FORMS`` is said in each frame, 0 to 1 [shape=(N, F)]
    bonus   : in nats, where it is 1
    reach   : frames before and after it, over which the bonus falls linearly
    """
    share = present.copy()
    for shift in range(1, min(reach, len(present) - 1) + 1):
        part = np.float32(1 - shift / (reach + 1)) * present
        np.maximum(share[shift:], part[:-shift], out=share[shift:])
        np.maximum(share[:-shift], part[shift:], out=share[:-shift])
    columns = [FORMS.index(find_form(name)) for name in hmm.table.names]
    return np.float32(bonus) * share[:, columns]


def find_form(name: str) -> str:
    """Return the general form of the phone of a density."""
    phone = name.partition(".")[0]
    return COMPARED_FORMS.get(phone, phone)


FORMS = tuple(sorted({find_form(phone) for phone in PHONES}))  # the phones that are compared


LabelT = TypeVar("LabelT")

CONFIDENCES = (0.25, 0.4)
"""Words confirm nothing at the first confidence, all at the second one. Five seconds of a fluent unseen speaker had
0.40 to 0.67; sentences in noise of 10 and 20 dB, in which words are found that nobody said, 0.00 to 0.28."""
WORD_POSTERIORS, PHONE_POSTERIORS = (0.7, 0.9), (0.5, 0.65)
"""A phone recogniser decides on English words from the first mean posterior on, and is relied on fully from the second
one on; the other two are for phones without words, of any language. Clear unseen speech has 0.77 to 0.98, in
noise of 20 dB 0.70 to 0.95, other languages 0.58 to 0.64."""
RANGE_PERCENTILES = (5, 95)
NOISY_DB = 20.0
"""A recording with a smaller range of levels is noisy: 25 to 34 dB in these pieces, 16 to 19 dB in babble of 10 dB."""
GAP_S = 1e-6  # shorter gaps between phones are of rounding
SLIVER_FRAMES = 3
"""Phones without words of which fewer frames are left beside a word are not made: no phone model is shorter."""


@dataclass(frozen=True)
class RecognisedWord:
    """A word that was recognised, and the probability that it is right, 0 to 1, as measured on other recordings."""

    text: str
    confidence: float


class LabelledFrames(NamedTuple):
    """A phone that begins in a frame."""

    first: int
    phone: str
    word: int = -1  # the number of its word among those that were recognised; -1 where none is known


LabelledStretch = tuple[Stretch, list[LabelledFrames]]  # frames, and the phones in them


@dataclass(frozen=True, eq=False)
class Recognition:
    """The result of a recognition."""

    units: Timeline[Unit]  # phones in time, with their words where words decided
    words: Timeline[RecognisedWord]  # these words in time
    word_s: float  # seconds of speech of which recognised words decided the phones
    phone_s: float  # seconds of speech that was recognised as phones
    similarity: float | None  # the speaker similarity score; None where it was not needed
    posterior: float | None = None  # mean of the phones that a phone recogniser finds, 0 to 1; None: it did not decide

    @property
    def confidence(self) -> float | None:
        """The mean confidence over the time of all words; None without words."""
        seconds = sum(span.duration_s for span in self.words)
        if not seconds:
            return None
        return sum(span.duration_s * span.label.confidence for span in self.words) / seconds

    @property
    def reliability(self) -> float:
        """How far the phones can be relied on, 0 to 1: by their posteriors, or else how far words confirm them.

        Words confirm them by their confidence, and the share of speech that they decided.
        """
        if self.posterior is not None:
            return float(np.interp(self.posterior, WORD_POSTERIORS if self.words else PHONE_POSTERIORS, (0, 1)))
        confirmed = (self.confidence or 0.0) * self.word_s / max(self.word_s + self.phone_s, 1e-9)
        return float(np.clip((confirmed - CONFIDENCES[0]) / (CONFIDENCES[1] - CONFIDENCES[0]), 0, 1))


def measure_level_range(log_energy: NDArray[np.floating[Any]]) -> float:
    """Return the decibels between loud and quiet moments of what is heard in a recording (``RANGE_PERCENTILES``).

    log_energy : natural logarithm of the energy of every frame [shape=(T,)]
    """
    heard = log_energy[log_energy > SILENT_ENERGY + 1]
    if not len(heard):
        return 0.0
    return float(np.ptp(np.percentile(heard, RANGE_PERCENTILES)) * 10 / np.log(10))


def time_phones(labels: Sequence[tuple[str, str]], bounds: NDArray[np.intp], duration_s: float) -> Timeline[Unit]:
    """Return phones in time, each with its word.

    bounds : the first frame of each, and the frame count [shape=(len(labels) + 1,)]; frame n covers (n ± ½) · 10 ms
    Silence at both ends stays silence however short; shorter than ``SHORT_PAUSE_S`` between words, it is a pause.
    """
    silent = [is_silent(phone) for phone, _ in labels]
    first = [i for i in range(len(labels)) if i == 0 or not (silent[i] and silent[i - 1])]
    labels, bounds = [labels[i] for i in first], np.append(bounds[first], bounds[-1])
    edges = np.clip((bounds - 0.5) / FRAME_RATE_HZ, 0, duration_s)
    edges[-1] = duration_s
    spans = []
    for i, ((phone, word), (start_s, end_s)) in enumerate(zip(labels, pairwise(edges.tolist()), strict=True)):
        is_pause = 0 < i < len(labels) - 1 and end_s - start_s < SHORT_PAUSE_S
        name = (PAUSE if is_pause else SILENCE) if is_silent(phone) else phone
        spans.append(Span(start_s, end_s, Unit(name, word=word)))
    return Timeline(tuple(spans))


def build_recognition(
    labels: Sequence[LabelledFrames], words: Sequence[RecognisedWord], audio: AnalysedAudio, similarity: float | None
) -> Recognition:
    """Return a recognition of labels of a recording; ``words`` are those that they number."""
    named = [(label.phone, words[label.word].text if label.word >= 0 else "") for label in labels]
    firsts = [label.first for label in labels]
    units = time_phones(named, np.array([*firsts, audio.frames]), audio.duration_s)
    timed = []
    ends = [*firsts[1:], round(audio.duration_s * FRAME_RATE_HZ)]
    for number, group in groupby(zip(labels, ends, strict=True), key=lambda pair: pair[0].word):
        if number >= 0:
            phones = list(group)
            timed.append(Span(phones[0][0].first / FRAME_RATE_HZ, phones[-1][1] / FRAME_RATE_HZ, words[number]))
    spoken = [span for span in units if not is_silent(span.label.phone)]
    word_s = sum(span.duration_s for span in spoken if span.label.word)
    phone_s = sum(span.duration_s for span in spoken) - word_s
    return Recognition(units, Timeline(tuple(timed)), word_s, phone_s, similarity)


def place_units(units: Timeline[LabelT], first: int, own: slice) -> Timeline[LabelT]:
    """Return labels in time of a passage that lie in its own frames, with times of the recording.

    first, own : as of ``Passage``
    """
    start, stop = max(own.start, first), own.stop
    within = units.between((start - first) / FRAME_RATE_HZ, (stop - first) / FRAME_RATE_HZ)
    return within.shifted(start / FRAME_RATE_HZ)


def join_units(parts: Iterable[Timeline[Unit]], silence: Unit, end_s: float) -> Timeline[Unit]:
    """Return the phones in time of a recording from those of its passages, with silence before, between and after them.

    parts : of each passage, with times of the recording (``place_units``)
    """
    joined: list[Span[Unit]] = []
    for part in [*parts, Timeline((Span(end_s, end_s, silence),))]:
        for number, span in enumerate(part):
            before_s = joined[-1].end_s if joined else 0.0
            gap = [Span(before_s, span.start_s, silence)] if span.start_s - before_s > GAP_S else []
            for each in [*gap, replace(span, end_s=min(span.end_s, end_s))]:
                at_seam = number == 0 or gap  # two silences that somebody has split stay two
                if at_seam and joined and is_silent(each.label.phone) and is_silent(joined[-1].label.phone):
                    joined[-1] = replace(joined[-1], end_s=max(each.end_s, joined[-1].end_s))
                elif each.end_s > each.start_s:
                    joined.append(each)
    if joined:
        joined[-1] = replace(joined[-1], end_s=end_s)
    return Timeline(tuple(joined) or (Span(0.0, end_s, silence),))


def join_recognition(parts: Sequence[tuple[Passage, Recognition]], duration_s: float) -> Recognition:
    """Return the recognition of a recording from those of its passages.

    The phones of each passage are as reliable as they are there; the similarity is that of the longest passage.
    """
    units, words = list[Timeline[Unit]](), list[Span[RecognisedWord]]()
    for (first, own, _), part in parts:
        units.append(place_units(select_reliable(part.units, part.reliability), first, own))
        words += place_units(part.words, first, own)
    speech_s = np.array([part.word_s + part.phone_s for _, part in parts])
    posteriors = np.array([np.nan if part.posterior is None else part.posterior for _, part in parts])
    decided = ~np.isnan(posteriors)
    posterior = float(np.average(posteriors[decided], weights=speech_s[decided] + 1e-9)) if decided.any() else None
    joined, similarity = join_units(units, Unit(SILENCE), duration_s), parts[int(np.argmax(speech_s))][1].similarity
    word_s, phone_s = sum(part.word_s for _, part in parts), sum(part.phone_s for _, part in parts)
    return Recognition(joined, Timeline(tuple(words)), word_s, phone_s, similarity, posterior)


def select_reliable(units: Timeline[Unit], confidence: float) -> Timeline[Unit]:
    """Return phones in time as recognised ones, with a confidence where they have none yet."""

    def rate(span: Span[Unit]) -> Span[Unit]:
        unrated = span.label.confidence is None
        return replace(span, label=replace(span.label, confidence=confidence)) if unrated else span

    return Timeline(tuple(map(rate, units)))


def label_words(
    aligned: AlignedWords, stretch: Stretch, believed: NDArray[np.bool_], first_word: int
) -> Iterator[LabelledStretch]:
    """Yield the labels of each run of words that are believed, with the frames that they take.

    believed   : of every word [shape=(W,)]
    Silence and pauses belong to a run if both words beside them do, or if all words are believed.
    """
    spoken, everything = aligned.of_word >= 0, bool(believed.all())
    takes = np.array([believed[word] if word >= 0 else everything for word in aligned.of_word])
    for place in np.flatnonzero(~spoken[1:-1]) + 1:
        takes[place] = takes[place - 1] and takes[place + 1]
    for taken, group in groupby(range(len(takes)), key=lambda place: bool(takes[place])):
        places = list(group)
        if taken:
            firsts = [stretch.first + int(first) for first in aligned.bounds[places[0] : places[-1] + 2]]
            words = [first_word + int(aligned.of_word[place]) if spoken[place] else -1 for place in places]
            phones = (aligned.phones[place] for place in places)
            yield Stretch(firsts[0], firsts[-1]), list(map(LabelledFrames, firsts[:-1], phones, words))


def splice(base: Sequence[LabelledFrames], parts: Sequence[LabelledStretch], frames: int) -> list[LabelledFrames]:
    """Return labels in which some stretches are replaced.

    parts  : stretches in order, without overlap, and their labels
    What is left of a phone of ``base`` beside a part is dropped if it is a sliver; the label before it goes on.
    """
    result: list[LabelledFrames] = []
    starts = np.array([label.first for label in base])
    ends = np.append(starts[1:], frames)
    at = 0
    for stretch, labels in [*parts, (Stretch(frames, frames), [])]:
        last = int(np.searchsorted(starts, stretch.first))
        for place in range(max(0, int(np.searchsorted(ends, at, "right"))), last):
            first, end = max(at, int(starts[place])), min(stretch.first, int(ends[place]))
            complete = first == starts[place] and end == ends[place]
            if complete or end - first >= SLIVER_FRAMES or (first < end and not result):
                result.append(base[place]._replace(first=first))
        result.extend(labels)
        at = stretch.end
    return result
