"""Mouth shapes for 2D animation: ``cues(generation) → cue sheet``; cue sheets to files: ``write_cues``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from lipmotion.articulation.cue_sheets import CUES_FPS, CueSheet, choose_cues
from lipmotion.articulation.delivery import Delivery, shift_in_time
from lipmotion.errors import ExportError, InputError
from lipmotion.formats.cues import CUE_FORMATS, find_format, write_cue_file
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.pipeline.outputs.curve_sets import show_edited_curves
from lipmotion.pipeline.outputs.output import Output, OutputSettings, Performance
from lipmotion.storage.files import as_text, check_distinct, check_target
from lipmotion.types import Generation
from lipmotion.types.values import check_class
from lipmotion.units.phones import OPTIONAL, SHAPES

SHEET = ".cues."  # what the name of a cue sheet among other outputs has before its format
FASTEST_FPS = 100.0
"""Largest frame rate: times in cue files are in hundredths of a second, and two frames must not share one."""


def cues(
    generation: Generation,
    *,
    fps: float = 24.0,
    hold_frames: int | None = None,
    shapes: str = OPTIONAL,
    delivery: Delivery | None = None,
) -> CueSheet:
    """Return the mouth shapes of generated motion for 2D animation, each held for a least number of frames.

    generation  : from ``animate``; without a channel ``opening``, shapes are chosen from the phones alone
    fps         : frames per second of the animation, 1 to 100
    hold_frames : smallest number of frames of a shape; None: as many as last two frames at 24 frames per second
    shapes      : the optional shapes among ``G``, ``H`` and ``X`` that the character has, besides A to F, in any case
    delivery    : intensity, anticipation and offset of the shapes, and the least time of each (docs/controls.md); of
                  this and ``hold_frames`` the longer one counts. None: as generated
    Raises InputError: an argument out of its range.
    Raises ExportError: the generation has no phones, or has values that are not finite.

    >>> import lipmotion
    >>> sheet = lipmotion.cues(lipmotion.animate("examples/welcome.flac"))
    >>> sheet.cues[0]
    Span(start_s=0.0, end_s=0.5, label='X')
    """
    check_class(generation, Generation, "generation", "what animate returned")
    check_cue_options(fps, hold_frames, shapes)
    if len(generation.motion.values) and not len(generation.units):
        raise ExportError("the motion has no phones, which cues need; give them by --units, or animate the recording")
    if not np.isfinite(generation.motion.values).all():
        raise ExportError("the motion has values that are not finite; interpolate them first")
    chosen = delivery or Delivery()
    hold_frames = max(hold_frames or 0, chosen.hold_frames(fps)) or None
    generation = show_edited_curves(replace(generation, motion=with_mouth(generation.motion)))
    return choose_cues(shift_in_time(generation, chosen), fps, hold_frames, shapes.upper(), intensity=chosen.intensity)


def write_cues(
    sheet: CueSheet, outputs: str | Path | Sequence[str | Path], *, speech: str | Path = "", form: str | None = None
) -> None:
    """Write a cue sheet to one or several files, each in the format of its suffix.

    sheet   : from ``cues``
    outputs : paths of files: ``.tsv``, ``.xml``, ``.json`` (formats of Rhubarb), ``.dat`` (Moho), ``.pgo`` (Papagayo),
              ``.spine.json`` (Spine)
    speech  : the recording that was animated; ``.xml`` and ``.json`` files name it
    form    : ``tsv``, ``xml``, ``json``, ``dat``, ``pgo`` or ``spine.json``: the format of all files; None: that of
              their suffix
    Raises ExportError: unknown format, no such folder, or a file that cannot be written.
    Formats and folders are checked before the first file is written.

    >>> import lipmotion, tempfile
    >>> from pathlib import Path
    >>> sheet = lipmotion.cues(lipmotion.animate("examples/welcome.flac"))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     lipmotion.write_cues(sheet, Path(folder) / "welcome.tsv")
    ...     print((Path(folder) / "welcome.tsv").read_text().splitlines()[0].split())
    ['0.00', 'X']
    """
    paths = [Path(output) for output in ([outputs] if isinstance(outputs, str | Path) else outputs)]
    check_cue_outputs(paths, speech, form)
    for path in paths:
        write_cue_file(path, sheet, as_text(speech), form or find_format(path))


def check_cue_options(fps: float, hold_frames: int | None, shapes: str) -> None:
    """Raise InputError if an argument of ``cues`` is out of its range."""
    if not 1 <= fps <= FASTEST_FPS:
        raise InputError(f"the frame rate is {fps}, required 1 to {FASTEST_FPS:.0f} a second")
    if hold_frames is not None and not 1 <= hold_frames <= fps:
        raise InputError(f"the hold is {hold_frames} frames, required 1 to {int(fps)}: at most a second")
    if set(shapes.upper()) - set(SHAPES):
        raise InputError(f"the optional shapes are {shapes!r}, required letters out of {OPTIONAL!r}, or none")


def check_cue_outputs(outputs: Sequence[Path], speech: str | Path, form: str | None) -> None:
    """Raise ExportError if an output of ``write_cues`` cannot be written."""
    if form is not None and form not in CUE_FORMATS:
        raise ExportError(f"unknown cue format {form!r}; required one of: {' '.join(CUE_FORMATS)}")
    check_distinct(outputs)
    for path in outputs:
        if form is None:
            find_format(path)
        check_target(path, speech or None)


class CueOutput(Output):
    """``NAME.cues.tsv``, ``.cues.xml``, …: a cue sheet among other outputs."""

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102, ARG003
        return tuple(f"{SHEET}{form}" for form in CUE_FORMATS)

    def check(self) -> None:  # noqa: D102
        check_cue_options(self.settings.outputs.fps or CUES_FPS, None, OPTIONAL)

    def prepare(self, performance: Performance) -> Callable[[], None]:  # noqa: D102
        fps, recording = self.settings.outputs.fps or CUES_FPS, self.settings.recording
        sheet = cues(performance.generation, fps=fps, delivery=self.settings.delivery)
        speech = "" if recording is None else as_text(recording)
        return partial(write_cue_file, self.path, sheet, speech, find_format(self.path))
