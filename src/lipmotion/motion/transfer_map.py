"""Transfer of motion onto another face: the map from the motion of one person to that of another.

Source of the task: Minnis & Breen 2000, §7 (mapping between the movements of different speakers).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lipmotion.errors import InputError
from lipmotion.motion.closure import OPENING
from lipmotion.motion.rest import is_away_from_speech, list_speech_intervals
from lipmotion.motion.speaker_maps import (
    MAX_GAIN,
    VISEME_NAMES,
    SpeakerMap,
    estimate_gains,
    estimate_rest_poses,
    measure_person,
)
from lipmotion.types import FRAME_RATE_HZ, Channel, Example, Motion

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
    Alternatives that were measured: docs/results/selection.md.
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
    """Return the motion of a person in the channels of a model, in their order.

    where : name of the recording, for the message
    Raises InputError: the motion has no such channel.
    """
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
    frames = 0
    for example in examples:
        time_s = np.arange(len(example.valid)) / FRAME_RATE_HZ
        spoken = ~is_away_from_speech(time_s, list_speech_intervals(example.speech.units), 0.0)
        frames += int((example.valid & spoken).sum())
    return frames / FRAME_RATE_HZ
