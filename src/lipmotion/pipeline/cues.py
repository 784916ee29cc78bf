"""Results to held mouth shapes, and those to files: for 2D animators."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lipmotion.errors import ExportError, InputError
from lipmotion.export.cues import CUE_FORMATS, OPTIONAL, CueSheet, choose_cues, format_of, write_cue_file
from lipmotion.storage.files import as_text, check_distinct, check_target
from lipmotion.types import Generation

FASTEST_FPS = 60.0
"""Cue files count in hundredths of a second: at more frames than this, two of them could have one name."""


def cues(
    generation: Generation, *, fps: float = 24.0, hold_frames: int | None = None, shapes: str = OPTIONAL
) -> CueSheet:
    """Return the mouth shapes of a result for 2D animation, each held long enough.

    fps         : frames per second of the animation, 1 to 60
    hold_frames : frames that every shape is held at least; by default as long as two at 24 a second
    shapes      : which of the optional shapes ``G``, ``H`` and ``X`` the character has, besides A to F
    Where the motion has no channel ``opening``, the phones decide alone.
    Raises InputError: an argument out of its range.
    Raises ExportError: a result without phones, or with values that are not finite.
    """
    check_cue_options(fps, hold_frames, shapes)
    if len(generation.motion.values) and not len(generation.units):
        raise ExportError("the result has no phones, and cues need them; take it from lipmotion.animate")
    if not np.isfinite(generation.motion.values).all():
        raise ExportError("the motion has values that are not finite; interpolate them first")
    return choose_cues(generation, fps, hold_frames, shapes)


def write_cues(
    sheet: CueSheet, outputs: str | Path | Sequence[str | Path], *, speech: str | Path = "", form: str | None = None
) -> None:
    """Write cues to one or several files, each in the format of its suffix.

    outputs : ``.tsv``, ``.xml``, ``.json`` (Rhubarb's) or ``.dat`` (Moho's)
    speech  : the recording they came from: ``.xml`` and ``.json`` name it
    form    : ``tsv``, ``xml``, ``json`` or ``dat``, whatever the suffix
    Raises ExportError: unknown format, no such folder, or a file that cannot be written; before the first is written.
    """
    paths = [Path(output) for output in ([outputs] if isinstance(outputs, str | Path) else outputs)]
    check_cue_outputs(paths, speech, form)
    for path in paths:
        write_cue_file(path, sheet, as_text(speech), form or format_of(path))


def cue_text(sheet: CueSheet, *, speech: str | Path = "", form: str = "tsv") -> str:
    """Return what ``write_cues`` would write."""
    return CUE_FORMATS[form](sheet, as_text(speech))


def check_cue_options(fps: float, hold_frames: int | None, shapes: str) -> None:
    """Raise InputError unless cues can be chosen so."""
    if not 1 <= fps <= FASTEST_FPS:
        raise InputError(f"the frame rate is {fps}, required 1 to {FASTEST_FPS:.0f} a second")
    if hold_frames is not None and hold_frames < 1:
        raise InputError(f"the hold is {hold_frames} frames, required 1 or more")
    if set(shapes) - set(OPTIONAL):
        raise InputError(f"the optional shapes are {shapes!r}, required letters out of {OPTIONAL!r}, or none")


def check_cue_outputs(outputs: Sequence[Path], speech: str | Path, form: str | None) -> None:
    """Raise ExportError unless every output can be written."""
    if form is not None and form not in CUE_FORMATS:
        raise ExportError(f"unknown cue format {form!r}; required one of: {' '.join(CUE_FORMATS)}")
    check_distinct(outputs)
    for path in outputs:
        if form is None:
            format_of(path)
        check_target(path, speech or None)
