"""Several people in one model: maps between the motion of each person and that of the mean person.

Engines learn and generate the motion of the mean person; the maps are outside of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.closure import OPENING, estimate_closed_opening, find_closable_ranges
from lipmotion.motion.frame_labels import list_speech_intervals, mark_distant
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import FRAME_RATE_HZ, Channel, Example, Motion, Timeline, Unit
from lipmotion.units import VISEME_OF, VISEMES

NEAR_SPEECH_S, FAR_FROM_SPEECH_S = 0.1, 0.48
"""Within the first distance of speech the map is that of speech, beyond the second the rest pose is exactly the
person's; the second is the one beyond which engines generate the rest pose."""
RANGE_PERCENTILES = (5.0, 95.0)  # the range of a channel lies between these percentiles of the frames of speech
RANGE_PRIOR_S = 2.0  # seconds of speech that count as much as the assumption that a person's range is the mean person's
MIN_GAIN, MAX_GAIN = 0.25, 4.0
"""Ranges of people differ by no more; beyond, they are differences of trackers or of units."""
MIN_FRAMES = 10  # fewest frames of silence from which a rest pose is taken
MIN_RANGE_SHARE = 0.05
"""A channel that somebody moves by less than this share of the widest range has a gain of 1 for everyone."""
VISEME_NAMES = tuple(VISEMES)  # the order of the visemes in stored habits
FADE_FRAMES = 11
HABIT_PRIOR_FRAMES = 50.0  # frames of a viseme that count as much as the assumption that a person has no habit in it
FULL_HABIT_SHARE = 0.25  # share of the mean range by which lips must be open for habits to show wholly
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpeakerMap:
    """The map from the mean person's motion to one person's: ``offset + gain · motion``, and ``rest`` in silence.

    channels : the P channels
    gain     : the person's range as a multiple of the mean person's [shape=(P,)]
    offset   : in the units of the channels [shape=(P,)]
    rest     : what is added in silence away from speech, so that rest pose maps onto rest pose [shape=(P,)]
    habits   : how the mean person's poses in each of the V visemes are changed before they are mapped [shape=(V, P)]
    lips     : openings of the mean person's lips up to which habits do not show, and from which on they do wholly
    """

    channels: tuple[Channel, ...]
    gain: Array
    offset: Array
    rest: Array
    habits: Array
    lips: tuple[float, float]

    def shift(self, values: NDArray[np.floating[Any]], visemes: Array) -> Array:
        """Return by how much the mean person's poses are changed by this person's habits [shape=(T, P)].

        values  : all channels of the mean person [shape=(T, P)]
        visemes : from ``weigh_visemes`` [shape=(T, V)]
        Lips that are closed stay closed.
        """
        change: Array = visemes @ self.habits
        column = next((n for n, channel in enumerate(self.channels) if channel.name == OPENING), None)
        if column is not None:
            closed, opened = self.lips
            change *= np.clip((values[:, column : column + 1] - closed) / max(opened - closed, 1e-6), 0, 1)
        return change

    def to_person(self, values: NDArray[np.floating[Any]], restful: Array) -> Array:
        """Return this person's motion of the mean person's [shape=(T, P)]; restful : as measured [shape=(T,)]."""
        return self.offset + self.gain * values + restful[:, None] * self.rest

    def to_mean(self, values: NDArray[np.floating[Any]], restful: Array) -> Array:
        """Return the motion of the mean person, of this person's; the inverse of ``to_person``."""
        return (values - self.offset - restful[:, None] * self.rest) / self.gain

    def reorder(self, channels: Sequence[Channel]) -> SpeakerMap:
        """Return the map of some channels, in this order. Raises InputError: a channel without a map."""
        if tuple(channels) == self.channels:
            return self
        missing = [channel.name for channel in channels if channel not in self.channels]
        if missing:
            raise InputError(f"no map of speakers for the channel {missing[0]!r}; train the model again")
        columns = [self.channels.index(channel) for channel in channels]
        parts = (self.gain[columns], self.offset[columns], self.rest[columns], self.habits[:, columns])
        return SpeakerMap(tuple(channels), *parts, self.lips)


@dataclass(frozen=True, eq=False)
class SpeakerMaps:
    """The maps of all S people of a model.

    channels : the P channels
    names    : of the S people
    gain, offset, rest : as in ``SpeakerMap``, of each [each shape=(S, P)]
    habits   : as in ``SpeakerMap``, of each, in the order of ``VISEME_NAMES`` [shape=(S, V, P)]
    lips     : as in ``SpeakerMap``, the same for all
    """

    channels: tuple[Channel, ...]
    names: tuple[str, ...]
    gain: Array
    offset: Array
    rest: Array
    habits: Array
    lips: tuple[float, float]

    def of(self, name: str) -> SpeakerMap:
        """Return the map of one person. Raises InputError: a person of another name."""
        if name not in self.names:
            raise InputError(
                f"the model knows no speaker {name!r}, only: {', '.join(self.names)}; give one of these, or none for "
                "the mean person"
            )
        number = self.names.index(name)
        parts = (self.gain[number], self.offset[number], self.rest[number], self.habits[number])
        return SpeakerMap(self.channels, *parts, self.lips)

    def select(self, names: Sequence[str]) -> SpeakerMaps:
        """Return the maps of some people."""
        rows = [self.names.index(name) for name in names]
        parts = (self.gain[rows], self.offset[rows], self.rest[rows], self.habits[rows])
        return SpeakerMaps(self.channels, tuple(names), *parts, self.lips)


def measure_restfulness(units: Timeline[Unit], frames: int) -> Array:
    """Return how far into silence each frame at 100 Hz lies, from 0 near speech to 1 away from it [shape=(frames,)]."""
    time_s = np.arange(frames) / FRAME_RATE_HZ
    speech_s = np.array(list_speech_intervals(units)).reshape(-1, 2)
    starts_s, ends_s = np.append(speech_s[:, 0], np.inf), np.append(-np.inf, speech_s[:, 1])
    following = np.searchsorted(speech_s[:, 0], time_s, side="right")  # the first interval that begins after a time
    distance_s = np.maximum(np.minimum(starts_s[following] - time_s, time_s - ends_s[following]), 0)
    share = np.clip((distance_s - NEAR_SPEECH_S) / (FAR_FROM_SPEECH_S - NEAR_SPEECH_S), 0, 1)
    return share * share * (3 - 2 * share)


def weigh_visemes(units: Timeline[Unit], frames: int) -> Array:
    """Return the weights of visemes in frames at 100 Hz [shape=(frames, V)]; 0 far from speech and for no phone."""
    from scipy.ndimage import convolve1d

    weights = np.zeros((frames, len(VISEME_NAMES)))
    for span in units:
        if span.label.phone in VISEME_OF:
            first, stop = (round(time_s * FRAME_RATE_HZ) for time_s in (span.start_s, span.end_s))
            weights[max(first, 0) : max(stop, 0), VISEME_NAMES.index(VISEME_OF[span.label.phone])] = 1
    if frames:
        window = np.hanning(FADE_FRAMES + 2)[1:-1]
        weights = convolve1d(weights, window / window.sum(), axis=0, mode="nearest")
    return weights * (1 - measure_restfulness(units, frames))[:, None]


def add_habits(
    maps: SpeakerMaps, examples: Sequence[Example], speakers: Sequence[str], generated: Iterable[NDArray[Any]]
) -> SpeakerMaps:
    """Return maps with the habits of each person: what is left of their motion in each viseme, on average.

    examples  : from ``map_to_mean_person``
    speakers  : the name of each example's speaker
    generated : the mean person's motion of each, as the engine generates it [each shape=(T, P)]
    Averages are drawn towards 0 with the weight of ``HABIT_PRIOR_FRAMES``.
    """
    sums = np.zeros(maps.habits.shape)
    counts = np.full(maps.habits.shape[:2], HABIT_PRIOR_FRAMES)
    for example, speaker, values in zip(examples, speakers, generated, strict=True):
        if speaker in maps.names:
            weights = weigh_visemes(example.speech.units, len(values)) * example.valid[:, None]
            number = maps.names.index(speaker)
            sums[number] += weights.T @ np.where(example.valid[:, None], example.motion.values - values, 0)
            counts[number] += weights.sum(axis=0)
    return replace(maps, habits=sums / counts[:, :, None])


def map_to_mean_person(examples: Sequence[Example], speakers: Sequence[str]) -> tuple[list[Example], SpeakerMaps]:
    """Return examples with the motion of the mean person, and the maps of all people who have a name.

    examples : with the same channels
    speakers : the name of each example's speaker; examples without a name are of one person more
    The mean person's poses are the means of all people's, its ranges their geometric means; whoever says more counts
    no more. Closed lips map onto closed lips and, in silence, rest pose onto rest pose. Ranges of people who say little
    are drawn towards the mean person's. Points share one gain for each axis, so that faces keep their shape.
    """
    names = tuple(sorted(set(speakers)))
    channels, motion_names = examples[0].motion.channels, examples[0].motion.names
    column = motion_names.index(OPENING) if OPENING in motion_names else None
    groups = [[e for e, speaker in zip(examples, speakers, strict=True) if speaker == name] for name in names]
    people = [measure_person(group, column) for group in groups]
    rests, follow = estimate_rest_poses(people), np.mean([person.follow for person in people], axis=0)
    closed = np.array([person.closed for person in people])
    parted = rests[:, column] - closed if column is not None else np.zeros(len(people))
    anchors = rests - parted[:, None] * follow  # the rest poses, but with lips that touch
    gain = estimate_gains(people, channels)
    offset = anchors - gain * anchors.mean(axis=0)
    rest = rests - offset - gain * rests.mean(axis=0)
    shut = float(closed.mean())
    wide = float(np.mean([person.range[column] for person in people])) if column is not None else 0.0
    habits = np.zeros((len(names), len(VISEME_NAMES), len(channels)))
    maps = SpeakerMaps(channels, names, gain, offset, rest, habits, (shut, shut + FULL_HABIT_SHARE * wide))
    mapped = []
    for example, speaker in zip(examples, speakers, strict=True):
        motion = example.motion
        restful = measure_restfulness(example.speech.units, len(motion.values))
        values = maps.of(speaker).to_mean(motion.values, restful)
        mapped.append(replace(example, motion=replace(motion, values=values)))
    return mapped, maps.select([name for name in names if name])


def speakers_to_arrays(maps: SpeakerMaps) -> dict[str, NDArray[Any]]:
    """Serialise maps."""
    channels = np.array([(channel.name, channel.unit) for channel in maps.channels])
    parts = {name: getattr(maps, name) for name in ("gain", "offset", "rest", "habits")}
    return {"channels": channels, "names": np.array(maps.names), **parts, "lips": np.array(maps.lips)}


def speakers_from_arrays(arrays: Arrays) -> SpeakerMaps:
    """Deserialise maps. Raises ModelFormatError: an array is missing, unknown, or has a wrong shape, type or range."""
    with format_errors("the table of speakers"):
        refuse_undeclared(arrays, SPEAKERS)
        stored = check_arrays(arrays, SPEAKERS, V=len(VISEME_NAMES))
        channels = tuple(Channel(name, unit) for name, unit in stored["channels"].tolist())
        names = tuple(stored["names"].tolist())
        if len({channel.name for channel in channels}) < len(channels) or len({*names} - {""}) < len(names):
            raise ValueError("names of speakers or channels that are empty or repeat")
        closed, opened = stored["lips"].tolist()
        parts = (stored["gain"], stored["offset"], stored["rest"], stored["habits"])
        return SpeakerMaps(channels, names, *parts, (closed, opened))


@dataclass(frozen=True, eq=False)
class PersonStatistics:
    """Statistics of one person's motion.

    rest     : rest pose, NaN where there is no silence [shape=(P,)]
    rest_s   : seconds of silence away from speech
    spoken   : median pose in speech [shape=(P,)]
    range    : of each channel in speech [shape=(P,)]
    follow   : change of each channel per unit of opening [shape=(P,)]; zeros without a channel of that name
    closed   : opening of closed lips; 0 without a channel of that name
    speech_s : seconds of speech
    """

    rest: Array
    rest_s: float
    spoken: Array
    range: Array
    follow: Array
    closed: float
    speech_s: float


def measure_person(examples: Sequence[Example], column: int | None) -> PersonStatistics:
    """Return the statistics of one person's motion; column : of the opening (None: there is no such channel)."""
    silent, silence, spoken, measured, smallest = [], [], [], [], []
    for example in examples:
        values, valid, units = np.asarray(example.motion.values, float), example.valid, example.speech.units
        silent.append(values[valid & mark_distant(units, len(values), FAR_FROM_SPEECH_S)])
        silence.append(values[valid & mark_distant(units, len(values), NEAR_SPEECH_S)])
        measured.append(values[valid])
        spoken.append(values[valid & ~mark_distant(units, len(values), 0.0)])
        if column is not None:
            ranges = find_closable_ranges(example.speech.units, len(values))
            smallest += [values[frames, column][valid[frames]].min() for frames in ranges if valid[frames].any()]
    resting, speech = np.concatenate(silent), np.concatenate(spoken)
    quiet = next((each for each in (resting, np.concatenate(silence)) if len(each) >= MIN_FRAMES), None)
    if not len(speech):
        speech = np.concatenate(measured)
    if not len(speech):
        speech = np.zeros((1, examples[0].motion.values.shape[1]))
    low, high = np.percentile(speech, RANGE_PERCENTILES, axis=0)
    follow, closed = np.zeros(speech.shape[1]), 0.0
    if column is not None:
        centred = speech - speech.mean(axis=0)
        follow = centred[:, column] @ centred / max(float(centred[:, column] @ centred[:, column]), 1e-12)
        follow[column] = 1
        closed = estimate_closed_opening(smallest, speech[:, column], np.concatenate(measured)[:, column])
    rest = np.median(quiet, axis=0) if quiet is not None else np.full(speech.shape[1], np.nan)
    seconds = [len(frames) / FRAME_RATE_HZ for frames in (resting, speech)]
    return PersonStatistics(rest, seconds[0], np.median(speech, axis=0), high - low, follow, closed, seconds[1])


def estimate_rest_poses(people: Sequence[PersonStatistics]) -> Array:
    """Return the rest poses of all people [shape=(S, P)]; who is never silent rests as far from speech as others."""
    rests, spoken = np.stack([person.rest for person in people]), np.stack([person.spoken for person in people])
    known: NDArray[np.bool_] = np.asarray(np.isfinite(rests).all(axis=1))
    usual = (rests - spoken)[known].mean(axis=0) if known.any() else np.zeros(rests.shape[1])
    return np.where(known[:, None], rests, spoken + usual)


def estimate_gains(people: Sequence[PersonStatistics], channels: Sequence[Channel], limit: float = MAX_GAIN) -> Array:
    """Return the range of each person as a multiple of the mean person's [shape=(S, P)].

    limit : gains lie between its inverse and itself
    Points share one gain for each axis. Of people who say little, gains are drawn towards 1 (``RANGE_PRIOR_S``).
    """
    ranges = np.stack([person.range for person in people])
    moves = (ranges > MIN_RANGE_SHARE * ranges.max(axis=0)).all(axis=0) & (ranges > 0).all(axis=0)
    ratio = np.ones(ranges.shape)
    usual = np.exp(np.log(ranges[:, moves]).mean(axis=0))
    ratio[:, moves] = ranges[:, moves] / usual
    for axis in ("x_", "y_", "z_"):
        points = moves & np.array([channel.name.startswith(axis) for channel in channels])
        if points.any():
            weights = np.square(np.exp(np.log(ranges[:, points]).mean(axis=0)))
            ratio[:, points] = np.sqrt(np.square(ratio[:, points]) @ weights / weights.sum())[:, None]
    speech_s = np.array([person.speech_s for person in people])
    trust = speech_s / (speech_s + RANGE_PRIOR_S)
    shrunk = np.exp(np.log(ratio) * trust[:, None])
    shrunk /= np.exp(np.log(shrunk).mean(axis=0))  # the geometric mean of all gains is 1
    return np.clip(shrunk, 1 / limit, limit)


SPEAKERS = {
    "channels": ArraySpec(np.str_, "P 2"),
    "names": ArraySpec(np.str_, "S"),
    "gain": ArraySpec(np.float64, "S P", MIN_GAIN, MAX_GAIN),
    "offset": ArraySpec(np.float64, "S P", -1e6, 1e6),
    "rest": ArraySpec(np.float64, "S P", -1e6, 1e6),
    "habits": ArraySpec(np.float64, "S V P", -1e6, 1e6),
    "lips": ArraySpec(np.float64, "2", 0, 1e6),
}
"""Arrays of the maps of S speakers, P channels and V visemes."""


REST_PRIOR_S = 0.5
"""Seconds of silence that count as much as the assumption that the map of speech is right in silence, too."""


def fit_transfer_map(source: Sequence[Example], target: Sequence[Example]) -> SpeakerMap:
    """Return the map from the motion of a source person to that of a target person, fitted in the same speech.

    source : generated motion of the source, for the speech of the target
    target : measured motion of the target; the same channels
    - Closed lips map onto closed lips. The median pose of all other channels in speech maps onto the target's.
    - The range in speech (5th to 95th percentile) maps onto the target's; points share one gain for each axis, so that
      the face keeps the shape of the target. With S seconds of speech the logarithm of a gain counts S / (S + 2), and
      gains lie between 1 / ``MAX_GAIN`` and ``MAX_GAIN``: a short recording gives place and shape alone.
    - In silence away from speech the rest pose maps onto the target's. With S seconds of such silence that counts
      S / (S + 0.5): people rest with closed lips in one pause and with parted lips in the next.
    The map has no habits (``SpeakerMap.habits`` is 0).
    Source of the task: Minnis & Breen 2000, §7. Alternatives that were measured: docs/results/selection.md.
    """
    channels = source[0].motion.channels
    names = [channel.name for channel in channels]
    column = names.index(OPENING) if OPENING in names else None
    people = [measure_person(examples, column) for examples in (source, target)]
    gains, rests = estimate_gains(people, channels, float(np.sqrt(MAX_GAIN))), estimate_rest_poses(people)
    gain = gains[1] / gains[0]
    offset = people[1].spoken - gain * people[0].spoken
    closed = people[0].closed
    if column is not None:
        offset[column] = people[1].closed - gain[column] * closed
    rest = people[1].rest_s / (people[1].rest_s + REST_PRIOR_S) * (rests[1] - offset - gain * rests[0])
    habits = np.zeros((len(VISEME_NAMES), len(channels)))
    return SpeakerMap(channels, gain, offset, rest, habits, (closed, closed + 1))


def compose_maps(first: SpeakerMap | None, second: SpeakerMap) -> SpeakerMap:
    """Return the map that applies ``first`` and then ``second``, which must not have habits.

    first : from a model's mean person to one of its people; None: the model has one person, or the mean one is meant
    Raises InputError: ``first`` has no map of a channel of ``second``.
    """
    if first is None:
        return second
    first = first.reorder(second.channels)
    gain = second.gain * first.gain
    offset = second.offset + second.gain * first.offset
    rest = second.rest + second.gain * first.rest
    return SpeakerMap(second.channels, gain, offset, rest, first.habits, first.lips)


def select_channels(motion: Motion, channels: Sequence[Channel], where: str) -> Motion:
    """Return motion in the channels of a model. Raises InputError, which names the recording: a channel is missing."""
    missing = [channel for channel in channels if channel not in motion.channels]
    if missing:
        raise InputError(
            f"{where}: its motion has no channel {missing[0].name!r} in the unit {missing[0].unit!r}, which the model "
            f"generates ({len(missing)} of {len(channels)} are missing); give recordings with the channels of the "
            "model (lipmotion info), or another model"
        )
    columns = [motion.channels.index(channel) for channel in channels]
    return Motion(np.asarray(motion.values)[:, columns], motion.rate_hz, tuple(channels))


def count_speech_s(examples: Sequence[Example]) -> float:
    """Return the seconds of speech in which the motion of some examples was measured."""
    spoken = (each.valid & ~mark_distant(each.speech.units, len(each.valid), 0.0) for each in examples)
    return sum(int(frames.sum()) for frames in spoken) / FRAME_RATE_HZ
