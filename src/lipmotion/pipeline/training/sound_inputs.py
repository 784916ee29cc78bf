"""What an engine takes from the sound of its examples: posteriors of phones, and spectra in many conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines import Engine
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.network.posteriors import installed_phone_recogniser, token_posteriors
from lipmotion.speech.sound.acoustic_conditions import condition_spectra
from lipmotion.types import (
    FRAME_RATE_HZ,
    Audio,
    ConditionSpectrum,
    Example,
    Monitor,
    ParallelMap,
    Progress,
    sub_monitor,
)

BLOCK = 16
"""Recordings of which progress is reported at once, and that are given to a process at once."""
VOICES = 32
"""Largest number of recordings whose voices make the babble."""
LONGEST_VOICE_S = 10.0


def with_sound_inputs(
    engine: Engine[Any],
    examples: Sequence[Example],
    sound: Mapping[str, Audio],
    monitor: Monitor,
    each: ParallelMap,
) -> list[Example]:
    """Return examples with what the engine's training takes from their sound (``Inputs``).

    These are posteriors of a phone recogniser (``Speech.posteriors``), where one is installed, the encoding of the
    sound (``Speech.encoding``), and spectra in many acoustic conditions (``Example.condition_spectra``).
    sound : of each example, by its name
    each  : applies a function to many items, perhaps in several processes
    """
    inputs = engine.inputs(sum(int(example.valid.sum()) for example in examples) / FRAME_RATE_HZ)
    recordings = [sound[example.name] for example in examples]
    result = list(examples)
    name = installed_phone_recogniser() if inputs.posteriors else None
    if name is not None:
        result = _with_posteriors(result, recordings, name, sub_monitor(monitor, 0, 0.5), each)
    if inputs.encoding:
        result = [
            replace(example, speech=replace(example.speech, encoding=encoding))
            for example, encoding in zip(result, each(_encode, recordings), strict=True)
        ]
    if inputs.conditions:
        result = _with_conditions(result, recordings, inputs.conditions, sub_monitor(monitor, 0.5, 1), each)
    return result


def _encode(audio: Audio) -> NDArray[np.float16]:
    return analysed(audio).encoding


def _with_posteriors(
    examples: Sequence[Example], recordings: Sequence[Audio], name: str, monitor: Monitor, each: ParallelMap
) -> list[Example]:
    result: list[Example] = []
    for example, posteriors in zip(examples, each(partial(token_posteriors, name), recordings), strict=True):
        result.append(replace(example, speech=replace(example.speech, posteriors=posteriors)))
        if len(result) % BLOCK == 0:
            monitor(Progress("posteriors of phones", len(result), len(examples), len(result) / len(examples)))
    return result


def _with_conditions(
    examples: Sequence[Example], recordings: Sequence[Audio], count: int, monitor: Monitor, each: ParallelMap
) -> list[Example]:
    """Return examples in ``count`` acoustic conditions each.

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
