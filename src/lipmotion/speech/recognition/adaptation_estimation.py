"""Unsupervised speaker adaptation: transforms estimated from recordings of a speaker, without transcripts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.model import UnitHmm
from lipmotion.speech.features.mfcc import FEATURES
from lipmotion.speech.recognition.adaptation import Adaptation, create_adaptation
from lipmotion.speech.recognition.general import NOISES, STREAMS, load_general
from lipmotion.speech.recognition.recogniser import Recogniser, weigh_own_model
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.speech.sound.speaker_similarity import WARPS, find_warp
from lipmotion.stats.constrained_mllr import (
    AffineStatistics,
    Array,
    collect_transform_statistics,
    create_prior,
    improve_transform,
)
from lipmotion.stats.em import run_em
from lipmotion.stats.mixture import Mixtures
from lipmotion.types import FRAME_RATE_HZ, Audio
from lipmotion.units import is_silent

PASSES, ITERATIONS = 2, 4
"""In every pass all recordings are recognised anew, and every transform is improved this many times."""
OWN_RELEVANCE, GENERAL_RELEVANCE = 300.0, 30.0
"""Frames that the prior of a transform, the identity, counts for (docs/adaptation.md says how they were chosen)."""
SHORT_S, SHORT_RELEVANCE = 10.0, 1000.0
"""From less speech than this, the own models' features, Δ and ΔΔ are transformed alone, with a stronger prior."""
MIN_SPEECH_S = 1.0


class EstimatedAdaptation(NamedTuple):
    """An adaptation to a speaker, and the seconds of speech that it was estimated from."""

    adaptation: Adaptation
    speech_s: float


def estimate_adaptation(own: UnitHmm, recordings: Sequence[Audio]) -> EstimatedAdaptation:
    """Return the adaptation of phone models to the speaker of some recordings.

    own        : the phone models of a corpus, not adapted
    All recordings are recognised with the own and the general models. The features of both then get the affine
    transform that makes the recognised states most probable, with the identity as prior mean. The frequencies are
    stretched first, by one factor for all recordings.
    Raises InputError: less speech than ``MIN_SPEECH_S``. Raises MissingDependencyError: pocketsphinx is not installed.
    Source: Gales 1998 (constrained MLLR); Lei, Hamaker & He 2006 (a prior for it; ours is the models' own statistics).
    """
    audios = [analysed(audio) for audio in recordings]
    scores = {
        warp: own.fit(np.concatenate([audio.mfcc(warp).values for audio in audios])) - own.typical_fit for warp in WARPS
    }
    warp = find_warp(scores)
    own_features = np.concatenate([audio.mfcc(warp).values for audio in audios])
    general_features = np.concatenate([audio.general_features for audio in audios])
    adaptation, speech_s = create_adaptation(warp, weigh_own_model(scores[warp])), 0.0
    for _ in range(PASSES):
        recogniser = Recogniser(own, adaptation=adaptation)
        densities = np.concatenate([recogniser.find_path_densities(audio) for audio in audios])
        combined = recogniser.combined
        units = (name.partition(".")[0] for name in combined.hmm.table.names)
        silent = np.array([is_silent(unit) or unit in NOISES for unit in units])
        speech_s = float((~silent[densities]).sum() / FRAME_RATE_HZ)
        if speech_s < MIN_SPEECH_S:
            raise InputError(f"found {speech_s:.1f} s of speech, required at least {MIN_SPEECH_S:.0f} s; give more")
        short = speech_s < SHORT_S
        group = np.arange(FEATURES + 1) // (FEATURES // 3 if short else FEATURES)
        free = (group[:-1, None] == group) | (np.arange(FEATURES + 1) == FEATURES)
        plain = np.arange(len(own.log_stay), dtype=np.intp)
        prior = create_prior(own.mixtures, plain).times(SHORT_RELEVANCE if short else OWN_RELEVANCE)
        matrix = _improve(combined.hmm.mixtures, prior, own_features, densities, adaptation.own, free)
        streams, columns = [], combined.columns[densities]
        for number, (stream, transform) in enumerate(zip(STREAMS, adaptation.general, strict=True)):
            mixtures, features = load_general().mixtures(number), general_features[:, stream]
            prior = create_prior(mixtures, np.arange(mixtures.size[0])).times(GENERAL_RELEVANCE)
            everything = np.ones(transform.shape, bool)
            streams.append(_improve(mixtures, prior, features, columns, transform, everything))
        adaptation = replace(adaptation, own=matrix, general=np.stack(streams))
    return EstimatedAdaptation(adaptation, speech_s)


def _improve(
    mixtures: Mixtures,
    prior: AffineStatistics,
    features: NDArray[np.float32],
    densities: NDArray[np.intp],
    transform: Array,
    free: NDArray[np.bool_],
) -> Array:
    """Return a transform whose ``free`` entries make frames more probable under the densities of their states."""
    return run_em(
        transform,
        lambda transform: collect_transform_statistics(mixtures, features, densities, transform),
        lambda transform, expected: improve_transform(transform, expected.statistics + prior, free),
        ITERATIONS,
    ).model
