"""How similar a speaker is to those of a model's training data, and the warp of the frequencies that helps most."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lipmotion.hmm.model import UnitHmm
from lipmotion.speech.features.analysed_audio import AnalysedAudio
from lipmotion.stats.mixture import QuadraticForm

WARPS = (0.88, 0.94, 1.0, 1.06, 1.12)
"""The lengths of adults' vocal tracts differ by about so much."""
JUDGED_FRAMES = 2000
"""20 seconds are enough to judge a speaker by."""


class SpeakerSimilarity(NamedTuple):
    """The similarity of a recording to the training data of some models.

    warp  : factor by which the frequencies of the recording are stretched to make it most similar
    score : mean log density per frame of the recording, so warped, less that of the training data. It depends on the
            speaker in speech, on the room and the microphone in silence
    """

    warp: float
    score: float


def speaker_similarity(hmm: UnitHmm, audio: AnalysedAudio) -> SpeakerSimilarity:
    """Return the speaker similarity of a recording to the training data of some models, at the best of ``WARPS``.

    A recording is judged by what is recorded of its longest passage, of which ``JUDGED_FRAMES`` are enough: silence
    that was added to it would be like that of every voice.
    Source: Lee & Rose 1996 (vocal tract length normalisation); the best density of each frame stands for the
    state path, so that the warp is chosen before anything is recognised.
    """
    stretch = max((passage.audio for passage in audio.passages), key=lambda part: part.frames, default=audio)

    def judge() -> SpeakerSimilarity:
        recorded = stretch.recorded
        part = stretch.stretch(recorded.start, min(recorded.stop, recorded.start + JUDGED_FRAMES))
        form, warped = _densities(hmm), zip(WARPS, part.mfcc_of_warps(WARPS), strict=True)
        fits = {warp: float(form.log_likelihood(features.values).max(axis=1).mean()) for warp, features in warped}
        warp = best_warp(fits)
        return SpeakerSimilarity(warp, fits[warp] - hmm.typical_fit)

    return stretch.cached(("similarity to", hmm), judge)


@lru_cache(maxsize=2)
def _densities(hmm: UnitHmm) -> QuadraticForm:
    """Return the densities of ``UnitHmm.fit``, ready for use; those of the last models are kept."""
    return hmm.mixtures.quadratic(np.arange(len(hmm.log_stay), dtype=np.intp))


def best_warp(fits: dict[float, float]) -> float:
    """Return the warp with the highest fit; of equal ones, that which changes the frequencies least."""
    return max(fits, key=lambda warp: (fits[warp], -abs(warp - 1)))
