"""Prosody: how loud and how high a voice is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Prosody:
    """Loudness and pitch of speech at 100 Hz; frame n is centred at n · 10 ms.

    level_db : power of the sound in decibels; the reference does not matter [shape=(T,)]
    log_f0   : natural logarithm of F0 in Hz, NaN in unvoiced frames [shape=(T,)]
    """

    level_db: NDArray[np.floating[Any]]
    log_f0: NDArray[np.floating[Any]]
