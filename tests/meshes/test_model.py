import json
from pathlib import Path

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.errors import InputError
from lipmotion.formats.base import Thinning
from lipmotion.meshes.model import shape_names
from lipmotion.meshes.model.mesh import Blendshape, Mesh, MeshPart
from lipmotion.meshes.model.rig_tables import apply_rig, read_rig_table
from lipmotion_faces.characters import surface
from lipmotion_faces.characters.scene import EVERY_KEY, HeadTurn, Scene, compute_shading_normals, place_keys
from meshes.heads import head, shaped

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SQUARE = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def _mesh(**changes) -> Mesh:
    up = Blendshape("up", np.array([2, 3]), np.array([[0.0, 1, 0], [0, 2, 0]]))
    out = Blendshape("out", np.array([3]), np.array([[0.0, 0, 4]]))
    return Mesh(**({"vertices": CORNERS, "triangles": SQUARE, "shapes": (up, out)} | changes))


def test_displacements_of_some_vertices_and_of_what_moves_alone():
    moved = _mesh().displacements(np.array([3, 0]))
    np.testing.assert_allclose(moved, [[[0, 2, 0], [0, 0, 0]], [[0, 0, 4], [0, 0, 0]]], atol=1e-12)
    shape = CORNERS.copy()
    shape[1] += [0, 0, 1e-9]
    shape[2] += [0, 0, 0.5]
    assert Blendshape.between("a", CORNERS, shape, smallest=1e-6).rows.tolist() == [2]


WRONG = [
    ({"vertices": CORNERS[:, :2]}, "shape"), ({"vertices": np.full((4, 3), np.nan)}, "finite"),
    ({"triangles": SQUARE + 1}, "1 to 4, required 0 to 3"), ({"triangles": SQUARE[:, :2]}, "required"),
    ({"triangles": SQUARE - 1}, "-1 to 2"), ({"triangles": SQUARE.astype(float)}, "whole numbers"),
    ({"uv": np.zeros((2, 2))}, "uv"), ({"parts": (MeshPart("a", 0, 1),)}, "parts"),
    ({"parts": (MeshPart("a", 0, 1), MeshPart("b", 0, 2))}, "parts"),
    ({"shapes": (Blendshape("a", np.array([9]), np.zeros((1, 3))),)}, "'a'"),
    ({"shapes": (Blendshape("a", np.array([1, 2]), np.zeros((1, 3))),)}, "as many"),
    ({"shapes": (Blendshape("a", np.array([1]), np.zeros((1, 3))),) * 2}, "one name"),
]  # fmt: skip


def test_what_does_not_fit_is_refused():
    for changes, message in WRONG:
        with pytest.raises(errors.InputError, match=message):
            _mesh(**changes)


PLACES, FRONT = CORNERS, SQUARE
BACK = np.array([[0, 3, 2], [2, 1, 0]], np.int32)


def test_a_part_with_both_sides_is_held_once():
    uv = np.arange(6 * 3 * 2.0).reshape(6, 3, 2)
    parts = (MeshPart("one", 0, 2), MeshPart("leaf", 2, 6))
    places = np.concatenate([PLACES, PLACES + 5])
    mesh = surface.drop_back_sides(Mesh(places, np.concatenate([FRONT, FRONT + 4, BACK + 4]), parts, uv=uv))
    assert mesh.triangles.tolist() == [*FRONT.tolist(), *(FRONT + 4).tolist()]
    assert [(part.first, part.stop, part.material.two_sided) for part in mesh.parts] == [(0, 2, False), (2, 4, True)]
    np.testing.assert_allclose(mesh.uv, uv[:4])


def test_other_meshes_stay_as_they_are():
    for triangles, of in (
        (FRONT, None),
        (np.concatenate([FRONT, FRONT]), None),
        (np.concatenate([FRONT, BACK[:1]]), None),
        (np.concatenate([FRONT, BACK]), (MeshPart("front", 0, 2), MeshPart("back", 2, 4))),
    ):
        mesh = Mesh(PLACES, triangles, of or ())
        assert surface.drop_back_sides(mesh) is mesh


def test_normals_of_both_sides_do_not_cancel_out():
    normals = compute_shading_normals(Mesh(PLACES, np.concatenate([FRONT, BACK])))
    np.testing.assert_allclose(normals.rest, np.tile([0.0, 0, 1], (4, 1)))


def weights(name: str = "jawOpen") -> types.Motion:
    return types.Motion(np.linspace(0, 1, 4)[:, None], 25.0, (types.Channel(name, types.WEIGHT),))


def test_weights_are_in_the_order_of_the_mesh_and_what_is_no_shape_is_refused() -> None:
    table = Scene(head(), weights()).tabulate()
    column = head().shape_names.index("jawOpen")
    assert table[:, column] == pytest.approx(np.linspace(0, 1, 4))
    assert np.delete(table, column, axis=1) == pytest.approx(np.zeros((4, table.shape[1] - 1)))
    with pytest.raises(errors.ExportError, match="no blendshape 'opening'"):
        Scene(head(), weights("opening"))


@pytest.mark.parametrize(("vertices", "frames"), [(3, 4), (None, 5)])
def test_a_turn_that_does_not_fit_is_refused(vertices: int | None, frames: int) -> None:
    share = np.ones(len(head().vertices) if vertices is None else vertices)
    turn = HeadTurn(np.zeros(3), share, np.tile([0.0, 0, 0, 1], (frames, 1)))
    with pytest.raises(errors.InputError, match=f"and \\({frames}, 4\\) frames, required"):
        Scene(head(), weights(), turn)


def test_normals_are_of_length_one_and_turn_with_the_shape() -> None:
    mesh = head()
    normals = compute_shading_normals(mesh)
    assert np.linalg.norm(normals.rest, axis=1) == pytest.approx(np.ones(len(mesh.vertices)))
    number = mesh.shape_names.index("jawOpen")
    rows, change = normals.turned[number]
    moved = type(mesh)(shaped(mesh, {"jawOpen": 1.0}), mesh.triangles, mesh.parts)
    after = compute_shading_normals(moved, split=False).rest
    assert len(rows) > 10
    inner = np.isin(rows, mesh.shapes[number].rows)
    assert (normals.rest[rows] + change)[inner] == pytest.approx(after[rows][inner], abs=0.35)
    assert set(rows.tolist()) != set(range(len(mesh.vertices)))


TIME_S = np.arange(300) / 100
ROWS = np.stack([np.sin(4 * TIME_S), np.abs(np.sin(9 * TIME_S)) ** 0.3, np.where(TIME_S < 1.5, 0.0, 0.4)], axis=1)
SMOOTH = (False, False, False)


def between(keys: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    time_s, rows = keys
    return np.stack([np.interp(TIME_S, time_s, column) for column in rows.T], axis=1)


@pytest.mark.parametrize("tolerance", [0.003, 0.01, 0.05])
def test_curves_stay_within_the_tolerance(tolerance: float) -> None:
    time_s, rows = place_keys(TIME_S, ROWS, SMOOTH, Thinning(tolerance))
    assert 4 < len(time_s) < len(TIME_S)
    assert (time_s[0], time_s[-1]) == (TIME_S[0], TIME_S[-1])
    assert np.abs(between((time_s, rows)) - ROWS).max() <= tolerance + 1e-12


def test_coarser_keys_are_fewer_and_closed_lips_stay_closed() -> None:
    counts = [len(Thinning(tolerance).choose(TIME_S, ROWS)) for tolerance in (0.0, 0.003, 0.01, 0.05, 2.0)]
    assert counts == sorted(counts, reverse=True)
    assert (counts[0], counts[-1]) == (300, 2)
    assert len(EVERY_KEY.choose(TIME_S[:0], ROWS[:0])) == 0
    assert Thinning(2.0, (0.703, 2.995)).choose(TIME_S, ROWS).tolist() == [0, 69, 70, 71, 298, 299]


def test_a_held_pose_still_changes_at_once() -> None:
    time_s, rows = place_keys(TIME_S, ROWS, (False, False, True), Thinning(0.05))
    rise = np.flatnonzero(np.diff(rows[:, 2]) > 0.3)
    assert len(rise) == 1
    assert time_s[rise[0] + 1] - time_s[rise[0]] == pytest.approx(0.001)


def test_names_as_files_spell_them():
    """Those of programs, of copies, of truncated files, and some that are none."""
    names = json.loads(Path(__file__).with_name("names.json").read_text(encoding="utf-8"))
    known = {"arkit": shape_names.to_arkit, "visemes": shape_names.find_viseme, "vowels": shape_names.find_vowel}
    for kind, find in known.items():
        assert {spelled: find(spelled) for spelled in names[kind]} == names[kind]
    assert len({*shape_names.ARKIT_MOUTH, *shape_names.ARKIT_OTHERS}) == 52
    assert len(set(shape_names.VISEMES_15)) == 15


SOURCES = {"jawOpen": np.array([0.0, 0.5, 1.0]), "mouthPucker": np.array([0.0, 1.0, 0.0])}


def _table(tmp_path, text):
    (tmp_path / "rig.csv").write_text(text)
    return read_rig_table(tmp_path / "rig.csv")


def test_controls_follow_their_sources_or_are_constant(tmp_path):
    rows = "Jaw.rz,jawOpen,-25,,-20,0\nLips,mouthPucker,0.5\nLips,jawOpen,-0.25,0.1\n"
    motion = apply_rig(_table(tmp_path, f"control,source,gain,offset,low,high\n{rows}"), SOURCES, 25.0)
    assert motion.names == ("Jaw.rz", "Lips")
    np.testing.assert_allclose(motion["Jaw.rz"], [0, -12.5, -20])
    np.testing.assert_allclose(motion["Lips"], [0.1, 0.475, -0.15])
    motion = apply_rig(_table(tmp_path, "control,source,offset\n# a comment\nBrow,,0.3\n\n"), SOURCES, 25.0)
    np.testing.assert_allclose(motion["Brow"], 0.3)
    with pytest.raises(InputError, match="'Jaw' follows 'jawopen', which is no curve; nearest: jawOpen"):
        apply_rig(_table(tmp_path, "control,source\nJaw,jawopen\n"), SOURCES, 25.0)


DAMAGED_TABLES = [
    ("", "required control,source"), ("control,from\nJaw,jawOpen\n", "required control,source"),
    ("control,source\n", "0 rows"), ("control,source,gain\nJaw,jawOpen,much\n", "line 2"),
    ("control,source,gain\nJaw,jawOpen,nan\n", "line 2: the number is"),
    ("control,source,gain\nJaw,jawOpen,1e9\n", "required at most"),
    ("control,source,low,high\nJaw,jawOpen,2,1\n", "goes from 2 to 1"),
    ("control,source\n,jawOpen\n", "without a control"),
]  # fmt: skip


def test_damaged_tables_are_refused(tmp_path):
    for text, message in DAMAGED_TABLES:
        with pytest.raises(InputError, match=message):
            _table(tmp_path, text)
