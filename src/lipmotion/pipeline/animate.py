"""Speech to motion, and motion to files: the main job."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lipmotion.errors import ExportError, InputError
from lipmotion.export.base import check_motion, motion_suffixes, write_motion
from lipmotion.faces.base import Face
from lipmotion.faces.registry import face_named
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.request import SpeechInput, request_of
from lipmotion.pipeline.understand import understand
from lipmotion.speech.audio_files import read_audio
from lipmotion.storage.files import as_text, check_distinct, check_target
from lipmotion.types import Constraints, Generation

VIDEO_SUFFIX = ".mp4"
SOUND_RATE_HZ = 48_000
"""The sound track of a rendered video."""
SLOWEST_HZ, FASTEST_HZ = 1.0, 1000.0
"""Frame rates that files are written at; a mistyped one must not fill the memory."""


@one_thread()
def animate(
    speech: SpeechInput,
    *,
    model: Model | str | Path | None = None,
    transcript: str | Path | None = None,
    constraints: Constraints | None = None,
) -> Generation:
    """Return the lip motion that goes with speech.

    speech      : an audio or video file, samples at 16 kHz, or a ``SpeechRequest``, which says what else is known
    model       : from ``load_model``, or its file; the shipped one by default
    transcript  : what is said, if known, or a Path to a text file: short for a request with this transcript
    constraints : values that the motion must take
    Raises InputError: the recording, the transcript or a constraint is not usable.
    Raises AlignmentError: the transcript does not fit into the recording.

    >>> import lipmotion
    >>> result = lipmotion.animate("examples/welcome.flac", transcript=Path("examples/welcome.txt"))
    >>> result.motion.rate_hz, result.motion.names[:3]
    (100.0, ('opening', 'width', 'outer'))
    """
    chosen = model if isinstance(model, Model) else load_model(model)
    return chosen.engine.generate(chosen.learned, understand(chosen, request_of(speech, transcript)), constraints)


def write(
    generation: Generation,
    outputs: str | Path | Sequence[str | Path],
    *,
    speech: str | Path | None = None,
    model: Model | None = None,
    channels: Sequence[str] | None = None,
    rate_hz: float | None = None,
    fps: float = 25.0,
    face: str = "portrait",
) -> None:
    """Write one result to one or several files, each in the format of its suffix.

    outputs  : ``.json``, ``.csv``, ``.npz`` (motion) or ``.mp4`` (the drawn face, with sound)
    speech   : the recording it came from; a video needs it
    model    : what made the result; motion files then name its corpus and licence
    channels : those to write to motion files, in this order; all by default
    rate_hz  : frames per second of motion files; the model's own 100 by default
    fps      : frames per second of videos
    face     : which face videos show: ``portrait``, or one that an installed package adds
    Raises ExportError: unknown suffix, no such folder, or a file that cannot be written.
    Raises InputError: a frame rate that is not from 1 to 1000, or an unknown channel or face.
    All of that is checked before the first file is written.
    """
    paths = [Path(output) for output in ([outputs] if isinstance(outputs, str | Path) else outputs)]
    check_outputs(paths, speech, rate_hz=rate_hz, fps=fps, face=face)
    videos = [path for path in paths if path.suffix.lower() == VIDEO_SUFFIX]
    if videos and "opening" not in generation.motion.names:
        raise ExportError(f"{videos[0]}: the motion has no channel 'opening' to draw a face from; write motion files")
    drawn = face_named(face)
    written = generation.selected(channels) if channels is not None else generation
    if rate_hz is not None:
        written = written.resampled(rate_hz)
    for path in paths:
        if path not in videos:
            check_motion(path, written.motion)
    for path in paths:
        if path.suffix.lower() == VIDEO_SUFFIX:
            _write_video(generation, path, Path(str(speech)), fps, drawn)
        else:
            _write_motion(written, path, speech, model)


def check_outputs(
    outputs: Sequence[str | Path],
    speech: str | Path | None = None,
    *,
    rate_hz: float | None = None,
    fps: float = 25.0,
    face: str = "portrait",
) -> None:
    """Raise ExportError or InputError unless every output can be written: before work begins, not after it."""
    for hertz in (fps, rate_hz):
        if hertz is not None and not SLOWEST_HZ <= hertz <= FASTEST_HZ:
            raise InputError(f"the frame rate is {hertz}, required {SLOWEST_HZ:.0f} to {FASTEST_HZ:.0f} a second")
    face_named(face)
    suffixes = (*motion_suffixes(), VIDEO_SUFFIX)
    check_distinct([Path(path) for path in outputs])
    for path in map(Path, outputs):
        if path.suffix.lower() not in suffixes:
            raise ExportError(f"{path}: unknown format {path.suffix!r}; required one of: {' '.join(suffixes)}")
        check_target(path, speech)
        if path.suffix.lower() == VIDEO_SUFFIX and speech is None:
            raise ExportError(f"{path}: a video needs the recording: write(..., speech=FILE)")


def _write_motion(generation: Generation, path: Path, speech: str | Path | None, model: Model | None) -> None:
    about = model.about if model else {}
    named = {key: _text(about[key]) for key in ("name", "corpus", "licence", "attribution") if about.get(key)}
    source = {"file": as_text(Path(speech).name)} if speech else {}
    write_motion(path, generation, source=source, model=named)


def _text(value: object) -> str:
    return as_text("; ".join(map(str, value)) if isinstance(value, list) else str(value))


def _write_video(generation: Generation, path: Path, speech: Path, fps: float, face: Face) -> None:
    from lipmotion.export.video import write_mp4

    frames = face.render(generation.motion, generation.units, fps=fps)
    write_mp4(path, frames, fps=fps, audio=read_audio(speech, SOUND_RATE_HZ))
