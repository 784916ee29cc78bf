"""Speech to motion: EM conversion, the inverse of training (Xie & Liu 2007, §4), and regression of visual means.

The visual chain of Xie & Liu 2007 has one mean for each state, which does not depend on the neighbouring phones: the
lips of a k do not take the shape of the vowels around it. Here the mean of a state is linear in the acoustic features
around the frame and in the posteriors of the first chain around it. These posteriors are a soft phonetic context, for
which no phone needs to be decided. Each state of each viseme has a regression, with a ridge towards that of the viseme,
and this one towards that of all visemes; the posteriors of the visual chain weight the regressions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import AudioVisualObservations, infer_components
from lipmotion.engines.coupled.chains.lattice import Lattice
from lipmotion.engines.coupled.chains.model import Chains, Inference
from lipmotion.motion.context_window import AcousticContext, fit_acoustic_context
from lipmotion.stats.em import run_em
from lipmotion.stats.pca import find_principal_axes, measure_covariance
from lipmotion.stats.trees import create_statistics, ridge

Array = NDArray[np.float64]
Index = NDArray[np.intp]
SOFT, VITERBI = "soft", "viterbi"
STARTS = (SOFT, VITERBI)
EXACT, PRINTED = "exact", "printed"
UPDATES = (EXACT, PRINTED)
CONVERGENCE_GAIN = 1e-4  # EM ends when the log likelihood per frame gains less


def convert(
    chains: Chains,
    observations: AudioVisualObservations,
    lattice: Lattice,
    start: str = SOFT,
    update: str = EXACT,
    max_steps: int = 10,
    given_speech: Inference | Index | None = None,
) -> tuple[tuple[Array, ...], tuple[float, ...]]:
    """Return the visual streams that maximise the joint likelihood with speech, near the start.

    observations : the first stream is speech; the values of the others are ignored
    lattice      : the joint states that the utterance may be in
    start        : ``soft``: expected means over all paths, given speech; ``viterbi``: the paper's, along the best path
    update       : ``exact``: the maximiser of each M-step; ``printed``: Eq. 9 as it stands
    max_steps    : greatest number of EM steps after the start
    given_speech : where it is known, what the start is made of: the posteriors, or the path, given speech alone
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
        path = given_speech if isinstance(given_speech, np.ndarray) else chains.best_path(speech, lattice)[0]
        streams = tuple(path_to_means(chains, path, stream) for stream in visual)
    else:
        inference = given_speech if isinstance(given_speech, Inference) else chains.infer(speech, lattice)
        streams = update_streams(inference, EXACT)
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


def path_to_means(chains: Chains, path: Index, stream: int) -> Array:
    """Return the mean of a stream's mixture in every state along a path of joint states [shape=(T, D)]."""
    group = chains.groups[group_index(chains, stream)]
    mixtures = group.stream_mixtures(stream)
    means = (np.exp(mixtures.log_weights)[:, :, None] * mixtures.means).sum(axis=1)
    return means[group.tie[path]].astype(float)


Single = NDArray[np.float32]
OFFSETS = (-28, -20, -14, -9, -5, -2, 0, 2, 5, 9, 14, 20, 28)
"""Frames whose posteriors are regression inputs, relative to the predicted frame; the farther, the more smoothed."""
REACH = 2  # frames to both sides over which the posteriors of the frame itself are smoothed
ACOUSTIC_AXES, POSTERIOR_AXES, INPUT_AXES = 150, 80, 400
"""Greatest number of principal axes: of the acoustic context, of posteriors, and of both together."""
ACOUSTIC_WEIGHT = 0.1  # scale of the acoustic context beside the posteriors
CONSTANT = 1.0  # the last regression input
SHARED_RIDGE = 1e-4  # strength of the ridge towards 0, a frame
OWN_RIDGE = 5.0  # strength of the ridges towards the regression of the viseme, and towards that of all
MIN_WEIGHT = 0.01  # a regression with less weight in a frame is left out there
MIN_FRAMES = 20.0  # the variance of all states counts as so many frames in that of each


@dataclass(frozen=True, eq=False)
class RegressionInputs:
    """The map from acoustic features and posteriors around a frame to F regression inputs.

    posterior_basis : principal axes of the posteriors of the first chain's N states, as columns [shape=(N, R)], float32
    mean, basis     : of both together [shapes=(F',), (F', F)], float32
    """

    acoustic: AcousticContext
    posterior_basis: Single
    mean: Single
    basis: Single

    def __call__(self, features: Single, posterior: Single) -> Single:
        """Return the regression inputs [shape=(T, F + 1)], constant last, of features and posteriors [shape=(T, N)]."""
        return self._projected(_context(self.acoustic, features, posterior @ self.posterior_basis))

    def observed_frames(self, utterance: RegressionUtterance) -> Single:
        """Return the regression inputs of the frames of an utterance whose motion was observed [shape=(T', F + 1)]."""
        context = _context(self.acoustic, utterance.features, utterance.reduced_posteriors)
        return self._projected(context[utterance.observed])

    def _projected(self, context: Single) -> Single:
        projected = (context - self.mean) @ self.basis
        return np.concatenate([projected, np.full((len(projected), 1), CONSTANT, np.float32)], axis=1)


@dataclass(frozen=True, eq=False)
class VisualRegression:
    """The regression of the means of one visual stream, in its standardised units.

    regression_of_state : which of the E regressions each state of the stream's chain uses [shape=(N_v,)]
    coefficients        : float32 array [shape=(E, F + 1, D)]
    variances           : of each state, around the regressed means, float32 array [shape=(N_v, D)]
    """

    regression_of_state: NDArray[np.intp]
    coefficients: Single
    variances: Single

    def means(self, inputs: Single, posterior: Single) -> Array:
        """Return the expected means [shape=(T, D)] for regression inputs and posteriors [shape=(T, N_v)]."""
        weights = weigh_regressions(posterior, self.regression_of_state, len(self.coefficients))
        means = np.zeros((len(inputs), self.coefficients.shape[2]))
        for weight, matrix in zip(weights.T, self.coefficients, strict=True):
            rows = np.flatnonzero(weight > 0)
            means[rows] += weight[rows, None] * (inputs[rows] @ matrix)
        return means

    def precisions(self, posterior: Single) -> Array:
        """Return the expected precisions of all frames [shape=(T, D)]; ``posterior`` as in ``means``."""
        return (posterior @ (1 / self.variances)).astype(float)


def weigh_regressions(posterior: Single, regression_of_state: NDArray[np.intp], count: int) -> Single:
    """Return the weight of each regression [shape=(T, count)], rows summing to 1, by posteriors of states."""
    weight = posterior @ np.eye(count, dtype=np.float32)[regression_of_state]
    weight[weight < MIN_WEIGHT] = 0
    return weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-9)


@dataclass(frozen=True, eq=False)
class RegressionUtterance:
    """What the regressions are learned from, for one utterance.

    features           : acoustic features [shape=(T, 39)]
    reduced_posteriors : posteriors of the first chain along their principal axes [shape=(T, R)]
    chain_posteriors   : for each visual stream, the posteriors of the states of its chain [each shape=(T, N_v)]
    targets            : the visual streams [each shape=(T, D)]
    observed           : the frames in which the visual streams were observed [shape=(T,)]
    """

    features: Single
    reduced_posteriors: Single
    chain_posteriors: Sequence[Single]
    targets: Sequence[Single]
    observed: NDArray[np.bool_]


def fit_axes(posteriors: Iterable[Single]) -> Single:
    """Return the principal axes of posteriors as columns [shape=(N, R)]."""
    total = sum((posterior.T @ posterior).astype(float) for posterior in posteriors)
    return _find_principal_axes(np.asarray(total), POSTERIOR_AXES)


def fit_regression_inputs(posterior_basis: Single, utterances: Sequence[RegressionUtterance]) -> RegressionInputs:
    """Return regression inputs along the principal axes of some utterances, with the basis of ``fit_axes``."""
    acoustic = fit_acoustic_context((utterance.features for utterance in utterances), ACOUSTIC_AXES)
    contexts = (_context(acoustic, each.features, each.reduced_posteriors) for each in utterances)
    mean, covariance = measure_covariance(contexts)
    basis = _find_principal_axes(covariance, INPUT_AXES)
    return RegressionInputs(acoustic, posterior_basis, mean.astype(np.float32), basis)


def fit_visual_regression(
    inputs: RegressionInputs,
    utterances: Sequence[RegressionUtterance],
    stream: int,
    regression_of_state: NDArray[np.intp],
    family: NDArray[np.intp],
) -> VisualRegression:
    """Return the regressions of the means of a visual stream, by ridge regression towards those of their families.

    regression_of_state : the regression of each state of its chain [shape=(N_v,)]
    family              : the family of each regression [shape=(E,)]; that of a family has a ridge towards that of all
    """
    outputs, size, count = utterances[0].targets[stream].shape[1], inputs.basis.shape[1] + 1, len(family)
    statistics = [create_statistics(size, outputs) for _ in range(count)]
    for utterance in utterances:
        z = inputs.observed_frames(utterance)
        weights = weigh_regressions(utterance.chain_posteriors[stream], regression_of_state, count)[utterance.observed]
        target = utterance.targets[stream][utterance.observed]
        for number, weight in enumerate(weights.T):
            rows = np.flatnonzero(weight)
            root = np.sqrt(weight[rows, None])
            statistics[number].add(z[rows] * root, target[rows] * root)
    total = sum(statistics[1:], statistics[0])
    frames = sum(int(utterance.observed.sum()) for utterance in utterances)
    shared = ridge(total, np.zeros_like(total.targets), SHARED_RIDGE * frames)
    families = [
        ridge(sum(members[1:], members[0]), shared, OWN_RIDGE)
        for members in ([statistics[i] for i in np.flatnonzero(family == f)] for f in range(int(family.max()) + 1))
    ]
    pairs = zip(statistics, family.tolist(), strict=True)
    coefficients = np.array([ridge(own, families[f], OWN_RIDGE) for own, f in pairs], np.float32)
    squares, counts = np.zeros((len(regression_of_state), outputs)), np.zeros(len(regression_of_state))
    regression = VisualRegression(regression_of_state, coefficients, np.ones(squares.shape, np.float32))
    for utterance in utterances:  # the variances around the regressed means
        posterior = utterance.chain_posteriors[stream][utterance.observed]
        means = regression.means(inputs.observed_frames(utterance), posterior)
        error = utterance.targets[stream][utterance.observed] - means
        squares += posterior.T @ np.square(error)
        counts += posterior.sum(axis=0)
    overall = squares.sum(axis=0) / counts.sum()
    variances = (squares + MIN_FRAMES * overall) / (counts + MIN_FRAMES)[:, None]
    return replace(regression, variances=np.maximum(variances, 1e-6).astype(np.float32))


def _find_principal_axes(covariance: Array, size: int) -> Single:
    return np.ascontiguousarray(find_principal_axes(covariance, size).T.astype(np.float32))


def _context(acoustic: AcousticContext, features: Single, reduced_posteriors: Single) -> Single:
    """Return the acoustic context and the smoothed posteriors at ``OFFSETS`` of all frames, side by side."""
    scale = ACOUSTIC_WEIGHT / float(np.linalg.norm(acoustic.basis[:, 0]))
    frames = np.arange(len(reduced_posteriors))
    windows = []
    for offset in OFFSETS:
        reach = REACH + abs(offset) // 5
        window = np.hanning(2 * reach + 3)[1:-1]
        padded = np.pad(reduced_posteriors, ((reach, reach), (0, 0)), mode="edge")
        smoothed = np.zeros_like(reduced_posteriors)
        for shift, share in enumerate((window / window.sum()).astype(np.float32)):
            smoothed += share * padded[shift : shift + len(frames)]
        windows.append(smoothed[np.clip(frames + offset, 0, len(frames) - 1)])
    return np.concatenate([acoustic(features, slice(None)) * np.float32(scale), *windows], axis=1)
