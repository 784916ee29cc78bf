"""Outputs: ``plan(path, settings) → Output``, one class for every kind of file.

A new kind is a class of ``Output`` in a module of its own, and a line in ``OUTPUTS``, or an entry point of the group
``lipmotion.outputs`` of an installed package (docs/extend/output.md).
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lipmotion.articulation.delivery import Delivery, delay_units
from lipmotion.errors import ExportError, shorten_list
from lipmotion.extensions import Registry, load_provided
from lipmotion.formats.label_files import LABEL_SUFFIXES, write_labels
from lipmotion.formats.sound import SOUND_CODECS, write_sound
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Outputs
from lipmotion.speech.features.f0 import find_prosody
from lipmotion.speech.features.mfcc import WINDOW
from lipmotion.speech.sound.analysed_audio import AnalysedAudio
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.storage.files import check_distinct, check_target
from lipmotion.storage.sources import VIDEO_SUFFIXES
from lipmotion.types import SPEECH_RATE_HZ, Audio, Generation, Monitor, Prosody, silent_monitor
from lipmotion.types.delivery import Staging
from lipmotion.types.progress import sub_monitor, with_progress
from lipmotion.types.values import check_class

LOG = logging.getLogger("lipmotion")
Made = TypeVar("Made")


class ShownFace(ABC):
    """A face with all that outputs ask of it."""

    has_own_background = False
    """Whether the background is footage, and not a colour."""
    character: DrivenCharacter | None = None
    """The character that is drawn, of which curves may be edited."""

    @abstractmethod
    def check(self, settings: OutputSettings) -> None:
        """Raise InputError if the face cannot be shown as the settings say; called before long work begins."""

    @abstractmethod
    def check_video(self, path: Path, settings: OutputSettings) -> None:
        """Raise ExportError or InputError if a video or pictures of that name cannot show the face so."""

    @abstractmethod
    def check_drawable(self, path: Path, generation: Generation) -> None:
        """Raise ExportError if a generation has nothing from which the face can be drawn."""

    @abstractmethod
    def write_video(self, path: Path, performance: Performance) -> None:
        """Write a video, or pictures. Raises InputError: the motion lacks channels. Raises ExportError: as writers."""

    @abstractmethod
    def build_scene(
        self, generation: Generation, settings: OutputSettings, prosody: Prosody | None, frames: slice | None = None
    ) -> Any:
        """Return the character of files for 3D programs, with its animation.

        frames : of the motion: the only ones that are wanted; None: all
        """

    def find_other_person(self, model: Model, speaker: str = "") -> Any:  # noqa: ARG002
        """Return the person (as of ``Request.onto``) onto whom the motion of a model must be mapped; None: nobody.

        speaker : of the people of the model whose motion is generated
        """
        return None

    def load(self) -> None:
        """Load what draws the face, so that drawing begins sooner."""
        return


@dataclass(frozen=True)
class OutputSettings:
    """What outputs hold, and how they show it: known, and checked, before there is motion.

    face      : of videos and scenes, from ``shown_face``
    outputs   : rates, channels, and how a filmed face is shown; a ``background`` there is footage
    staging, delivery : as of ``write``
    curves    : what motion files hold instead of the motion; None: nothing
    recording : the file that was, or will be, animated; None: there is none
    sounded   : whether there is, or will be, a sound that is in no file
    """

    face: ShownFace
    recording: Path | None = None
    sounded: bool = False
    outputs: Outputs = field(default_factory=Outputs)
    curves: str | Path | DrivenCharacter | None = None
    staging: Staging = field(default_factory=Staging)
    delivery: Delivery = field(default_factory=Delivery)


@dataclass(frozen=True, eq=False)
class Performance:
    """Generated motion with all that its outputs need of it.

    sound   : the sound, where it is in no file; None: that of the recording of the settings
    sound_file : the file of the sound that outputs refer to; None: they refer to none
    monitor : receives reports of the progress
    """

    generation: Generation
    settings: OutputSettings
    sound: Audio | None = None
    sound_file: Path | None = None
    model: Model | None = None
    monitor: Monitor = silent_monitor
    _cache: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def speech(self) -> Path | Audio | None:
        """The sound, or else the recording; None: there is neither."""
        return self.sound or self.settings.recording

    def cached(self, make: Callable[[Performance], Made]) -> Made:
        """Return what a function makes of this performance; outputs that need the same share it."""
        if make not in self._cache:
            self._cache[make] = make(self)
        made: Made = self._cache[make]
        return made


class Output(ABC):
    """A file that is written of a performance."""

    draws = False
    """Whether it shows a face in pictures, which takes longer than motion."""

    def __init__(self, path: Path, settings: OutputSettings) -> None:
        self.path, self.settings = path, settings

    @classmethod
    @abstractmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:
        """Return the ends of names of such files, as messages list them."""

    @classmethod
    def takes(cls, path: Path, settings: OutputSettings) -> bool:
        """Return whether a file of that name is such an output: whether it ends in one of the suffixes."""
        name = path.name.lower()
        return any(len(name) > len(end) and name.endswith(end.lower()) for end in cls.suffixes(settings))

    def check(self) -> None:
        """Raise ExportError or InputError if the file cannot be written; called before long work begins."""
        return

    @abstractmethod
    def prepare(self, performance: Performance) -> Callable[[], None]:
        """Return a function that writes the file; whole or not at all.

        Raises ExportError or InputError: the motion does not suit the file. So nothing is written if one of several
        outputs cannot be.
        """


_HERE = "lipmotion.pipeline.outputs"
OUTPUTS: Registry[type[Output]] = Registry(
    "output",
    "lipmotion.outputs",
    {
        "motion": f"{_HERE}.motion_files:MotionOutput",
        "labels": f"{_HERE}.output:LabelOutput",
        "sound": f"{_HERE}.output:SoundOutput",
        "cues": f"{_HERE}.cues:CueOutput",
    },
    Output,
)
"""Kinds of outputs; those that show a face are entry points of the package of faces."""


def plan(path: str | Path, settings: OutputSettings) -> Output:
    """Return the output of a path; the longest suffix counts. Raises ExportError: no kind of output has such a name."""
    file, name, ends = Path(path), Path(path).name.lower(), list_outputs(settings)

    def length(kind: type[Output]) -> int:
        return max((len(suffix) for suffix in kind.suffixes(settings) if name.endswith(suffix.lower())), default=0)

    taking = [kind for kind in map(OUTPUTS.load, OUTPUTS.names) if kind.takes(file, settings)]
    if taking:
        return max(taking, key=length)(file, settings)
    likely = ".mp4" if file.suffix.lower() in VIDEO_SUFFIXES else file.suffix.lower() or "\0"
    meant = [f"{file.stem}.{end.removeprefix('.')}, or " for end in ends if end.endswith(likely)]
    raise ExportError(f"{path}: unknown format {file.suffix!r}; required {''.join(meant)}one of: {' '.join(ends)}")


def list_outputs(settings: OutputSettings) -> tuple[str, ...]:
    """Return the ends of names of all outputs, as messages list them."""
    return tuple(suffix for kind in map(OUTPUTS.load, OUTPUTS.names) for suffix in kind.suffixes(settings))


def create_outputs(paths: Iterable[str | Path], settings: OutputSettings) -> list[Output]:
    """Return the outputs of some paths. Raises ExportError or InputError: one cannot be written as the settings say."""
    settings.face.check(settings)
    planned = [plan(path, settings) for path in paths]
    check_distinct([output.path for output in planned])
    for output in planned:
        check_target(output.path, settings.recording)
        output.check()
    return planned


def measure_prosody(speech: str | Path | Audio) -> Prosody:
    """Return loudness and pitch of a recording or a sound, for movements of brows and head.

    A sound that is shorter than one frame of speech is followed by silence. One that keeps its features keeps this.
    Raises InputError: the recording cannot be read.
    """
    if isinstance(speech, AnalysedAudio):
        return speech.cached("prosody", lambda: _prosody(speech))
    return _prosody(speech if isinstance(speech, Audio) else read_audio(Path(speech), SPEECH_RATE_HZ, warn=False))


def _prosody(sound: Audio) -> Prosody:
    samples = sound.samples.astype(np.float32)
    if sound.rate_hz != SPEECH_RATE_HZ:
        from scipy.signal import resample_poly

        samples = resample_poly(samples, SPEECH_RATE_HZ, int(sound.rate_hz)).astype(np.float32)
    missing = max(WINDOW - len(samples), 0)
    return find_prosody(Audio(np.pad(samples, (0, missing)), SPEECH_RATE_HZ))


def shift_prosody(prosody: Prosody, delivery: Delivery) -> Prosody:
    """Return loudness and pitch on the timeline of files: later by the offset."""
    frames = round(delivery.offset_ms / 10)
    if frames <= 0:
        return Prosody(prosody.level_db[-frames:], prosody.log_f0[-frames:])
    quiet = np.full(frames, prosody.level_db.min(initial=0.0))
    return Prosody(np.concatenate([quiet, prosody.level_db]), np.concatenate([quiet * np.nan, prosody.log_f0]))


def measure_recorded_prosody(performance: Performance) -> Prosody | None:
    """Return loudness and pitch of what is performed, on the timeline of files; None: there is no sound."""
    speech = performance.speech
    return None if speech is None else shift_prosody(measure_prosody(speech), performance.settings.delivery)


class LabelOutput(Output):
    """``.TextGrid``, ``.vtt``, ``.srt``: phones and words, in the time of the sound."""

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102, ARG003
        return LABEL_SUFFIXES

    def prepare(self, performance: Performance) -> Callable[[], None]:  # noqa: D102
        generation = performance.generation
        end_s = float(generation.motion.time_s[-1])
        return partial(write_labels, self.path, delay_units(generation.units, self.settings.delivery, end_s))


class SoundOutput(Output):
    """``.wav``, ``.flac``, ``.ogg``: a sound that is in no file yet."""

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102
        return tuple(SOUND_CODECS) if settings.sounded else ()

    def prepare(self, performance: Performance) -> Callable[[], None]:  # noqa: D102
        if performance.sound is None:
            raise ExportError(f"{self.path}: there is no sound to write; give one: write(..., speech=Audio(...))")
        return partial(write_sound, self.path, performance.sound)


def write(  # noqa: PLR0913
    generation: Generation,
    outputs: str | Path | Sequence[str | Path],
    *,
    speech: str | Path | Audio | None = None,
    model: Model | None = None,
    channels: str | Sequence[str] | None = None,
    rate_hz: float | None = None,
    fps: float | None = None,
    face: Any = "portrait",
    film: Outputs | None = None,
    staging: Staging | None = None,
    delivery: Delivery | None = None,
    curves: str | Path | DrivenCharacter | None = None,
    temporary: bool = False,
    monitor: Monitor = silent_monitor,
) -> None:
    """Write generated motion to one or several files, each in the format of its suffix.

    generation : from ``animate``
    outputs  : paths of files: ``.json``, ``.csv``, ``.npz`` (motion), ``.livelink.csv`` (a take of Live Link Face),
               ``.glb``, ``.usda``, ``.fbx`` (a 3D character with its animation), ``.TextGrid`` (phones in time),
               ``.mp4``, ``.webm``, ``.mov`` (a drawn face, with sound), or ``NAME%05d.png`` (its pictures, without
               sound); where ``speech`` is a sound, also ``.wav``, ``.flac``, ``.ogg``
    speech   : the recording that was animated, or the sound, as of ``speak``; a video needs it for its sound
    model    : the model that generated the motion, whose corpus and licence motion files name; None: those that the
               generation names
    channels : channels of motion files, in this order, also articulatory ones as ``tongue`` (docs/articulation.md), or
               a text as ``opening,width``; None: all of the motion
    rate_hz  : frames per second of motion files, 1 to 1000; None: the 100 of the model (Live Link Face: 60)
    fps      : frames per second of videos, 1 to 240; None: 25 for drawn faces, those of the footage for filmed ones
    face     : the face of videos: ``portrait``, ``woman``, ``man``, ``cartoon``, one of an installed package, or a
               filmed face (a value or a ``.face`` file), which is written as ``.mp4``. ``.glb`` and ``.usda`` hold the
               character of a ``MeshFace``, or else the 3D head
    film     : how a filmed face is shown: its background, jaw, overlay, mark, refinement; None: the defaults
    staging  : size and background of a drawn face, and what moves on its own (docs/faces.md); None: the
               defaults
    delivery : intensity, anticipation, offset and held poses of every output (docs/controls.md); None: the
               defaults
    curves   : what motion files hold instead of the motion, unless ``channels`` asks for more: ``arkit``, ``visemes``,
               ``fap``, a table of a rig (``.csv``), or a character with blendshapes (docs/meshes.md)
    temporary : whether ``speech`` is a file that will be gone, which outputs then do not name
    monitor  : receives reports of the progress
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
    check_class(generation, Generation, "generation", "what animate returned")
    check_class(delivery, Delivery | None, "delivery", "Delivery(intensity=1.2)")
    channels = channels.split(",") if isinstance(channels, str) else channels
    sound = speech if isinstance(speech, Audio) else None
    settings = OutputSettings(
        load_provided("shown_face")(face),
        None if speech is None or sound is not None else Path(str(speech)),
        sound is not None,
        replace(film or Outputs(), channels=tuple(channels or ()), rate_hz=rate_hz, fps=fps),
        curves,
        staging or Staging(),
        delivery or Delivery(),
    )
    performance = Performance(generation, settings, sound, settings.recording, model, monitor)
    write_performance(performance, [outputs] if isinstance(outputs, str | Path) else outputs, temporary=temporary)


def write_performance(performance: Performance, outputs: Sequence[str | Path], *, temporary: bool = False) -> None:
    """Write what is performed to files; ``temporary``: as of ``write``. Raises as that."""
    planned = create_outputs(outputs, performance.settings)
    end_s = len(performance.generation.motion.values) / performance.generation.motion.rate_hz
    if late := [str(key) for key in performance.settings.delivery.moods if key.time_s > end_s]:
        LOG.warning("the motion ends at %.2f s, before these moods, which are not shown: %s", end_s, shorten_list(late))
    if performance.sound_file is None or temporary:
        written = (output.path for output in planned if isinstance(output, SoundOutput))
        performance = replace(performance, sound_file=next(written, None))
    shown = sub_monitor(performance.monitor, 0.0, float(not any(output.draws for output in planned)))
    prepared = with_progress(planned, "preparing the files", shown)
    for write_file in [output.prepare(performance) for output in prepared]:  # nothing, if the motion does not suit one
        write_file()
