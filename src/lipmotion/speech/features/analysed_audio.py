"""A recording with its acoustic features, each kind of which is computed once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import HOP, LOG_ENERGY, checked_samples, log_energy, mfcc_of_warps
from lipmotion.speech.features.spectrum import spectrum
from lipmotion.speech.recognition.general.front_end import general_features
from lipmotion.types import Audio, Features

MadeT = TypeVar("MadeT")


@dataclass(frozen=True, eq=False)
class AnalysedAudio(Audio):
    """One channel of sound at 16 kHz, and its acoustic features.

    Each kind of features is computed when it is first asked for, and kept as long as this object. The samples must not
    change. Make one for each recording (``analysed``), hand it down to everything that works on this recording, and
    drop it then: an hour takes 56 MB a kind.
    All methods raise InputError as ``mfcc`` says.
    """

    _mfcc: dict[float, Features] = field(default_factory=dict, repr=False)
    _stretches: dict[int, AnalysedAudio] = field(default_factory=dict, repr=False)
    _made: dict[str, Any] = field(default_factory=dict, repr=False)

    def once(self, name: str, make: Callable[[], MadeT]) -> MadeT:
        """Return what a function makes of this recording; it is made once, and kept under a name."""
        if name not in self._made:
            self._made[name] = make()
        made: MadeT = self._made[name]
        return made

    def mfcc(self, warp: float = 1.0) -> Features:
        """Return the features of ``speech.features.mfcc.mfcc`` at one warp of the frequencies."""
        (features,) = self.mfcc_of_warps((warp,))
        return features

    def mfcc_of_warps(self, warps: Sequence[float]) -> list[Features]:
        """Return the features of ``features.mfcc.mfcc`` at several warps; the missing ones are computed together."""
        missing = [warp for warp in warps if warp not in self._mfcc]
        if missing:
            self._mfcc.update(zip(missing, mfcc_of_warps(self, missing, self.log_energy), strict=True))
        return [self._mfcc[warp] for warp in warps]

    @cached_property
    def log_energy(self) -> NDArray[np.float32]:
        """The natural logarithm of the energy of every frame [shape=(T,)], as of ``features.mfcc.log_energy``."""
        return log_energy(checked_samples(self))

    @cached_property
    def general_features(self) -> NDArray[np.float32]:
        """The features of the general models [shape=(T, 39)], as of ``speech.recognition.general.front_end``."""
        return general_features(self)

    @cached_property
    def spectrum(self) -> NDArray[np.float32]:
        """The normalised log mel spectrum [shape=(T, 40)], as of ``speech.features.spectrum``."""
        return spectrum(self)

    def loudest_stretch(self, frames: int) -> AnalysedAudio:
        """Return the stretch of so many frames with the most energy; the recording itself if it is no longer."""
        energy = self.mfcc().values[:, LOG_ENERGY].astype(float)
        if len(energy) <= frames:
            return self
        if frames not in self._stretches:
            total: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(energy)])
            start = int((total[frames:] - total[:-frames]).argmax())
            samples = self.samples[start * HOP : (start + frames) * HOP]
            self._stretches[frames] = AnalysedAudio(samples, self.rate_hz)
        return self._stretches[frames]

    def stretch(self, first: int, stop: int) -> AnalysedAudio:
        """Return some frames of the recording, with the features that they have in the whole."""
        return _Stretch(self.samples[first * HOP : stop * HOP], self.rate_hz, whole=self, first=first)


@dataclass(frozen=True, eq=False)
class _Stretch(AnalysedAudio):
    """Frames of a recording, from ``first`` on, whose features are those of the whole: normalised as these."""

    whole: AnalysedAudio = field(default=None, repr=False, kw_only=True)  # type: ignore[assignment]
    first: int = field(default=0, kw_only=True)

    def mfcc_of_warps(self, warps: Sequence[float]) -> list[Features]:
        return [Features(self._rows(each.values), self.duration_s) for each in self.whole.mfcc_of_warps(warps)]

    @cached_property
    def log_energy(self) -> NDArray[np.float32]:
        return self._rows(self.whole.log_energy)

    @cached_property
    def general_features(self) -> NDArray[np.float32]:
        return self._rows(self.whole.general_features)

    @cached_property
    def spectrum(self) -> NDArray[np.float32]:
        return self._rows(self.whole.spectrum)

    def loudest_stretch(self, frames: int) -> AnalysedAudio:
        return self.whole.loudest_stretch(frames)

    def _rows(self, rows: NDArray[np.float32]) -> NDArray[np.float32]:
        return rows[self.first : self.first + len(self.samples) // HOP + 1]


def analysed(audio: Audio, features: Features | None = None) -> AnalysedAudio:
    """Return a recording that keeps its features: the same object if it already does.

    features : of the recording, from ``mfcc``, if they are known; they are not computed then
    """
    if not isinstance(audio, AnalysedAudio):
        audio = AnalysedAudio(audio.samples, audio.rate_hz)
    if features is not None:
        audio._mfcc.setdefault(1.0, features)
    return audio
