"""Writing of USD: a mesh with its blendshapes, its skeleton and their animation, as one text file (``.usda``).

Source: the schemas UsdSkel, UsdGeom, UsdShade and UsdMedia of OpenUSD.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError, shorten
from lipmotion.meshes.model.mesh import Mesh, MeshPart
from lipmotion.printable import is_line
from lipmotion.storage.files import as_text, atomic_file
from lipmotion_faces.characters.scene import Scene, ShadingNormals, compute_shading_normals
from lipmotion_faces.characters.textures import decode_srgb

INDENT = "    "
_CONTROL = re.compile("[\x00-\x1f\x7f]")


def list_prim(
    schema: str, name: str, inside: Iterable[str], *, schemas: Sequence[str] = (), **about: str
) -> Iterator[str]:
    """Yield the lines of a prim.

    schema  : ``Mesh``, for instance
    name    : as of ``name_prims``
    inside  : the lines of its attributes and of its own prims
    schemas : API schemas that are applied to it
    about   : further metadata, as ``kind``
    """
    lines = [f'{INDENT}{key} = "{value}"' for key, value in about.items()]
    if schemas:
        lines.insert(0, f"{INDENT}prepend apiSchemas = {format_tokens(schemas)}")
    yield f'def {schema} "{name}"' + (" (" if lines else "")
    if lines:
        yield from (*lines, ")")
    yield "{"
    yield from (INDENT + line for line in inside)
    yield "}"


def name_prims(names: Iterable[str]) -> list[str]:
    """Return names of letters, digits and low lines, as prims need them, none twice."""
    taken: dict[str, None] = {}
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name) or "part"
        plain = f"_{plain}" if plain[0].isdigit() else plain
        number, unused = 1, plain
        while unused in taken:
            number += 1
            unused = f"{plain}_{number}"
        taken[unused] = None
    return list(taken)


def format_tokens(names: Iterable[str]) -> str:
    """Return names as an array of tokens; control characters are escaped, surrogates as in Python."""
    escaped = (as_text(name).replace("\\", "\\\\").replace('"', '\\"') for name in names)
    plain = (_CONTROL.sub(lambda match: f"\\x{ord(match[0]):02x}", name) for name in escaped)
    return "[" + ", ".join(f'"{name}"' for name in plain) + "]"


def format_asset(path: str) -> str:
    """Return a path from the folder of the file, with slashes, as a reference to a file.

    Raises ExportError: a name with a line end or another control character, which USD cannot refer to.
    """
    if not is_line(path):
        raise ExportError(f"the name {shorten(path)!r} has a character that .usda cannot refer to; rename the file")
    mark = "@@@" if "@" in path else "@"
    absolute = path.startswith(("/", "../")) or ":" in path
    return mark + ("" if absolute else "./") + path.replace("@@@", "\\@@@") + mark


def _join(values: NDArray[np.integer]) -> str:
    return "[" + ", ".join(map(str, values.tolist())) + "]"


def _format(values: NDArray[np.floating]) -> str:
    """Return numbers as an array, or rows of three as an array of tuples, with the seven digits of single precision."""
    if values.ndim == 1:
        return "[" + ", ".join([f"{value:.7g}" for value in (values + 0.0).tolist()]) + "]"
    return "[" + ", ".join([f"({x:.7g}, {y:.7g}, {z:.7g})" for x, y, z in (values + 0.0).tolist()]) + "]"


def _format_tuple(values: NDArray[np.floating]) -> str:
    return "(" + ", ".join([f"{value:.7g}" for value in (values + 0.0).tolist()]) + ")"


def _format_matrix(values: NDArray[np.floating]) -> str:
    """Return a matrix [shape=(4, 4)], its rows one after another; USD multiplies rows from the left."""
    return "( " + ", ".join(map(_format_tuple, values)) + " )"


ROOT = "Character"
SKELETON, ANIMATION, LOOKS, FACE = f"/{ROOT}/Skeleton", f"/{ROOT}/Animation", f"/{ROOT}/Looks", f"/{ROOT}/Face"
JOINTS = ("body", "body/head")
USUAL_HZ, FASTEST_HZ = 24.0, 60.0  # time codes a second: the usual ones, and the most that programs show as frames
PER_VERTEX = 'interpolation = "vertex"'


def write_usda(path: Path, scene: Scene) -> None:
    """Write a scene as ``.usda``.

    Up to ``FASTEST_HZ`` keys a second, key n is time code n; of more, time codes are 24ths of a second, and keys lie
    between them: programs that ignore the rate of time codes, as Blender 5.0 does, play 24 a second.
    The sound is a ``SpatialAudio``, everywhere equally loud; of one that began before time code 0, the rest is played.
    Textures are not written.
    Raises ExportError: the file cannot be written.
    """
    normals = compute_shading_normals(scene.mesh, split=scene.split)
    last_code = max(len(scene.weights.values) - 1, 0) * _count_codes_per_key(scene) if scene.weights else 0.0
    rate, last, bound = f"{_find_rate(scene):.9g}", f"{last_code:.9g}", ("SkelBindingAPI",)
    places = [np.eye(4), np.eye(4)][: len(_list_joints(scene))]
    if scene.turn is not None:
        places[1][3, :3] = scene.turn.pivot
    matrices = ", ".join(map(_format_matrix, places))
    skeleton = [
        f"uniform matrix4d[] bindTransforms = [{matrices}]",
        f"uniform token[] joints = {format_tokens(_list_joints(scene))}",
        f"uniform matrix4d[] restTransforms = [{matrices}]",
        f"rel skel:animationSource = <{ANIMATION}>",
    ]
    sound = [
        'uniform token auralMode = "nonSpatial"',
        f"uniform timecode endTime = {last}",
        f"uniform asset filePath = {format_asset(scene.sound)}" if scene.sound else "",
        *([f"uniform double mediaOffset = {-scene.sound_s:.9g}"] if scene.sound_s < 0 else []),
        'uniform token playbackMode = "onceFromStart"',
        f"uniform timecode startTime = {max(scene.sound_s, 0.0) * _find_rate(scene):.9g}",
    ]
    character = chain(  # line by line: a long motion takes no memory for its text
        list_prim("Skeleton", "Skeleton", skeleton, schemas=bound),
        list_prim("SkelAnimation", "Animation", _list_animation(scene)),
        list_prim("Mesh", "Face", _list_mesh(scene, normals), schemas=(*bound, "MaterialBindingAPI")),
        list_prim("Scope", "Looks", _list_looks(scene.mesh)),
        list_prim("SpatialAudio", "Sound", sound) if scene.sound else (),
    )
    head = [
        *("#usda 1.0", "(", f'    defaultPrim = "{ROOT}"', '    doc = "Written by lipmotion"'),
        *(f"    endTimeCode = {last}", f"    framesPerSecond = {rate}", f"    metersPerUnit = {scene.metres:.9g}"),
        *("    startTimeCode = 0", f"    timeCodesPerSecond = {rate}", '    upAxis = "Y"', ")", ""),
    ]
    with atomic_file(path) as unfinished, unfinished.open("w", encoding="utf-8", newline="\n") as file:
        root = list_prim("SkelRoot", ROOT, character, schemas=bound, kind="component")
        file.writelines(line + "\n" for line in chain(head, root))


def _list_animation(scene: Scene) -> Iterator[str]:
    joints, (time_s, table) = _list_joints(scene), scene.list_keys()
    yield f"uniform token[] blendShapes = {format_tokens(scene.mesh.shape_names)}"
    if len(table):
        yield from _list_samples("float[] blendShapeWeights", map(_format, table), time_s * _find_rate(scene))
    else:
        yield f"float[] blendShapeWeights = {_format(np.zeros(len(scene.mesh.shapes)))}"
    yield f"uniform token[] joints = {format_tokens(joints)}"
    if scene.turn is not None:
        rotations = (
            f"[(1, 0, 0, 0), ({w:.7g}, {x:.7g}, {y:.7g}, {z:.7g})]" for x, y, z, w in scene.turn.rotations.tolist()
        )
        codes = _count_codes_per_key(scene) * np.arange(len(scene.turn.rotations), dtype=np.float64)
        yield from _list_samples("quatf[] rotations", rotations, codes)
        yield f"float3[] translations = [(0, 0, 0), {_format_tuple(scene.turn.pivot)}]"
    else:
        yield "quatf[] rotations = [(1, 0, 0, 0)]"
        yield "float3[] translations = [(0, 0, 0)]"
    yield f"half3[] scales = [{', '.join(['(1, 1, 1)'] * len(joints))}]"


def _list_samples(attribute: str, values: Iterable[str], codes: NDArray[np.float64]) -> Iterator[str]:
    """Yield the values of an attribute at time codes [shape=(K,)]."""
    yield f"{attribute}.timeSamples = {{"
    yield from (f"    {code:.9g}: {value}," for code, value in zip(codes.tolist(), values, strict=True))
    yield "}"


def _list_mesh(scene: Scene, normals: ShadingNormals) -> Iterator[str]:
    mesh = scene.mesh
    names = name_prims(mesh.shape_names)
    yield "uniform bool doubleSided = 1"
    yield 'uniform token subdivisionScheme = "none"'
    yield f"float3[] extent = {_format(np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)]))}"
    yield f"int[] faceVertexCounts = {_join(np.full(len(mesh.triangles), 3))}"
    yield f"int[] faceVertexIndices = {_join(mesh.triangles.reshape(-1))}"
    yield f"normal3f[] normals = {_format(normals.rest)} ({PER_VERTEX})"
    yield f"point3f[] points = {_format(mesh.vertices)}"
    if mesh.colours is not None:
        yield f"color3f[] primvars:displayColor = {_format(decode_srgb(mesh.colours))} ({PER_VERTEX})"
    count, joints = len(mesh.vertices), len(_list_joints(scene))
    share = np.zeros(count) if scene.turn is None else scene.turn.share
    weights = np.stack([1 - share, share], axis=1)[:, :joints]
    hints = f"(elementSize = {joints}\n            {PER_VERTEX})"
    yield f"matrix4d primvars:skel:geomBindTransform = {_format_matrix(np.eye(4))}"
    yield f"int[] primvars:skel:jointIndices = {_join(np.tile(np.arange(joints), count))} {hints}"
    yield f"float[] primvars:skel:jointWeights = {_format(weights.reshape(-1))} {hints}"
    if names:
        yield f"uniform token[] skel:blendShapes = {format_tokens(mesh.shape_names)}"
        yield f"rel skel:blendShapeTargets = [{', '.join(f'<{FACE}/{name}>' for name in names)}]"
    yield f"rel skel:skeleton = <{SKELETON}>"
    yield 'uniform token subsetFamily:materialBind:familyType = "partition"'
    for name, shape, turned in zip(names, mesh.shapes, normals.turned, strict=True):
        rows = np.union1d(shape.rows, turned[0])  # what is added to places, and to normals, of the same vertices
        offsets = np.zeros((2, len(rows), 3))
        for values, (of, added) in zip(offsets, ((shape.rows, shape.displacements), turned), strict=True):
            values[np.searchsorted(rows, of)] = added
        moved = [f"uniform vector3f[] offsets = {_format(offsets[0])}", f"uniform int[] pointIndices = {_join(rows)}"]
        yield from list_prim("BlendShape", name, [f"uniform vector3f[] normalOffsets = {_format(offsets[1])}", *moved])
    for name, part in _list_parts(mesh):
        subset = [
            'uniform token elementType = "face"',
            'uniform token familyName = "materialBind"',
            f"int[] indices = {_join(np.arange(part.first, part.stop))}",
            f"rel material:binding = <{LOOKS}/{name}>",
        ]
        yield from list_prim("GeomSubset", f"{name}_faces", subset, schemas=("MaterialBindingAPI",))


def _list_looks(mesh: Mesh) -> Iterator[str]:
    for name, part in _list_parts(mesh):
        place, painted = f"{LOOKS}/{name}", mesh.colours is not None
        colour = f" = {_format_tuple(decode_srgb(part.material.colour))}"
        colour = f".connect = <{place}/Colour.outputs:result>" if painted else colour
        surface = [
            'uniform token info:id = "UsdPreviewSurface"',
            f"color3f inputs:diffuseColor{colour}",
            f"float inputs:opacity = {part.material.opacity:.6g}",
            f"float inputs:roughness = {1 - part.material.gloss:.6g}",
            "token outputs:surface",
        ]
        reader = ['uniform token info:id = "UsdPrimvarReader_float3"', 'string inputs:varname = "displayColor"']
        shaders = [
            f"token outputs:surface.connect = <{place}/Surface.outputs:surface>",
            *list_prim("Shader", "Surface", surface),
            *(list_prim("Shader", "Colour", [*reader, "float3 outputs:result"]) if painted else ()),
        ]
        yield from list_prim("Material", name, shaders)


def _find_rate(scene: Scene) -> float:
    return scene.weights.rate_hz if scene.weights and scene.weights.rate_hz <= FASTEST_HZ else USUAL_HZ


def _count_codes_per_key(scene: Scene) -> float:
    """Return how many time codes a key is after the one before."""
    return _find_rate(scene) / scene.weights.rate_hz if scene.weights else 1.0


def _list_joints(scene: Scene) -> Sequence[str]:
    return JOINTS[:1] if scene.turn is None else JOINTS


def _list_parts(mesh: Mesh) -> list[tuple[str, MeshPart]]:
    """Return the parts that have triangles, with names that USD takes."""
    parts = [part for part in mesh.parts if part.stop > part.first]
    return list(zip(name_prims(part.name or part.material.name for part in parts), parts, strict=True))
