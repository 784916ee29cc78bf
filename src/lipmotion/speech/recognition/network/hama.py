"""hama: a network of 4.7 MB for the phones of many languages, with its weights in a wheel, for NumPy alone."""

from __future__ import annotations

import platform
import sys
from functools import cache
from importlib.util import find_spec
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.recognition.network.posteriors import PhoneRecogniser

LIBRARIES = {("linux", "x86_64"), ("linux", "aarch64"), ("darwin", "x86_64"), ("darwin", "arm64")}
"""Systems and processors that the package has a library for."""
LEAST_SAMPLES = 1600
"""Shorter sound is filled up with silence: the network has no row for it."""


@final
class Hama(PhoneRecogniser):
    """The phone recogniser of the package ``hama`` (Apache-2.0)."""

    name: ClassVar[str] = "hama"

    def __init__(self) -> None:
        self.tokens = tuple(_model().decoder_tokens)

    @classmethod
    def is_installed(cls) -> bool:
        """Return whether the package is installed, and has a library for this machine."""
        return (sys.platform, platform.machine()) in LIBRARIES and find_spec("hama") is not None

    def log_posteriors(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return natural logarithms of the posteriors, as ``PhoneRecogniser.log_posteriors``."""
        filled = np.pad(samples, (0, max(0, LEAST_SAMPLES - len(samples)))).astype(np.float32)
        values, rows = _model().session.run(
            ["log_probs", "out_lengths"],
            {"waveform": filled[None], "waveform_lengths": np.array([len(filled)], np.int64)},
        )
        posteriors: NDArray[np.float32] = np.asarray(values, np.float32).reshape(-1, len(self.tokens))
        return posteriors[: int(rows[0])]


@cache
def _model() -> Any:
    """Return the network of this process; it is loaded once."""
    from hama.asr import ASRModel

    return ASRModel()
