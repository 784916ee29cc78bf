import numpy as np
import pytest

from lipmotion import Staging
from lipmotion.kernels.compiler import numba_works
from lipmotion.types import Audio, Channel, Generation, Motion, StateTrace, Timeline, silent_monitor
from lipmotion_faces.outputs.drawn_video import load_drawing, write_drawn_face
from lipmotion_faces.portrait.planar import PlanarRasteriser
from lipmotion_faces.registry import make_face


@pytest.fixture
def drawn_poses(monkeypatch):
    """Return a list that grows with every picture that is drawn for an encoder."""
    drawn = []
    picture = PlanarRasteriser.picture

    def counted(self, pose, canvas):
        drawn.append(pose)
        return picture(self, pose, canvas)

    monkeypatch.setattr(PlanarRasteriser, "picture", counted)
    return drawn


@pytest.fixture
def generation() -> Generation:
    values = np.linspace(0, 0.2, 40)[:, None]
    trace = StateTrace(("known",), np.zeros(len(values), np.intp))
    return Generation(Motion(values, 100.0, (Channel("opening"),)), np.zeros_like(values), Timeline(()), trace)


def write(path, generation, **staging) -> None:
    sound = Audio(np.zeros(48_000 * 4 // 10, np.float32), 48_000)
    face = make_face("woman")
    write_drawn_face(path, generation, sound, 25.0, face, Staging(size=64, **staging), silent_monitor)


def test_an_mp4_is_drawn_in_the_colours_of_its_encoder(tmp_path, generation, drawn_poses):
    write(tmp_path / "a.mp4", generation)
    assert len(drawn_poses) == 10
    assert (tmp_path / "a.mp4").stat().st_size > 1000


@pytest.mark.parametrize(("name", "background"), [("a%d.png", "scene"), ("a.webm", "transparent")])
def test_other_files_are_drawn_in_red_green_and_blue(tmp_path, generation, drawn_poses, name, background):
    write(tmp_path / name, generation, background=background)
    assert not drawn_poses
    assert len(list(tmp_path.iterdir())) == (10 if "%" in name else 1)


@pytest.mark.skipif(not numba_works(), reason="numba is not installed")
def test_what_draws_is_loaded_by_drawing(drawn_poses):
    load_drawing(make_face("man"))
    assert len(drawn_poses) == 1
