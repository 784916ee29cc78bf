import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cli.conftest import run
from formats.examples import of_motion
from lipmotion.types import Channel, Generation, Motion, Span, Timeline, Unit

__all__ = ["generation", "run"]


@pytest.fixture
def generation() -> Generation:
    """A second of two curves, with phones."""
    values = np.random.default_rng(7).normal(0, 0.2, (101, 2))
    values[3] = [-1e-9, 0.123456789]
    motion = Motion(values, 100.0, (Channel("opening"), Channel("x_17", "metre")))
    units = Timeline((Span(0.0, 0.3, Unit("sil", "sil")), Span(0.3, 0.45, Unit("m", "m", word="mama"))))
    return of_motion(motion, units)


@pytest.fixture
def write(tmp_path: Path) -> Any:
    """Return the path of a file with some content: bytes, a text, or a value for JSON."""

    def writer(content: Any, name: str = "a.json") -> Path:
        path = tmp_path / name
        if not isinstance(content, str | bytes):
            content = json.dumps(content, ensure_ascii=False)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return writer
