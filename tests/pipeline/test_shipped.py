"""The model that ships with the package, on the example that ships with the repository."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion import animate
from lipmotion.pipeline.model import read_header, shipped_path
from lipmotion.types import Generation

EXAMPLES = Path(__file__).parent.parent.parent / "examples"


@pytest.fixture(scope="module")
def welcome() -> Generation:
    return animate(EXAMPLES / "welcome.flac", transcript=(EXAMPLES / "welcome.txt").read_text())


def test_header_says_whose_recordings() -> None:
    header = read_header(shipped_path())
    assert header["licence"] == ["CC BY 4.0"]
    assert any("GRID" in line for line in header["attribution"])
    assert header["split"] == "all"
    assert header["utterances"] == 524
    assert shipped_path().stat().st_size < 9_000_000


def test_lips_meet_on_p_b_m(welcome: Generation) -> None:
    opening = welcome.motion["opening"]
    closing = [span for span in welcome.units if span.label.phone in ("p", "b", "m")]
    assert len(closing) == 9  # please speak my lips move big blue boats by
    for span in closing:
        first, last = int(span.start_s * 100) - 2, int(span.end_s * 100) + 3
        assert opening[max(first, 0) : last].min() < 0.01, span


def test_vowels_open_and_silence_rests(welcome: Generation) -> None:
    opening = welcome.motion["opening"]
    loudest = [span for span in welcome.units if span.label.phone in ("ay", "ae", "iy")]
    assert np.median([opening[int(s.start_s * 100) : int(s.end_s * 100) + 1].max() for s in loudest]) > 0.05
    assert opening[:10].max() < 0.02
    assert opening[-10:].max() < 0.02
    assert np.abs(np.diff(opening)).max() < 0.04  # smooth: no jump between frames of 10 ms
