"""Speech to motion: ``animate(speech) → generation``; motion to files: ``write(generation, files)``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from lipmotion.articulation.pauses import with_pauses
from lipmotion.articulation.symmetry import symmetrical
from lipmotion.errors import InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.motion.speakers import SpeakerMap
from lipmotion.pipeline.generate.generation_for import generate_for
from lipmotion.pipeline.generate.outlook import outlook_of
from lipmotion.pipeline.generate.transfer import person_of
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.understand.request import SpeechInput, SpeechRequest, request_of
from lipmotion.pipeline.understand.understood_speech import UnderstoodSpeech, understood_speech
from lipmotion.pipeline.workers import map_in_processes
from lipmotion.types import (
    Constraints,
    Generation,
    Monitor,
    Progress,
    TimedTranscript,
    silent_monitor,
)

SOUND_RATE_HZ = 48_000
"""Sampling rate of the sound track of a drawn video."""
DRAWN_HZ = 25.0
"""Frame rate of videos of drawn faces."""
MOVING = 0.9
"""The share of the work that is recognition, in reports; the rest is the generation of motion."""
SLOWEST_HZ, FASTEST_HZ = 1.0, 1000.0
"""Smallest and largest frame rate of a file; a mistyped rate must not fill the memory."""


@one_thread()
def animate(
    speech: SpeechInput,
    *,
    model: Model | str | Path | None = None,
    transcript: str | Path | TimedTranscript | None = None,
    constraints: Constraints | None = None,
    workers: int = 1,
    monitor: Monitor = silent_monitor,
    meanwhile: Callable[[], None] | None = None,
) -> Generation:
    """Return lip motion for speech: values of all channels at 100 Hz, variances, phones in time, and states.

    speech      : an audio or video file, samples at 16 kHz, or a ``SpeechRequest`` with all that is known of it
    model       : from ``load_model``, or the path of a model file; None: the shipped model
    transcript  : the spoken words, or a Path of a file with them; the same as a ``SpeechRequest`` with this transcript
    constraints : values that the motion must take exactly, in the units of the request's speaker
    workers     : number of processes that recognise the words of a long recording. With more than one, a script must be
                  guarded by ``if __name__ == "__main__":``
    monitor     : receives reports of the progress
    meanwhile   : is called while these processes work, where there are several: to prepare what is done next
    Raises InputError: the recording, the transcript or a constraint is not usable, or the model knows no such speaker.
    Raises AlignmentError: the transcript cannot be aligned with the recording.
    Source: Hofer, Yamagishi & Shimodaira 2008 (``engines.trajectory``, the engine of the shipped model).

    >>> import lipmotion
    >>> from pathlib import Path
    >>> result = lipmotion.animate("examples/welcome.flac", transcript=Path("examples/welcome.txt"))
    >>> result.motion.rate_hz, result.motion.names[:3]
    (100.0, ('opening', 'width', 'outer'))
    >>> result.units[1].label.word
    'please'
    """
    if not isinstance(constraints, Constraints | None):
        raise InputError(f"the constraints are a {type(constraints).__name__}, required Constraints((Pin(...),))")
    chosen = model if isinstance(model, Model) else load_model(model)
    request = request_of(speech, transcript)
    person = person_of(chosen, request)
    understood = understood_speech(chosen, request, map_in_processes(workers, meanwhile), monitor)
    monitor(Progress("moving the mouth", 0, 1, MOVING))
    generation = generation_of(request, person, chosen, understood, constraints)
    monitor(Progress("moving the mouth", 1, 1, 1.0))
    return generation


def generation_of(
    request: SpeechRequest,
    person: SpeakerMap | None,
    model: Model,
    understood: UnderstoodSpeech,
    constraints: Constraints | None = None,
) -> Generation:
    """Return the motion of understood speech, with pauses and asymmetry as asked for, and what to expect of it.

    person : of ``person_of``
    Raises InputError: a constraint is not usable.
    """
    generation = generate_for(person, model.engine, model.learned, understood.speech, constraints)
    pinned_s = [pin.time_s for pin in constraints.pins] if constraints else []
    if request.onto is None:
        generation = replace(generation, motion=symmetrical(generation.motion, request.asymmetry))
    return replace(with_pauses(generation, request.pauses, pinned_s), outlook=outlook_of(request, understood))
