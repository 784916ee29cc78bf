"""Emission densities: Gaussian mixtures of the streams, tied to the states of a chain or to joint states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.mixture import Mixtures, QuadraticForm, normalise_components, with_squares

Index = NDArray[np.intp]
Single = NDArray[np.float32]
MIN_COMPONENT_FRAMES = 0.1  # a component with less data than so many frames keeps its mean and variance


@dataclass(frozen=True, eq=False)
class AudioVisualObservations:
    """Streams of T frames [each shape=(T, D_s)], speech first, and where each was observed [shape=(T,)] (None: all)."""

    streams: tuple[Single, ...]
    observed: tuple[NDArray[np.bool_] | None, ...]

    @property
    def frames(self) -> int:
        """T."""
        return len(self.streams[0])

    def with_visual_streams(
        self, values: Sequence[Single], observed: NDArray[np.bool_] | None = None
    ) -> AudioVisualObservations:
        """Return the speech with other visual streams [each shape=(T, D_s)], observed in some frames [shape=(T,)]."""
        return AudioVisualObservations((self.streams[0], *values), (self.observed[0], *[observed] * len(values)))

    def without_visual_streams(self) -> AudioVisualObservations:
        """Return the observations with all streams but speech marked as not observed."""
        return self.with_visual_streams(self.streams[1:], np.zeros(self.frames, bool))


@dataclass(frozen=True, eq=False)
class StreamGroup:
    """The emission densities of one or more streams that share their mixture components.

    columns  : for each of these streams, its columns among the D dimensions of the mixtures
    mixtures : G densities over all of these streams
    weights  : the exponent of each stream's density
    tie      : the density of each joint state [shape=(S,)]
    """

    streams: tuple[int, ...]
    columns: tuple[slice, ...]
    mixtures: Mixtures
    weights: tuple[float, ...]
    tie: Index

    def stream_mixtures(self, stream: int) -> Mixtures:
        """Return the marginal densities of one of the streams."""
        columns = self.columns[self.streams.index(stream)]
        mixtures = self.mixtures
        return Mixtures(mixtures.log_weights, mixtures.means[:, :, columns], mixtures.variances[:, :, columns])

    @cached_property
    def _forms(self) -> tuple[QuadraticForm, ...]:
        """The densities of each stream as quadratic forms, without component weights."""
        marginals = (self.stream_mixtures(stream) for stream in self.streams)
        return tuple(replace(each, log_weights=np.zeros_like(each.log_weights)).quadratic() for each in marginals)

    def log_densities(self, observations: AudioVisualObservations, densities: Index) -> tuple[Single, Single | None]:
        """Return the log density of every frame under some mixtures [shape=(T, G')], and component responsibilities.

        densities : the numbers of these mixtures [shape=(G',)]
        The responsibilities [shape=(T, M, G')] sum to 1 over the M components; they are None where M is 1.
        A stream that was not observed is left out. This is exact: its density integrates to 1.
        """
        log_weights = self.mixtures.log_weights[densities].T
        total = np.zeros((observations.frames, *log_weights.shape), np.float32)
        for form, stream, exponent in zip(self._forms, self.streams, self.weights, strict=True):
            observed = observations.observed[stream]
            if observed is not None and not observed.any():
                continue
            if not np.array_equal(densities, np.arange(form.constant.shape[1])):
                columns = form.form.reshape(len(form.form), *form.constant.shape)[:, :, densities]
                form = QuadraticForm(columns.reshape(len(columns), -1), form.constant[:, densities])  # noqa: PLW2901
            log = form.log_components(observations.streams[stream])
            if exponent != 1:
                log *= np.float32(exponent)
            if observed is not None:
                log[~observed] = 0
            total += log
        total += log_weights
        return normalise_components(total)


@dataclass(frozen=True, eq=False)
class EmissionStatistics:
    """Sufficient statistics of a stream group; they accumulate in place.

    products  : for each stream, sums of component posteriors times features, features², and 1 [shape=(M, G, 2 D_s + 1)]
    occupancy : sums of component posteriors over all frames, observed or not [shape=(M, G)]
    """

    products: tuple[NDArray[np.float64], ...]
    occupancy: NDArray[np.float64]

    def accumulate(
        self,
        group: StreamGroup,
        observations: AudioVisualObservations,
        densities: Index,
        posterior: Single,
        responsibilities: Single | None,
    ) -> None:
        """Add the statistics of some frames.

        densities        : the densities with posteriors [shape=(G',)]
        posterior        : of these densities [shape=(T, G')]
        responsibilities : of their components [shape=(T, M, G')]; None: one component
        """
        weight = infer_components(posterior, responsibilities)
        flat = weight.reshape(len(weight), -1).T
        for stream, products in zip(group.streams, self.products, strict=True):
            observed = observations.observed[stream]
            if observed is not None and not observed.any():
                continue
            features = with_squares(observations.streams[stream])
            if observed is not None:
                features *= observed[:, None]
            products[:, densities] += (flat @ features).reshape(*weight.shape[1:], -1)
        self.occupancy[:, densities] += weight.sum(axis=0, dtype=np.float64)


def create_emission_statistics(group: StreamGroup) -> EmissionStatistics:
    """Return zero statistics for a stream group."""
    count, components, _ = group.mixtures.size
    widths = [columns.stop - columns.start for columns in group.columns]
    products = tuple(np.zeros((components, count, 2 * width + 1)) for width in widths)
    return EmissionStatistics(products, np.zeros((components, count)))


def infer_components(posterior: Single, responsibilities: Single | None) -> Single:
    """Return γ(q, k) [shape=(T, M, G')], from γ(q) [shape=(T, G')] and responsibilities (None: M is 1)."""
    return posterior[:, None] if responsibilities is None else responsibilities * posterior[:, None]


def reestimate_group(
    group: StreamGroup, sums: EmissionStatistics, floors: Sequence[Single], min_frames: float, streams: Sequence[int]
) -> StreamGroup:
    """Return the group with the mixtures that maximise the expected log likelihood (M-step).

    floors  : the least variance of each stream of the group [each shape=(D_s,)]
    min_frames : densities with less data than so many frames stay as they are
    streams : the streams whose means and variances are re-estimated; those of other streams stay
    """
    mixtures = group.mixtures.copy()
    enough = np.flatnonzero(sums.occupancy.sum(axis=0) >= min_frames)
    occupancy = sums.occupancy.T[enough]
    with np.errstate(divide="ignore"):
        mixtures.log_weights[enough] = np.log(occupancy / occupancy.sum(axis=1, keepdims=True))
    for stream, columns, products, floor in zip(group.streams, group.columns, sums.products, floors, strict=True):
        if stream not in streams:
            continue
        frames = products[:, enough, -1].T[:, :, None]
        first, second = np.split(products[:, enough, :-1].transpose(1, 0, 2), 2, axis=2)
        known = frames > MIN_COMPONENT_FRAMES
        divisor = np.where(known, frames, 1)
        mean = first / divisor
        variance = np.maximum(second / divisor - mean * mean, floor)
        mixtures.means[enough, :, columns] = np.where(known, mean, mixtures.means[enough, :, columns])
        mixtures.variances[enough, :, columns] = np.where(known, variance, mixtures.variances[enough, :, columns])
    return replace(group, mixtures=mixtures)
