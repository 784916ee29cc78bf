"""EM audio-to-visual conversion: the most likely visual streams for given speech (Xie & Liu 2007, §4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import AudioVisualObservations, infer_components
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


def convert(
    chains: Chains,
    observations: AudioVisualObservations,
    lattice: Lattice,
    start: str = SOFT,
    update: str = EXACT,
    max_steps: int = 10,
    speech_inference: Inference | None = None,
) -> tuple[tuple[Array, ...], tuple[float, ...]]:
    """Return the visual streams that maximise the joint likelihood with speech, near the start.

    observations : the first stream is speech; the values of the others are ignored
    lattice      : the joint states that the utterance may be in
    start        : ``soft``: expected means over all paths, given speech alone; ``viterbi``: means along the best path,
                   as in the paper
    update       : ``exact``: the maximiser of each M-step; ``printed``: Eq. 9 as it stands
    max_steps    : greatest number of EM steps after the start
    speech_inference : posteriors given speech alone, where they are known; a soft start needs them
    Returns the streams [each shape=(T, D_s)], and the log likelihood per frame by step. With ``exact`` updates the
    joint likelihood never falls; with ``printed`` ones it may.
    Source: Xie & Liu 2007, Eqs. 3–11, Fig. 6.
    """
    speech, visual = observations.without_visual_streams(), range(1, len(chains.streams))

    def update_streams(inference: Inference, update: str) -> tuple[Array, ...]:
        """The M-step: return the visual streams that the posteriors make most likely."""
        statistics = (sum_precisions(chains, inference, stream, update) for stream in visual)
        return tuple(weighted / np.maximum(precision, 1e-300) for precision, weighted in statistics)

    if start == VITERBI:
        path, _ = chains.best_path(speech, lattice)
        streams = tuple(path_to_means(chains, path, stream) for stream in visual)
    else:
        streams = update_streams(speech_inference or chains.infer(speech, lattice), EXACT)
    if not max_steps:
        return streams, ()
    result = run_em(
        streams,
        lambda streams: chains.infer(speech.with_visual_streams([x.astype(np.float32) for x in streams]), lattice),
        lambda _, inference: update_streams(inference, update),
        max_steps,
        min_gain=CONVERGENCE_GAIN,
        maximise_converged=False,
    )
    return result.model, result.log_likelihoods


def group_index(chains: Chains, stream: int) -> int:
    """Return the number of the group that a stream belongs to."""
    return next(number for number, group in enumerate(chains.groups) if stream in group.streams)


def sum_precisions(chains: Chains, inference: Inference, stream: int, update: str = EXACT) -> tuple[Array, Array]:
    """Return expected precisions and precision-weighted means of a stream [each shape=(T, D)].

    These are Σ γ(q, k) Σ⁻¹ and Σ γ(q, k) Σ⁻¹ μ over the states q and components k of the stream; with the ``printed``
    update as Eq. 9 sums them, over joint states and with the weights of components once more.
    """
    number = group_index(chains, stream)
    group, densities = chains.groups[number], inference.lattice.densities[number]
    weight = infer_components(inference.posteriors.densities[number], inference.responsibilities[number])
    if update == PRINTED:
        joint_states = np.bincount(inference.lattice.ties[number], minlength=len(densities))
        factors = (np.exp(group.mixtures.log_weights[densities]).T * joint_states).astype(np.float32)
        weight = weight * factors
    mixtures = group.stream_mixtures(stream).select(densities)
    precision = (1 / mixtures.variances).transpose(1, 0, 2)
    weighted = precision * mixtures.means.transpose(1, 0, 2)
    size, flat = precision.shape[2], weight.reshape(len(weight), -1)
    precisions, weighted_means = ((flat @ part.reshape(-1, size)).astype(float) for part in (precision, weighted))
    return precisions, weighted_means


def path_to_means(chains: Chains, path: NDArray[np.intp], stream: int) -> Array:
    """Return the mean of a stream's mixture in every state along a path of joint states [shape=(T, D)]."""
    group = chains.groups[group_index(chains, stream)]
    mixtures = group.stream_mixtures(stream)
    means = (np.exp(mixtures.log_weights)[:, :, None] * mixtures.means).sum(axis=1)
    return means[group.tie[path]].astype(float)
