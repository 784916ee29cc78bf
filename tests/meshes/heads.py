"""A small head for tests: a curved sheet with a mouth cut into it, ARKit's blendshapes, teeth behind, eyes beside."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.model.mesh import Blendshape, Mesh, MeshPart
from lipmotion.types import Motion
from lipmotion_faces.characters import gltf_writer, scene

REPORTED = json.loads(Path(__file__).with_name("reported.json").read_text(encoding="utf-8"))
"""Characters and their files in the manner of public reports, and what is right of each."""
SEAM, HALF = -0.86, 0.3  # height of the mouth and half its width, in eye distances
COLUMNS = np.linspace(-1.2, 1.2, 49)
ROWS = np.linspace(0.34, -2.06, 49)
SIZE = 10.0  # units of the mesh in an eye distance


def head(*, shapes: bool = True, slit: bool = True, size: float = SIZE) -> Mesh:
    vertices, triangles = _sheet(slit)
    first, stop = len(triangles), len(triangles) + 1
    parts = (MeshPart("face", 0, first), MeshPart("teeth", first, stop))
    triangles = np.concatenate([triangles, [[len(vertices), len(vertices) + 2, len(vertices) + 1]]]).astype(np.int32)
    vertices = np.concatenate([vertices, [[-0.1, -0.95, 0.1], [0.1, -0.95, 0.1], [0.0, -1.05, 0.1]]])
    whole = Mesh(vertices, triangles, parts)
    made = tuple(_shapes(whole)) if shapes else ()
    scaled = tuple(Blendshape(each.name, each.rows, size * each.displacements) for each in made)
    return Mesh(size * whole.vertices, whole.triangles, whole.parts, scaled)


def lip_points(mesh: Mesh, size: float = SIZE) -> dict[int, int]:
    places = mesh.vertices / size
    names = {}
    for point, x in ((61, -HALF), (291, HALF)):
        names[point] = int(np.abs(places - [x, SEAM, _depth(x, SEAM)]).sum(axis=1).argmin())
    upper, lower = np.flatnonzero(np.abs(places[:, 0]) + np.abs(places[:, 1] - SEAM) < 1e-6)[:2].tolist()
    return names | {13: upper, 14: lower}


def _sheet(slit: bool) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    seam = int(np.abs(ROWS - SEAM).argmin())
    x, y = np.meshgrid(COLUMNS, ROWS)
    y[seam] = SEAM
    vertices = np.stack([x, y, _depth(x, y)], axis=2).reshape(-1, 3)
    number = np.arange(x.size).reshape(x.shape)
    below = number[seam].copy()
    if slit:
        cut = np.flatnonzero(np.abs(COLUMNS) < HALF - 1e-6)
        below[cut] = len(vertices) + np.arange(len(cut))
        vertices = np.concatenate([vertices, vertices[number[seam, cut]]])
    triangles = []
    for row in range(len(ROWS) - 1):
        top, bottom = (below if row == seam else number[row]), number[row + 1]
        for column in range(len(COLUMNS) - 1):
            a, b, c, d = top[column], top[column + 1], bottom[column], bottom[column + 1]
            triangles += [(a, c, b), (b, c, d)]
    return vertices, np.array(triangles)


def _depth(x, y):
    return 0.35 - 0.35 * np.square(x) - 0.1 * np.square(y - SEAM)


def _shapes(mesh: Mesh):
    places = mesh.vertices
    under = _under(mesh)
    across = np.clip(places[:, 0] / HALF, -1, 1)
    near = np.exp(-np.square((places[:, 1] - SEAM) / 0.2)) * (np.abs(places[:, 0]) < 0.6)
    middle = np.sqrt(1 - across**2) * near
    corner = np.abs(across) ** 3 * near
    left, right = np.clip(0.5 + across, 0, 1), np.clip(0.5 - across, 0, 1)
    fall = np.clip((SEAM - places[:, 1]) / 0.3, 0, 1)
    jaw = np.where(under, np.maximum(np.sqrt(1 - across**2) * (np.abs(places[:, 0]) < HALF), fall), 0.0)
    jaw *= np.clip(1.6 - np.abs(places[:, 0]), 0, 1) * np.clip(2.2 + places[:, 1], 0, 1)
    drop = -0.5 * jaw

    def shape(name, x=0.0, y=0.0, z=0.0):
        moved = np.stack(np.broadcast_arrays(x, y, z, np.zeros(len(places))), axis=1)[:, :3]
        return Blendshape.between(name, places, places + moved, smallest=1e-9)

    yield shape("jawOpen", y=drop)
    yield shape("mouthClose", y=np.where(under, -drop * near, 0.0))
    yield shape("mouthFunnel", -0.1 * across * near, np.where(under, -0.08, 0.08) * middle, 0.08 * near)
    yield shape("mouthPucker", -0.15 * across * near, 0.0, 0.1 * near)
    for side, share in (("Left", left), ("Right", right)):
        yield shape(f"mouthSmile{side}", 0.1 * across * near * share, 0.08 * corner * share)
        yield shape(f"mouthStretch{side}", 0.12 * across * near * share, -0.03 * corner * share)
        yield shape(f"mouthLowerDown{side}", y=np.where(under, -0.08, 0.0) * middle * share)
        yield shape(f"mouthUpperUp{side}", y=np.where(under, 0.0, 0.07) * middle * share)
    yield shape("mouthRollLower", y=np.where(under, 0.03, 0.0) * middle, z=np.where(under, -0.05, 0.0) * middle)
    yield shape("mouthPressLeft", z=-0.02 * near * left)
    yield shape("mouthPressRight", z=-0.02 * near * right)
    yield shape("eyeBlinkLeft", y=np.where(places[:, 1] > 0.2, -0.05, 0.0))


def _under(mesh: Mesh):
    sheet = len(COLUMNS) * len(ROWS)
    under = mesh.vertices[:, 1] < SEAM - 1e-9
    under[sheet:] = True
    return under


def shaped(mesh: Mesh, weights: dict[str, float]) -> NDArray[np.float64]:
    assert weights.keys() <= set(mesh.shape_names)
    vertices = mesh.vertices.copy()
    for shape in mesh.shapes:
        vertices[shape.rows] += weights.get(shape.name, 0.0) * shape.displacements
    return vertices


def write_glb(path: Path, mesh: Mesh, weights: Motion | None = None) -> None:
    gltf_writer.write_gltf_scene(path, scene.Scene(mesh, weights))


def write_obj(path: Path, mesh: Mesh, vertices: NDArray[np.float64] | None = None) -> None:
    places = mesh.vertices if vertices is None else vertices
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in places.tolist())
        for part in mesh.parts:
            file.write(f"o {part.name}\nusemtl {part.material.name or 'part'}\n")
            file.writelines(f"f {a} {b} {c}\n" for a, b, c in (mesh.triangles[part.first : part.stop] + 1).tolist())


VISEMES = {
    "jawOpen": "viseme_aa", "mouthPucker": "viseme_U", "mouthFunnel": "viseme_O", "mouthSmileLeft": "viseme_E",
    "mouthStretchLeft": "viseme_I", "mouthRollLower": "viseme_FF", "mouthPressLeft": "viseme_PP",
    "mouthLowerDownLeft": "viseme_DD", "mouthUpperUpLeft": "viseme_SS",
}  # fmt: skip
"""Shapes of the head, and visemes that they may stand for."""


def renamed(names: Mapping[str, str]) -> Mesh:
    mesh = head()
    kept = tuple(replace(shape, name=names[shape.name]) for shape in mesh.shapes if shape.name in names)
    return replace(mesh, shapes=kept)
