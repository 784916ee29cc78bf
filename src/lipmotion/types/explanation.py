"""Why a frame is what it is, and what chains of states believe over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lipmotion.types.timeline import Span, Unit


@dataclass(frozen=True)
class NamedProbability:
    """Something by name, and its probability."""

    name: str
    probability: float


@dataclass(frozen=True)
class ChannelValue:
    """A value of a channel and its standard deviation, in the channel's unit."""

    value: float
    deviation: float


@dataclass(frozen=True)
class ChainStates:
    """Where one chain of states is in a frame.

    name   : its unit set
    states : the most probable ones, best first: unit and place, counted from 1 (``b.1``)
    lead   : probability of every number of states that it is ahead of the first chain (negative: behind); empty for the
             first, and where chains go their own ways
    """

    name: str
    states: tuple[NamedProbability, ...]
    lead: Mapping[int, float] = field(default_factory=dict)

    @property
    def expected_lead(self) -> float:
        """How many states it is ahead, on average."""
        return sum(states * probability for states, probability in self.lead.items())


@dataclass(frozen=True)
class DominantGaussian:
    """The mixture component that most of a frame comes from, in one stream.

    density, component, components : the mixture's name; which of its Gaussians this is, from 1; how many there are
    responsibility : the posterior probability of this one, among all densities of the stream
    distance : how far what was observed lies from its mean: root mean square over its dimensions, in standard
               deviations (None: the stream was not observed)
    channels : mean and deviation of each motion channel (none of speech)
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
    """The mean of a stream where it is not that of a density: it follows what is heard and believed around the frame.

    shares   : how much each regression says, largest first; ``rest`` in silence away from speech
    channels : what they say together, and its deviation
    """

    stream: str
    shares: tuple[NamedProbability, ...]
    channels: Mapping[str, ChannelValue]


@dataclass(frozen=True)
class Explanation:
    """What stands behind one frame of a result.

    span        : the phone that is said then, its unit, its word (None: there is none)
    state       : of the model, as in ``Generation.trace``
    motion      : value of every channel, and the model's own deviation
    chains      : where each chain is (of engines that have chains)
    joint       : the most probable state of all chains together (None: they are not listed)
    gaussians, regressions : what the frame's values come from, stream by stream
    """

    time_s: float
    frame: int
    span: Span[Unit] | None
    state: str
    motion: Mapping[str, ChannelValue]
    chains: tuple[ChainStates, ...] = ()
    joint: NamedProbability | None = None
    gaussians: tuple[DominantGaussian, ...] = ()
    regressions: tuple[RegressedMean, ...] = ()


@dataclass(frozen=True, eq=False)
class ChainPosteriors:
    """What is believed of one chain over time.

    name, units : its unit set
    probability : float32 array [shape=(T, U)]
    leads       : the numbers of states that it may be ahead of the first chain; none of the first
    lead        : probability of each [shape=(T, len(leads))]
    """

    name: str
    units: tuple[str, ...]
    probability: NDArray[np.float32]
    leads: tuple[int, ...]
    lead: NDArray[np.float32]
