"""The tied densities of one stream: mixtures of Gaussians, with or without a point mass for frames without a value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.multistream.streams import Stream
from lipmotion.stats.mixture import LOG_2PI, Mixtures

LEAST_FRAMES = 2.0
"""A Gaussian with less data than so many frames stays as it is."""
SPLIT_FRAMES = 40.0
"""A Gaussian with less is not split."""
LEAST_VOICED = 1e-3
"""No frame is voiced, or unvoiced, with less than this probability."""
LEAST_SHARE = np.float32(1e-10)
"""Posteriors under this are nothing; also, none is denormal, which is slow."""
LEAST_SCALE = 1e-6
"""Dimensions that move less than this do not move."""

Floats = NDArray[np.float32]
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scale:
    """The mean and standard deviation of a stream's dimensions: inside, everything is counted from and in these.

    mean, deviation : [shape=(D,)]
    """

    mean: Array
    deviation: Array

    def inside(self, stream: Stream) -> Floats:
        """Return a stream as its densities take it [shape=(T, 2 + 2·D)], a row a frame.

        Each is 1 and, where the frame has a value, 1, the value in this scale and its square, else all 0.
        """
        values = (stream.values - self.mean) / self.deviation
        known = stream.known[:, None]
        ones = np.ones((len(values), 1))
        return np.concatenate([ones, known, values * known, values * values * known], axis=1).astype(np.float32)

    @property
    def log_volume(self) -> float:
        """What densities inside are more than outside, as a logarithm."""
        return float(np.log(self.deviation).sum())


@dataclass(frozen=True, eq=False)
class Sums:
    """What frames say about densities.

    frames : [shape=(G,)], those without a value included
    sums   : [shape=(G, M, 1 + 2·D)], of posteriors, values and squares, in frames with a value
    """

    frames: Array
    sums: Array

    @classmethod
    def none(cls, densities: int, components: int, dimensions: int) -> Sums:
        """Return what nothing says."""
        return cls(np.zeros(densities), np.zeros((densities, components, 1 + 2 * dimensions)))

    def add(self, densities: NDArray[np.intp], rows: Array) -> None:
        """Add, in place, sums of posteriors and rows [shape=(len(densities), 2 + 2·D)] to single Gaussians.

        Each density is named once.
        """
        self.frames[densities] += rows[:, 0]
        self.sums[densities, 0] += rows[:, 1:]

    def of_groups(self, groups: NDArray[np.intp], count: int) -> Sums:
        """Return what the frames say about groups of densities: ``groups`` [shape=(G,)] says which each is in."""
        joined = Sums.none(count, self.sums.shape[1], self.sums.shape[2] // 2)
        np.add.at(joined.frames, groups, self.frames)
        np.add.at(joined.sums, groups, self.sums)
        return joined


@dataclass(frozen=True, eq=False)
class Tied:
    """G densities.

    mixtures : of what is known, in the stream's own scale
    voiced   : [shape=(G,)], the probability that a frame has a value; None: a frame without one says nothing
    Source: Tokuda, Masuko, Miyazaki & Kobayashi 1999 (multi-space distributions), with one space of D dimensions and
    one of none.
    """

    mixtures: Mixtures
    voiced: Array | None

    def log_density(self, rows: Floats, leaves: NDArray[np.intp], log_volume: float = 0.0) -> Floats:
        """Return the log density of every frame under some of the densities [shape=(T, len(leaves))].

        rows       : from ``Scale.inside``
        log_volume : of the scale, so that densities are those of the values as they were observed
        """
        if self.mixtures.size[1] == 1:
            values = rows @ self._linear[leaves].T
            values -= np.float32(log_volume) * rows[:, 1:2]
            return values
        used, local = np.unique(leaves, return_inverse=True)
        values = self.mixtures.log_likelihood(self.values(rows), used) - np.float32(log_volume)
        values *= rows[:, 1:2]
        values += rows[:, :2] @ self._linear[used].T
        return values[:, local]

    def values(self, rows: Floats) -> Floats:
        """Return the values of frames, in the stream's own scale, 0 where there is none [shape=(T, D)]."""
        return rows[:, 2 : 2 + self.mixtures.size[2]]

    @cached_property
    def _linear(self) -> Floats:
        """What rows are multiplied by in the log density [shape=(G, 2 + 2·D)]; of mixtures, the first two."""
        constant = np.zeros((self.mixtures.size[0], 2))
        if self.voiced is not None:
            constant[:, 0] = np.log1p(-self.voiced)
            constant[:, 1] = np.log(self.voiced) - constant[:, 0]
        if self.mixtures.size[1] > 1:
            return constant.astype(np.float32)
        means, variances = (array[:, 0].astype(float) for array in (self.mixtures.means, self.mixtures.variances))
        constant[:, 1] -= 0.5 * (LOG_2PI + np.log(variances) + means * means / variances).sum(axis=1)
        return np.concatenate([constant, means / variances, -0.5 / variances], axis=1).astype(np.float32)

    def add_components(self, sums: Sums, rows: Floats, leaves: NDArray[np.intp], shares: Floats) -> None:
        """Add, in place, what frames say about the Gaussians of mixtures.

        rows   : of frames [shape=(N, 2 + 2·D)]; one may stand there more than once
        leaves : the density that each has a share in [shape=(N,)];  shares : how much [shape=(N,)]
        """
        order = np.argsort(leaves, kind="stable")
        visited, starts = np.unique(leaves[order], return_index=True)
        for leaf, mine in zip(visited.tolist(), np.split(order, starts[1:]), strict=True):
            x, known = rows[mine], shares[mine] * rows[mine, 1]
            components = self.mixtures.responsibilities(leaf, self.values(x), known)
            sums.sums[leaf] += components.T @ x[:, 1:]
            sums.frames[leaf] += (known if self.voiced is None else shares[mine]).sum()

    def maximised(self, sums: Sums, floor: float) -> Tied:
        """Return the densities that explain the sums best (the M-step).

        floor : least variance, in the stream's own scale
        What has too little data stays as it is, so the likelihood never falls.
        """
        count, first, second = np.split(sums.sums, [1, 1 + self.mixtures.size[2]], axis=2)
        alive = count >= LEAST_FRAMES
        safe = np.maximum(count, LEAST_FRAMES)
        mean = first / safe
        variance = np.maximum(second / safe - mean * mean, floor)
        total = count.sum(axis=1)
        with np.errstate(divide="ignore"):
            log_weights = np.log(count[:, :, 0] / np.maximum(total, 1e-30))
        mixtures = Mixtures(
            np.where(total >= LEAST_FRAMES, log_weights, self.mixtures.log_weights).astype(np.float32),
            np.where(alive, mean, self.mixtures.means).astype(np.float32),
            np.where(alive, variance, self.mixtures.variances).astype(np.float32),
        )
        if self.voiced is None:
            return replace(self, mixtures=mixtures)
        voiced = np.clip(total[:, 0] / np.maximum(sums.frames, 1e-30), LEAST_VOICED, 1 - LEAST_VOICED)
        return Tied(mixtures, np.where(sums.frames >= LEAST_FRAMES, voiced, self.voiced))

    def splits(self, sums: Sums) -> bool:
        """Return whether any Gaussian has enough data to be split."""
        return bool((sums.sums[:, :, 0] >= SPLIT_FRAMES).any())

    def split(self, sums: Sums) -> Tied:
        """Return mixtures of up to twice as many Gaussians; those with too little data are not split."""
        once, twice, M = self.mixtures, self.mixtures.split(), self.mixtures.size[1]
        whole = sums.sums[:, :, 0] < SPLIT_FRAMES
        twice.log_weights[:, :M] = np.where(whole, once.log_weights, twice.log_weights[:, :M])
        twice.log_weights[:, M:] = np.where(whole, -np.inf, twice.log_weights[:, M:])
        twice.means[:, :M] = np.where(whole[:, :, None], once.means, twice.means[:, :M])
        return replace(self, mixtures=_compact(twice))


def _compact(mixtures: Mixtures) -> Mixtures:
    """Return the same mixtures, Gaussians without weight last, and no more places for Gaussians than are used."""
    order = np.argsort(-mixtures.log_weights, axis=1, kind="stable")
    order = order[:, : np.isfinite(mixtures.log_weights).sum(axis=1).max()]
    means, variances = (np.take_along_axis(a, order[:, :, None], axis=1) for a in (mixtures.means, mixtures.variances))
    return Mixtures(np.take_along_axis(mixtures.log_weights, order, axis=1), means, variances)


def standard(densities: int, dimensions: int, has_spaces: bool, voiced: float = 0.5) -> Tied:
    """Return densities that are all as the whole stream is: mean 0, variance 1."""
    shape = (densities, 1, dimensions)
    mixtures = Mixtures(np.zeros((densities, 1), np.float32), np.zeros(shape, np.float32), np.ones(shape, np.float32))
    share = float(np.clip(voiced, LEAST_VOICED, 1 - LEAST_VOICED))
    return Tied(mixtures, np.full(densities, share) if has_spaces else None)


def fit_scale(streams: list[Stream]) -> tuple[Scale, float]:
    """Return the scale of a stream over all utterances, and the share of its frames that have a value."""
    known = np.concatenate([stream.values[stream.known] for stream in streams]).astype(float)
    dimensions = known.shape[1]
    if not len(known):
        return Scale(np.zeros(dimensions), np.ones(dimensions)), 0.0
    scale = Scale(known.mean(axis=0), np.maximum(known.std(axis=0), LEAST_SCALE))
    return scale, len(known) / sum(len(stream.known) for stream in streams)
