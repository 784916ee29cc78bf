"""What a motion file holds: the channels that were asked for, or the curves of its format."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from lipmotion.export.base import motion_format
from lipmotion.pipeline.characters import ARKIT, curves_of
from lipmotion.rig.facial_animation import FAP
from lipmotion.rig.shape_names import arkit_name
from lipmotion.types import Channel, Generation, Motion


def in_format(path: Path, generation: Generation, chosen: Generation, rate_hz: float | None) -> Generation:
    """Return a generation as a motion file of that name holds it.

    chosen  : the generation with the channels, and at the rate, that the user asked for: what most formats hold
    rate_hz : the rate that the user asked for; None: that of the format, or else that of the motion
    Blendshapes that the motion has already, by any spelling of ARKit's names, are taken as they are.
    Raises ExportError: unknown suffix. Raises InputError: curves that cannot be computed.
    """
    form = motion_format(path)
    held = chosen
    if form.curves:
        curves = _held_already(generation.motion, form.curves)
        if curves is None:
            curves = curves_of(generation.motion, generation.units, form.curves)
        held = replace(generation, motion=curves, spread=np.zeros(curves.values.shape))
    hertz = rate_hz or form.rate_hz
    return held if hertz in {None, held.motion.rate_hz} else held.resampled(hertz)


def _held_already(motion: Motion, curves: str) -> Motion | None:
    """Return the channels of a motion that are curves of a set already; None: there are none."""
    if curves == ARKIT:
        return _blendshapes(motion)
    columns = [column for column, channel in enumerate(motion.channels) if channel.unit == curves == FAP]
    if not columns:
        return None
    return Motion(motion.values[:, columns], motion.rate_hz, tuple(motion.channels[column] for column in columns))


def _blendshapes(motion: Motion) -> Motion | None:
    """Return the channels of a motion that are ARKit's blendshapes, by ARKit's names; None: it has no jawOpen."""
    known = {arkit_name(name): column for column, name in reversed(list(enumerate(motion.names)))}
    columns = [(name, column) for name, column in sorted(known.items(), key=lambda each: each[1]) if name]
    if "jawOpen" not in known:
        return None
    channels = tuple(Channel(name, motion.channels[column].unit) for name, column in columns)
    return Motion(motion.values[:, [column for _, column in columns]], motion.rate_hz, channels)
