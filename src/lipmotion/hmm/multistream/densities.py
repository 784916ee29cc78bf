"""Streams of data, and the tied densities of one: mixtures of Gaussians, a point mass for frames without a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.curves import mark_known_dynamics, with_dynamics
from lipmotion.stats.mixture import LOG_2PI, Mixtures, QuadraticForm

SPEECH, MOTION = "speech", "motion"
F0_STREAMS = ("f0", "f0_slope", "f0_curvature")
STREAMS = (SPEECH, *F0_STREAMS, MOTION)
ACOUSTIC_STREAMS = (SPEECH, *F0_STREAMS)


@dataclass(frozen=True)
class StreamWeights:
    """Factors of the streams' log densities; 0: off."""

    speech: float = 1.0
    f0: float = 1.0
    f0_slope: float = 1.0
    f0_curvature: float = 1.0
    motion: float = 1.0

    @property
    def active(self) -> dict[str, float]:
        """The streams whose weight is not 0, and their weights."""
        return {name: weight for name, weight in vars(self).items() if weight}


@dataclass(frozen=True, eq=False)
class ObservedStream:
    """One kind of data of an utterance [shape=(T, D)], and which frames have a value, or are voiced [shape=(T,)]."""

    values: NDArray[np.floating[Any]]
    known: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class StreamObservations:
    """The streams of an utterance, by name. Recordings without a face have no motion, or motion that is nowhere known.

    Raises InputError: no speech, an unknown stream, streams of different lengths, or known values that are not finite.
    """

    streams: Mapping[str, ObservedStream]

    def __post_init__(self) -> None:
        if SPEECH not in self.streams or not set(self.streams) <= set(STREAMS):
            raise InputError(f"streams {', '.join(self.streams)}; required speech, and others of {', '.join(STREAMS)}")
        for name, stream in self.streams.items():
            if stream.values.ndim != 2 or stream.known.shape != (self.frames,) or len(stream.values) != self.frames:
                raise InputError(
                    f"the stream {name} has values of shape {stream.values.shape} and a mask of {stream.known.shape}; "
                    f"required ({self.frames}, D) and ({self.frames},), as many frames as speech"
                )
            if not np.isfinite(stream.values).all():
                raise InputError(f"the stream {name} holds values that are not finite; mark them as not known")

    @property
    def frames(self) -> int:
        """The number of frames, T."""
        return len(self.streams[SPEECH].values)


def stream_observations(
    speech: NDArray[np.floating[Any]],
    log_f0: NDArray[np.floating[Any]] | None = None,
    motion: NDArray[np.floating[Any]] | None = None,
    measured: NDArray[np.bool_] | None = None,
) -> StreamObservations:
    """Return the streams of an utterance.

    speech : features [shape=(T, 39)]
    log_f0 : natural logarithm of F0 in Hz, NaN where there is no voice [shape=(T,)]
    motion : static values [shape=(T, Q)]; their Δ and Δ² are computed here
    measured : where motion was measured [shape=(T,)]; None: everywhere
    F0 becomes three streams: static values, Δ and Δ², each known where its whole window is voiced. Motion is one, of
    static values, Δ and Δ² side by side, known where all three are.
    Source: Hofer 2008, §4; the windows of F0 as for motion.
    Raises InputError: as ``StreamObservations``; motion of another shape, or a mask that is not that of the frames.
    """
    speech = np.asarray(speech)
    streams = {SPEECH: ObservedStream(speech, np.ones(len(speech), bool))}
    if log_f0 is not None:
        pitch: NDArray[np.float64] = np.asarray(log_f0, np.float64)
        voiced = np.isfinite(pitch)
        dynamics = with_dynamics(np.where(voiced, pitch, 0.0)[:, None])
        masks = (voiced, *[mark_known_dynamics(voiced)] * 2)
        for window, (name, mask) in enumerate(zip(F0_STREAMS, masks, strict=True)):
            streams[name] = ObservedStream(np.where(mask[:, None], dynamics[:, window], 0.0), mask)
    if motion is not None:
        values: NDArray[np.float64] = np.asarray(motion, np.float64)
        seen = np.ones(len(values), bool) if measured is None else np.asarray(measured)
        if values.ndim != 2 or seen.shape != values.shape[:1]:
            raise InputError(f"motion has shape {values.shape}, its mask {seen.shape}; required (T, Q) and (T,)")
        known = mark_known_dynamics(np.asarray(seen, bool))
        dynamics = with_dynamics(np.where(seen[:, None], values, 0.0)).reshape(len(values), -1)
        streams[MOTION] = ObservedStream(np.where(known[:, None], dynamics, 0.0), known)
    return StreamObservations(streams)


MIN_FRAMES = 2.0  # a Gaussian with less data, in frames, is not re-estimated
SPLIT_FRAMES = 40.0  # a Gaussian with less data, in frames, is not split
MIN_VOICED_PROBABILITY = 1e-3  # smallest probability of a frame being voiced, and of its being unvoiced
MIN_POSTERIOR = np.float32(1e-10)  # smaller posteriors are set to 0; so none is denormal, which would be slow
MIN_SCALE = 1e-6  # smallest standard deviation of a scale: a dimension that varies less is constant

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
    moments : [shape=(G, M, 1 + 2·D)], over frames with a value, sums of posteriors, and of values and squares by them
    """

    frames: Array
    moments: Array

    @classmethod
    def zeros(cls, densities: int, components: int, dimensions: int) -> GaussianStatistics:
        """Return the statistics of no frames."""
        return cls(np.zeros(densities), np.zeros((densities, components, 1 + 2 * dimensions)))

    def add(self, densities: NDArray[np.intp], rows: Array) -> None:
        """Accumulate statistics of single Gaussians: weighted sums of standardised frames [shape=(N, 2 + 2·D)]."""
        visited, group = np.unique(densities, return_inverse=True)
        sums = (np.arange(len(visited))[:, None] == group).astype(float) @ rows  # in half the time of np.add.at
        self.frames[visited] += sums[:, 0]
        self.moments[visited, 0] += sums[:, 1:]


@dataclass(frozen=True, eq=False)
class TiedDensities:
    """G densities of one stream.

    mixtures : of standardised values
    voiced   : [shape=(G,)], the probability that a frame has a value; None: a frame without one has log density 0
    Source: Tokuda, Masuko, Miyazaki & Kobayashi 1999 (multi-space distributions): spaces of D dimensions and of none.
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
        """Return the densities of an M-step; Gaussians of under ``MIN_FRAMES`` stay, so the likelihood never falls."""
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
