from dataclasses import replace

import numpy as np
import pytest

from lipmotion.meshes.files.gltf_scene import read_gltf
from lipmotion.meshes.fitting.driven import JAW_OPEN, load_character, with_jaw
from lipmotion.meshes.model.bones import HEAD, JAW, LEFT_EYE, NECK, RIGHT_EYE, Bone, bone_kind, merge_bones
from meshes.gltf import POSITIONS, document, glb
from meshes.heads import SEAM, head, shaped, write_glb
from meshes.speech import motion, units


def with_bone(mesh):
    """A jaw bone that everything below the mouth follows."""
    jaw = next(shape for shape in head().shapes if shape.name == "jawOpen")
    shares = -jaw.displacements[:, 1] / -jaw.displacements[:, 1].min()
    return replace(mesh, bones=(Bone(JAW, np.array([0.0, 10 * SEAM + 2, -9.0]), jaw.rows, shares),))


def test_bones_are_known_by_their_names():
    kinds = {"Head": HEAD, "mixamorig:Neck1": NECK, "J_Bip_C_Head": HEAD, "JawBone": JAW, "jaw_01": JAW}
    kinds |= {"LeftEye": LEFT_EYE, "eye_r": RIGHT_EYE, "HeadTop_End": None, "Hips": None, "": None}
    kinds |= {"mixamorigHead": HEAD, "headphones": None, "CC_Base_JawRoot": JAW, "Head_nub": None}
    assert {name: bone_kind(name) for name in kinds} == kinds


def test_a_jaw_bone_opens_the_mouth():
    mesh = with_jaw(with_bone(head(shapes=False)))
    assert mesh.shape_names == (JAW_OPEN,)
    moved = shaped(mesh, {JAW_OPEN: 1}) - mesh.vertices
    chin = int(np.abs(mesh.vertices - [0, -16, 0]).sum(axis=1).argmin())
    assert moved[chin, 1] < -1
    assert np.abs(moved[mesh.vertices[:, 1] > 10 * SEAM + 1]).max() == pytest.approx(0)


def test_a_mesh_that_opens_its_mouth_already_keeps_its_shapes():
    mesh = with_bone(head())
    assert with_jaw(mesh).shape_names == mesh.shape_names
    assert with_jaw(head(shapes=False)).shape_names == ()


def test_a_character_with_a_jaw_bone_alone_follows_the_motion(tmp_path):
    """The square of two triangles is no head; the made head has no skin. So the bone is put on the read mesh."""
    from lipmotion.meshes.fitting import driven

    path = tmp_path / "head.glb"
    write_glb(path, head(shapes=False))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driven, "read_character", lambda _: with_bone(head(shapes=False)))
        character = load_character(path)
    weights = character.weights(motion(), units())
    assert weights.names == (JAW_OPEN,)
    assert np.corrcoef(weights.values[:, 0], motion()["opening"])[0, 1] > 0.95


def test_bones_of_one_kind_become_one():
    one = Bone(HEAD, np.zeros(3), np.array([1, 2]), np.array([0.5, 1.0]))
    two = Bone(HEAD, np.ones(3), np.array([2, 4]), np.array([0.25, 1.0]))
    (merged,) = merge_bones([one, two, Bone(JAW, np.zeros(3), np.zeros(0, int), np.zeros(0))])
    assert merged.rows.tolist() == [1, 2, 4]
    assert merged.shares.tolist() == [0.5, 1.0, 1.0]
    np.testing.assert_array_equal(merged.place, np.zeros(3))


def test_bones_are_read_from_skins_and_nodes(tmp_path):
    content, binary = document()
    joints, weights = np.zeros((4, 4), np.uint8), np.zeros((4, 4), "<f4")
    joints[:, 1], weights[:] = 1, [[1, 0, 0, 0], [1, 0, 0, 0], [0.25, 0.75, 0, 0], [0, 1, 0, 0]]
    content["nodes"] = [
        {"mesh": 0, "skin": 0},
        {"name": "Neck", "translation": [0, 1, 0], "children": [2]},
        {"name": "Head", "translation": [0, 2, 0], "children": [3]},
        {"mesh": 1, "name": "glasses"},
    ]
    content["scenes"] = [{"nodes": [0, 1]}]
    content["skins"] = [{"joints": [1, 2]}]
    content["meshes"].append({"primitives": [{"attributes": {"POSITION": 0}, "indices": 3}]})
    start = len(binary)
    content["bufferViews"] += [
        {"buffer": 0, "byteOffset": start, "byteLength": 16},
        {"buffer": 0, "byteOffset": start + 16, "byteLength": 64},
    ]
    content["accessors"] += [
        {"bufferView": 4, "componentType": 5121, "count": 4, "type": "VEC4"},
        {"bufferView": 5, "componentType": 5126, "count": 4, "type": "VEC4"},
    ]
    content["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": 4, "WEIGHTS_0": 5}
    path = tmp_path / "head.glb"
    path.write_bytes(glb(content, binary + joints.tobytes() + weights.tobytes()))
    mesh = read_gltf(path)
    bones = {bone.kind: bone for bone in mesh.bones}
    assert len(mesh.vertices) == 2 * len(POSITIONS)
    assert bones[NECK].rows.tolist() == [*range(8)]
    assert bones[HEAD].rows.tolist() == [2, 3, 4, 5, 6, 7]
    np.testing.assert_allclose(bones[HEAD].shares, [0.75, 1, 1, 1, 1, 1], atol=1e-6)
    np.testing.assert_allclose(bones[HEAD].place, [0, 3, 0], atol=1e-6)
