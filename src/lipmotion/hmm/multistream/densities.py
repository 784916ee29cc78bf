"""The tied densities of one stream: mixtures of Gaussians, and a point mass where frames may be without a value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.multistream.streams import ObservedStream
from lipmotion.stats.mixture import LOG_2PI, Mixtures, QuadraticForm

MIN_FRAMES = 2.0
"""A Gaussian with less data, in frames, is not re-estimated."""
SPLIT_FRAMES = 40.0
"""A Gaussian with less data, in frames, is not split."""
MIN_VOICED_PROBABILITY = 1e-3
"""Smallest probability of a frame being voiced, and of its being unvoiced."""
MIN_POSTERIOR = np.float32(1e-10)
"""Smaller posteriors are set to 0; so none is denormal, which would be slow."""
MIN_SCALE = 1e-6
"""Smallest standard deviation of a scale: a dimension that varies less is constant."""

Floats = NDArray[np.float32]
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StreamScale:
    """Mean and standard deviation of a stream's dimensions [shape=(D,)], which standardise its values."""

    mean: Array
    deviation: Array

    def standardise(self, stream: ObservedStream) -> Floats:
        """Return the frames of a stream in the form that its densities take [shape=(T, 2 + 2·D)]."""
        values = (stream.values - self.mean) / self.deviation
        known = stream.known[:, None]
        ones = np.ones((len(values), 1))
        return np.concatenate([ones, known, values * known, values * values * known], axis=1).astype(np.float32)

    @property
    def log_determinant(self) -> float:
        """Log-determinant of the scale: log density of a standardised value minus that of the value itself."""
        return float(np.log(self.deviation).sum())


@dataclass(frozen=True, eq=False)
class GaussianStatistics:
    """Sufficient statistics of frames for G densities of M Gaussians each.

    frames  : [shape=(G,)], sums of posteriors over all frames
    moments : [shape=(G, M, 1 + 2·D)], over the frames with a value, sums of posteriors, and of values and of squared
              values weighted by them
    """

    frames: Array
    moments: Array

    @classmethod
    def zeros(cls, densities: int, components: int, dimensions: int) -> GaussianStatistics:
        """Return the statistics of no frames."""
        return cls(np.zeros(densities), np.zeros((densities, components, 1 + 2 * dimensions)))

    def add(self, densities: NDArray[np.intp], rows: Array) -> None:
        """Accumulate statistics of single Gaussians: weighted sums of standardised frames [shape=(N, 2 + 2·D)]."""
        self.frames[densities] += rows[:, 0]
        self.moments[densities, 0] += rows[:, 1:]

    def pool(self, groups: NDArray[np.intp], count: int) -> GaussianStatistics:
        """Return the statistics of ``count`` groups of densities; ``groups`` is the group of each [shape=(G,)]."""
        pooled = GaussianStatistics.zeros(count, self.moments.shape[1], self.moments.shape[2] // 2)
        np.add.at(pooled.frames, groups, self.frames)
        np.add.at(pooled.moments, groups, self.moments)
        return pooled


@dataclass(frozen=True, eq=False)
class TiedDensities:
    """G densities of one stream.

    mixtures : of standardised values
    voiced   : [shape=(G,)], the probability that a frame has a value; None: a frame without one has log density 0
    Source: Tokuda, Masuko, Miyazaki & Kobayashi 1999 (multi-space distributions), with one space of D dimensions and
    one of none.
    """

    mixtures: Mixtures
    voiced: Array | None

    def log_density(self, rows: Floats, leaves: NDArray[np.intp], log_determinant: float = 0.0) -> Floats:
        """Return the log density of every frame under some of the densities [shape=(T, len(leaves))].

        log_determinant : of the scale: then densities are those of values before they were standardised
        """
        if self.mixtures.size[1] == 1:
            values = rows @ self._linear[leaves].T
            values -= np.float32(log_determinant) * rows[:, 1:2]
            return values
        used, local = np.unique(leaves, return_inverse=True)
        form = self._all_mixtures if len(used) == self.mixtures.size[0] else self.mixtures.quadratic(used)
        values = form.log_likelihood(self.values(rows)) - np.float32(log_determinant)
        values *= rows[:, 1:2]
        values += rows[:, :2] @ self._linear[used].T
        return values[:, local]

    def values(self, rows: Floats) -> Floats:
        """Return the standardised values of frames, 0 where there is none [shape=(T, D)]."""
        return rows[:, 2 : 2 + self.mixtures.size[2]]

    @cached_property
    def _all_mixtures(self) -> QuadraticForm:
        return self.mixtures.quadratic()

    @cached_property
    def _linear(self) -> Floats:
        """Coefficients of the columns of rows in the log density [shape=(G, 2 + 2·D)]; of mixtures, the first two."""
        constant = np.zeros((self.mixtures.size[0], 2))
        if self.voiced is not None:
            constant[:, 0] = np.log1p(-self.voiced)
            constant[:, 1] = np.log(self.voiced) - constant[:, 0]
        if self.mixtures.size[1] > 1:
            return constant.astype(np.float32)
        means, variances = (array[:, 0].astype(float) for array in (self.mixtures.means, self.mixtures.variances))
        constant[:, 1] -= 0.5 * (LOG_2PI + np.log(variances) + means * means / variances).sum(axis=1)
        return np.concatenate([constant, means / variances, -0.5 / variances], axis=1).astype(np.float32)

    def accumulate_components(
        self, statistics: GaussianStatistics, rows: Floats, leaves: NDArray[np.intp], posteriors: Floats
    ) -> None:
        """Accumulate, in place, the statistics of frames for all Gaussians of mixtures.

        rows       : [shape=(N, 2 + 2·D)], one for each pair of a frame and a leaf
        leaves     : [shape=(N,)], the leaf of each pair
        posteriors : [shape=(N,)], of the leaf in the frame
        """
        order = np.argsort(leaves, kind="stable")
        visited, starts = np.unique(leaves[order], return_index=True)
        for leaf, pairs in zip(visited.tolist(), np.split(order, starts[1:]), strict=True):
            x, known = rows[pairs], posteriors[pairs] * rows[pairs, 1]
            components = self.mixtures.responsibilities(leaf, self.values(x), known)
            statistics.moments[leaf] += components.T @ x[:, 1:]
            statistics.frames[leaf] += (known if self.voiced is None else posteriors[pairs]).sum()

    def reestimate(self, statistics: GaussianStatistics, floor: float) -> TiedDensities:
        """Return the densities of an M-step; Gaussians with less than ``MIN_FRAMES`` stay, so the likelihood never
        falls.
        """
        count, first, second = np.split(statistics.moments, [1, 1 + self.mixtures.size[2]], axis=2)
        enough = count >= MIN_FRAMES
        safe = np.maximum(count, MIN_FRAMES)
        mean = first / safe
        variance = np.maximum(second / safe - mean * mean, floor)
        total = count.sum(axis=1)
        with np.errstate(divide="ignore"):
            log_weights = np.log(count[:, :, 0] / np.maximum(total, 1e-30))
        mixtures = Mixtures(
            np.where(total >= MIN_FRAMES, log_weights, self.mixtures.log_weights).astype(np.float32),
            np.where(enough, mean, self.mixtures.means).astype(np.float32),
            np.where(enough, variance, self.mixtures.variances).astype(np.float32),
        )
        if self.voiced is None:
            return replace(self, mixtures=mixtures)
        frames = statistics.frames
        voiced = np.clip(total[:, 0] / np.maximum(frames, 1e-30), MIN_VOICED_PROBABILITY, 1 - MIN_VOICED_PROBABILITY)
        return TiedDensities(mixtures, np.where(frames >= MIN_FRAMES, voiced, self.voiced))

    def can_split(self, statistics: GaussianStatistics) -> bool:
        """Return whether any Gaussian has enough data to be split."""
        return bool((statistics.moments[:, :, 0] >= SPLIT_FRAMES).any())

    def split(self, statistics: GaussianStatistics) -> TiedDensities:
        """Return mixtures of up to twice as many Gaussians; those with too little data are not split."""
        halves, M = self.mixtures.split(), self.mixtures.size[1]
        log_weights, means = halves.log_weights, halves.means
        unsplit = statistics.moments[:, :, 0] < SPLIT_FRAMES
        log_weights[:, :M] = np.where(unsplit, self.mixtures.log_weights, log_weights[:, :M])
        log_weights[:, M:] = np.where(unsplit, -np.inf, log_weights[:, M:])
        means[:, :M] = np.where(unsplit[:, :, None], self.mixtures.means, means[:, :M])
        order = np.argsort(-log_weights, axis=1, kind="stable")  # those of weight 0 last, and not where all are
        order = order[:, : np.isfinite(log_weights).sum(axis=1).max()]
        means, variances = (np.take_along_axis(a, order[:, :, None], axis=1) for a in (means, halves.variances))
        return replace(self, mixtures=Mixtures(np.take_along_axis(log_weights, order, axis=1), means, variances))


def make_standard_normals(densities: int, dimensions: int, has_spaces: bool, voiced: float = 0.5) -> TiedDensities:
    """Return equal densities of mean 0 and variance 1, those of the whole standardised stream."""
    shape = (densities, 1, dimensions)
    mixtures = Mixtures(np.zeros((densities, 1), np.float32), np.zeros(shape, np.float32), np.ones(shape, np.float32))
    share = float(np.clip(voiced, MIN_VOICED_PROBABILITY, 1 - MIN_VOICED_PROBABILITY))
    return TiedDensities(mixtures, np.full(densities, share) if has_spaces else None)


def fit_scale(streams: list[ObservedStream]) -> tuple[StreamScale, float]:
    """Return the scale of a stream over all utterances, and the share of its frames that have a value."""
    known = np.concatenate([stream.values[stream.known] for stream in streams]).astype(float)
    dimensions = known.shape[1]
    if not len(known):
        return StreamScale(np.zeros(dimensions), np.ones(dimensions)), 0.0
    scale = StreamScale(known.mean(axis=0), np.maximum(known.std(axis=0), MIN_SCALE))
    return scale, len(known) / sum(len(stream.known) for stream in streams)
