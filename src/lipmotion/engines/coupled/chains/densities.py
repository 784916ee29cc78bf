"""What chains emit: mixtures of the streams that a state of theirs, or a joint state, has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.mixture import Mixtures, QuadraticForm, normalised_components, with_squares

Index = NDArray[np.intp]
Single = NDArray[np.float32]
LEAST_COMPONENT_FRAMES = 0.1
"""A component with less data than so many frames keeps its mean and variance."""


@dataclass(frozen=True, eq=False)
class Observed:
    """What is known of some frames.

    streams : values of every stream [each shape=(T, D_s)]
    seen    : whether each stream was observed [each shape=(T,)]; None: everywhere
    """

    streams: tuple[Single, ...]
    seen: tuple[NDArray[np.bool_] | None, ...]

    @property
    def frames(self) -> int:
        """T."""
        return len(self.streams[0])

    def missing(self, stream: int) -> Observed:
        """Return the same with one stream unknown everywhere."""
        return self.given(stream, self.streams[stream], np.zeros(self.frames, bool))

    def given(self, stream: int, values: Single, seen: NDArray[np.bool_] | None = None) -> Observed:
        """Return the same with other values of one stream."""
        streams, masks = list(self.streams), list(self.seen)
        streams[stream], masks[stream] = values, seen
        return Observed(tuple(streams), tuple(masks))


@dataclass(frozen=True, eq=False)
class Group:
    """Streams that share their mixture components, and with them one hidden choice.

    streams  : which they are
    columns  : which numbers of the mixtures' D are each stream's
    mixtures : G densities of all of them together
    weights  : the exponent of each stream's density
    tie      : the density of each joint state [shape=(S,)]
    """

    streams: tuple[int, ...]
    columns: tuple[slice, ...]
    mixtures: Mixtures
    weights: tuple[float, ...]
    tie: Index

    def of_stream(self, stream: int) -> Mixtures:
        """Return the densities of one stream alone."""
        columns = self.columns[self.streams.index(stream)]
        mixtures = self.mixtures
        return Mixtures(mixtures.log_weights, mixtures.means[:, :, columns], mixtures.variances[:, :, columns])

    def ready(self) -> Ready:
        """Return the densities as what features are multiplied by."""
        alone = (self.of_stream(stream) for stream in self.streams)
        forms = [replace(one, log_weights=np.zeros_like(one.log_weights)).quadratic() for one in alone]
        return Ready(self, tuple(forms))


@dataclass(frozen=True, eq=False)
class Ready:
    """A group with the matrices of its streams, without the weights of components."""

    group: Group
    forms: tuple[QuadraticForm, ...]

    def divided(self, observed: Observed, chosen: Index) -> tuple[Single, Single | None]:
        """Return the log density of some mixtures [shape=(T, G')], and their components' shares [shape=(T, M, G')].

        chosen : the densities wanted [shape=(G',)]
        A stream that was not seen is left out, which is exact: its density integrates to 1. Shares are None where
        there is one component.
        """
        return normalised_components(self._components(observed, chosen))

    def _components(self, observed: Observed, chosen: Index) -> Single:
        group = self.group
        priors = group.mixtures.log_weights[chosen].T
        total = np.zeros((observed.frames, *priors.shape), np.float32)
        for form, stream, weight in zip(self.forms, group.streams, group.weights, strict=True):
            seen = observed.seen[stream]
            if seen is not None and not seen.any():
                continue
            log = _among(form, chosen).log_components(observed.streams[stream])
            if weight != 1:
                log *= np.float32(weight)
            if seen is not None:
                log[~seen] = 0
            total += log
        total += priors
        return total


def _among(form: QuadraticForm, chosen: Index) -> QuadraticForm:
    """Return the matrix of some densities."""
    if np.array_equal(chosen, np.arange(form.constant.shape[1])):
        return form
    columns = form.form.reshape(len(form.form), *form.constant.shape)[:, :, chosen]
    return QuadraticForm(columns.reshape(len(columns), -1), form.constant[:, chosen])


@dataclass(frozen=True, eq=False)
class Sums:
    """What frames say about a group, stream by stream; they grow in place.

    products : of posteriors with features, their squares, and 1 [each shape=(M, G, 2 D_s + 1)]
    count    : of the posteriors alone, seen or not [shape=(M, G)]
    """

    products: tuple[NDArray[np.float64], ...]
    count: NDArray[np.float64]

    def add(self, group: Group, observed: Observed, chosen: Index, posterior: Single, shares: Single | None) -> None:
        """Take in frames.

        chosen    : the densities that they may be of [shape=(G',)]
        posterior : of these [shape=(T, G')]
        shares    : of their components [shape=(T, M, G')]
        """
        weight = component_posteriors(posterior, shares)
        flat = weight.reshape(len(weight), -1).T
        for stream, products in zip(group.streams, self.products, strict=True):
            seen = observed.seen[stream]
            if seen is not None and not seen.any():
                continue
            features = with_squares(observed.streams[stream])
            if seen is not None:
                features *= seen[:, None]
            products[:, chosen] += (flat @ features).reshape(*weight.shape[1:], -1)
        self.count[:, chosen] += weight.sum(axis=0, dtype=np.float64)

    def plus(self, other: Sums) -> Sums:
        """Return both together."""
        products = tuple(a + b for a, b in zip(self.products, other.products, strict=True))
        return Sums(products, self.count + other.count)


def no_sums(group: Group) -> Sums:
    """Return the sums over no frames."""
    count, components, _ = group.mixtures.size
    widths = [columns.stop - columns.start for columns in group.columns]
    return Sums(tuple(np.zeros((components, count, 2 * width + 1)) for width in widths), np.zeros((components, count)))


def component_posteriors(posterior: Single, shares: Single | None) -> Single:
    """Return γ(q, k) [shape=(T, M, G')] of densities [shape=(T, G')] and their components' shares [as the result]."""
    return posterior[:, None] if shares is None else shares * posterior[:, None]


def relearned(group: Group, sums: Sums, floors: Sequence[Single], least: float, streams: Sequence[int]) -> Group:
    """Return the group with the mixtures that explain the sums best.

    floors  : the least variance of every stream [each shape=(D_s,)]
    least   : densities with less data than so many frames stay as they are
    streams : those whose means and variances are learned; of others they stay
    """
    mixtures = group.mixtures.copy()
    known = np.flatnonzero(sums.count.sum(axis=0) >= least)
    count = sums.count.T[known]
    with np.errstate(divide="ignore"):
        mixtures.log_weights[known] = np.log(count / count.sum(axis=1, keepdims=True))
    for stream, columns, products, floor in zip(group.streams, group.columns, sums.products, floors, strict=True):
        if stream not in streams:
            continue
        frames = products[:, known, -1].T[:, :, None]
        first, second = np.split(products[:, known, :-1].transpose(1, 0, 2), 2, axis=2)
        seen = frames > LEAST_COMPONENT_FRAMES
        safe = np.where(seen, frames, 1)
        mean = first / safe
        variance = np.maximum(second / safe - mean * mean, floor)
        mixtures.means[known, :, columns] = np.where(seen, mean, mixtures.means[known, :, columns])
        mixtures.variances[known, :, columns] = np.where(seen, variance, mixtures.variances[known, :, columns])
    return replace(group, mixtures=mixtures)
