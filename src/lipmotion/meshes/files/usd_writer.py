"""Writing of USD: a mesh with its blendshapes, its skeleton and their animation, as one text file (``.usda``).

Source: the schemas UsdSkel, UsdGeom, UsdShade and UsdMedia of OpenUSD.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.files.usd_text import asset, matrix, numbers, prim, prim_names, rows_of, tokens, triple, whole
from lipmotion.meshes.model.mesh import Mesh, MeshPart
from lipmotion.meshes.model.scene import HeadTurn, Scene, ShadingNormals, shading_normals
from lipmotion.meshes.model.textures import linear
from lipmotion.storage.files import atomic_file

ROOT = "Character"
SKELETON, ANIMATION, LOOKS, FACE = f"/{ROOT}/Skeleton", f"/{ROOT}/Animation", f"/{ROOT}/Looks", f"/{ROOT}/Face"
JOINTS = ("body", "body/head")
USUAL_HZ, FASTEST_HZ = 24.0, 60.0
"""Time codes a second: the usual ones, and the most that programs show as frames."""
PER_VERTEX = 'interpolation = "vertex"'


def write_usda(path: Path, scene: Scene) -> None:
    """Write a scene as ``.usda``.

    Up to ``FASTEST_HZ`` keys a second, key n is time code n; of more, time codes are 24ths of a second, and keys lie
    between them: programs that ignore the rate of time codes, as Blender 5.0 does, play 24 a second.
    The sound is a ``SpatialAudio``, everywhere equally loud; of one that began before time code 0, the rest is played.
    Textures are not written.
    Raises ExportError: the file cannot be written.
    """
    normals = shading_normals(scene.mesh, split=scene.split)
    with atomic_file(path) as unfinished, unfinished.open("w", encoding="utf-8", newline="\n") as file:
        for line in _lines(scene, normals):
            file.write(line + "\n")


def _lines(scene: Scene, normals: ShadingNormals) -> Iterator[str]:
    rate = f"{_codes_hz(scene):.9g}"
    yield from ("#usda 1.0", "(", f'    defaultPrim = "{ROOT}"', '    doc = "Written by lipmotion"')
    yield from (f"    endTimeCode = {_last(scene):.9g}", f"    framesPerSecond = {rate}")
    yield from (f"    metersPerUnit = {scene.metres:.9g}", "    startTimeCode = 0", f"    timeCodesPerSecond = {rate}")
    yield from ('    upAxis = "Y"', ")", "")
    yield from prim("SkelRoot", ROOT, _character(scene, normals), schemas=("SkelBindingAPI",), kind="component")


def _character(scene: Scene, normals: ShadingNormals) -> Iterator[str]:
    yield from prim("Skeleton", "Skeleton", _skeleton(scene), schemas=("SkelBindingAPI",))
    yield from prim("SkelAnimation", "Animation", _animation(scene))
    yield from prim("Mesh", "Face", _mesh(scene, normals), schemas=("SkelBindingAPI", "MaterialBindingAPI"))
    yield from prim("Scope", "Looks", _looks(scene.mesh))
    if scene.sound:
        yield from prim("SpatialAudio", "Sound", _sound(scene))


def _sound(scene: Scene) -> Iterator[str]:
    yield 'uniform token auralMode = "nonSpatial"'
    yield f"uniform timecode endTime = {_last(scene):.9g}"
    yield f"uniform asset filePath = {asset(scene.sound)}"
    if scene.sound_s < 0:
        yield f"uniform double mediaOffset = {-scene.sound_s:.9g}"
    yield 'uniform token playbackMode = "onceFromStart"'
    yield f"uniform timecode startTime = {max(scene.sound_s, 0.0) * _codes_hz(scene):.9g}"


def _skeleton(scene: Scene) -> Iterator[str]:
    places = [np.eye(4), np.eye(4)][: len(_joints(scene))]
    if scene.turn is not None:
        places[1][3, :3] = scene.turn.pivot
    matrices = ", ".join(map(matrix, places))
    yield f"uniform matrix4d[] bindTransforms = [{matrices}]"
    yield f"uniform token[] joints = {tokens(_joints(scene))}"
    yield f"uniform matrix4d[] restTransforms = [{matrices}]"
    yield f"rel skel:animationSource = <{ANIMATION}>"


def _animation(scene: Scene) -> Iterator[str]:
    joints, (time_s, table) = _joints(scene), scene.keys()
    yield f"uniform token[] blendShapes = {tokens(scene.mesh.shape_names)}"
    if len(table):
        yield from _samples("float[] blendShapeWeights", map(numbers, table), time_s * _codes_hz(scene))
    else:
        yield f"float[] blendShapeWeights = {numbers(np.zeros(len(scene.mesh.shapes)))}"
    yield f"uniform token[] joints = {tokens(joints)}"
    if scene.turn is not None:
        codes = _step(scene) * np.arange(len(scene.turn.rotations), dtype=np.float64)
        yield from _samples("quatf[] rotations", _rotations(scene.turn), codes)
        yield f"float3[] translations = [(0, 0, 0), {triple(scene.turn.pivot)}]"
    else:
        yield "quatf[] rotations = [(1, 0, 0, 0)]"
        yield "float3[] translations = [(0, 0, 0)]"
    yield f"half3[] scales = [{', '.join(['(1, 1, 1)'] * len(joints))}]"


def _rotations(turn: HeadTurn) -> Iterator[str]:
    for x, y, z, w in turn.rotations.tolist():
        yield f"[(1, 0, 0, 0), ({w:.7g}, {x:.7g}, {y:.7g}, {z:.7g})]"


def _samples(attribute: str, values: Iterable[str], codes: NDArray[np.float64]) -> Iterator[str]:
    """Yield the values of an attribute at time codes [shape=(K,)]."""
    yield f"{attribute}.timeSamples = {{"
    yield from (f"    {code:.9g}: {value}," for code, value in zip(codes.tolist(), values, strict=True))
    yield "}"


def _mesh(scene: Scene, normals: ShadingNormals) -> Iterator[str]:
    mesh = scene.mesh
    names = prim_names(mesh.shape_names)
    yield "uniform bool doubleSided = 1"
    yield 'uniform token subdivisionScheme = "none"'
    yield f"float3[] extent = {rows_of(np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)]))}"
    yield f"int[] faceVertexCounts = {whole(np.full(len(mesh.triangles), 3))}"
    yield f"int[] faceVertexIndices = {whole(mesh.triangles.reshape(-1))}"
    yield f"normal3f[] normals = {rows_of(normals.rest)} ({PER_VERTEX})"
    yield f"point3f[] points = {rows_of(mesh.vertices)}"
    if mesh.colours is not None:
        yield f"color3f[] primvars:displayColor = {rows_of(linear(mesh.colours))} ({PER_VERTEX})"
    yield from _binding(scene)
    if names:
        yield f"uniform token[] skel:blendShapes = {tokens(mesh.shape_names)}"
        yield f"rel skel:blendShapeTargets = [{', '.join(f'<{FACE}/{name}>' for name in names)}]"
    yield f"rel skel:skeleton = <{SKELETON}>"
    yield 'uniform token subsetFamily:materialBind:familyType = "partition"'
    for name, shape, turned in zip(names, mesh.shapes, normals.turned, strict=True):
        yield from prim("BlendShape", name, _blend_shape((shape.rows, shape.displacements), turned))
    for name, part in _parts(mesh):
        yield from prim("GeomSubset", f"{name}_faces", _subset(name, part), schemas=("MaterialBindingAPI",))


def _binding(scene: Scene) -> Iterator[str]:
    """Yield which joints the vertices follow."""
    count, joints = len(scene.mesh.vertices), len(_joints(scene))
    share = np.zeros(count) if scene.turn is None else scene.turn.share
    weights = np.stack([1 - share, share], axis=1)[:, :joints]
    hints = f"(elementSize = {joints}\n            {PER_VERTEX})"
    yield f"matrix4d primvars:skel:geomBindTransform = {matrix(np.eye(4))}"
    yield f"int[] primvars:skel:jointIndices = {whole(np.tile(np.arange(joints), count))} {hints}"
    yield f"float[] primvars:skel:jointWeights = {numbers(weights.reshape(-1))} {hints}"


def _blend_shape(
    moved: tuple[NDArray[np.int64], NDArray[np.float64]], turned: tuple[NDArray[np.int64], NDArray[np.float64]]
) -> Iterator[str]:
    """Yield a blendshape: what is added to places, and to normals; both are of the same vertices."""
    both = np.union1d(moved[0], turned[0])
    yield f"uniform vector3f[] normalOffsets = {rows_of(_spread(turned, both))}"
    yield f"uniform vector3f[] offsets = {rows_of(_spread(moved, both))}"
    yield f"uniform int[] pointIndices = {whole(both)}"


def _spread(some: tuple[NDArray[np.int64], NDArray[np.float64]], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    values = np.zeros((len(rows), 3))
    values[np.searchsorted(rows, some[0])] = some[1]
    return values


def _subset(name: str, part: MeshPart) -> Iterator[str]:
    yield 'uniform token elementType = "face"'
    yield 'uniform token familyName = "materialBind"'
    yield f"int[] indices = {whole(np.arange(part.first, part.stop))}"
    yield f"rel material:binding = <{LOOKS}/{name}>"


def _looks(mesh: Mesh) -> Iterator[str]:
    for name, part in _parts(mesh):
        yield from prim("Material", name, _material(f"{LOOKS}/{name}", part, painted=mesh.colours is not None))


def _material(place: str, part: MeshPart, *, painted: bool) -> Iterator[str]:
    """Yield a material: of one colour, or of the colours of the vertices."""
    material = part.material
    colour = f" = {triple(linear(material.colour))}" if not painted else f".connect = <{place}/Colour.outputs:result>"
    surface = [
        'uniform token info:id = "UsdPreviewSurface"',
        f"color3f inputs:diffuseColor{colour}",
        f"float inputs:opacity = {material.opacity:.6g}",
        f"float inputs:roughness = {1 - material.gloss:.6g}",
        "token outputs:surface",
    ]
    yield f"token outputs:surface.connect = <{place}/Surface.outputs:surface>"
    yield from prim("Shader", "Surface", surface)
    if painted:
        reader = ['uniform token info:id = "UsdPrimvarReader_float3"', 'string inputs:varname = "displayColor"']
        yield from prim("Shader", "Colour", [*reader, "float3 outputs:result"])


def _codes_hz(scene: Scene) -> float:
    return scene.weights.rate_hz if scene.weights and scene.weights.rate_hz <= FASTEST_HZ else USUAL_HZ


def _step(scene: Scene) -> float:
    """Return how many time codes a key is after the one before."""
    return _codes_hz(scene) / scene.weights.rate_hz if scene.weights else 1.0


def _last(scene: Scene) -> float:
    """Return the time code of the last key."""
    return max(len(scene.weights.values) - 1, 0) * _step(scene) if scene.weights else 0.0


def _joints(scene: Scene) -> Sequence[str]:
    return JOINTS[:1] if scene.turn is None else JOINTS


def _parts(mesh: Mesh) -> list[tuple[str, MeshPart]]:
    """Return the parts that have triangles, with names that USD takes."""
    parts = [part for part in mesh.parts if part.stop > part.first]
    return list(zip(prim_names(part.name or part.material.name for part in parts), parts, strict=True))
