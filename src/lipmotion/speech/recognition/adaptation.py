"""Speaker adaptation of phone models: transforms of the acoustic features, as a value and as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import FEATURES
from lipmotion.speech.recognition.general import STREAMS
from lipmotion.speech.sound.analysed_audio import AnalysedAudio
from lipmotion.stats.constrained_mllr import identity, transform_features
from lipmotion.storage.schema import LARGEST_MEAN, Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared

LARGEST_WARP = 2.0  # frequencies are not stretched by more, nor by less than its inverse
_GENERAL = (len(STREAMS), STREAMS[0].stop, STREAMS[0].stop + 1)


@dataclass(frozen=True, eq=False)
class Adaptation:
    """Transforms that make the features of one speaker more probable under phone models trained on others."""

    warp: float  # factor by which the frequencies are stretched for the own models
    own_weight: float  # what the log densities of the own models are multiplied by beside the general ones, 0 to 1
    own: NDArray[np.float64]  # affine transform of the features for the own models, after the warp [shape=(39, 40)]
    general: NDArray[np.float64]  # the same of each stream of those for the general models [shape=(3, 13, 14)]

    def own_features(self, audio: AnalysedAudio) -> NDArray[np.float32]:
        """Return the adapted features for the own models [shape=(T, 39)]."""
        return transform_features(audio.mfcc(self.warp).values, self.own)

    def general_features(self, audio: AnalysedAudio) -> NDArray[np.float32]:
        """Return the adapted features for the general models [shape=(T, 39)]."""
        features = audio.general_features
        streams = [transform_features(features[:, s], matrix) for s, matrix in zip(STREAMS, self.general, strict=True)]
        return np.concatenate(streams, axis=1)


def create_adaptation(warp: float, own_weight: float) -> Adaptation:
    """Return an adaptation whose affine transforms are the identity."""
    streams, size, _ = _GENERAL
    return Adaptation(warp, own_weight, identity(FEATURES), np.stack([identity(size)] * streams))


def adaptation_to_arrays(adaptation: Adaptation) -> dict[str, NDArray[Any]]:
    """Return an adaptation serialised as arrays (``ADAPTATION_ARRAYS``)."""
    numbers = np.array([adaptation.warp, adaptation.own_weight])
    return {"numbers": numbers, "own": adaptation.own, "general": adaptation.general}


def adaptation_from_arrays(arrays: Arrays) -> Adaptation:
    """Deserialise an adaptation. Raises ModelFormatError: an array is missing, or cannot be a transform."""
    with format_errors("the adaptation", "adapt the model again"):
        refuse_undeclared(arrays, ADAPTATION_ARRAYS)
        checked = check_arrays(arrays, ADAPTATION_ARRAYS)
        warp, own_weight = checked["numbers"].tolist()
        if not 1 / LARGEST_WARP <= warp <= LARGEST_WARP or not 0 <= own_weight <= 1:
            raise ValueError(f"a warp of {warp} and a weight of the own models of {own_weight}")
        return Adaptation(warp, own_weight, checked["own"], checked["general"])


ADAPTATION_ARRAYS = {
    "numbers": ArraySpec(np.float64, "2"),
    "own": ArraySpec(np.float64, f"{FEATURES} {FEATURES + 1}", -LARGEST_MEAN, LARGEST_MEAN),
    "general": ArraySpec(np.float64, " ".join(map(str, _GENERAL)), -LARGEST_MEAN, LARGEST_MEAN),
}
"""The arrays of an adaptation; ``numbers`` are the warp and the weight of the own models."""
