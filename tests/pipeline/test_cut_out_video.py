"""Pictures of a folder of drawings: every one is that of the cue of its time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import lipmotion
from faces.test_cut_out import draw
from lipmotion.articulation.cue_sheets import list_frame_shapes
from lipmotion.errors import ExportError, InputError
from lipmotion.types import Audio, Generation, StateTrace, Timeline
from lipmotion_faces import Staging
from meshes.speech import motion, units

LETTERS = "A B C D E F G H X"
SOUND = Audio(np.zeros(34_000, np.float32), 16_000)


@pytest.fixture(scope="module")
def result() -> Generation:
    moved = motion()
    trace = StateTrace(("a",), np.zeros(len(moved.values), np.intp))
    return Generation(moved, np.zeros(moved.values.shape), units(), trace)


def test_every_picture_is_that_of_its_cue(result, tmp_path):
    drawings = draw(tmp_path / "chart", LETTERS)
    lipmotion.write(result, tmp_path / "a%05d.png", speech=SOUND, face=drawings, fps=24)
    shown = list_frame_shapes(lipmotion.cues(result, fps=24))
    pictures = sorted(tmp_path.glob("a*.png"))
    greys = [int(np.asarray(Image.open(path).convert("RGB"))[-1, 0, 0]) for path in pictures]
    expected = [10 + 10 * LETTERS.split().index(shape) for shape in shown]
    assert len(greys) == int(result.motion.time_s[-1] * 24 + 1e-9) + 1
    assert greys == [*expected, expected[-1]][: len(greys)]
    assert {10, 90} <= {*greys}


def test_what_drawings_cannot_show_is_refused(result, tmp_path):
    drawings = draw(tmp_path / "chart", "A B C D E F")
    silent = replace(result, units=Timeline(()))
    with pytest.raises(ExportError, match="has no phones, from which drawings are chosen"):
        lipmotion.write(silent, [tmp_path / "a.json", tmp_path / "a.webm"], speech=SOUND, face=drawings)
    assert not (tmp_path / "a.json").exists()
    with pytest.raises(InputError, match="the frame rate is 101"):
        lipmotion.write(result, tmp_path / "a.webm", speech=SOUND, face=drawings, fps=101)
    clear = Staging(background="transparent")
    with pytest.raises(ExportError, match="cannot be transparent"):
        lipmotion.write(result, tmp_path / "a.mp4", speech=SOUND, face=drawings, staging=clear)
