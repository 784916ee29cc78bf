"""How well models know a voice, and the stretching of frequencies that they know it best by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.model import UnitHmm
from lipmotion.speech.mfcc import HOP, LOG_ENERGY, mfcc
from lipmotion.types import Audio, Features

WARPS = (0.88, 0.94, 1.0, 1.06, 1.12)
"""The vocal tracts of adults differ by about so much."""
JUDGED_FRAMES = 2000
"""Twenty seconds, the loudest, are enough to judge a voice by."""


@dataclass(frozen=True, eq=False)
class SpeakerSimilarity:
    """A recording as some models hear it best.

    features : warped by ``warp``
    fit      : how much better (above 0) or worse than their training data the models explain it, in mean log
               density per frame: the voice in speech, the room and the microphone in silence
    """

    features: Features
    warp: float
    fit: float


def speaker_similarity(hmm: UnitHmm, audio: Audio, features: Features) -> SpeakerSimilarity:
    """Return a recording made most like the voices that the models know.

    features : of the audio, not warped
    Source: Lee & Rose 1996 (vocal tract length normalisation); the best density of each frame stands for the
    state path, so that the warp is chosen before anything is recognised.
    """
    judged = _loudest(audio, features)
    heard = {warp: features if warp == 1 and judged is audio else mfcc(judged, warp) for warp in WARPS}
    fits = {warp: hmm.fit(heard[warp].values) for warp in WARPS}
    warp = max(fits, key=lambda warp: (fits[warp], -abs(warp - 1)))
    if judged is not audio:
        heard[warp] = features if warp == 1 else mfcc(audio, warp)
    return SpeakerSimilarity(heard[warp], warp, fits[warp] - hmm.typical_fit)


def _loudest(audio: Audio, features: Features) -> Audio:
    """Return the stretch of ``JUDGED_FRAMES`` with the most energy, or the recording itself if it is no longer."""
    energy = features.values[:, LOG_ENERGY].astype(float)
    if len(energy) <= JUDGED_FRAMES:
        return audio
    total: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(energy)])
    start = int((total[JUDGED_FRAMES:] - total[:-JUDGED_FRAMES]).argmax())
    return Audio(audio.samples[start * HOP : (start + JUDGED_FRAMES) * HOP], audio.rate_hz)
