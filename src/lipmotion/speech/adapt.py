"""Learning to hear a voice from its recordings alone, without transcripts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.speech.adaptation import Adaptation
from lipmotion.speech.general.acoustic import STREAMS, general_model
from lipmotion.speech.general.front_end import general_features
from lipmotion.speech.joint import NOISES, Joint
from lipmotion.speech.mfcc import FEATURES, mfcc
from lipmotion.speech.recogniser import Recogniser, trusted
from lipmotion.speech.voice import WARPS
from lipmotion.stats.affine import AffineStatistics, Array, heard_statistics, identity, improved, own_statistics
from lipmotion.stats.hmm.model import UnitHmm
from lipmotion.stats.mixture import Mixtures
from lipmotion.types import FRAME_RATE_HZ, Audio
from lipmotion.units import is_silent

ITERATIONS = 4
OWN_RELEVANCE, GENERAL_RELEVANCE = 300.0, 30.0
"""Frames that the prior of a transform, no change at all, counts for (docs/adaptation.md says how they were chosen)."""
SHORT_S, SHORT_RELEVANCE = 10.0, 1000.0
"""From less speech, features, Δ and ΔΔ are transformed for the own models each by themselves, and less."""
LEAST_SPEECH_S = 1.0


class Adapted(NamedTuple):
    """How a voice is heard, and how much of its speech that was learned from."""

    adaptation: Adaptation
    speech_s: float


def adapted(own: UnitHmm, recordings: Sequence[Audio]) -> Adapted:
    """Return how phone models should hear a voice, after recognising its recordings with all models.

    own : not adapted
    Both the own and the general models get the affine transform of the features that makes what they recognised most
    probable, drawn towards no change. The frequencies are stretched first, by one factor for all recordings.
    Raises InputError: less speech than ``LEAST_SPEECH_S``.
    Raises MissingDependencyError: pocketsphinx is not installed.
    Source: Gales 1998 (constrained MLLR); Lei, Hamaker & He 2006 (a prior for it; ours is the models' own statistics).
    """
    hear = Recogniser(own)
    densities = np.concatenate([hear.densities(audio, mfcc(audio)) for audio in recordings])
    speech_s = _checked_speech_s(hear.joint.hmm.table.names, densities)
    warp, fit = _common_warp(own, recordings)
    transform = _own_transform(own, hear.joint, [mfcc(audio, warp).values for audio in recordings], densities, speech_s)
    streams = _general_transforms([general_features(audio) for audio in recordings], hear.joint.columns[densities])
    return Adapted(Adaptation(warp, trusted(fit), transform, streams), speech_s)


def _checked_speech_s(names: Sequence[str], densities: NDArray[np.intp]) -> float:
    units = [name.partition(".")[0] for name in names]
    silent = np.array([is_silent(unit) or unit in NOISES for unit in units])
    speech_s = float((~silent[densities]).sum() / FRAME_RATE_HZ)
    if not speech_s:
        raise InputError("no speech found in the recordings; give some of the voice to adapt to")
    if speech_s < LEAST_SPEECH_S:
        raise InputError(
            f"found {speech_s:.1f} s of speech, required at least {LEAST_SPEECH_S:.0f} s; give more of this voice"
        )
    return speech_s


def _common_warp(own: UnitHmm, recordings: Sequence[Audio]) -> tuple[float, float]:
    """Return the warp that fits the recordings best together, and how well it does (``Voice.fit``)."""
    fits = {
        warp: own.fit(np.concatenate([mfcc(audio, warp).values for audio in recordings])) - own.typical_fit
        for warp in WARPS
    }
    warp = max(fits, key=lambda warp: (fits[warp], -abs(warp - 1)))
    return warp, fits[warp]


def _own_transform(
    own: UnitHmm, joint: Joint, features: Sequence[NDArray[np.float32]], densities: NDArray[np.intp], speech_s: float
) -> Array:
    short = speech_s < SHORT_S
    group = np.arange(FEATURES + 1) // (FEATURES // 3 if short else FEATURES)
    free = (group[:-1, None] == group) | (np.arange(FEATURES + 1) == FEATURES)
    plain = np.arange(len(own.log_stay), dtype=np.intp)  # the same densities as in the joint models
    prior = own_statistics(own.mixtures, plain).times(SHORT_RELEVANCE if short else OWN_RELEVANCE)
    return _transform(joint.hmm.mixtures, prior, np.concatenate(features), densities, free)


def _general_transforms(features: Sequence[NDArray[np.float32]], densities: NDArray[np.intp]) -> Array:
    found = []
    for number, stream in enumerate(STREAMS):
        heard = np.concatenate([part[:, stream] for part in features])
        mixtures = general_model().mixtures(number)
        prior = own_statistics(mixtures, np.arange(mixtures.size[0])).times(GENERAL_RELEVANCE)
        found.append(_transform(mixtures, prior, heard, densities, np.ones((heard.shape[1], heard.shape[1] + 1), bool)))
    return np.stack(found)


def _transform(
    mixtures: Mixtures,
    prior: AffineStatistics,
    features: NDArray[np.float32],
    densities: NDArray[np.intp],
    free: NDArray[np.bool_],
) -> Array:
    """Return the transform [shape=(D, D + 1)] that makes frames most probable under the density of each."""
    transform = identity(features.shape[1])
    for _ in range(ITERATIONS):
        statistics, _ = heard_statistics(mixtures, features, densities, transform)
        transform = improved(transform, statistics + prior, free)
    return transform
