"""The examples of a training in many acoustic conditions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from lipmotion.speech.sound.acoustic_conditions import condition_spectra
from lipmotion.types import Audio, ConditionSpectrum, Example, Monitor, ParallelMap, Progress

BLOCK = 16
"""Recordings that are given to a process at once."""
VOICES = 32
"""Largest number of recordings whose voices make the babble."""
LONGEST_VOICE_S = 10.0


def with_conditions(
    examples: Sequence[Example], recordings: Sequence[Audio], count: int, monitor: Monitor, each: ParallelMap
) -> list[Example]:
    """Return examples with their spectra in ``count`` conditions each (``Example.condition_spectra``).

    recordings : the sound of each example
    each       : applies a function to many items, perhaps in several processes
    The noise of babble is made of the recordings themselves; all is drawn from the number of the recording.
    """
    chosen = np.unique(np.linspace(0, len(recordings) - 1, VOICES).round().astype(int))
    voices = [_shortened(recordings[number]) for number in chosen]
    blocks = [list(enumerate(recordings))[start : start + BLOCK] for start in range(0, len(recordings), BLOCK)]
    varied: list[list[ConditionSpectrum]] = []
    for block in each(partial(_block, voices=voices, count=count), blocks):
        varied += block
        monitor(Progress("acoustic conditions", len(varied), len(recordings), len(varied) / len(recordings)))
    return [
        replace(example, condition_spectra=tuple(spectra)) for example, spectra in zip(examples, varied, strict=True)
    ]


def _block(
    recordings: Sequence[tuple[int, Audio]], voices: Sequence[Audio], count: int
) -> list[list[ConditionSpectrum]]:
    return [condition_spectra(audio, voices, count, [number]) for number, audio in recordings]


def _shortened(audio: Audio) -> Audio:
    return Audio(audio.samples[: int(LONGEST_VOICE_S * audio.rate_hz)], audio.rate_hz)
