"""Speech to motion in one call: ``animate(speech) → generation``; one pass through a session."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lipmotion.pipeline.edits import CurveStep, Edits
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.request import SpeechInput, as_request
from lipmotion.pipeline.session import Session
from lipmotion.types import Constraints, Generation, Monitor, TimedTranscript, silent_monitor
from lipmotion.types.values import check_class

if TYPE_CHECKING:
    from lipmotion.pipeline.edit_files import EditFile


def animate(  # noqa: PLR0913
    speech: SpeechInput,
    *,
    model: Model | str | Path | None = None,
    transcript: str | Path | TimedTranscript | None = None,
    language: str | None = None,
    constraints: Constraints | None = None,
    edits: EditFile | Edits | str | Path | None = None,
    workers: int = 1,
    monitor: Monitor = silent_monitor,
    background: Callable[[], None] | None = None,
    curves: Iterable[str] = (),
) -> Generation:
    """Return lip motion for speech: values of all channels at 100 Hz, variances, phones in time, and states.

    speech      : an audio or video file, samples at 16 kHz, or a ``Request`` with all that is known of it
    model       : from ``load_model``, or the path of a model file; None: that of the request, or the shipped one
    transcript  : the spoken words, or a Path of a file with them; the same as a ``Request`` with this transcript
    language    : that is spoken; the same as a ``Request`` with this language (None: its own, or English)
    constraints : values that the motion must take exactly, in the units of the request's speaker; also of curves that
                  follow from it (``Session.generate``)
    edits       : what is changed of the motion, or the path of a file of edits (docs/edit.md), whose phones are used
                  where the request has no words and no phones. None: those of the request
    workers     : number of processes that recognise the words of a long recording. With more than one, a script must be
                  guarded by ``if __name__ == "__main__":``
    monitor     : receives reports of the progress
    background  : is called while these processes work, where there are several: to prepare what is done next
    curves      : names of further curves that outputs will have, and that may be edited: of a rig or a character
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
    check_class(constraints, Constraints | None, "constraints", "Constraints((Pin(...),))")
    request = as_request(speech, transcript, language)
    model = load_model(model or request.model)
    edits = request.edits if edits is None else edits
    how: dict[str, Any] = {"workers": workers, "monitor": monitor, "background": background, "curves": curves}
    if edits is None or isinstance(edits, Edits):
        session = Session(request, model=model, **how)
    else:
        from lipmotion.pipeline.edit_files import edit_file

        file = edit_file(edits)
        session, edits = file.session(request, model=model, **how), file.edits
    pins = constraints.pins if constraints else ()
    return session.generate((edits or Edits()).then(*map(CurveStep, pins)))
