"""Visual densities whose means follow what is heard, and what the chains believe, around the frame.

The visual chain of the paper has one mean a state, which says nothing of the neighbours: lips in a k are those of its
vowels. Here the mean of a state is linear in the sound around the frame and in the posteriors of the first chain around
it: a soft context, for no phone need be decided. Each state of each viseme has a regression, drawn towards that of the
viseme, and this towards that of all; the visual chain's posteriors weigh them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError
from lipmotion.motion.context_window import AcousticContext, fit_acoustic_context
from lipmotion.stats.regression import ridge, zero_statistics

Array = NDArray[np.float64]
Single = NDArray[np.float32]
OFFSETS = (-28, -20, -14, -9, -5, -2, 0, 2, 5, 9, 14, 20, 28)
"""Frames whose posteriors count, relative to the one that is wanted; the farther, the more smoothed."""
REACH = 2
SOUND_AXES, BELIEF_AXES, AXES = 150, 80, 400
SOUND_WEIGHT = 0.1
CONSTANT = 1.0
SHARED_RIDGE = 1e-4
"""Of the frames."""
OWN_RIDGE = 5.0
LEAST_GATE = 0.01
LEAST_FRAMES = 20.0


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is heard and believed around a frame, in F numbers.

    sound  : the audio window
    belief : float32 array [shape=(N, R)], the axes of posteriors of the first chain's N states
    mean, basis : of both together [shapes=(F',), (F', F)], float32
    """

    sound: AcousticContext
    belief: Single
    mean: Single
    basis: Single

    def __call__(self, features: Single, posterior: Single) -> Single:
        """Return the numbers of all frames, and a constant [shape=(T, F + 1)].

        features  : [shape=(T, 39)];  posterior : of the first chain's states [shape=(T, N)]
        """
        inputs = _inputs(self.sound, features, posterior @ self.belief)
        projected = (inputs - self.mean) @ self.basis
        return np.concatenate([projected, np.full((len(projected), 1), CONSTANT, np.float32)], axis=1)


@dataclass(frozen=True, eq=False)
class Following:
    """How one visual stream follows its surroundings, in its standardised units.

    kind         : the regression of each state of the stream's chain [shape=(N_v,)]
    coefficients : float32 array [shape=(E, F + 1, D)]
    variances    : float32 array [shape=(N_v, D)], around the means
    """

    kind: NDArray[np.intp]
    coefficients: Single
    variances: Single

    def means(self, around: Single, gate: Single) -> Array:
        """Return the expected means [shape=(T, D)].

        around : from ``Surroundings`` [shape=(T, F + 1)]
        gate   : posteriors of the chain's states [shape=(T, N_v)]
        """
        weight = gates(gate, self.kind, len(self.coefficients))
        means = np.zeros((len(around), self.coefficients.shape[2]))
        for one, matrix in zip(weight.T, self.coefficients, strict=True):
            rows = np.flatnonzero(one > 0)
            means[rows] += one[rows, None] * (around[rows] @ matrix)
        return means

    def precisions(self, gate: Single) -> Array:
        """Return the expected precisions [shape=(T, D)]."""
        return (gate @ (1 / self.variances)).astype(float)


def gates(posterior: Single, kind: NDArray[np.intp], count: int) -> Single:
    """Return how much each regression says in each frame [shape=(T, E)], small shares left out; rows sum to 1."""
    weight = posterior @ np.eye(count, dtype=np.float32)[kind]
    weight[weight < LEAST_GATE] = 0
    return weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-9)


@dataclass(frozen=True, eq=False)
class Heard:
    """What training keeps of a recording.

    features  : [shape=(T, 39)]
    belief    : posteriors of the first chain along its main axes [shape=(T, R)]
    gates     : posteriors of the chain of each visual stream [each shape=(T, N_v)]
    targets   : each visual stream [each shape=(T, D)];  seen : bool array [shape=(T,)]
    """

    features: Single
    belief: Single
    gates: Sequence[Single]
    targets: Sequence[Single]
    seen: NDArray[np.bool_]


def belief_axes(posteriors: Iterable[Single]) -> Single:
    """Return the main axes of posteriors [each shape=(T, N)] as columns [shape=(N, R)]."""
    total: Array | None = None
    for posterior in posteriors:
        products = (posterior.T @ posterior).astype(float)
        total = products if total is None else total + products
    if total is None:
        raise CorpusError("no recording to learn from")
    return _axes(total, BELIEF_AXES)


def fit_surroundings(belief: Single, heard: Sequence[Heard]) -> Surroundings:
    """Return the surroundings of some recordings in few numbers."""
    sound = fit_acoustic_context((one.features for one in heard), SOUND_AXES)
    count, total, products = 0, np.zeros(0), np.zeros(0)
    for one in heard:
        inputs = _inputs(sound, one.features, one.belief).astype(float)
        if not count:
            total, products = np.zeros(inputs.shape[1]), np.zeros((inputs.shape[1],) * 2)
        count += len(inputs)
        total += inputs.sum(axis=0)
        products += inputs.T @ inputs
    mean = total / count
    basis = _axes(products / count - np.outer(mean, mean), AXES)
    return Surroundings(sound, belief, mean.astype(np.float32), basis)


def fit_following(
    around: Surroundings, heard: Sequence[Heard], stream: int, kind: NDArray[np.intp], family: NDArray[np.intp]
) -> Following:
    """Return how a visual stream follows its surroundings.

    kind   : the regression of each state of its chain [shape=(N_v,)]
    family : of each regression [shape=(E,)]; each is drawn towards that of its family, and this towards that of all
    """
    outputs, inputs, count = heard[0].targets[stream].shape[1], around.basis.shape[1] + 1, len(family)
    moments = [zero_statistics(inputs, outputs) for _ in range(count)]
    for one in heard:
        z, weight = _frames(around, one), gates(one.gates[stream], kind, count)[one.seen]
        target = one.targets[stream][one.seen]
        for number, own in enumerate(weight.T):
            rows = np.flatnonzero(own)
            root = np.sqrt(own[rows, None])
            moments[number].add(z[rows] * root, target[rows] * root)
    every = sum(moments[1:], moments[0])
    frames = sum(int(one.seen.sum()) for one in heard)
    shared = ridge(every, np.zeros_like(every.targets), SHARED_RIDGE * frames)
    families = [
        ridge(sum(members[1:], members[0]), shared, OWN_RIDGE)
        for members in ([moments[i] for i in np.flatnonzero(family == f)] for f in range(int(family.max()) + 1))
    ]
    pairs = zip(moments, family.tolist(), strict=True)
    own = np.array([ridge(one, families[f], OWN_RIDGE) for one, f in pairs], np.float32)
    following = Following(kind, own, np.ones((len(kind), outputs), np.float32))
    return Following(kind, own, _variances(following, around, heard, stream))


def _variances(following: Following, around: Surroundings, heard: Sequence[Heard], stream: int) -> Single:
    squares, counts = np.zeros(following.variances.shape), np.zeros(len(following.kind))
    for one in heard:
        gate = one.gates[stream][one.seen]
        error = one.targets[stream][one.seen] - following.means(_frames(around, one), gate)
        squares += gate.T @ np.square(error)
        counts += gate.sum(axis=0)
    overall = squares.sum(axis=0) / counts.sum()
    found = (squares + LEAST_FRAMES * overall) / (counts + LEAST_FRAMES)[:, None]
    return np.maximum(found, 1e-6).astype(np.float32)


def _frames(around: Surroundings, one: Heard) -> Single:
    inputs = _inputs(around.sound, one.features, one.belief)[one.seen]
    projected = (inputs - around.mean) @ around.basis
    return np.concatenate([projected, np.full((len(projected), 1), CONSTANT, np.float32)], axis=1)


def _axes(covariance: Array, size: int) -> Single:
    _, vectors = np.linalg.eigh(covariance)
    basis = vectors[:, ::-1][:, :size]
    signs = np.where(basis[np.abs(basis).argmax(axis=0), np.arange(basis.shape[1])] < 0, -1.0, 1.0)
    return (basis * signs).astype(np.float32)


def _inputs(sound: AcousticContext, features: Single, belief: Single) -> Single:
    """Return what is heard and believed around all frames [shape=(T, F')]."""
    scale = SOUND_WEIGHT / float(np.linalg.norm(sound.basis[:, 0]))
    frames = np.arange(len(belief))
    windows = [
        _smoothed(belief, REACH + abs(offset) // 5)[np.clip(frames + offset, 0, len(frames) - 1)] for offset in OFFSETS
    ]
    return np.concatenate([sound(features, slice(None)) * np.float32(scale), *windows], axis=1)


def _smoothed(values: Single, reach: int) -> Single:
    """Return a moving average with a cosine window of 2·reach + 1 frames; beyond the ends, the first and last go on."""
    window = np.hanning(2 * reach + 3)[1:-1]
    window = (window / window.sum()).astype(np.float32)
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    total = np.zeros_like(values)
    for shift, share in enumerate(window):
        total += share * padded[shift : shift + len(values)]
    return total
