"""Two experts that predict each frame together: the states, and a predictor without states."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.emission import Emission
from lipmotion.motion.articulation import ArticulationPrior, slice_dynamics, unseen_share
from lipmotion.motion.generation import Statistics
from lipmotion.motion.predictors import Predictor
from lipmotion.motion.rest import rate_phones
from lipmotion.types import Speech

Array = NDArray[np.float64]
NETWORK_SHARE = 0.6
"""Weight of the predictor beside the states, 0 to 1, in models that have no other."""
RESTING_SHARE = 0.5
"""Share of its weight that the predictor has where the states rest, with voices that training knows: their mouths open
before they speak."""
STRANGER_LOSS = 0.8
"""Share of their weight that states lose with voices that training does not know at all."""


@dataclass(frozen=True, eq=False)
class Experts:
    """The states and the predictor on one recording.

    emission, rows : densities, and the one of each frame [shape=(T,)]; the last density is that of the rest pose
    network        : predicts motion without the states (None: there was too little speech to train it)
    network_share  : weight of that predictor, 0 to 1, in contexts that training knows well
    prior          : says how well training knows a phone in its context (None: taken as well known)
    silent         : frames of digital silence, in which states count alone [shape=(T,)] (None: there are none)
    """

    emission: Emission
    rows: NDArray[np.intp]
    speech: Speech
    network: Predictor | None
    prior: ArticulationPrior | None
    network_share: float = NETWORK_SHARE
    silent: NDArray[np.bool_] | None = None

    def statistics(self, frames: slice) -> Statistics:
        """Return means and precisions of a range of N frames [each shape=(N, 3, Q)]: weighted means of both."""
        means, precisions = self.emission.statistics(self.rows[frames], np.asarray(self.speech.features.values), frames)
        if self.network is None or self._predicted is None:
            return means, precisions
        share = self._share[frames, None, None]
        means += share * (slice_dynamics(self._predicted[0], frames) - means)
        precisions += share * (1 / self.network.variances - precisions)
        return means, precisions

    @cached_property
    def reliability(self) -> Array:
        """How far the phones in time can be relied on, 0 to 1 [shape=(T,)]."""
        return rate_phones(self.speech, None if self._predicted is None else self._predicted[1], len(self.rows))

    @cached_property
    def _predicted(self) -> tuple[Array, Array] | None:
        """Motion [shape=(T, Q)] and distortion [shape=(T,)] by the predictor."""
        if self.network is None or not self.network.can_predict(self.speech):
            return None
        return self.network.predict(self.speech)

    @cached_property
    def _share(self) -> Array:
        """The share of the predictor in every frame, 0 to 1 [shape=(T,)]."""
        familiarity = np.ones(len(self.rows))
        if self.prior is not None and not (self.network is not None and self.network.uses_articulation):
            familiarity = self.prior.familiarity(self.speech.units, len(self.rows))
        resting = self.rows == len(self.emission.means) - 1
        own = self.network is not None and self.network.uses_prior  # states of a person, not of a distant speaker
        strange = unseen_share(self.speech.voice)
        known = 1.0 if own else 1 - STRANGER_LOSS * strange
        states = (1 - self.network_share) * self.reliability * familiarity * known
        at_rest = np.maximum(1 - self.reliability, 0.0 if own else RESTING_SHARE * (1 - strange))
        if self.silent is not None:
            at_rest[self.silent] = 0
        network = self.network_share * np.where(resting, at_rest, 1.0)
        return network / np.maximum(states + network, 1e-12)
