"""Speech to motion: ``animate(speech) → generation``; motion to files: ``write(generation, files)``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lipmotion.errors import ExportError, InputError
from lipmotion.export.base import check_motion, motion_suffixes, write_motion
from lipmotion.export.sound import SOUND_CODECS, write_sound
from lipmotion.export.textgrid import TEXTGRID_SUFFIX, write_textgrid
from lipmotion.faces.base import Face
from lipmotion.faces.filmed.face import SUFFIX, FilmedFace, load_face
from lipmotion.faces.registry import face_named
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.film.video import FILM, FilmOptions, write_film
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outlook import outlook_of
from lipmotion.pipeline.request import SpeechInput, request_of
from lipmotion.pipeline.speakers import generate_for
from lipmotion.pipeline.transfer import person_of
from lipmotion.pipeline.understand import understood_speech
from lipmotion.pipeline.workers import map_in_processes
from lipmotion.speech.audio_files import read_audio
from lipmotion.storage.files import as_text, check_distinct, check_target
from lipmotion.types import Audio, Constraints, Generation, TimedTranscript

VIDEO_SUFFIX = ".mp4"
SOUND_RATE_HZ = 48_000
"""Sampling rate of the sound track of a drawn video."""
DRAWN_HZ = 25.0
"""Frame rate of videos of drawn faces."""
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
) -> Generation:
    """Return lip motion for speech: values of all channels at 100 Hz, variances, phones in time, and states.

    speech      : an audio or video file, samples at 16 kHz, or a ``SpeechRequest`` with all that is known of it
    model       : from ``load_model``, or the path of a model file; None: the shipped model
    transcript  : the spoken words, or a Path of a file with them; the same as a ``SpeechRequest`` with this transcript
    constraints : values that the motion must take exactly, in the units of the request's speaker
    workers     : number of processes that recognise the words of a long recording. With more than one, a script must be
                  guarded by ``if __name__ == "__main__":``
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
    chosen = model if isinstance(model, Model) else load_model(model)
    request = request_of(speech, transcript)
    person = person_of(chosen, request)
    understood = understood_speech(chosen, request, map_in_processes(workers))
    generation = generate_for(person, chosen.engine, chosen.learned, understood.speech, constraints)
    return replace(generation, outlook=outlook_of(request, understood))


def write(
    generation: Generation,
    outputs: str | Path | Sequence[str | Path],
    *,
    speech: str | Path | Audio | None = None,
    model: Model | None = None,
    channels: Sequence[str] | None = None,
    rate_hz: float | None = None,
    fps: float | None = None,
    face: str | Path | Face | FilmedFace = "portrait",
    film: FilmOptions = FILM,
) -> None:
    """Write generated motion to one or several files, each in the format of its suffix.

    generation : from ``animate``
    outputs  : paths of files: ``.json``, ``.csv``, ``.npz`` (motion), ``.TextGrid`` (phones in time) or ``.mp4`` (a
               drawn face, with sound); where ``speech`` is a sound, also ``.wav``, ``.flac``, ``.ogg``
    speech   : the recording that was animated, or the sound, as of ``speak``; a video needs it for its sound
    model    : the model that generated the motion; motion files then name its corpus and licence
    channels : channels of motion files, in this order; None: all
    rate_hz  : frames per second of motion files, 1 to 1000; None: the 100 of the model
    fps      : frames per second of videos, 1 to 1000; None: 25 for drawn faces, those of the footage for filmed ones
    face     : the face of videos: ``portrait``, the name of a face of an installed package, or a filmed face (a value
               or a ``.face`` file)
    film     : how a filmed face is shown
    Raises ExportError: unknown suffix, no such folder, or a file that cannot be written.
    Raises InputError: a frame rate out of its range, or an unknown channel or face.
    The arguments are checked before the first file is written.

    >>> import lipmotion, tempfile
    >>> from pathlib import Path
    >>> result = lipmotion.animate("examples/welcome.flac")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     lipmotion.write(result, Path(folder) / "welcome.csv", rate_hz=25, channels=["opening", "width"])
    ...     print((Path(folder) / "welcome.csv").read_text().splitlines()[0])
    time_s,opening,width
    """
    paths = [Path(output) for output in ([outputs] if isinstance(outputs, str | Path) else outputs)]
    sound = speech if isinstance(speech, Audio) else None
    recording = None if isinstance(speech, Audio) else speech
    check_outputs(paths, recording, rate_hz=rate_hz, fps=fps, face=face, with_sound=sound is not None)
    videos = [path for path in paths if path.suffix.lower() == VIDEO_SUFFIX]
    shown_face = opened_face(face)
    if videos and not isinstance(shown_face, FilmedFace) and "opening" not in generation.motion.names:
        raise ExportError(f"{videos[0]}: the motion has no channel 'opening' to draw a face from; write motion files")
    written = generation.selected(channels) if channels is not None else generation
    if rate_hz is not None:
        written = written.resampled(rate_hz)
    sounds = [path for path in paths if path.suffix.lower() in SOUND_CODECS]
    for path in paths:
        if path.suffix.lower() in motion_suffixes():
            check_motion(path, written.motion)
    for path in paths:
        if path in sounds and sound is not None:
            write_sound(path, sound)
        elif path in videos:
            heard = sound or read_audio(Path(str(recording)), SOUND_RATE_HZ, warn=False)
            if isinstance(shown_face, FilmedFace):
                filmed = None if recording is None else Path(recording)
                write_film(
                    path, shown_face, generation.motion, heard, speech=filmed, model=model, fps=fps, options=film
                )
            else:
                _write_video(generation, path, heard, DRAWN_HZ if fps is None else fps, shown_face)
        elif path.suffix.lower() == TEXTGRID_SUFFIX.lower():
            write_textgrid(path, generation.units)
        else:
            _write_motion(written, path, recording, model)


def check_outputs(
    outputs: Sequence[str | Path],
    speech: str | Path | None = None,
    *,
    rate_hz: float | None = None,
    fps: float | None = None,
    face: str | Path | Face | FilmedFace = "portrait",
    with_sound: bool = False,
) -> None:
    """Raise ExportError or InputError if an output cannot be written; called before long work begins.

    outputs, speech, rate_hz, fps, face : as of ``write``
    with_sound : the speech is, or will be, a sound that is in no file
    """
    for hertz in (fps, rate_hz):
        if hertz is not None and not SLOWEST_HZ <= hertz <= FASTEST_HZ:
            raise InputError(f"the frame rate is {hertz}, required {SLOWEST_HZ:.0f} to {FASTEST_HZ:.0f} a second")
    opened_face(face)
    suffixes = (*motion_suffixes(), VIDEO_SUFFIX, TEXTGRID_SUFFIX, *(SOUND_CODECS if with_sound else ()))
    check_distinct([Path(path) for path in outputs])
    for path in map(Path, outputs):
        if path.suffix.lower() not in map(str.lower, suffixes):
            raise ExportError(f"{path}: unknown format {path.suffix!r}; required one of: {' '.join(suffixes)}")
        check_target(path, speech)
        if path.suffix.lower() == VIDEO_SUFFIX and speech is None and not with_sound:
            raise ExportError(f"{path}: a video needs the recording: write(..., speech=FILE)")


def opened_face(face: str | Path | Face | FilmedFace) -> Face | FilmedFace:
    """Return a face by its name, the one in a ``.face`` file, or the same face.

    Raises InputError: no such face or file. Raises ModelFormatError: the file is damaged, or of another version.
    """
    if isinstance(face, Face | FilmedFace):
        return face
    if Path(face).suffix.lower() == SUFFIX:
        return load_face(face)
    return face_named(str(face))


def _write_motion(generation: Generation, path: Path, speech: str | Path | None, model: Model | None) -> None:
    about = model.about if model else {}
    named = {key: _text(about[key]) for key in ("name", "corpus", "licence", "attribution") if about.get(key)}
    source = {"file": as_text(Path(speech).name)} if speech else {}
    write_motion(path, generation, source=source, model=named)


def _text(value: object) -> str:
    return as_text("; ".join(map(str, value)) if isinstance(value, list) else str(value))


def _write_video(generation: Generation, path: Path, sound: Audio, fps: float, face: Face) -> None:
    from lipmotion.export.video import write_mp4

    frames = face.render(generation.motion, generation.units, fps=fps)
    write_mp4(path, frames, fps=fps, audio=sound)
