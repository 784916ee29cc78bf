"""Explanations of frames, and posterior probabilities of chains of states over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lipmotion.types.timeline import Span, Unit


@dataclass(frozen=True)
class NamedProbability:
    """A name and a probability: of a state, or of a regression.

    probability : 0 to 1
    """

    name: str
    probability: float


@dataclass(frozen=True)
class ChannelValue:
    """A value of a channel and its standard deviation, both in the unit of the channel."""

    value: float
    deviation: float


@dataclass(frozen=True)
class ChainStates:
    """Posterior probabilities of the states of one chain in a frame.

    name   : the unit set of the chain
    states : the most probable states, best first; the name is the unit and the number of the state, from 1 (``b.1``)
    lead   : asynchrony: probability of each number of states by which the chain is ahead of the first chain (negative:
             behind it); empty for the first chain, and where the asynchrony is not limited
    """

    name: str
    states: tuple[NamedProbability, ...]
    lead: Mapping[int, float] = field(default_factory=dict)

    @property
    def expected_lead(self) -> float:
        """Expected number of states by which the chain is ahead of the first chain."""
        return sum(states * probability for states, probability in self.lead.items())


@dataclass(frozen=True)
class DominantGaussian:
    """The mixture component with the largest posterior probability in a frame, in one stream.

    stream     : name of the stream
    density    : name of the mixture
    component, components : number of the Gaussian in the mixture, from 1, and how many Gaussians the mixture has
    responsibility : posterior probability of the component, among all components of the stream
    distance   : distance of the observation from the mean: root mean square over its dimensions, in standard
                 deviations (None: the stream was not observed)
    channels   : mean and standard deviation of each motion channel (empty: a stream of speech)
    """

    stream: str
    density: str
    component: int
    components: int
    responsibility: float
    distance: float | None
    channels: Mapping[str, ChannelValue]


@dataclass(frozen=True)
class RegressedMean:
    """A mean of a stream that is regressed on the acoustic features and posteriors around a frame.

    stream   : name of the stream
    shares   : weight of each regression, largest first; ``rest`` in silence away from speech
    channels : weighted mean of the regressions, and its standard deviation, by channel
    """

    stream: str
    shares: tuple[NamedProbability, ...]
    channels: Mapping[str, ChannelValue]


@dataclass(frozen=True)
class Explanation:
    """What determined one frame of generated motion; returned by ``explain``.

    time_s      : time of the frame in seconds
    frame       : number of the frame, at 100 Hz
    span        : phone, unit and word that contain the frame (None: no span contains it)
    state       : state of the model, as in ``Generation.trace``
    motion      : value of every channel, and the standard deviation that the model gives it
    confidence  : 0 to 1, how sure the frame is, as in ``Generation.confidence`` (None: not from ``explain``)
    chains      : posterior probabilities of the states of each chain (empty: the engine has no chains)
    joint       : the most probable joint state of all chains (None: the engine does not list joint states)
    gaussians   : the dominant Gaussian of each stream
    regressions : the regressed mean of each stream that has one

    >>> import lipmotion
    >>> (explanation,) = lipmotion.explain("examples/welcome.flac", at=1.0)
    >>> explanation.frame, explanation.time_s, sorted(explanation.motion)[:2]
    (100, 1.0, ['opening', 'outer'])
    """

    time_s: float
    frame: int
    span: Span[Unit] | None
    state: str
    motion: Mapping[str, ChannelValue]
    confidence: float | None = None
    chains: tuple[ChainStates, ...] = ()
    joint: NamedProbability | None = None
    gaussians: tuple[DominantGaussian, ...] = ()
    regressions: tuple[RegressedMean, ...] = ()


@dataclass(frozen=True, eq=False)
class ChainPosteriors:
    """Posterior probabilities of one chain over time, at 100 Hz.

    name        : name of its unit set
    units       : names of its U units
    probability : float32 array [shape=(T, U)], of each unit
    leads       : asynchronies: numbers of states by which it may be ahead of the first chain; empty for the first chain
    lead        : float32 array [shape=(T, len(leads))], probability of each asynchrony
    """

    name: str
    units: tuple[str, ...]
    probability: NDArray[np.float32]
    leads: tuple[int, ...]
    lead: NDArray[np.float32]
