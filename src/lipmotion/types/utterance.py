"""One recorded sentence of a corpus, and the motion of the face in it."""

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
    """Motion of the face in one recording: tracked in a video, or supplied as curves.

    motion : at the frame rate of the recording. Of a video: ``opening``, ``width``, ``outer`` and the lip and jaw
             points (``x_17``, ``y_17``, ``z_17``: face-mesh point 17) without head motion, in eye distances; supplied
             curves may have any channels
    seen   : bool array [shape=(T,)], False in frames where the face was not measured and the motion is interpolated;
             True everywhere for supplied curves, but without a face in a take of Live Link Face
    crops  : uint8 array [shape=(T, 56, 72, 3)], RGB pictures of the mouth, or None
    notes  : remarks on the video for the user, in words (cuts, damage, a covered mouth)
    """

    motion: Motion
    seen: NDArray[np.bool_]
    crops: NDArray[np.uint8] | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Utterance:
    """One recorded sentence: sound, acoustic features, motion, transcript.

    name     : unique in its corpus
    audio    : the sound, at 16 kHz
    features : acoustic features of the sound, at 100 Hz
    track    : motion of the face
    words    : the transcript in lower case, or None if it is not known
    split    : ``train``, ``val`` or ``test``
    source   : file, digest, licence, attribution and software of the recording, by name
    speaker  : name of the speaker; empty if it is not known
    phones   : labelled phones in time, from 0 s to the end of the sound, or None if there are no labels
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
