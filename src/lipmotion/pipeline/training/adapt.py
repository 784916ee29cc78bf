"""Speaker adaptation: ``adapt(model, recordings) → model``, from recordings without transcripts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.model import Model, load_model
from lipmotion.speech.recognition.adaptation_estimation import estimate_adaptation
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio


@one_thread()
def adapt(model: Model | str | Path | None, recordings: Sequence[str | Path | Audio]) -> Model:
    """Return a model whose phone models are adapted to one speaker, for recognition and alignment.

    model      : from ``load_model``, or the path of a model file; None: the shipped model. The new adaptation replaces
                 an earlier one
    recordings : of this speaker alone: audio or video files, or samples at 16 kHz; transcripts are not needed
    Raises InputError: no recording, one that cannot be read, or too little speech in them.
    Raises MissingDependencyError: pocketsphinx is not installed.
    Source: Gales 1998, constrained maximum-likelihood linear regression (``speech.recognition.adaptation_estimation``).

    >>> import lipmotion
    >>> adapted = lipmotion.adapt(None, ["examples/welcome.flac"])
    >>> adapted.about["adapted"]["recordings"], adapted.about["adapted"]["speech_s"] > 4
    (1, True)
    """
    if isinstance(recordings, str | Path | Audio) or not len(recordings):
        raise InputError("recordings are not a list, or it is empty; required: one or more recordings of the speaker")
    chosen = model if isinstance(model, Model) else load_model(model)
    sounds = [recording if isinstance(recording, Audio) else read_audio(Path(recording)) for recording in recordings]
    estimated = estimate_adaptation(chosen.phones, sounds)
    about = {**chosen.about, "adapted": {"recordings": len(recordings), "speech_s": round(estimated.speech_s, 1)}}
    return replace(chosen, about=about, adaptation=estimated.adaptation)
