"""Motion from the encoding of speech alone, for every voice: by a network that learned from hundreds of readers.

``scripts/live_network.py`` trains it on measured motion of one speaker, and on what ``animate`` makes of the others'
recordings, in quiet and in noise: mistakes differ from reader to reader, and the network learns what they share
(Xie, Luong, Hovy & Le 2020, self-training). It needs no phones.
"""

from __future__ import annotations

from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.articulation import ARTICULATORS
from lipmotion.motion.network_steps import STEP, ConvolutionalShape, interpolate_steps
from lipmotion.stats.networks import ConvolutionalNetwork
from lipmotion.types import Speech

WEIGHTS = "general-motion.npz"
SHAPE = ConvolutionalShape("general", "general network", 64, 128, (1, 2, 4, 8))
"""From the 64 values of ``Speech.encoding``, 0.6 s before and after a frame."""
ENCODING_SCALE = np.float32(4)
"""What the encoding is multiplied by, so that its values are about 1."""


def hear_articulators(speech: Speech) -> NDArray[np.float64] | None:
    """Return articulators, in deviations from the pose of the table of articulation [shape=(T, 8)].

    None: the speech has no encoding, or its phones are given for a voice that training knows.
    """
    if speech.encoding is None or (speech.voice >= 1 and speech.units_known):
        return None
    steps = np.asarray(speech.encoding)[::STEP].astype(np.float32) * ENCODING_SCALE
    return interpolate_steps(load_shipped()(steps).astype(float), len(speech.features.values))


@cache
def load_shipped() -> ConvolutionalNetwork:
    """Return the network of the package."""
    path = resources.files("lipmotion") / "models" / WEIGHTS
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        return SHAPE.from_arrays(dict(stored), len(ARTICULATORS))
