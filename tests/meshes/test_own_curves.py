"""The table beside a character: names, gains and offsets of its blendshapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.files.rig_tables import table_path, write_rig_table
from lipmotion.meshes.fitting.driven import load_character
from lipmotion.meshes.model.face_shapes import life_scale
from meshes.heads import head, write_glb
from meshes.speech import motion, units

COLUMNS = "control,source,gain,offset\n"
CLOSED = [20, 55, 95]
"""Frames of silence, m and p."""


@pytest.fixture
def file(tmp_path):
    write_glb(tmp_path / "head.glb", head())
    return tmp_path / "head.glb"


def _parted(character, weights):
    """How far the middles of the inner lips are apart, in eye distances."""
    rows = character.placement.vertices[[character.placement.row(point) for point in (13, 14)]]
    moved = np.einsum("ts,snd->tnd", weights.values, character.mesh.displacements(rows, weights.names))
    return (moved[:, 0, 1] - moved[:, 1, 1]) / character.placement.scale


def test_any_names_are_understood_by_their_rows(file):
    plain = load_character(file).weights(motion(), units())
    shapes = {shape.name: f"あ {number}" for number, shape in enumerate(head().shapes)}
    halves = [
        replace(shape, name=shapes[shape.name], displacements=shape.displacements / (1 + (shape.name == "mouthFunnel")))
        for shape in head().shapes
    ]
    halves.append(replace(next(each for each in halves if each.name == shapes["mouthFunnel"]), name="other half"))
    write_glb(file, replace(head(), shapes=tuple(halves)))
    rows = "".join(f"{own},{known},,\n" for known, own in shapes.items())
    table_path(file).write_text(f"{COLUMNS}{rows}other half,mouthFunnel,,\n", encoding="utf-8")
    character = load_character(file)
    weights = character.weights(motion(), units())
    for name in plain.names:
        np.testing.assert_allclose(weights[shapes[name]], plain[name], atol=1e-4)
    np.testing.assert_array_equal(weights["other half"], weights[shapes["mouthFunnel"]])
    assert character.has_shape("eyeBlinkLeft")
    assert [*character.weigh_others({"eyeBlinkLeft": np.ones(2)}, 2)] == [shapes["eyeBlinkLeft"]]


def test_the_table_of_what_was_found_changes_nothing(file):
    before = load_character(file)
    write_rig_table(before.table_file, before.table_rows())
    after = load_character(file)
    assert after.table_rows() == before.table_rows()
    np.testing.assert_array_equal(after.weights(motion(), units()).values, before.weights(motion(), units()).values)


def test_gains_weaken_the_mouth_and_lips_still_touch(file):
    table_path(file).write_text(f"{COLUMNS}jawOpen,jawOpen,0.5,\nmouthPressLeft,mouthPressLeft,1,0.2\n")
    character = load_character(file)
    weights = character.weights(motion(), units())
    whole = load_character(file.rename(file.with_name("other.glb"))).weights(motion(), units())
    assert weights["jawOpen"][75] == pytest.approx(0.5 * whole["jawOpen"][75], abs=0.02)  # aa
    assert _parted(character, weights)[75] < 0.7 * _parted(character, whole)[75]
    assert _parted(character, weights)[CLOSED].max() < 0.004
    assert weights["mouthPressLeft"].min() == pytest.approx(0.2)
    assert np.abs(np.diff(weights.values, axis=0)).max() < 1.5 * np.abs(np.diff(whole.values, axis=0)).max()


def test_weights_that_are_given_back_stay(file):
    table_path(file).write_text(f"{COLUMNS}jawOpen,jawOpen,0.5,0.03\nmouthPucker,mouthPucker,1.2,\n")
    character = load_character(file)
    weights = character.weights(motion(), units())
    np.testing.assert_allclose(character.weights(weights, units()).values, weights.values, atol=0.03)


@pytest.mark.parametrize(
    ("rows", "message"),
    [("jawOpn,jawOpen,,\n", "head.glb.character.csv: there is no blendshape 'jawOpn'; nearest: jawOpen"),
     ("jawOpen,jawopen,,\n", "'jawOpen' follows 'jawopen', which is no curve; nearest: jawOpen"),
     ("jawOpen,jawOpen,,\njawOpen,,,\n", "'jawOpen' occurs twice"),
     ("jawOpen,jawOpen,,\nmouthPucker,ou,,\n", "has jawOpen and ou; leave the sources of one kind empty")],
)  # fmt: skip
def test_damaged_tables_are_refused(file, rows, message):
    table_path(file).write_text(COLUMNS + rows)
    with pytest.raises(InputError, match=message):
        load_character(file)


def test_a_head_in_metres_parts_its_lips_as_far_as_in_centimetres(file):
    mesh, found = head(), []
    for unit in (1.3, 0.013):  # 22 cm
        shapes = tuple(replace(each, displacements=unit * each.displacements) for each in mesh.shapes)
        write_glb(file, replace(mesh, vertices=unit * mesh.vertices, shapes=shapes))
        found.append(load_character(file))
    centimetres, metres = found
    assert life_scale(centimetres.mesh, centimetres.placement) == pytest.approx(9.0)
    np.testing.assert_allclose(metres.shapes.gap, centimetres.shapes.gap, rtol=1e-3, atol=1e-6)
