"""What engines learn from: the channels of a model (tracked, supplied, eigenlips), and inputs from the sound."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines import Animator
from lipmotion.errors import CorpusError, InputError, shorten
from lipmotion.motion.eigenlips import COMPONENTS, Eigenlips, fit_eigenlips
from lipmotion.pipeline.model import BOTH, GEOMETRY, VISUALS
from lipmotion.printable import printable
from lipmotion.speech.recognition.network.posteriors import find_installed_recogniser, infer_posteriors
from lipmotion.speech.sound.acoustic_conditions import list_conditions
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.stats.pca import choose_evenly
from lipmotion.types import (
    FRAME_RATE_HZ,
    Audio,
    Channel,
    ConditionSpectrum,
    Example,
    Monitor,
    Motion,
    ParallelMap,
    Progress,
    Utterance,
    sub_monitor,
)

LOG = logging.getLogger("lipmotion")
PICTURES = 980  # number of mouth pictures that eigenlips are trained on. Source: Xie & Liu 2007, §5


def check_visual(visual: str) -> None:
    """Raise InputError if ``visual`` is not one of ``VISUALS``."""
    if visual not in VISUALS:
        raise InputError(f"visual is {visual!r}, required one of: {', '.join(VISUALS)}")


def train_eigenlips(
    utterances: Sequence[Utterance], components: int = COMPONENTS, pictures: int = PICTURES
) -> Eigenlips:
    """Return the eigenlips of some utterances, trained on mouth pictures that are spread evenly over all seen frames.

    Raises CorpusError: an utterance has no mouth pictures, or no utterance has a seen frame.
    """
    seen_frames = [np.flatnonzero(utterance.track.seen) for utterance in utterances]
    ends = np.cumsum([len(frames) for frames in seen_frames])
    chosen = choose_evenly(pictures, int(ends[-1]) if len(ends) else 0)
    if not len(chosen):
        raise CorpusError(f"no face is seen in {len(utterances)} utterances; prepare a corpus of videos with faces")
    by_utterance = np.split(chosen, np.searchsorted(chosen, ends[:-1]))
    crops = [
        _crops(utterance)[frames[numbers - (end - len(frames))]]
        for utterance, frames, numbers, end in zip(utterances, seen_frames, by_utterance, ends, strict=True)
    ]
    sizes = {array.shape[1:] for array in crops}
    if len(sizes) > 1:
        raise CorpusError(f"mouth pictures of {len(sizes)} sizes; prepare all recordings again with one lipmotion")
    return fit_eigenlips(np.concatenate(crops), components)


def with_visual_channels(utterance: Utterance, visual: str, eigenlips: Eigenlips | None) -> Utterance:
    """Return an utterance whose motion has the channels of ``visual``, at the frame rate of the camera.

    visual    : one of ``VISUALS``
    eigenlips : from ``train_eigenlips``. Coefficients are not smoothed; those of unseen frames are without meaning
    Raises InputError: no such ``visual``, or eigenlips are missing. Raises CorpusError: mouth pictures are missing.
    """
    check_visual(visual)
    if visual == GEOMETRY:
        return utterance
    if eigenlips is None:
        raise InputError(f"visual {visual!r} without eigenlips; required: those of train_eigenlips, or of the model")
    motion = utterance.track.motion
    values, channels = eigenlips.project(_crops(utterance)).astype(float), eigenlips.channels
    if visual == BOTH:
        values = np.concatenate([motion.values, values], axis=1)
        channels = (*motion.channels, *channels)
    return replace(utterance, track=replace(utterance.track, motion=Motion(values, motion.rate_hz, channels)))


def with_common_channels(utterances: Sequence[Utterance]) -> list[Utterance]:
    """Return utterances with the channels, by name and unit, that all of them have, in the order of the first.

    Utterances that have the same channels are returned as they are; else a warning says which are left out.
    Raises CorpusError: they have no channel in common.
    """

    def names_of(channels: Sequence[Channel]) -> str:
        return printable(shorten(", ".join(channel.name for channel in channels)))

    kinds = list(dict.fromkeys(utterance.track.motion.channels for utterance in utterances))
    if len(kinds) < 2:
        return list(utterances)
    common = tuple(channel for channel in kinds[0] if all(channel in kind for kind in kinds))
    if not common:
        found = "; ".join(map(names_of, kinds))
        raise CorpusError(f"{len(kinds)} kinds of motion without a common channel: {found}; train on one (--speaker)")
    left_out = sorted({channel.name for kind in kinds for channel in kind if channel not in common})
    counted = len(kinds), len(common), names_of(common), printable(shorten(", ".join(left_out)))
    LOG.warning("%d kinds of motion: training on the %d channels that all have (%s); left out: %s", *counted)
    names = [channel.name for channel in common]
    motions = [utterance.track.motion.selected(names) for utterance in utterances]
    return [replace(u, track=replace(u.track, motion=motion)) for u, motion in zip(utterances, motions, strict=True)]


def _crops(utterance: Utterance) -> NDArray[np.uint8]:
    """Return the mouth pictures of an utterance. Raises CorpusError: it has none."""
    crops = utterance.track.crops
    if crops is None:
        advice = "prepare its video again without --no-crops, or train with --visual geometry"
        raise CorpusError(f"{utterance.name}: no mouth pictures, which eigenlips need; {advice}")
    return np.asarray(crops)


BLOCK = 16  # recordings of which progress is reported at once, and that are given to a process at once
VOICES = 32  # largest number of recordings whose voices make the babble
LONGEST_VOICE_S = 10.0


def with_sound_inputs(
    engine: Animator[Any], examples: Sequence[Example], sound: Mapping[str, Audio], monitor: Monitor, each: ParallelMap
) -> list[Example]:
    """Return examples with what the engine's training takes from their sound (``Inputs``).

    These are posteriors of a phone recogniser (``Speech.posteriors``), where one is installed, the encoding of the
    sound, and spectra in many acoustic conditions (``Example.condition_spectra``). The noise of babble is made of the
    recordings themselves; all is drawn from the number of the recording.
    """
    inputs = engine.inputs(sum(int(example.valid.sum()) for example in examples) / FRAME_RATE_HZ)
    recordings, count = [sound[example.name] for example in examples], len(examples)
    result = list(examples)
    if inputs.posteriors and find_installed_recogniser() is not None:
        report = sub_monitor(monitor, 0, 0.5)
        for number, posteriors in enumerate(each(infer_posteriors, recordings)):
            result[number] = replace(result[number], speech=replace(result[number].speech, posteriors=posteriors))
            if (number + 1) % BLOCK == 0:
                report(Progress("posteriors of phones", number + 1, count, (number + 1) / count))
    if inputs.encoding and not inputs.conditions:
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
        for number, varied in enumerate(spectra):
            heard = replace(result[number].speech, encoding=varied[0].encoding)
            result[number] = replace(result[number], speech=heard, condition_spectra=tuple(varied))
    return result


def _vary_block(
    recordings: Sequence[tuple[int, Audio]], voices: Sequence[Audio], count: int
) -> list[list[ConditionSpectrum]]:
    return [list_conditions(audio, voices, count, [number]) for number, audio in recordings]


def _encode(audio: Audio) -> NDArray[np.float16]:
    return analysed(audio).encoding
