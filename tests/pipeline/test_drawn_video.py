from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import lipmotion
from faces.test_cut_out import draw
from lipmotion.articulation.cue_sheets import list_frame_shapes
from lipmotion.errors import ExportError, InputError
from lipmotion.kernels.compiler import numba_works
from lipmotion.types import Audio, Channel, Generation, Motion, StateTrace, Timeline, silent_monitor
from lipmotion_faces import Staging
from lipmotion_faces.outputs.drawn_video import load_drawing, write_drawn_face
from lipmotion_faces.portrait.portrait_rasteriser import Rasteriser
from lipmotion_faces.registry import make_face


@pytest.fixture
def drawn_poses(monkeypatch):
    """Return a list that grows with every picture that is drawn."""
    drawn = []
    picture = Rasteriser.picture

    def counted(self, pose, canvas):
        drawn.append(pose)
        return picture(self, pose, canvas)

    monkeypatch.setattr(Rasteriser, "picture", counted)
    return drawn


@pytest.fixture
def rising() -> Generation:
    values = np.linspace(0, 0.2, 40)[:, None]
    trace = StateTrace(("known",), np.zeros(len(values), np.intp))
    return Generation(Motion(values, 100.0, (Channel("opening"),)), np.zeros_like(values), Timeline(()), trace)


def write(path, generation, **staging) -> None:
    sound = Audio(np.zeros(48_000 * 4 // 10, np.float32), 48_000)
    face = make_face("woman")
    write_drawn_face(path, generation, sound, 25.0, face, Staging(size=64, **staging), silent_monitor)


@pytest.mark.parametrize(("name", "background"), [("a.mp4", "scene"), ("a%d.png", "scene"), ("a.webm", "transparent")])
def test_every_picture_is_drawn_once(tmp_path, rising, drawn_poses, name, background):
    write(tmp_path / name, rising, background=background)
    assert len(drawn_poses) == 10
    assert len(list(tmp_path.iterdir())) == (10 if "%" in name else 1)


@pytest.mark.skipif(not numba_works(), reason="numba is not installed")
def test_what_draws_is_loaded_by_drawing(drawn_poses):
    load_drawing(make_face("man"))
    assert len(drawn_poses) == 1


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
