"""One recorded sentence of a corpus."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.types.audio import Audio
from lipmotion.types.features import Features
from lipmotion.types.motion import Motion
from lipmotion.types.timeline import Timeline, Unit


@dataclass(frozen=True, eq=False)
class Track:
    """How a face moved: followed through a video, or given as curves.

    motion   : any channels, at the rate they were recorded. Of a video: ``opening``, ``width``, ``outer`` and the lip
               and jaw points (``x_17``, ``y_17``, ``z_17``: face-mesh point 17), head motion removed, lengths in eye
               distances
    seen     : bool array [shape=(T,)], False where the face cannot be measured (motion interpolated there); given
               curves are seen everywhere
    crops    : uint8 array [shape=(T, 56, 72, 3)], RGB mouth images, or None
    notes    : what a user should know of the video, in words (cuts, damage, a covered mouth)
    """

    motion: Motion
    seen: NDArray[np.bool_]
    crops: NDArray[np.uint8] | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Utterance:
    """One recorded sentence: sound, features, motion, and what was said.

    words   : the transcript, or None where it is not known
    split   : ``train``, ``val`` or ``test``
    source  : where it came from (file, sizes, licence, ...)
    speaker : who speaks, empty where it is not known
    phones  : labelled phones in time, from 0 s to the end of the sound, or None where there are no such labels
    """

    name: str
    audio: Audio
    features: Features
    track: Track
    words: tuple[str, ...] | None
    split: str
    source: dict[str, str]
    speaker: str = ""
    phones: Timeline[Unit] | None = None
