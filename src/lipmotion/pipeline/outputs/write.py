"""Motion to files: ``write(generation, files)``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from lipmotion.articulation.delivery import Delivery, delay_units
from lipmotion.errors import ExportError
from lipmotion.extensions import load_provided
from lipmotion.formats.label_files import LABEL_SUFFIXES, write_labels
from lipmotion.formats.sound import SOUND_CODECS, write_sound
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.outputs.output import Output, OutputSettings, Performance, create_outputs
from lipmotion.pipeline.request import Outputs
from lipmotion.types import Audio, Generation, Monitor, silent_monitor
from lipmotion.types.delivery import Staging


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
    channels: Sequence[str] | None = None,
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
               ``.glb``, ``.usda`` (a 3D character with its animation), ``.TextGrid`` (phones in time), ``.mp4``,
               ``.webm``, ``.mov`` (a drawn face, with sound), or ``NAME%05d.png`` (its pictures, without sound); where
               ``speech`` is a sound, also ``.wav``, ``.flac``, ``.ogg``
    speech   : the recording that was animated, or the sound, as of ``speak``; a video needs it for its sound
    model    : the model that generated the motion, whose corpus and licence motion files name; None: those that the
               generation names
    channels : channels of motion files, in this order, also articulatory ones as ``tongue`` (docs/articulation.md);
               None: all of the motion
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
    sound = speech if isinstance(speech, Audio) else None
    how = replace(film or Outputs(), channels=tuple(channels or ()), rate_hz=rate_hz, fps=fps)
    settings = OutputSettings(
        load_provided("shown_face")(face),
        None if speech is None or sound is not None else Path(str(speech)),
        sound is not None,
        how,
        curves,
        staging or Staging(),
        delivery or Delivery(),
    )
    planned = create_outputs([outputs] if isinstance(outputs, str | Path) else outputs, settings)
    write_planned(generation, planned, settings, sound=sound, model=model, temporary=temporary, monitor=monitor)


def write_planned(
    generation: Generation,
    planned: Sequence[Output],
    settings: OutputSettings,
    *,
    sound: Audio | None = None,
    model: Model | None = None,
    temporary: bool = False,
    monitor: Monitor = silent_monitor,
) -> None:
    """Write generated motion to the outputs of ``create_outputs``.

    model, temporary, monitor : as of ``write``. Raises as ``write``.
    """
    sounds = (output.path for output in planned if isinstance(output, SoundOutput))
    sound_file = next(sounds, None) if settings.recording is None or temporary else settings.recording
    performance = Performance(generation, settings, sound, sound_file, model, monitor)
    for write_file in [output.prepare(performance) for output in planned]:  # nothing, if the motion does not suit one
        write_file()
