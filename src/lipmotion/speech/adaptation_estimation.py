"""Learning to hear a voice from its recordings alone, without transcripts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.model import UnitHmm
from lipmotion.speech.adaptation import Adaptation, identity_adaptation
from lipmotion.speech.combined_phones import NOISES
from lipmotion.speech.general.acoustic import STREAMS, general_model
from lipmotion.speech.general.front_end import general_features
from lipmotion.speech.mfcc import FEATURES, mfcc
from lipmotion.speech.recogniser import Recogniser, own_model_weight
from lipmotion.speech.speaker_similarity import WARPS
from lipmotion.stats.affine import AffineStatistics, Array, improved_transform, prior_statistics, transform_statistics
from lipmotion.stats.mixture import Mixtures
from lipmotion.types import FRAME_RATE_HZ, Audio
from lipmotion.units import is_silent

PASSES, ITERATIONS = 2, 4
"""All is recognised anew in every pass; each improves the transforms so often."""
OWN_RELEVANCE, GENERAL_RELEVANCE = 300.0, 30.0
"""Frames that the prior of a transform, no change at all, counts for (docs/adaptation.md says how they were chosen)."""
SHORT_S, SHORT_RELEVANCE = 10.0, 1000.0
"""From less speech, features, Δ and ΔΔ are transformed for the own models each by themselves, and less."""
LEAST_SPEECH_S = 1.0


class EstimatedAdaptation(NamedTuple):
    """How a voice is heard, and how much of its speech that was learned from."""

    adaptation: Adaptation
    speech_s: float


def estimate_adaptation(own: UnitHmm, recordings: Sequence[Audio]) -> EstimatedAdaptation:
    """Return how phone models should hear a voice, after recognising its recordings with all models.

    own : not adapted
    Both the own and the general models get the affine transform of the features that makes what they recognised most
    probable, drawn towards no change. The frequencies are stretched first, by one factor for all recordings.
    Raises InputError: less speech than ``LEAST_SPEECH_S``.
    Raises MissingDependencyError: pocketsphinx is not installed.
    Source: Gales 1998 (constrained MLLR); Lei, Hamaker & He 2006 (a prior for it; ours is the models' own statistics).
    """
    warp, fit = _common_warp(own, recordings)
    sound = np.concatenate([mfcc(audio, warp).values for audio in recordings])
    general = np.concatenate([general_features(audio) for audio in recordings])
    adaptation, speech_s = identity_adaptation(warp, own_model_weight(fit)), 0.0
    for _ in range(PASSES):
        hear = Recogniser(own, adaptation=adaptation)
        densities = np.concatenate([hear.densities(audio, mfcc(audio)) for audio in recordings])
        speech_s = _checked_speech_s(hear.joint.hmm.table.names, densities)
        prior, free = _own_prior(own, short=speech_s < SHORT_S)
        matrix = _improved(hear.joint.hmm.mixtures, prior, sound, densities, adaptation.own, free)
        streams = _general_improved(general, hear.joint.columns[densities], adaptation.general)
        adaptation = replace(adaptation, own=matrix, general=streams)
    return EstimatedAdaptation(adaptation, speech_s)


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


def _own_prior(own: UnitHmm, *, short: bool) -> tuple[AffineStatistics, NDArray[np.bool_]]:
    """Return what draws the own models' transform towards none, and its entries that may change [shape=(39, 40)]."""
    group = np.arange(FEATURES + 1) // (FEATURES // 3 if short else FEATURES)
    free = (group[:-1, None] == group) | (np.arange(FEATURES + 1) == FEATURES)
    plain = np.arange(len(own.log_stay), dtype=np.intp)
    return prior_statistics(own.mixtures, plain).times(SHORT_RELEVANCE if short else OWN_RELEVANCE), free


def _general_improved(features: NDArray[np.float32], densities: NDArray[np.intp], transforms: Array) -> Array:
    found = []
    for number, (stream, transform) in enumerate(zip(STREAMS, transforms, strict=True)):
        mixtures = general_model().mixtures(number)
        prior = prior_statistics(mixtures, np.arange(mixtures.size[0])).times(GENERAL_RELEVANCE)
        free = np.ones(transform.shape, bool)
        found.append(_improved(mixtures, prior, features[:, stream], densities, transform, free))
    return np.stack(found)


def _improved(
    mixtures: Mixtures,
    prior: AffineStatistics,
    features: NDArray[np.float32],
    densities: NDArray[np.intp],
    transform: Array,
    free: NDArray[np.bool_],
) -> Array:
    """Return a transform [shape=(D, D + 1)] that makes frames more probable under the density of each."""
    for _ in range(ITERATIONS):
        statistics, _ = transform_statistics(mixtures, features, densities, transform)
        transform = improved_transform(transform, statistics + prior, free)
    return transform
