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
    engine: Engine[Any], examples: Sequence[Example], sound: Mapping[str, Audio], monitor: Monitor, each: ParallelMap
) -> list[Example]:
    """Return examples with what the engine's training takes from their sound (``Inputs``).

    These are posteriors of a phone recogniser (``Speech.posteriors``), where one is installed, the encoding of the
    sound, and spectra in many acoustic conditions (``Example.condition_spectra``). The noise of babble is made of the
    recordings themselves; all is drawn from the number of the recording.
    sound : of each example, by its name
    each  : applies a function to many items, perhaps in several processes
    """
    inputs = engine.inputs(sum(int(example.valid.sum()) for example in examples) / FRAME_RATE_HZ)
    recordings, count = [sound[example.name] for example in examples], len(examples)
    result = list(examples)
    name = installed_phone_recogniser() if inputs.posteriors else None
    if name is not None:
        report = sub_monitor(monitor, 0, 0.5)
        for number, posteriors in enumerate(each(partial(token_posteriors, name), recordings)):
            result[number] = replace(result[number], speech=replace(result[number].speech, posteriors=posteriors))
            if (number + 1) % BLOCK == 0:
                report(Progress("posteriors of phones", number + 1, count, (number + 1) / count))
    if inputs.encoding:
        result = [
            replace(example, speech=replace(example.speech, encoding=encoding))
            for example, encoding in zip(result, each(_encode, recordings), strict=True)
        ]
    if inputs.conditions:
        report, spectra = sub_monitor(monitor, 0.5, 1), list[list[ConditionSpectrum]]()
        chosen = [recordings[n] for n in np.unique(np.linspace(0, count - 1, VOICES).round().astype(int))]
        voices = [Audio(voice.samples[: int(LONGEST_VOICE_S * voice.rate_hz)], voice.rate_hz) for voice in chosen]
        blocks = [list(enumerate(recordings))[start : start + BLOCK] for start in range(0, count, BLOCK)]
        for block in each(partial(_vary_block, voices=voices, count=inputs.conditions), blocks):
            spectra += block
            report(Progress("acoustic conditions", len(spectra), count, len(spectra) / count))
        result = [
            replace(example, condition_spectra=tuple(varied)) for example, varied in zip(result, spectra, strict=True)
        ]
    return result


def _vary_block(
    recordings: Sequence[tuple[int, Audio]], voices: Sequence[Audio], count: int
) -> list[list[ConditionSpectrum]]:
    return [condition_spectra(audio, voices, count, [number]) for number, audio in recordings]


def _encode(audio: Audio) -> NDArray[np.float16]:
    return analysed(audio).encoding
