"""What the checks of all contracts share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lipmotion.errors import LipMotionError
from lipmotion.formats.base import MotionFormat
from lipmotion.formats.fap import FAP
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, CLOSED
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.testing.examples import example
from lipmotion.types import Generation, StateTrace
from lipmotion.types.motion import RADIAN


def check_exporter(exporter: MotionFormat) -> None:
    """Check that a motion format writes a result and, if it reads, reads the same motion back to 1e-5.

    Formats of curves are given curves; those of MPEG-4's parameters whole numbers. Channels may come back in another
    order, and beside others; eyes, brows, head and pressed lips may be left out.
    Raises ContractError: what was found.

    >>> from lipmotion.formats.base import MOTION_FORMATS
    >>> check_exporter(MOTION_FORMATS.load("csv"))
    """
    one = example(("m", "aa"))
    given = make_curves(one.motion, one.speech.units, exporter.curves) if exporter.curves else one.motion
    if all(channel.unit == FAP for channel in given.channels):
        given = replace(given, values=np.rint(given.values))
    if exporter.fixed_rate and exporter.rate_hz:
        given = given.resampled(exporter.rate_hz)
    trace = StateTrace(("state",), np.zeros(len(given.values), np.intp))
    result = Generation(given, np.zeros_like(given.values), one.speech.units, trace)
    exporter.check(given)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "motion"
        exporter.write(path, result, {"file": "speech.wav"}, {"name": "model"})
        require(path.is_file() and path.stat().st_size > 0, "no file, or an empty one, is written")
        first = path.read_bytes()
        exporter.write(path, result, {"file": "speech.wav"}, {"name": "model"})
        require(path.read_bytes() == first, "the same result gives other bytes")
        if exporter.read is None:
            return
        motion, _ = exporter.read(path)
    required = [
        channel.name
        for channel in given.channels
        if channel.unit != RADIAN and channel.name not in (*ARKIT_OTHERS, CLOSED)
    ]
    require(set(required) <= set(motion.names), f"channels {motion.names} come back, required {required}")
    require(abs(motion.rate_hz - given.rate_hz) < 1e-6, f"{motion.rate_hz} Hz come back, required {given.rate_hz}")
    require(len(motion.values) == len(given.values), f"{len(motion.values)} frames come back")
    difference = max(float(np.abs(motion[name] - given[name]).max()) for name in {*given.names} & {*motion.names})
    require(difference < 1e-5, f"values come back that differ by {difference:g}")


class ContractError(LipMotionError):
    """An extension breaks the contract of its kind."""


def require(holds: bool, found: str) -> None:
    """Raise ContractError, saying what was found, unless something holds."""
    if not holds:
        raise ContractError(found)


def require_error(kind: type[LipMotionError], call: Callable[[], object], what: str) -> None:
    """Raise ContractError unless a call raises an error of one kind."""
    try:
        call()
    except kind:
        return
    except Exception as error:
        raise ContractError(f"{what}: {type(error).__name__} ({error}), required {kind.__name__}") from error
    raise ContractError(f"{what}: no error, required {kind.__name__}")
