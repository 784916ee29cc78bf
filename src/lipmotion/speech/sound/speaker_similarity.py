"""How similar a speaker is to those of a model's training data, and the warp of the frequencies that helps most."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.model import UnitHmm
from lipmotion.speech.features.encoding import COMPONENTS, read_background
from lipmotion.speech.sound.analysed_audio import AnalysedAudio
from lipmotion.stats.mixture import QuadraticForm

WARPS = (0.88, 0.94, 1.0, 1.06, 1.12)  # the lengths of adults' vocal tracts differ by about so much
JUDGED_FRAMES = 2000  # 20 seconds are enough to judge a speaker by
STRANGER_SCORE, OWN_SCORE = -9.0, -3.0
"""A model knows nothing of a voice with the first speaker similarity score; one with the second is its training's own.
The score of another speaker in the same studio is -4 to -6 for GRID's models, of other voices in other rooms -7 to -15,
and of the training's own in noise no more."""
STRANGER_LIKENESS, OWN_LIKENESS = (0.3, 0.6), (0.6, 0.9)
"""The same of the likeness of speaker vectors: each where the score says nothing of the voice, as in noise, and where
it half knows it (docs/results/voices.md)."""
QUIET_SHARE = 0.4
"""So many of the frames, the most quiet, are not used for a speaker vector: pauses sound like the room alone."""
JUDGED_RECORDINGS = 100  # recordings of a training whose speaker vectors are enough


class SpeakerSimilarity(NamedTuple):
    """The similarity of a recording to the training data of some models.

    warp  : factor by which the frequencies of the recording are stretched to make it most similar
    score : mean log density per frame of the recording, so warped, less that of the training data. It depends on the
            speaker in speech, on the room and the microphone in silence
    """

    warp: float
    score: float


def measure_similarity(hmm: UnitHmm, audio: AnalysedAudio) -> SpeakerSimilarity:
    """Return the speaker similarity of a recording to the training data of some models, at the best of ``WARPS``.

    A recording is judged by its longest passage.
    Source: Lee & Rose 1996 (vocal tract length normalisation); the best density of each frame stands for the
    state path, so that the warp is chosen before anything is recognised.
    """
    stretch = _find_passage(audio)

    def judge() -> SpeakerSimilarity:
        part = _select_judged(stretch)
        form, warped = _load_densities(hmm), zip(WARPS, part.mfcc_of_warps(WARPS), strict=True)
        fits = {warp: float(form.log_likelihood(features.values).max(axis=1).mean()) for warp, features in warped}
        warp = find_warp(fits)
        stretch.forget_warps()
        return SpeakerSimilarity(warp, fits[warp] - hmm.typical_fit)

    return stretch.cached(("similarity to", hmm), judge)


def rate_knowledge(hmm: UnitHmm, audio: AnalysedAudio) -> float:
    """Return how well a model knows the voice of a recording, 0 (as little as any) to 1 (its own).

    By the speaker similarity or the likeness of speaker vectors, whichever says more: noise makes every voice
    dissimilar, and vectors of short recordings are unlike. In noise less likeness is needed.
    """
    by_score = float(np.interp(measure_similarity(hmm, audio).score, (STRANGER_SCORE, OWN_SCORE), (0, 1)))
    if hmm.speaker is None or by_score >= 1:
        return by_score
    stretch = _find_passage(audio)
    vector, own = stretch.cached("speaker vector", lambda: embed_speaker(stretch)), hmm.speaker.astype(float)
    likeness = float(vector @ own) / float(own @ own)
    limits = [np.interp(by_score, (0.0, 0.5), pair) for pair in (STRANGER_LIKENESS, OWN_LIKENESS)]
    return max(by_score, float(np.interp(likeness, limits, (0, 1))))


def embed_speaker(audio: AnalysedAudio) -> NDArray[np.float64]:
    """Return a vector of the speaker and the room, in units of what differs within them [shape=(2 · 64,)].

    It is the mean and the deviation of the encoding over the louder frames of the longest passage, from those of many
    voices (``read_background``). In digital silence it is 0.
    Source: Fisher 1936 (linear discriminant analysis): differences from the mean voice, whitened by the covariance of
    recordings of one speaker in quiet, in noise and in rooms.
    """
    part = _select_judged(_find_passage(audio))
    centre, whitening = read_background()
    if not part.samples.any():
        return np.zeros(2 * COMPONENTS)
    rows = part.encoding[part.log_energy >= np.quantile(part.log_energy, QUIET_SHARE)].astype(float)
    return np.asarray((np.concatenate([rows.mean(axis=0), rows.std(axis=0)]) - centre) @ whitening, np.float64)


def _find_passage(audio: AnalysedAudio) -> AnalysedAudio:
    return max((passage.audio for passage in audio.passages), key=lambda part: part.frames, default=audio)


def _select_judged(stretch: AnalysedAudio) -> AnalysedAudio:
    """Return what is recorded of a passage, ``JUDGED_FRAMES`` at most: silence that was added is like every voice's."""
    recorded = stretch.recorded
    return stretch.stretch(recorded.start, min(recorded.stop, recorded.start + JUDGED_FRAMES))


@lru_cache(maxsize=2)
def _load_densities(hmm: UnitHmm) -> QuadraticForm:
    """Return the densities of ``UnitHmm.fit``, ready for use; those of the last models are kept."""
    return hmm.mixtures.quadratic(np.arange(len(hmm.log_stay), dtype=np.intp))


def find_warp(fits: dict[float, float]) -> float:
    """Return the warp with the highest fit; of equal ones, that which changes the frequencies least."""
    return max(fits, key=lambda warp: (fits[warp], -abs(warp - 1)))
