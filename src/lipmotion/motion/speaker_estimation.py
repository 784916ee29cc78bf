"""Estimation of the maps between people (``motion.speaker_maps``) from their motion in speech and in silence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.closure import OPENING, estimate_closed_opening, find_closable_ranges
from lipmotion.motion.frame_labels import mark_distant
from lipmotion.motion.speaker_maps import (
    FAR_FROM_SPEECH_S,
    MAX_GAIN,
    NEAR_SPEECH_S,
    VISEME_NAMES,
    SpeakerMap,
    SpeakerMaps,
    measure_restfulness,
    weigh_viseme_classes,
)
from lipmotion.types import FRAME_RATE_HZ, Channel, Example

RANGE_PERCENTILES = (5.0, 95.0)  # the range of a channel lies between these percentiles of the frames of speech
RANGE_PRIOR_S = 2.0  # seconds of speech that count as much as the assumption that a person's range is the mean person's
MIN_FRAMES = 10  # fewest frames of silence from which a rest pose is taken
MIN_RANGE_SHARE = 0.05
"""A channel that somebody moves by less than this share of the widest range has a gain of 1 for everyone."""
HABIT_PRIOR_FRAMES = 50.0  # frames of a viseme that count as much as the assumption that a person has no habit in it
FULL_HABIT_SHARE = 0.25  # share of the mean range by which lips must be open for habits to show wholly
Array = NDArray[np.float64]


def add_habits(
    maps: SpeakerMaps, examples: Sequence[Example], speakers: Sequence[str], generated: Iterable[NDArray[Any]]
) -> SpeakerMaps:
    """Return maps with the habits of each person: what is left of their motion in each viseme, on average.

    examples  : from ``map_to_mean_person``
    speakers  : the name of each example's speaker
    generated : the mean person's motion of each, as the engine generates it [each shape=(T, P)]
    Averages are drawn towards 0 with the weight of ``HABIT_PRIOR_FRAMES``.
    """
    sums = {name: np.zeros_like(person.habits) for name, person in maps.items()}
    counts = {name: np.full((len(VISEME_NAMES), 1), HABIT_PRIOR_FRAMES) for name in maps}
    for example, speaker, values in zip(examples, speakers, generated, strict=True):
        if speaker in maps:
            weights = weigh_viseme_classes(example.speech.units, len(values)) * example.valid[:, None]
            sums[speaker] += weights.T @ np.where(example.valid[:, None], example.motion.values - values, 0)
            counts[speaker] += weights.sum(axis=0)[:, None]
    return {name: replace(person, habits=sums[name] / counts[name]) for name, person in maps.items()}


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
    habits, lips = np.zeros((len(VISEME_NAMES), len(channels))), (shut, shut + FULL_HABIT_SHARE * wide)
    maps = {
        name: SpeakerMap(channels, gain[number], offset[number], rest[number], habits, lips)
        for number, name in enumerate(names)
    }
    mapped = []
    for example, speaker in zip(examples, speakers, strict=True):
        motion = example.motion
        restful = measure_restfulness(example.speech.units, len(motion.values))
        values = maps[speaker].to_mean(motion.values, restful)
        mapped.append(replace(example, motion=replace(motion, values=values)))
    return mapped, {name: person for name, person in maps.items() if name}


class PersonStatistics(NamedTuple):
    """Statistics of one person's motion of P channels [each array: shape=(P,)]."""

    rest: Array  # rest pose, NaN where there is no silence
    rest_s: float  # seconds of silence away from speech
    spoken: Array  # median pose in speech
    range: Array  # of each channel in speech
    follow: Array  # change of each channel per unit of opening; zeros without a channel of that name
    closed: float  # opening of closed lips; 0 without a channel of that name
    speech_s: float  # seconds of speech


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
    for others in (np.concatenate(measured), np.zeros((1, examples[0].motion.values.shape[1]))):
        speech = speech if len(speech) else others
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
