from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import lipmotion
from faces.test_cut_out import draw
from lipmotion.articulation.cue_sheets import list_frame_shapes
from lipmotion.errors import ExportError, InputError
from lipmotion.types import Audio, Timeline
from lipmotion_faces import Staging

LETTERS = "A B C D E F G H X"
SOUND = Audio(np.zeros(34_000, np.float32), 16_000)


def test_every_picture_is_that_of_its_cue(generation, tmp_path):
    drawings = draw(tmp_path / "chart", LETTERS)
    lipmotion.write(generation, tmp_path / "a%05d.png", speech=SOUND, face=drawings, fps=24)
    shown = list_frame_shapes(lipmotion.cues(generation, fps=24))
    pictures = sorted(tmp_path.glob("a*.png"))
    greys = [int(np.asarray(Image.open(path).convert("RGB"))[-1, 0, 0]) for path in pictures]
    expected = [10 + 10 * LETTERS.split().index(shape) for shape in shown]
    assert len(greys) == int(generation.motion.time_s[-1] * 24 + 1e-9) + 1
    assert greys == [*expected, expected[-1]][: len(greys)]
    assert {10, 90} <= {*greys}


def test_what_drawings_cannot_show_is_refused(generation, tmp_path):
    drawings = draw(tmp_path / "chart", "A B C D E F")
    silent, clear = replace(generation, units=Timeline(())), Staging(background="transparent")
    for given, names, options, error, message in (
        (silent, ["a.json", "a.webm"], {}, ExportError, "has no phones, from which drawings are chosen"),
        (generation, ["a.webm"], {"fps": 101}, InputError, "the frame rate is 101"),
        (generation, ["a.mp4"], {"staging": clear}, ExportError, "cannot be transparent"),
    ):
        with pytest.raises(error, match=message):
            lipmotion.write(given, [tmp_path / name for name in names], speech=SOUND, face=drawings, **options)
        assert not (tmp_path / names[0]).exists()
