"""How phone models hear a voice that they were not trained on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ModelFormatError
from lipmotion.speech.general.acoustic import STREAMS
from lipmotion.speech.general.front_end import general_features
from lipmotion.speech.mfcc import FEATURES, mfcc
from lipmotion.stats.affine import identity, transformed
from lipmotion.storage.schema import STANDARD, Arrays, ArraySpec, checked_arrays, refuse_undeclared
from lipmotion.types import Audio, Features

LARGEST_WARP = 2.0
"""Frequencies are not stretched by more, nor by less than its inverse."""
_GENERAL = (len(STREAMS), STREAMS[0].stop, STREAMS[0].stop + 1)


@dataclass(frozen=True, eq=False)
class Adaptation:
    """What is done to the features of one voice before phone models hear them.

    warp    : factor by which its frequencies are stretched for the own models
    trust   : what the log densities of these are multiplied by beside the general ones, 0 to 1
    own     : affine transform of the features after the warp [shape=(39, 40)]
    general : the same for each stream of the general models' features [shape=(3, 13, 14)]
    """

    warp: float
    trust: float
    own: NDArray[np.float64]
    general: NDArray[np.float64]

    def own_features(self, audio: Audio, features: Features) -> NDArray[np.float32]:
        """Return what the own models hear [shape=(T, 39)].

        features : of the audio, not warped
        """
        warped = features if self.warp == 1 else mfcc(audio, self.warp)
        return transformed(warped.values, self.own)

    def general_features(self, audio: Audio) -> NDArray[np.float32]:
        """Return what the general models hear [shape=(T, 39)]."""
        features = general_features(audio)
        streams = [transformed(features[:, s], matrix) for s, matrix in zip(STREAMS, self.general, strict=True)]
        return np.concatenate(streams, axis=1)


def identity_adaptation(warp: float, trust: float) -> Adaptation:
    """Return an adaptation whose transforms change nothing."""
    streams, size, _ = _GENERAL
    return Adaptation(warp, trust, identity(FEATURES), np.stack([identity(size)] * streams))


def adaptation_arrays(adaptation: Adaptation) -> dict[str, NDArray[Any]]:
    """Return an adaptation as arrays."""
    numbers = np.array([adaptation.warp, adaptation.trust])
    return {"numbers": numbers, "own": adaptation.own, "general": adaptation.general}


def adaptation_from_arrays(arrays: Arrays) -> Adaptation:
    """Return an adaptation again. Raises ModelFormatError: something is missing, or cannot be a transform."""
    try:
        refuse_undeclared(arrays, ADAPTATION_MEMBERS)
        found = checked_arrays(arrays, ADAPTATION_MEMBERS)
        warp, trust = found["numbers"].tolist()
        if not 1 / LARGEST_WARP <= warp <= LARGEST_WARP or not 0 <= trust <= 1:
            raise ValueError(f"a warp of {warp} and a trust of {trust}")
        return Adaptation(warp, trust, found["own"], found["general"])
    except (KeyError, ValueError, TypeError) as error:
        raise ModelFormatError(f"the adaptation is damaged ({error}); adapt the model again") from error


ADAPTATION_MEMBERS = {
    "numbers": ArraySpec(np.float64, "2"),
    "own": ArraySpec(np.float64, f"{FEATURES} {FEATURES + 1}", -STANDARD, STANDARD),
    "general": ArraySpec(np.float64, " ".join(map(str, _GENERAL)), -STANDARD, STANDARD),
}
"""How an adaptation is stored."""
