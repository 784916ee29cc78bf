"""The contract of motion formats: ``check_exporter(motion_format)``."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lipmotion.export.base import MotionFormat
from lipmotion.testing.contract import require
from lipmotion.testing.examples import example
from lipmotion.types import Generation, StateTrace


def check_exporter(exporter: MotionFormat) -> None:
    """Check that a motion format writes a result and, if it reads, reads the same motion back to 1e-5.

    Raises ContractError: what was found.

    >>> from lipmotion.export.base import MOTION_FORMATS
    >>> check_exporter(MOTION_FORMATS.load("csv"))
    """
    one = example(("m", "aa"))
    trace = StateTrace(("state",), np.zeros(len(one.motion.values), np.intp))
    result = Generation(one.motion, np.zeros_like(one.motion.values), one.speech.units, trace)
    exporter.check(one.motion)
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
    require(motion.names == one.motion.names, f"channels {motion.names} come back, required {one.motion.names}")
    require(abs(motion.rate_hz - one.motion.rate_hz) < 1e-6, f"{motion.rate_hz} Hz come back")
    difference = float(np.abs(motion.values - one.motion.values).max())
    require(difference < 1e-5, f"values come back that differ by {difference:g}")
