"""Speech to motion: ``animate(speech) → generation``; motion to files: ``write(generation, files)``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lipmotion.articulation.delivery import Delivery, closed_on_grid, closed_times, sound_units
from lipmotion.articulation.pauses import with_pauses
from lipmotion.articulation.phone_targets import GESTURES, with_gestures
from lipmotion.articulation.symmetry import symmetrical
from lipmotion.errors import ExportError, InputError
from lipmotion.export.base import check_motion, motion_format, motion_suffix, motion_suffixes, write_motion
from lipmotion.export.sound import SOUND_CODECS, write_sound
from lipmotion.export.timed_labels import LABEL_SUFFIXES, holds_labels, write_labels
from lipmotion.faces.base import Face, Staging
from lipmotion.faces.filmed.face import SUFFIX, FilmedFace, load_face
from lipmotion.faces.registry import FACES, face_named
from lipmotion.kernels.threads import one_thread
from lipmotion.meshes.fitting.blendshape_motion import is_of_blendshapes
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.motion.speakers import SpeakerMap
from lipmotion.pipeline.film.video import FILM, FilmOptions, check_film, film_of, write_film
from lipmotion.pipeline.generate.generation_for import generate_for
from lipmotion.pipeline.generate.outlook import outlook_of
from lipmotion.pipeline.generate.transfer import person_of
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outputs.curve_sets import WHOLE_FACE, with_curves
from lipmotion.pipeline.outputs.delivered import (
    check_delivery,
    delivered,
    delivered_scene,
    held_mouth,
    moved_prosody,
    shown,
)
from lipmotion.pipeline.outputs.drawn_video import (
    OPAQUE_SUFFIX,
    VIDEO_SUFFIXES,
    check_background,
    check_staging,
    prosody_heard,
    shows_face,
    write_drawn_face,
)
from lipmotion.pipeline.outputs.motion_files import (
    check_length,
    in_format,
    needs_prosody,
    resampled_curves,
    warn_of_unused,
)
from lipmotion.pipeline.outputs.scenes import SCENE_SUFFIXES, check_sound_name, is_scene, sound_reference, write_scene
from lipmotion.pipeline.understand.request import SpeechInput, SpeechRequest, request_of
from lipmotion.pipeline.understand.understood_speech import UnderstoodSpeech, understood_speech
from lipmotion.pipeline.workers import map_in_processes
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.storage.files import as_text, check_distinct, check_target
from lipmotion.storage.sources import is_file
from lipmotion.types import (
    Audio,
    Constraints,
    Generation,
    Monitor,
    Motion,
    Progress,
    Prosody,
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
    staging: Staging | None = None,
    delivery: Delivery | None = None,
    curves: str | Path | DrivenCharacter | None = None,
    temporary: bool = False,
    monitor: Monitor = silent_monitor,
) -> None:
    """Write generated motion to one or several files, each in the format of its suffix.

    generation : from ``animate``
    outputs  : paths of files: ``.json``, ``.csv``, ``.npz`` (motion), ``.livelink.csv`` (a take of Live Link Face),
               ``.glb``, ``.usda`` (a 3D character with its animation), ``.TextGrid`` (phones in time), ``.mp4``,
               ``.webm``, ``.mov`` (a drawn face, with sound), or ``NAME%05d.png`` (its pictures, without sound); where
               ``speech`` is a sound, also ``.wav``, ``.flac``, ``.ogg``
    speech   : the recording that was animated, or the sound, as of ``speak``; a video needs it for its sound
    model    : the model that generated the motion; motion files then name its corpus and licence
    channels : channels of motion files, in this order, also articulatory ones as ``tongue`` (docs/articulation.md);
               None: all of the motion
    rate_hz  : frames per second of motion files, 1 to 1000; None: the 100 of the model (Live Link Face: 60)
    fps      : frames per second of videos, 1 to 1000; None: 25 for drawn faces, those of the footage for filmed ones
    face     : the face of videos: ``portrait``, ``woman``, ``man``, ``cartoon``, one of an installed package, or a
               filmed face (a value or a ``.face`` file), which is written as ``.mp4``. ``.glb`` and ``.usda`` hold the
               character of a ``MeshFace``, or else the 3D head
    film     : how a filmed face is shown
    staging  : size and background of a drawn face, and what moves on its own (docs/faces.md); None: the
               defaults
    delivery : intensity, anticipation, offset and held poses of every output (docs/controls.md); None: the
               defaults
    curves   : what motion files hold instead of the motion, unless ``channels`` asks for more: ``arkit``, ``visemes``,
               ``fap``, a table of a rig (``.csv``), or a character with blendshapes (docs/meshes.md)
    temporary : whether ``speech`` is a file that will be gone, which outputs then do not name
    monitor  : receives reports of the progress of videos
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
    shown_face = opened_face(face)
    delivery, staging = delivery or Delivery(), staging or Staging()
    check_outputs(
        paths,
        recording,
        rate_hz=rate_hz,
        fps=fps,
        face=shown_face,
        film=film,
        staging=staging,
        delivery=delivery,
        with_sound=sound is not None,
    )
    videos = [path for path in paths if shows_face(path)]
    drawn = [path for path in paths if is_scene(path) or (shows_face(path) and not isinstance(shown_face, FilmedFace))]
    if drawn:
        check_drawable(drawn[0], generation.motion)
    sounds = [path for path in paths if path.suffix.lower() in SOUND_CODECS]
    scenes = [path for path in paths if is_scene(path)]
    lives = bool(scenes) or curves == WHOLE_FACE or any(map(needs_prosody, paths))
    heard = moved_prosody(prosody_heard(speech), delivery) if speech is not None and lives else None
    written = _motion_files(paths, generation, channels, curves, rate_hz, delivery, staging, heard)
    for path, each in written.items():
        check_motion(path, each.motion)
    heard_in = next(iter(sounds), None) if recording is None or temporary else Path(recording)
    scene = None
    for path in paths:
        if path in sounds and sound is not None:
            write_sound(path, sound)
        elif path in videos:
            played = sound or read_audio(Path(str(recording)), SOUND_RATE_HZ, warn=False)
            hertz = DRAWN_HZ if fps is None else fps
            character = curves if isinstance(curves, DrivenCharacter) else None
            seen = shown(generation, delivery, hertz, character)
            if isinstance(shown_face, FilmedFace):
                filmed = None if recording is None else Path(recording)
                frames = film_of(
                    shown_face, seen.motion, speech=filmed, sound=played, model=model, fps=fps, options=film
                )
                write_film(path, frames, played, mark=film.mark, monitor=monitor)
            else:
                loudness = moved_prosody(prosody_heard(played), delivery)
                write_drawn_face(path, seen, played, hertz, shown_face, staging, monitor, loudness)
        elif path in scenes:
            scene = scene or delivered_scene(generation, delivery, shown_face, rate_hz, staging=staging, prosody=heard)
            write_scene(path, scene, sound=heard_in)
        elif holds_labels(path):
            write_labels(path, sound_units(generation.units, delivery, float(generation.motion.time_s[-1])))
        else:
            _write_motion(written[path], path, heard_in, model, delivery.offset_ms / 1000)


def check_outputs(
    outputs: Sequence[str | Path],
    speech: str | Path | None = None,
    *,
    rate_hz: float | None = None,
    fps: float | None = None,
    face: str | Path | Face | FilmedFace = "portrait",
    film: FilmOptions = FILM,
    staging: Staging | None = None,
    delivery: Delivery | None = None,
    with_sound: bool = False,
) -> None:
    """Raise ExportError or InputError if an output cannot be written; called before long work begins.

    outputs, speech, rate_hz, fps, face, film, staging, delivery : as of ``write``
    with_sound : the speech is, or will be, a sound that is in no file
    """
    for hertz in (fps, rate_hz):
        if hertz is not None and not SLOWEST_HZ <= hertz <= FASTEST_HZ:
            raise InputError(f"the frame rate is {hertz}, required {SLOWEST_HZ:.0f} to {FASTEST_HZ:.0f} a second")
    shown_face = opened_face(face)
    check_film(shown_face, film, speech)
    check_staging(shown_face, staging or Staging())
    check_delivery(delivery or Delivery(), map(Path, outputs), shown_face)
    suffixes = (
        *motion_suffixes(),
        *VIDEO_SUFFIXES,
        *SCENE_SUFFIXES,
        *LABEL_SUFFIXES,
        *(SOUND_CODECS if with_sound else ()),
    )
    check_distinct([Path(path) for path in outputs])
    for path in map(Path, outputs):
        if not (motion_suffix(path) or path.suffix.lower() in map(str.lower, suffixes) or shows_face(path)):
            raise ExportError(f"{path}: unknown format {path.suffix!r}; required one of: {' '.join(suffixes)} %05d.png")
        check_target(path, speech)
        if motion_suffix(path) and speech is not None:
            check_length(path, Path(speech), rate_hz, (delivery or Delivery()).offset_ms / 1000)
        if is_scene(path) and speech is not None:
            check_sound_name(path, Path(speech))
        check_background(path, staging or Staging())
        if isinstance(shown_face, FilmedFace) and shows_face(path) and path.suffix.lower() != OPAQUE_SUFFIX:
            raise ExportError(f"{path}: filmed faces are written as {OPAQUE_SUFFIX}; name the output so")
        if shows_face(path) and speech is None and not with_sound:
            raise ExportError(f"{path}: a video needs the recording: write(..., speech=FILE)")


def check_drawable(path: Path, motion: Motion) -> None:
    """Raise ExportError if motion has no channel from which a face can be drawn."""
    if "opening" not in motion.names and not is_of_blendshapes(motion):
        raise ExportError(
            f"{path}: the motion has no channel 'opening' to draw a face from, nor the blendshape 'jawOpen'; write "
            "motion files"
        )


def opened_face(face: str | Path | Face | FilmedFace) -> Face | FilmedFace:
    """Return a face by its name, the one in a ``.face`` file, or the same face.

    Raises InputError: no such face or file. Raises ModelFormatError: the file is damaged, or of another version.
    """
    if isinstance(face, Face | FilmedFace):
        return face
    if Path(face).suffix.lower() == SUFFIX:
        return load_face(face)
    beside = Path(f"{face}{SUFFIX}")
    if str(face) not in FACES.names and is_file(beside):
        raise InputError(f"no drawn face {str(face)!r}; for the filmed face give its file: {beside}")
    return face_named(str(face))


def _motion_files(
    paths: Sequence[Path],
    generation: Generation,
    channels: Sequence[str] | None,
    curves: str | Path | DrivenCharacter | None,
    rate_hz: float | None,
    delivery: Delivery,
    staging: Staging,
    prosody: Prosody | None,
) -> dict[Path, Generation]:
    """Return what each motion file among some outputs holds."""
    files = [path for path in paths if motion_suffix(path)]
    if {*(channels or ())} & {*GESTURES}:
        generation = with_articulation(generation, channels or ())
    spoken = delivered(generation, delivery)
    closed_s = closed_times(spoken) if delivery.hold_ms else []
    if rate_hz is not None and (closed_s or rate_hz < spoken.motion.rate_hz):
        spoken = closed_on_grid(spoken, rate_hz)
    named, asked = channels, channels or ()
    if curves is not None and files:
        spoken, names = with_curves(spoken, curves, staging=staging, prosody=prosody)
        asked = asked if named or isinstance(curves, DrivenCharacter) else names
        channels = names if channels is None else channels
    chosen = spoken.selected(channels) if channels is not None else spoken
    if rate_hz is not None:
        chosen = chosen.resampled(rate_hz) if curves is None else resampled_curves(chosen, spoken, rate_hz)
    written = {path: in_format(path, spoken, chosen, rate_hz, staging, prosody, named) for path in files}
    for path, each in written.items():
        warn_of_unused(path, each, asked)
    return {
        path: held_mouth(each, delivery.hold_frames(each.motion.rate_hz), closed_s) for path, each in written.items()
    }


def _write_motion(
    generation: Generation, path: Path, speech: str | Path | None, model: Model | None, sound_s: float
) -> None:
    about = model.about if model else {}
    named = {key: _text(about[key]) for key in ("name", "corpus", "licence", "attribution") if about.get(key)}
    source = {"file": as_text(Path(speech).name)} if speech else {}
    if speech and sound_s:
        source["start_s"] = f"{sound_s:.9g}"
    if speech and motion_format(path).names_sound:
        source["path"] = sound_reference(Path(speech), path)
    write_motion(path, generation, source=source, model=named)


def _text(value: object) -> str:
    return as_text("; ".join(map(str, value)) if isinstance(value, list) else str(value))


def with_articulation(generation: Generation, channels: Sequence[str] = GESTURES) -> Generation:
    """Return the generation with articulatory channels that its motion lacks, as they follow from its phones.

    channels : the articulatory ones among these are added (docs/articulation.md); their variance is 0
    """
    motion = with_gestures(generation.motion, generation.units, channels)
    added = len(motion.channels) - len(generation.motion.channels)
    variance = np.pad(generation.variance, ((0, 0), (0, added))) if added else generation.spread
    return replace(generation, motion=motion, spread=variance)
