"""English articulation: its table, the range of a speaker, and motion for voices that training does not know."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.closure import OPENING, REACH_S, find_closable_ranges
from lipmotion.motion.frame_labels import mark_distant, with_neighbours
from lipmotion.motion.space import MotionSpace
from lipmotion.stats.curves import with_dynamics
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import EYE_DISTANCE, FRAME_RATE_HZ, Example, Span, Timeline, Unit, frames_of
from lipmotion.units import PHONES, SILENCE, VOWELS, describe_unknown_phone, find_similar_phone, is_silent


def count_unseen(voice: float) -> float:
    """Return how far the measures for unknown voices apply, 0 to 1; more than half for voices half known."""
    return float(np.sqrt(1 - voice))


Array = NDArray[np.float64]
Context = tuple[str, str, str]  # the phone before, the phone, and the phone after
Statistics = tuple[Array, Array]
"""Means and precisions of successive frames [each shape=(T, 3, Q)], or values and variances [each shape=(T, Q)]."""
Predict = Callable[[slice], Statistics]
TABLE = ("lipmotion.motion", "articulation.csv")
ARTICULATORS = ("opening", "width", "outer", "jaw", "upper_lip", "lower_lip", "protrusion", "inner_width")
"""The columns of the table (docs/articulation.md)."""
TYPICAL_DEVIATIONS = (0.054, 0.051, 0.055, 0.047, 0.023, 0.032, 0.009, 0.041)
"""Standard deviations of talkers in fluent speech, eye distances. The range of a speaker is taken to be the geometric
mean of these and of his own: few words, as GRID's, do not show how far a mouth can go."""
THIRDS = ("begin", "middle", "end")
SMOOTHING_S = 0.048
"""Standard deviation of the Gaussian that joins the thirds of successive phones: 1.2 pictures at 25 Hz."""
REST_S = 0.5  # silence further than this from speech is not in the table: the mouth rests
GAIN = 2.0
"""The means of the table are made so much larger: a fifth to a third of the words that it was measured on are wrong."""
RIDGE = 1e-2  # ridge parameter of the map from articulators to the motion space, as a share of the number of frames
MIN_DEVIATION = 1e-6
TABLE_WEIGHT = 4.0  # weight of the table beside the means of states, in a context that training never saw
TABLE_WEIGHT_WITH_PREDICTOR = 1.0  # the same where a predictor that asks for no context stands beside the states
KNOWN_VOICE_SHARE = 0.3
"""Share of that weight for a voice that training knows: of its speaker the predictor knows more than the table."""
POWER = 3
"""The weight of the table grows with this power of the reliability, for wrong phones make contexts unknown, and of how
unknown a context is: it is an eighth where training saw the context once, a 27th where twice."""
HALF_FAMILIAR_COUNT = 1.0  # occurrences in training after which a context counts as half familiar


@dataclass(frozen=True, eq=False)
class ArticulationPrior:
    """The table of articulations in the range of one speaker, for phones in contexts that training saw little of."""

    centre: Array  # the pose of which the table gives deviations: the median in speech [shape=(Q,)]
    matrix: Array  # change of the motion space with each articulator, per deviation of the speaker [shape=(8, Q)]
    contexts: Mapping[Context, int]  # occurrences in training of each phone between its neighbours
    weight: float = TABLE_WEIGHT  # beside a model's own means, in a context that training never saw
    known_voice_share: float = 1.0  # share of that weight for a voice that training knows

    def familiarity(self, units: Timeline[Unit], frames: int) -> Array:
        """Return how well training knows each phone between its neighbours, and rest, 0 to 1 [shape=(frames,)]."""
        steps = np.ones((frames, 1))
        for context, span in _list_contexts(units):
            at_end = is_silent(span.label.phone) and span in (units[0], units[-1])
            if not at_end:
                count = self.contexts.get(context, 0)
                first, stop = frames_of(span, frames)
                steps[first:stop] = count / (count + HALF_FAMILIAR_COUNT)
        steps[mark_distant(units, frames, REST_S)] = 1
        return smooth_steps(steps)[:, 0]

    def blend(
        self, statistics: Predict, units: Timeline[Unit], frames: int, reliability: Array | float, voice: float = 1.0
    ) -> Predict:
        """Return means and precisions of ranges of frames, drawn towards the table where training saw little.

        statistics  : returns those of a model
        reliability : of the phones in time, 0 to 1 [shape=(frames,)]
        voice       : how well training knows the voice, 0 to 1
        Precisions stay those of the model.
        """
        values = self.centre + GAIN * trace_articulators(units, frames) @ self.matrix
        unknown = 1 - self.familiarity(units, frames)
        of_voice = self.known_voice_share + count_unseen(voice) * (1 - self.known_voice_share)
        weight = of_voice * self.weight * (np.asarray(reliability) * unknown) ** POWER
        share = (weight / (1 + weight))[:, None, None]
        return draw_towards(values, share, statistics)


def draw_towards(values: Array, share: Array, statistics: Predict) -> Predict:
    """Return a function that draws the means of ``statistics`` towards values [shape=(T, Q)], by a share of frames."""

    def predict(chosen: slice) -> Statistics:
        means, precisions = statistics(chosen)
        return means + share[chosen] * (slice_dynamics(values, chosen) - means), precisions

    return predict


def slice_dynamics(values: Array, frames: slice) -> Array:
    """Return static value, Δ and Δ² [shape=(N, 3, Q)] of N frames of the values of a recording [shape=(T, Q)]."""
    start, stop, _ = frames.indices(len(values))
    first = max(start - 1, 0)
    return with_dynamics(values[first : stop + 1])[start - first :][: stop - start]


def trace_articulators(units: Timeline[Unit], frames: int) -> Array:
    """Return the articulators of phones in time, in standard deviations of a speaker [shape=(frames, 8)].

    Every third of a phone has the means of the table; a Gaussian joins them. A phone without a row of its own has that
    of the most similar phone with one.
    Raises InputError: an unknown phone.
    """
    table, steps = read_articulation_table(), np.zeros((frames, len(ARTICULATORS)))
    for span in units:
        phone, (first, stop) = span.label.phone, frames_of(span, frames)
        if phone and phone not in PHONES:
            raise InputError(describe_unknown_phone(phone, f" at {span.start_s} s"))
        if first < stop and phone:
            row = table[phone if phone in table else find_similar_phone(phone, list(table))]
            time_s = np.arange(first, stop) / FRAME_RATE_HZ
            third = (time_s - span.start_s) / max(span.duration_s, 1e-9) * len(THIRDS)
            steps[first:stop] = row[np.clip(third.astype(int), 0, len(THIRDS) - 1)]
    return smooth_steps(steps)


def smooth_steps(steps: Array) -> Array:
    """Return values in frames [shape=(T, C)] smoothed by a Gaussian of ``SMOOTHING_S``; the ends are repeated."""
    deviation = SMOOTHING_S * FRAME_RATE_HZ
    return scipy.ndimage.gaussian_filter1d(steps, deviation, axis=0, mode="nearest", radius=int(np.ceil(4 * deviation)))


@cache
def compare_vowels() -> Array:
    """Return how articulators change from the mean consonant to the mean vowel, per change of the opening [shape=(8,)].

    Source: Lindblom 1963 (vowel reduction): the shorter a vowel, the more it misses its target.
    """
    table = read_articulation_table()
    counts = {row["phone"]: float(row["count"]) for row in read_shipped_table(*TABLE)}
    kinds = ([each for each in table if not is_silent(each) and (each in VOWELS) == vowel] for vowel in (False, True))
    consonants, vowels = (
        np.average([table[phone] for phone in phones], axis=0, weights=[counts[phone] for phone in phones])
        for phones in kinds
    )
    more_open: Array = (vowels - consonants).mean(axis=0)
    return more_open / more_open[ARTICULATORS.index(OPENING)]


@cache
def read_articulation_table() -> dict[str, Array]:
    """Return the mean of every articulator in each third of every phone [each shape=(3, 8)]."""
    return {
        row["phone"]: np.array([[float(row[f"{name}_{third}"]) for name in ARTICULATORS] for third in THIRDS])
        for row in read_shipped_table(*TABLE)
    }


def fit_articulation_prior(
    space: MotionSpace, values: Sequence[Array], examples: Sequence[Example]
) -> ArticulationPrior | None:
    """Return the table in the range of the speaker of some examples; None where no channel is called ``opening``.

    values : motion of each example in the motion space [each shape=(T, Q)]
    Channels that the table has are taken from it. The other dimensions follow by a regression on the articulators that
    can be measured on the examples.
    """
    if OPENING not in space.direct_names:
        return None
    pairs = zip(values, examples, strict=True)
    poses = np.concatenate([x[each.valid & ~mark_distant(each.speech.units, len(x), 0.0)] for x, each in pairs])
    if not len(poses):
        return None
    measured = measure_articulators(space.restore(poses), [channel.name for channel in space.channels])
    known = [number for number, name in enumerate(ARTICULATORS) if name in measured]
    columns = np.stack([measured[ARTICULATORS[number]] for number in known], axis=1)
    deviations = speaker = np.maximum(columns.std(axis=0), MIN_DEVIATION)
    standard = (columns - columns.mean(axis=0)) / speaker
    if space.channels[space.direct[space.direct_names.index(OPENING)]].unit == EYE_DISTANCE:
        deviations = np.sqrt(speaker * [TYPICAL_DEVIATIONS[number] for number in known])
    products = standard.T @ standard + RIDGE * len(poses) * np.eye(len(known))
    matrix = np.zeros((len(ARTICULATORS), poses.shape[1]))
    slopes = np.linalg.solve(products, standard.T @ (poses - poses.mean(axis=0)))
    matrix[known] = slopes * (deviations / speaker)[:, None]
    for column, name in enumerate(space.direct_names):
        if name in ARTICULATORS:
            matrix[:, column] = 0
            row = ARTICULATORS.index(name)
            matrix[row, column] = deviations[known.index(row)]
    contexts = Counter(context for example in examples for context, _ in _list_contexts(example.speech.units))
    return ArticulationPrior(np.median(poses, axis=0), matrix, dict(sorted(contexts.items())))


def articulation_to_arrays(prior: ArticulationPrior | None) -> dict[str, NDArray[Any]]:
    """Serialise a prior."""
    if prior is None:
        return {}
    return {
        "articulation_centre": prior.centre,
        "articulation_matrix": prior.matrix,
        "contexts": np.array(list(prior.contexts)),
        "context_counts": np.array(list(prior.contexts.values()), np.int32),
    }


def articulation_from_arrays(arrays: Arrays, dimensions: int) -> ArticulationPrior | None:
    """Deserialise a prior in Q dimensions; None: an earlier version. Raises KeyError, ValueError: damaged arrays."""
    if arrays.keys().isdisjoint(ARTICULATION):
        return None
    stored = check_arrays(arrays, ARTICULATION, Q=dimensions)
    pairs = zip(stored["contexts"].tolist(), stored["context_counts"].tolist(), strict=True)
    contexts = {(left, phone, right): count for (left, phone, right), count in pairs}
    return ArticulationPrior(stored["articulation_centre"], stored["articulation_matrix"], contexts)


ARTICULATION = {
    "articulation_centre": ArraySpec(np.float64, "Q", -1e6, 1e6),
    "articulation_matrix": ArraySpec(np.float64, f"{len(ARTICULATORS)} Q", -1e6, 1e6),
    "contexts": ArraySpec(np.str_, "N 3"),
    "context_counts": ArraySpec(np.int32, "N", 1, 1e9),
}


def _list_contexts(units: Timeline[Unit]) -> Iterator[tuple[Context, Span[Unit]]]:
    """Yield each known phone between its neighbours; pauses count as silence."""
    for before, span, after in with_neighbours(units):
        if span.label.phone:
            phones = (before, span.label.phone, after)
            left, phone, right = (SILENCE if is_silent(each) else each for each in phones)
            yield (left, phone, right), span


def measure_articulators(motion: NDArray[np.floating[Any]], names: Sequence[str]) -> dict[str, Array]:
    """Return the articulators that motion of named channels [shape=(N, P)] shows, by name [each shape=(N,)].

    Points: y is up, z out of the face, the nose does not move.
    """
    of = {name: np.asarray(curve, float) for name, curve in zip(names, np.asarray(motion).T, strict=True)}
    measured = {name: of[name] for name in ARTICULATORS[:3] if name in of}
    measured |= {name: -of[point] for name, point in (("jaw", "y_152"), ("upper_lip", "y_13")) if point in of}
    if {"y_14", "y_152"} <= of.keys():
        measured["lower_lip"] = of["y_14"] - of["y_152"]
    if {"z_13", "z_14", "z_61", "z_291"} <= of.keys():
        measured["protrusion"] = (of["z_13"] + of["z_14"] - of["z_61"] - of["z_291"]) / 2
    if {"x_78", "x_308"} <= of.keys():
        measured["inner_width"] = np.abs(of["x_78"] - of["x_308"])
    return measured


SOUND_SHARES = (0.65, 0.35)
"""Share of the motion that the general network hears, after all that is done for such a voice, where training knows
nothing of it: where phones cannot be relied on at all, and where they can (docs/results/voices.md)."""
NEAR_S, CLEAR_DB = 0.2, (25.0, 30.0)
"""Seconds before and after speech in which that holds. Further away it holds as far as there are so many decibels
between loud and quiet moments: else others may be speaking in pauses, as in a babble of 10 dB (18 to 26)."""
CONFIRMED = -0.5
"""An unreliable p, b or m closes the lips where the general network hears them less open than so many deviations."""
VOWEL_S, OPENING_BY_DURATION = 0.1, 0.5
"""A vowel of the first duration is as open as the table says; one that is e times as long is more open by so many
standard deviations of the speaker, and a shorter one less (docs/results/voices.md)."""
CONSONANT_CLOSING = 0.25
"""Consonants are less open than the table says, by so many deviations: some phones of its recordings were wrong."""
BREATH_S = 0.6
"""So long before the first phone such a mouth is as open as in speech: people part their lips and breathe in."""
BREATH_RISE, LIP_CLOSING_S, SHUT = 0.2, 0.12, -1.5
"""Then it is more open by so many deviations; p, b or m shuts lips so long before it is heard (s1: 0.13 s), so far."""
SURE_PHONES = 5000
"""Models of so many phones in training, some twelve minutes, know their own speaker; those of 50 sentences take his
voice for 0.85 of a known one (docs/results/jerk.md), no more than the large model other speakers of that studio."""
INSET_S = 0.03
"""The lips of such a voice close in p, b and m further than this from both ends of the phone, or in its middle, so that
short vowels beside it stay open."""
RETAINED = (1.0, 0.85)
"""Standard deviation of what is generated for voices that training does not know, as a share of that of its speaker:
where phones cannot be relied on at all, and where they can. The general network moves a mouth as far as people do."""


@dataclass(frozen=True, eq=False)
class UnseenSpeaker:
    """What is changed in the motion of a voice that training does not know; precisions stay those of the model.

    Every method takes and returns a function that returns means and precisions of a range of frames.
    """

    prior: ArticulationPrior  # the table of articulation
    units: Timeline[Unit]  # phones in time, in T frames
    frames: int
    reliability: Array | float  # of the phones in time, 0 to 1 [shape=(T,)]
    voice: float  # how well training knows the voice, 0 to 1; at 1 its motion stays
    range_db: Array | float = 0.0  # between loud and quiet moments, 0 in digital silence [shape=(T,)]

    def follow_sound(self, statistics: Predict, articulators: Array) -> Predict:
        """Draw motion, but in loud pauses, towards articulators that the general network hears [shape=(T, 8)]."""
        spoken = smooth_steps((~mark_distant(self.units, self.frames, NEAR_S)[:, None]).astype(float))
        quiet = smooth_steps(np.broadcast_to(np.interp(self.range_db, CLEAR_DB, (0, 1)), self.frames)[:, None])
        unsure, sure = SOUND_SHARES
        reliability = np.broadcast_to(self.reliability, self.frames)[:, None, None]
        share = (1 - self.voice) * (unsure + reliability * (sure - unsure))
        share = share * (spoken + quiet * (1 - spoken))[:, :, None]
        return draw_towards(self.prior.centre + articulators @ self.prior.matrix, share, statistics)

    def slow_width(self, statistics: Predict, column: int) -> Predict:
        """Smooth the width, in a column, and what goes with it, but where lips are round: people differ in it."""
        along = self.prior.matrix[1] / self.prior.matrix[1, column]
        sure = min(sum(self.prior.contexts.values()) / SURE_PHONES, 1)
        traced = trace_articulators(self.units, self.frames)[:, 1:2]
        share = count_unseen(self.voice) * sure * np.clip(1 + GAIN * traced, 0, 1)

        def predict(chosen: slice) -> Statistics:
            means, precisions = statistics(chosen)
            change = share[chosen] * (smooth_steps(means[:, :, column]) - means[:, :, column])
            return means + change[:, :, None] * along, precisions

        return predict

    def confirm_closures(self, ranges: Sequence[slice], articulators: Array) -> list[slice]:
        """Return the ranges of p, b, m that are reliable, or that heard articulators confirm [shape=(T, 8)]."""
        reliability, opening = np.broadcast_to(self.reliability, self.frames), articulators[:, 0]
        return [r for r in ranges if reliability[r].mean() > 0.5 or opening[r].min() < CONFIRMED]

    def raise_contrast(self, statistics: Predict) -> Predict:
        """Open consonants less, and vowels by their duration; all articulators move as from consonants to vowels."""
        wider = np.zeros((self.frames, 1))
        for span in self.units:
            inside, phone = slice(*frames_of(span, self.frames)), span.label.phone
            if phone in VOWELS:
                wider[inside] = OPENING_BY_DURATION * np.log(max(span.duration_s, 1 / FRAME_RATE_HZ) / VOWEL_S)
            elif phone and not is_silent(phone):
                wider[inside] = -CONSONANT_CLOSING
        gain = count_unseen(self.voice) * np.broadcast_to(self.reliability, self.frames)[:, None]
        change = gain * smooth_steps(wider) * compare_vowels() @ self.prior.matrix

        def predict(chosen: slice) -> Statistics:
            means, precisions = statistics(chosen)
            return means + slice_dynamics(change, chosen), precisions

        return predict

    def open_before_speech(self, statistics: Predict) -> Predict:
        """Open the mouth before speech begins, more and more; before p, b or m the lips close again.

        All else is drawn towards its median in speech. A model of few phones half knows its own speaker's voice, too.
        Source: Scobbie, Schaeffler & Mennen 2011 (lips part and breath is taken before the first sound).
        """
        first = next((span for span in self.units if not is_silent(span.label.phone)), Span(0.0, 1.0, Unit(SILENCE)))
        time_s = np.arange(self.frames) / FRAME_RATE_HZ - first.start_s
        before = ((time_s >= -BREATH_S) & (time_s < 0))[:, None].astype(float)
        wider = BREATH_RISE * np.clip(1 + time_s / BREATH_S, 0, 1)
        if find_closable_ranges(Timeline((first,)), self.frames):
            wider[time_s >= -LIP_CLOSING_S] = SHUT
        pose = self.prior.centre + smooth_steps(wider[:, None]) * self.prior.matrix[[0, 2]].sum(axis=0)
        sure = min(sum(self.prior.contexts.values()) / SURE_PHONES, 1)
        strange = max(2 * np.sqrt(self.voice), 1.0) * count_unseen(self.voice) * sure
        share = strange * np.broadcast_to(self.reliability, self.frames)[:, None] * smooth_steps(before)
        return draw_towards(pose, share[:, :, None], statistics)


def choose_closing_reach(voice: float) -> float:
    """Return how many seconds around a p, b or m lips may close; negative: within; voice: how well known, 0 to 1."""
    return REACH_S - count_unseen(voice) * (REACH_S + INSET_S)


def widen_range(prior: ArticulationPrior, space: MotionSpace, voice: float, reliability: float) -> float:
    """Return the factor by which movements reach the range of typical talkers, at least 1.

    prior       : the table of articulation, which knows the range of the model's speaker
    space       : of the motion; the factor is 1 where its opening is not in eye distances
    voice       : how well training knows the voice, 0 to 1; at 1 the range is that of the speaker, and the factor 1
    reliability : of the phones, 0 to 1, on average
    """
    column, row = space.direct_names.index(OPENING), ARTICULATORS.index(OPENING)
    if space.channels[space.direct[column]].unit != EYE_DISTANCE:
        return 1.0
    typical = TYPICAL_DEVIATIONS[row]
    generated = prior.matrix[row, column] ** 2 / typical * float(np.interp(reliability, (0, 1), RETAINED))
    return float(max(typical / generated, 1.0) ** (1 - voice))
