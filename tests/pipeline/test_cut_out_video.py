"""Videos of a folder of drawings: every picture is that of the cue of its time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import lipmotion
from faces.test_cut_out import draw
from lipmotion.errors import ExportError, InputError
from lipmotion.export.cues.sheet import shown_shapes
from lipmotion.faces import Staging
from lipmotion.pipeline.model import Model
from lipmotion.testing.toy import ToySentence
from lipmotion.types import Timeline

LETTERS = "A B C D E F G H X"


def test_every_picture_is_that_of_its_cue(toy_model: Model, toy_sentence: ToySentence, tmp_path: Path) -> None:
    result = lipmotion.animate(toy_sentence.audio, transcript=" ".join(toy_sentence.words), model=toy_model)
    drawings = draw(tmp_path / "chart", LETTERS)
    outputs = [tmp_path / "a%05d.png", tmp_path / "a.webm"]
    lipmotion.write(result, outputs, speech=toy_sentence.audio, face=drawings, fps=24)
    shown = shown_shapes(lipmotion.cues(result, fps=24))
    pictures = sorted(tmp_path.glob("a*.png"))
    greys = [int(np.asarray(Image.open(path).convert("RGB"))[-1, 0, 0]) for path in pictures]
    expected = [10 + 10 * LETTERS.split().index(shape) for shape in shown]
    assert len(greys) == int(result.motion.time_s[-1] * 24 + 1e-9) + 1
    assert greys == [*expected, expected[-1]][: len(greys)]
    assert 10 in greys
    assert (tmp_path / "a.webm").stat().st_size > 0


def test_what_drawings_cannot_show_is_refused(toy_model: Model, toy_sentence: ToySentence, tmp_path: Path) -> None:
    result = lipmotion.animate(toy_sentence.audio, transcript=" ".join(toy_sentence.words), model=toy_model)
    drawings, sound = draw(tmp_path / "chart", "A B C D E F"), toy_sentence.audio
    with pytest.raises(ExportError, match="has no phones, from which drawings are chosen"):
        lipmotion.write(
            replace(result, units=Timeline(())), [tmp_path / "a.json", tmp_path / "a.webm"], speech=sound, face=drawings
        )
    assert not (tmp_path / "a.json").exists()
    with pytest.raises(InputError, match="the frame rate is 100"):
        lipmotion.write(result, tmp_path / "a.webm", speech=sound, face=drawings, fps=100)
    staging = Staging(background="transparent")
    with pytest.raises(ExportError, match="cannot be transparent"):
        lipmotion.write(result, tmp_path / "a.mp4", speech=sound, face=drawings, staging=staging)
