"""The streams of data of an utterance: speech, F0 with slope and curvature, and motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.curves import mark_known_dynamics, with_dynamics

SPEECH, MOTION = "speech", "motion"
F0_STREAMS = ("f0", "f0_slope", "f0_curvature")
STREAMS = (SPEECH, *F0_STREAMS, MOTION)
ACOUSTIC_STREAMS = (SPEECH, *F0_STREAMS)


@dataclass(frozen=True)
class StreamWeights:
    """Factors of the streams' log densities; 0: off. Raises InputError: a weight is negative or not finite."""

    speech: float = 1.0
    f0: float = 1.0
    f0_slope: float = 1.0
    f0_curvature: float = 1.0
    motion: float = 1.0

    def __post_init__(self) -> None:
        for name, weight in self:
            if not 0 <= weight < float("inf"):
                raise InputError(f"the weight of the stream {name} is {weight}, required 0 or more and finite")

    def __iter__(self) -> Iterator[tuple[str, float]]:
        return ((field.name, getattr(self, field.name)) for field in fields(self))

    @property
    def active(self) -> dict[str, float]:
        """The streams whose weight is not 0, and their weights."""
        return {name: weight for name, weight in self if weight}


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
    Raises InputError: as ``StreamObservations``; log F0 or motion of another shape, infinite log F0, a mask that is not
    that of the frames, or a measured value that is not finite.
    """
    speech = np.asarray(speech)
    streams = {SPEECH: ObservedStream(speech, np.ones(len(speech), bool))}
    if log_f0 is not None:
        pitch: NDArray[np.float64] = np.asarray(log_f0, np.float64)
        if pitch.ndim != 1 or np.isinf(pitch).any():
            raise InputError(
                f"log F0 has shape {pitch.shape}, required (T,), NaN where there is no voice, never infinite"
            )
        voiced = ~np.isnan(pitch)
        dynamics = with_dynamics(np.where(voiced, pitch, 0.0)[:, None])
        masks = (voiced, *[mark_known_dynamics(voiced)] * 2)
        for window, (name, mask) in enumerate(zip(F0_STREAMS, masks, strict=True)):
            streams[name] = ObservedStream(np.where(mask[:, None], dynamics[:, window], 0.0), mask)
    if motion is not None:
        values: NDArray[np.float64] = np.asarray(motion, np.float64)
        seen = np.ones(len(values), bool) if measured is None else np.asarray(measured)
        if values.ndim != 2 or seen.shape != values.shape[:1]:
            raise InputError(f"motion has shape {values.shape}, its mask {seen.shape}; required (T, Q) and (T,)")
        if not np.isfinite(values[seen]).all():
            raise InputError(
                "motion holds values that are not finite where it was measured; mark these frames as not measured"
            )
        known = mark_known_dynamics(np.asarray(seen, bool))
        dynamics = with_dynamics(np.where(seen[:, None], values, 0.0)).reshape(len(values), -1)
        streams[MOTION] = ObservedStream(np.where(known[:, None], dynamics, 0.0), known)
    return StreamObservations(streams)
