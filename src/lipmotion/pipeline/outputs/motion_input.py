"""Motion from files, ready to be drawn and written again: edited curves, captures, what other programs exported."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np

from lipmotion.articulation.expression import is_mood
from lipmotion.errors import InputError
from lipmotion.formats.base import read_motion
from lipmotion.formats.cues import read_cue_motion
from lipmotion.meshes.files.steady_rate import match_sound_rate
from lipmotion.meshes.model.shape_names import is_known
from lipmotion.pipeline.analysis.read_request import read_units
from lipmotion.types import EYE_DISTANCE, WEIGHT, Channel, Generation, Motion, StateTrace, Timeline, Unit

LOG = logging.getLogger("lipmotion")
TOLERATED_S = 0.1
"""Sound and motion may differ so much in length without a warning."""
SLOWEST_HZ, FASTEST_HZ = 1.0, 10_000.0
"""Smallest and largest frame rate of motion that is read: a mistyped one must not fill the memory."""
LONGEST_S = 86_400.0
"""Longest motion that is read."""
CUE_SUFFIXES = (".dat", ".tsv", ".xml", ".pgo")
STATE = "file"
"""The state of every frame of motion that was read."""


def read_generation(
    path: str | Path, units: str | Path | Timeline[Unit] | None = None, rate_hz: float | None = None
) -> Generation:
    """Return the motion of a file as ``write`` takes it: with its phones, if it has them, and without variance.

    path  : ``.json``, ``.csv``, ``.npz``, or another motion file that can be read
    units : phones in time, or a file with them (``read_units``), for motion files that have none; None: those of the
            motion file
    rate_hz : frames a second, where the file states them wrong, or not at all, as Moho's ``.dat``; None: as it says
    Blendshapes, visemes, vowels and moods count as weights, whatever unit the file gives them.
    Raises InputError: a file that cannot be read, motion without frames, of an unlikely rate, or of more than a day.
    """
    if rate_hz is not None and Path(path).suffix.lower() in CUE_SUFFIXES:
        motion, found = read_cue_motion(Path(path), rate_hz)
    else:
        motion, found = read_motion(path)
        motion = motion if rate_hz is None else replace(motion, rate_hz=rate_hz)
    if not len(motion.values):
        raise InputError(f"{path}: the motion has no frames; export it again")
    if not SLOWEST_HZ <= motion.rate_hz <= FASTEST_HZ:
        required = f"required {SLOWEST_HZ:.0f} to {FASTEST_HZ:.0f}; export it again"
        raise InputError(f"{path}: {motion.rate_hz:g} frames a second, {required}")
    lasts_s = (len(motion.values) - 1) / motion.rate_hz
    if lasts_s > LONGEST_S:
        raise InputError(f"{path}: the motion lasts {lasts_s:.0f} s, required at most {LONGEST_S:.0f}; cut it")
    phones = found if units is None else read_units(units) if isinstance(units, str | Path) else units
    channels = tuple(
        Channel(each.name, WEIGHT)
        if each.unit == EYE_DISTANCE and (is_known(each.name) or is_mood(each.name))
        else each
        for each in motion.channels
    )
    states = np.zeros(len(motion.values), np.intp)
    nothing = np.broadcast_to(0.0, motion.values.shape)
    return Generation(replace(motion, channels=channels), nothing, phones, StateTrace((STATE,), states))


def correct_rate(motion: Motion, duration_s: float, advice: str = "") -> Motion:
    """Return motion at the rate of its sound, where it is off by 1001 / 1000 (``match_sound_rate``); a warning."""
    rate_hz = match_sound_rate(motion.rate_hz, len(motion.values), duration_s)
    if rate_hz != motion.rate_hz:
        lasts_s = len(motion.values) / motion.rate_hz
        what = (
            f"the motion lasts {lasts_s:.2f} s, the sound {duration_s:.2f} s, {duration_s / lasts_s:.4f} times as long"
        )
        LOG.warning("%s: read at %.3f frames a second, not at %.3f%s", what, rate_hz, motion.rate_hz, advice)
    return replace(motion, rate_hz=rate_hz)


def match_duration(generation: Generation, duration_s: float, *, keeps_rate: bool = False) -> Generation:
    """Return a generation that lasts as long as its sound: the last pose stays, or the rest is cut.

    keeps_rate : whether its rate is right; otherwise one that is off by 1001 / 1000 is corrected, if it has no phones
    A difference of more than ``TOLERATED_S`` is logged as a warning.
    """
    motion = generation.motion
    if not keeps_rate and not len(generation.units):
        motion = correct_rate(motion, duration_s, "; --motion-rate says another")
    lasts_s = (len(motion.values) - 1) / motion.rate_hz
    if abs(lasts_s - duration_s) > TOLERATED_S:
        what = "the last pose stays" if lasts_s < duration_s else "what comes after the sound is left out"
        LOG.warning("the motion lasts %.2f s, the sound %.2f s: %s", lasts_s, duration_s, what)
    count = int(np.floor(duration_s * motion.rate_hz + 1e-6)) + 1
    frames = np.minimum(np.arange(count), len(motion.values) - 1)
    return replace(
        generation,
        motion=Motion(motion.values[frames], motion.rate_hz, motion.channels),
        spread=np.broadcast_to(0.0, (count, len(motion.channels))),
        trace=StateTrace(generation.trace.states, generation.trace.frames[frames]),
    )
