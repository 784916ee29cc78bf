import numpy as np
import pytest

from lipmotion import Staging
from lipmotion.meshes.model.mesh import Material, Mesh, MeshPart
from lipmotion_faces.characters.binding import PosedCharacter
from lipmotion_faces.characters.character_files import load_character
from lipmotion_faces.mesh import MeshFace, MeshStage
from lipmotion_faces.testing import check_face
from meshes.heads import head, write_glb
from meshes.speech import motion, units

STILL = Staging(blinks=False, gaze=False, brows=False, head=False)


@pytest.fixture(scope="module")
def character(tmp_path_factory) -> PosedCharacter:
    path = tmp_path_factory.mktemp("character") / "head.glb"
    mesh = head()
    red = Material("lips", (0.8, 0.2, 0.2))
    parts = (MeshPart("face", 0, mesh.parts[0].stop, red), *mesh.parts[1:])
    write_glb(path, Mesh(mesh.vertices, mesh.triangles, parts, mesh.shapes))
    return load_character(path)


def drawn(character, staging: Staging) -> list[np.ndarray]:
    return list(MeshFace(character, 256, 144).with_staging(staging).render(motion(), units(), fps=10.0))


@pytest.fixture(scope="module")
def pictures(character):
    return drawn(character, STILL)


def test_a_character_keeps_the_contract_of_faces(character, pictures):
    check_face(MeshFace(character, 256, 144))
    assert [picture.shape for picture in pictures] == [(144, 256, 3)] * 21
    picture = next(MeshFace(character).with_staging(Staging(size=90)).render(motion(), units()))
    assert picture.shape == (90, 160, 3)


def test_the_open_mouth_is_seen(pictures):
    """The sheet has a hole where the mouth is open, through which the background is seen."""
    changed = np.abs(pictures[7].astype(int) - pictures[0]).max(axis=2) > 40  # aa
    rows, columns = np.nonzero(changed)
    assert changed.sum() > 50
    assert abs(columns.mean() - 128) < 12
    closed = np.abs(pictures[18].astype(int) - pictures[0]).max(axis=2) > 40
    assert closed.sum() < changed.sum() / 5
    assert rows.max() < 144


def test_the_head_moves_unless_it_is_told_not_to_otherwise_with_another_seed(character, pictures):
    """Above the eyes, only the movement of the head changes a picture."""
    moving, other = (drawn(character, Staging(seed=seed)) for seed in (1, 2))
    edge = np.s_[:45]
    assert max(np.abs(one[edge].astype(int) - pictures[0][edge]).max() for one in moving) > 40
    assert max(np.abs(one[edge].astype(int) - pictures[0][edge]).max() for one in pictures) < 8
    assert any((a != b).any() for a, b in zip(moving, other, strict=True))


def test_a_colour_is_the_background_and_a_transparent_one_has_alpha(character):
    picture = drawn(character, Staging(background="#40a0ff"))[0]
    assert np.abs(picture[0, 0].astype(int) - [0x40, 0xA0, 0xFF]).max() <= 2
    picture = drawn(character, Staging(background="transparent"))[0]
    assert picture.shape == (144, 256, 4)
    assert picture[0, 0, 3] == 0
    assert picture[40, 128, 3] == 255
    solid = drawn(character, Staging())[0]
    assert np.abs(picture[40, 128, :3].astype(int) - solid[40, 128]).max() <= 2


def test_the_head_turns_to_its_left(character):
    """The pivot lies behind the face, so all of it goes to the right of the picture."""
    stage = MeshStage(character, 256, 144)

    def middle(turn: tuple[float, float, float]) -> float:
        return float(np.nonzero(stage.cut_out(character.mesh.vertices, turn)[..., 3])[1].mean())

    assert middle((0.2, 0.0, 0.0)) > middle((0.0, 0.0, 0.0)) + 1
