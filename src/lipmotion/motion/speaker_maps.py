"""Several people in one model: maps between the motion of each person and that of the mean person.

Engines learn and generate the motion of the mean person; ``speaker_estimation`` fits the maps, outside of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.closure import OPENING
from lipmotion.motion.frame_labels import list_speech_intervals
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import FRAME_RATE_HZ, Channel, Timeline, Unit
from lipmotion.units import VISEME_OF, VISEMES

NEAR_SPEECH_S, FAR_FROM_SPEECH_S = 0.1, 0.48
"""Within the first distance of speech the map is that of speech, beyond the second the rest pose is exactly the
person's; the second is the one beyond which engines generate the rest pose."""
MIN_GAIN, MAX_GAIN = 0.25, 4.0
"""Ranges of people differ by no more; beyond, they are differences of trackers or of units."""
VISEME_NAMES = tuple(VISEMES)  # the order of the visemes in stored habits
FADE_FRAMES = 11
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpeakerMap:
    """The map from the mean person's motion to one person's: ``offset + gain · motion``, and ``rest`` in silence."""

    channels: tuple[Channel, ...]  # the P channels
    gain: Array  # the person's range as a multiple of the mean person's [shape=(P,)]
    offset: Array  # in the units of the channels [shape=(P,)]
    rest: Array  # what is added in silence away from speech, so that rest pose maps onto rest pose [shape=(P,)]
    habits: Array  # how poses in each of the V visemes are changed before they are mapped [shape=(V, P)]
    lips: tuple[float, float]  # the mean person's openings up to which habits do not show, and from which on wholly

    def shift(self, values: NDArray[np.floating[Any]], visemes: Array) -> Array:
        """Return by how much the mean person's poses are changed by this person's habits [shape=(T, P)].

        values  : all channels of the mean person [shape=(T, P)]
        visemes : from ``weigh_viseme_classes`` [shape=(T, V)]
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
        parts = {part: getattr(self, part)[..., columns] for part in PARTS}
        return replace(self, channels=tuple(channels), **parts)


SpeakerMaps = Mapping[str, SpeakerMap]
"""The maps of all people of a model by their names: of the same channels, and with the same ``lips``."""


def measure_restfulness(units: Timeline[Unit], frames: int) -> Array:
    """Return how far into silence each frame at 100 Hz lies, from 0 near speech to 1 away from it [shape=(frames,)]."""
    time_s = np.arange(frames) / FRAME_RATE_HZ
    speech_s = np.array(list_speech_intervals(units)).reshape(-1, 2)
    starts_s, ends_s = np.append(speech_s[:, 0], np.inf), np.append(-np.inf, speech_s[:, 1])
    following = np.searchsorted(speech_s[:, 0], time_s, side="right")  # the first interval that begins after a time
    distance_s = np.maximum(np.minimum(starts_s[following] - time_s, time_s - ends_s[following]), 0)
    share = np.clip((distance_s - NEAR_SPEECH_S) / (FAR_FROM_SPEECH_S - NEAR_SPEECH_S), 0, 1)
    return share * share * (3 - 2 * share)


def weigh_viseme_classes(units: Timeline[Unit], frames: int) -> Array:
    """Return the weights of visemes in frames at 100 Hz [shape=(frames, V)]; 0 far from speech and for no phone."""
    weights = np.zeros((frames, len(VISEME_NAMES)))
    for span in units:
        if span.label.phone in VISEME_OF:
            first, stop = (round(time_s * FRAME_RATE_HZ) for time_s in (span.start_s, span.end_s))
            weights[max(first, 0) : max(stop, 0), VISEME_NAMES.index(VISEME_OF[span.label.phone])] = 1
    if frames:
        window = np.hanning(FADE_FRAMES + 2)[1:-1]
        weights = scipy.ndimage.convolve1d(weights, window / window.sum(), axis=0, mode="nearest")
    return weights * (1 - measure_restfulness(units, frames))[:, None]


def speakers_to_arrays(maps: SpeakerMaps) -> dict[str, NDArray[Any]]:
    """Serialise maps."""
    people = list(maps.values())
    channels = np.array([(channel.name, channel.unit) for channel in people[0].channels])
    parts = {part: np.stack([getattr(person, part) for person in people]) for part in PARTS}
    return {"channels": channels, "names": np.array(list(maps)), **parts, "lips": np.array(people[0].lips)}


def speakers_from_arrays(arrays: Arrays) -> SpeakerMaps:
    """Deserialise maps. Raises ModelFormatError: an array is missing, unknown, or has a wrong shape, type or range."""
    with format_errors("the table of speakers"):
        refuse_undeclared(arrays, SPEAKERS)
        stored = check_arrays(arrays, SPEAKERS, V=len(VISEME_NAMES))
        channels = tuple(Channel(name, unit) for name, unit in stored["channels"].tolist())
        names = stored["names"].tolist()
        if len({channel.name for channel in channels}) < len(channels) or len({*names} - {""}) < len(names):
            raise ValueError("names of speakers or channels that are empty or repeat")
        closed, opened = stored["lips"].tolist()
        people = [{part: stored[part][number] for part in PARTS} for number in range(len(names))]
        maps = (SpeakerMap(channels, **parts, lips=(closed, opened)) for parts in people)
        return dict(zip(names, maps, strict=True))


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
PARTS = ("gain", "offset", "rest", "habits")


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
