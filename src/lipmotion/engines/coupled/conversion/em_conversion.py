"""EM audio-to-visual conversion: the most likely visual streams for given speech (Xie & Liu 2007, §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import AudioVisualObservations, Single, StreamGroup, infer_components
from lipmotion.engines.coupled.chains.lattice import Lattice
from lipmotion.engines.coupled.chains.model import Chains, Inference
from lipmotion.stats.em import run_em

Array = NDArray[np.float64]
SOFT, VITERBI = "soft", "viterbi"
STARTS = (SOFT, VITERBI)
EXACT, PRINTED = "exact", "printed"
UPDATES = (EXACT, PRINTED)
CONVERGENCE_GAIN = 1e-4
"""EM ends when the log likelihood per frame gains less."""


@dataclass(frozen=True)
class ConversionSettings:
    """Options of the EM conversion.

    start      : ``soft``: expected means over all paths, given speech alone; ``viterbi``: means along the best path, as
                 in the paper
    update     : ``exact``: the maximiser of each M-step; ``printed``: Eq. 9 as it stands
    most_steps : greatest number of EM steps after the start
    """

    start: str = SOFT
    update: str = EXACT
    most_steps: int = 10


@dataclass(frozen=True, eq=False)
class ConversionResult:
    """The streams of a conversion, speech first [each shape=(T, D_s)], and the log likelihood per frame by step."""

    streams: tuple[Array, ...]
    log_likelihood: tuple[float, ...]


def convert(
    chains: Chains,
    observations: AudioVisualObservations,
    lattice: Lattice,
    settings: ConversionSettings,
    given_speech: Inference | None = None,
) -> ConversionResult:
    """Return the visual streams that maximise the joint likelihood with speech, near the start.

    observations : the first stream is speech; the values of the others are ignored
    lattice      : the joint states that the utterance may be in
    given_speech : posteriors given speech alone, where they are known; a soft start needs them
    With ``exact`` updates the joint likelihood never falls; with ``printed`` ones it may.
    Source: Xie & Liu 2007, Eqs. 3–11, Fig. 6.
    """
    speech = without_visual_streams(observations)
    streams = _start(chains, speech, lattice, settings, given_speech)
    log_likelihoods: tuple[float, ...] = ()
    if settings.most_steps:
        result = run_em(
            streams,
            lambda streams: chains.infer(_with_visual_streams(speech, streams), lattice),
            lambda _, inference: _update_streams(chains, inference, settings.update),
            settings.most_steps,
            least_gain=CONVERGENCE_GAIN,
            maximise_converged=False,
        )
        streams, log_likelihoods = result.model, result.log_likelihoods
    return ConversionResult((observations.streams[0].astype(float), *streams), log_likelihoods)


def without_visual_streams(observations: AudioVisualObservations) -> AudioVisualObservations:
    """Return the observations with all streams but speech marked as not observed."""
    for stream in range(1, len(observations.streams)):
        observations = observations.without_stream(stream)
    return observations


def group_index(chains: Chains, stream: int) -> int:
    """Return the number of the group that a stream belongs to."""
    return next(number for number, group in enumerate(chains.groups) if stream in group.streams)


def sum_precisions(chains: Chains, inference: Inference, stream: int) -> tuple[Array, Array]:
    """Return expected precisions and precision-weighted means of a stream [each shape=(T, D)].

    These are Σ γ(q, k) Σ⁻¹ and Σ γ(q, k) Σ⁻¹ μ over the states q and components k of the stream.
    """
    number = group_index(chains, stream)
    weight = infer_components(inference.posteriors.densities[number], inference.emissions.responsibilities[number])
    return _weigh_precisions(chains.groups[number], stream, inference.lattice.densities[number], weight)


def path_to_means(chains: Chains, path: NDArray[np.intp], stream: int) -> Array:
    """Return the mean of a stream's mixture in every state along a path of joint states [shape=(T, D)]."""
    group = chains.groups[group_index(chains, stream)]
    mixtures = group.stream_mixtures(stream)
    means = (np.exp(mixtures.log_weights)[:, :, None] * mixtures.means).sum(axis=1)
    return means[group.tie[path]].astype(float)


def _start(
    chains: Chains,
    speech: AudioVisualObservations,
    lattice: Lattice,
    settings: ConversionSettings,
    given_speech: Inference | None,
) -> tuple[Array, ...]:
    """Return the visual streams before the first step of EM [each shape=(T, D_s)]."""
    if settings.start == VITERBI:
        path, _ = chains.best_path(chains.emission_log_densities(speech, lattice), lattice)
        return tuple(path_to_means(chains, path, stream) for stream in range(1, len(chains.streams)))
    return _update_streams(chains, given_speech or chains.infer(speech, lattice), EXACT)


def _update_streams(chains: Chains, inference: Inference, update: str) -> tuple[Array, ...]:
    """Return the visual streams that the posteriors make most likely (M-step) [each shape=(T, D_s)]."""
    statistics = sum_precisions if update == EXACT else _sum_smoothed
    streams = []
    for stream in range(1, len(chains.streams)):
        precision, weighted = statistics(chains, inference, stream)
        streams.append(weighted / np.maximum(precision, 1e-300))
    return tuple(streams)


def _sum_smoothed(chains: Chains, inference: Inference, stream: int) -> tuple[Array, Array]:
    """Return precisions and precision-weighted means of a stream as Eq. 9 sums them [each shape=(T, D)]."""
    number = group_index(chains, stream)
    group, densities = chains.groups[number], inference.lattice.densities[number]
    joint_states = np.bincount(inference.lattice.ties[number], minlength=len(densities))
    factors = (np.exp(group.mixtures.log_weights[densities]).T * joint_states).astype(np.float32)
    posteriors = infer_components(inference.posteriors.densities[number], inference.emissions.responsibilities[number])
    return _weigh_precisions(group, stream, densities, posteriors * factors)


def _weigh_precisions(
    group: StreamGroup, stream: int, densities: NDArray[np.intp], weight: Single
) -> tuple[Array, Array]:
    """Return the sums of weighted precisions, and of these times means, of a stream [each shape=(T, D)]."""
    mixtures = group.stream_mixtures(stream).select(densities)
    precision = (1 / mixtures.variances).transpose(1, 0, 2)
    weighted = precision * mixtures.means.transpose(1, 0, 2)
    size, flat = precision.shape[2], weight.reshape(len(weight), -1)
    precisions, weighted_means = ((flat @ part.reshape(-1, size)).astype(float) for part in (precision, weighted))
    return precisions, weighted_means


def _with_visual_streams(observations: AudioVisualObservations, streams: tuple[Array, ...]) -> AudioVisualObservations:
    for number, values in enumerate(streams, start=1):
        observations = observations.with_stream(number, values.astype(np.float32))
    return observations
