"""A model and untranscribed recordings of a voice to a model that hears this voice better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.model import Model, load_model
from lipmotion.speech.adaptation_estimation import estimate_adaptation
from lipmotion.speech.audio_files import read_audio
from lipmotion.types import Audio


@one_thread()
def adapt(model: Model | str | Path | None, recordings: Sequence[str | Path | Audio]) -> Model:
    """Return a model whose phone models are adapted to one voice; it recognises and aligns with them from then on.

    model      : from ``load_model``, or its file; None: the one that ships. An earlier adaptation is forgotten
    recordings : of the voice alone: audio or video files, or samples at 16 kHz; what is said need not be known
    Raises InputError: no recording, one that cannot be read, or too little speech in them.
    Raises MissingDependencyError: pocketsphinx is not installed.
    """
    if isinstance(recordings, str | Path | Audio) or not len(recordings):
        raise InputError("required: a list of one recording or more of the voice to adapt to")
    chosen = model if isinstance(model, Model) else load_model(model)
    found = estimate_adaptation(
        chosen.phones, [one if isinstance(one, Audio) else read_audio(Path(one)) for one in recordings]
    )
    about = {**chosen.about, "adapted": {"recordings": len(recordings), "speech_s": round(found.speech_s, 1)}}
    return replace(chosen, about=about, adaptation=found.adaptation)
