"""glTF scenes: nodes, skins at rest and primitives, as one mesh."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened
from lipmotion.rig.gltf_accessors import GltfArrays
from lipmotion.rig.gltf_container import GltfDocument, read_gltf_document
from lipmotion.rig.gltf_textures import gltf_material, texture_colours
from lipmotion.rig.limits import (
    MOST_DISPLACEMENTS,
    MOST_SHAPES,
    MOST_TRIANGLES,
    MOST_VERTICES,
    check_count,
)
from lipmotion.rig.mesh import Blendshape, Material, Mesh, MeshPart
from lipmotion.rig.vrm import expression_shapes, looks_backwards

Matrix = NDArray[np.float64]
TRIANGLES = 4
"""The mode of primitives that are lists of triangles; strips, fans, lines and points are not read."""
HALF_CLEAR = 0.5
"""A triangle is clear where the texture in its middle is clearer than this."""
DEEPEST = 256
"""Most levels of nodes."""
LEAST = 1e-9
"""Vertices that a morph target moves by no more than this, in the unit of the file, are not stored."""


@dataclass
class _Surface:
    """What the primitives have given so far."""

    vertices: list[Matrix] = field(default_factory=list)
    triangles: list[NDArray[np.int64]] = field(default_factory=list)
    uv: list[Matrix | None] = field(default_factory=list)
    colours: list[Matrix] = field(default_factory=list)
    parts: list[tuple[str, Material]] = field(default_factory=list)
    moved: dict[str, list[tuple[NDArray[np.int64], Matrix]]] = field(default_factory=dict)
    targets: dict[tuple[int, int], str] = field(default_factory=dict)
    first: dict[Any, int] = field(default_factory=dict)
    blocks: dict[Any, int] = field(default_factory=dict)
    count: int = 0
    displacements: int = 0


def read_gltf(path: Path) -> Mesh:
    """Return all meshes of a ``.glb``, ``.gltf`` or ``.vrm`` file as one, in the place where its scene has them at
    rest.

    Every primitive becomes a part. Morph targets become blendshapes; those of one name in several primitives become
    one. Expressions of a VRM become blendshapes as well (``aa``, ``ih``, ...), after the targets.
    Raises InputError: damaged, too large, or without triangles.
    """
    try:
        document = read_gltf_document(path)
        return _mesh(document, GltfArrays(document))
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from error


def _mesh(document: GltfDocument, arrays: GltfArrays) -> Mesh:
    surface = _Surface()
    places = dict(_global_matrices(document))
    for number, matrix in sorted(places.items()):
        node = document.item("nodes", number)
        if "mesh" in node:
            _add_node(surface, document, arrays, node, matrix, places)
    if not surface.triangles:
        raise InputError("there are no triangles in it; export the surface")
    vertices = np.concatenate(surface.vertices)
    turn = np.array([-1.0, 1.0, -1.0]) if looks_backwards(document) else np.ones(3)
    shapes = [
        Blendshape(name, np.concatenate([rows for rows, _ in moved]), np.concatenate([way for _, way in moved]) * turn)
        for name, moved in surface.moved.items()
    ]
    shapes += expression_shapes(document, surface.targets, shapes)
    stops = np.cumsum([0, *(len(rows) for rows in surface.triangles)])
    parts = tuple(
        MeshPart(name, int(first), int(stop), material)
        for (name, material), first, stop in zip(surface.parts, stops, stops[1:], strict=False)
    )
    uv = [each for each in surface.uv if each is not None]
    return Mesh(
        vertices * turn,
        np.concatenate(surface.triangles).astype(np.int32),
        parts,
        tuple(shapes),
        np.concatenate(uv) if len(uv) == len(surface.uv) else None,
        np.concatenate(surface.colours),
    )


def _add_node(
    surface: _Surface,
    document: GltfDocument,
    arrays: GltfArrays,
    node: dict[str, Any],
    matrix: Matrix,
    places: dict[int, Matrix],
) -> None:
    mesh = document.item("meshes", node["mesh"])
    primitives = mesh.get("primitives", [])
    if not isinstance(primitives, list) or not all(isinstance(each, dict) for each in primitives):
        raise InputError("a mesh without primitives; export it again")
    name = _text(node.get("name") or mesh.get("name")) or f"mesh {node['mesh']}"
    for primitive in primitives:
        if primitive.get("mode", TRIANGLES) == TRIANGLES and isinstance(primitive.get("attributes"), dict):
            _add_primitive(surface, document, arrays, node, primitive, (mesh, name), matrix, places)


def _add_primitive(
    surface: _Surface,
    document: GltfDocument,
    arrays: GltfArrays,
    node: dict[str, Any],
    primitive: dict[str, Any],
    owner: tuple[dict[str, Any], str],
    matrix: Matrix,
    places: dict[int, Matrix],
) -> None:
    attributes = primitive["attributes"]
    targets = primitive.get("targets", [])
    if not isinstance(targets, list) or not all(isinstance(target, dict) for target in targets):
        raise InputError("morph targets that are no list of objects; export it again")
    shared = (id(node), attributes.get("POSITION"), tuple(target.get("POSITION") for target in targets))
    if shared not in surface.first:
        surface.first[shared], surface.blocks[shared] = surface.count, len(surface.vertices)
        _add_vertices(surface, document, arrays, node, primitive, owner[0], matrix, places)
    first = surface.first[shared]
    count = len(arrays.floats(attributes.get("POSITION"), 3))
    corners = arrays.whole(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
    if corners.size % 3 or (corners.size and not 0 <= corners.min() <= corners.max() < count):
        raise InputError(f"triangles of vertices up to {corners.max(initial=0)} of {count}; export it again")
    material = gltf_material(document, primitive.get("material"))
    check_count("triangles", sum(map(len, surface.triangles)) + corners.size // 3, MOST_TRIANGLES)
    triangles, clear, mapped = corners.reshape(-1, 3), np.zeros(corners.size // 3, bool), None
    block = surface.colours[surface.blocks[shared]]
    if "TEXCOORD_0" in attributes:
        in_texture = arrays.floats(attributes["TEXCOORD_0"], 2)
        if len(in_texture) != count:
            raise InputError("texture coordinates of another number of vertices; export it again")
        mapped = (in_texture * (1.0, -1.0) + (0.0, 1.0))[corners].reshape(-1, 3, 2)
        seen = texture_colours(document, arrays, primitive.get("material"), in_texture)
        if seen is not None:
            block[np.unique(corners)] = seen[np.unique(corners), :3]
            middles = texture_colours(document, arrays, primitive.get("material"), in_texture[triangles].mean(axis=1))
            clear = middles[:, 3] < HALF_CLEAR if middles is not None else clear
    else:
        block[np.unique(corners)] = material.colour
    for hidden in (False, True):  # what a texture leaves out becomes a part of its own
        chosen = clear == hidden
        if chosen.any():
            look = replace(material, opacity=0.0) if hidden else material
            surface.triangles.append(triangles[chosen] + first)
            surface.parts.append((_unused(owner[1], look.name, surface), look))
            surface.uv.append(None if mapped is None else mapped[chosen])


def _add_vertices(
    surface: _Surface,
    document: GltfDocument,
    arrays: GltfArrays,
    node: dict[str, Any],
    primitive: dict[str, Any],
    mesh: dict[str, Any],
    matrix: Matrix,
    places: dict[int, Matrix],
) -> None:
    """Add the vertices of a primitive and its morph targets, at their places in the scene."""
    vertices = arrays.floats(primitive["attributes"].get("POSITION"), 3)
    check_count("vertices", surface.count + len(vertices), MOST_VERTICES)
    if "skin" in node:
        linear, shift = _skinned(document, arrays, node["skin"], primitive["attributes"], len(vertices), places)
        surface.vertices.append(np.einsum("nij,nj->ni", linear, vertices) + shift)
    else:
        linear = np.broadcast_to(matrix[:3, :3], (len(vertices), 3, 3))
        surface.vertices.append(vertices @ matrix[:3, :3].T + matrix[:3, 3])
    targets = primitive.get("targets", [])
    check_count("blendshapes", len(targets), MOST_SHAPES)
    surface.displacements += len(targets) * len(vertices)
    check_count("displacements", surface.displacements, MOST_DISPLACEMENTS)
    names = target_names(mesh, primitive, len(targets))
    for number, (name, target) in enumerate(zip(names, targets, strict=True)):
        surface.targets[(int(node["mesh"]), number)] = name
        moved = arrays.floats(target["POSITION"], 3) if "POSITION" in target else np.zeros_like(vertices)
        if moved.shape != vertices.shape:
            raise InputError(f"the target {shortened(name)!r} moves {len(moved)} of {len(vertices)} vertices")
        moved = np.einsum("nij,nj->ni", linear, moved)
        rows = np.flatnonzero(np.abs(moved).max(axis=1, initial=0.0) > LEAST)
        surface.moved.setdefault(name, []).append((rows + surface.count, moved[rows]))
    surface.colours.append(np.tile(gltf_material(document, primitive.get("material")).colour, (len(vertices), 1)))
    surface.count += len(vertices)


def _skinned(
    document: GltfDocument,
    arrays: GltfArrays,
    skin_number: Any,
    attributes: dict[str, Any],
    count: int,
    places: dict[int, Matrix],
) -> tuple[Matrix, Matrix]:
    """Return how a skin at rest maps every vertex: matrices [shape=(N, 3, 3)] and shifts [shape=(N, 3)]."""
    skin = document.item("skins", skin_number)
    joints = skin.get("joints")
    if not isinstance(joints, list) or not all(joint in places for joint in joints if isinstance(joint, int)):
        raise InputError("a skin with joints that are not in the scene; export it again")
    matrices = np.array([places.get(joint, np.eye(4)) for joint in joints])
    if "inverseBindMatrices" in skin:
        inverse = arrays.floats(skin["inverseBindMatrices"], 16).reshape(-1, 4, 4).transpose(0, 2, 1)
        if len(inverse) < len(joints):
            raise InputError(f"{len(inverse)} matrices of {len(joints)} joints; export it again")
        matrices = matrices @ inverse[: len(joints)]
    blended = np.zeros((count, 3, 4))
    total = np.zeros(count)
    for group in range(8):
        if f"JOINTS_{group}" not in attributes:
            break
        numbers = arrays.whole(attributes[f"JOINTS_{group}"], 4)
        weights = arrays.floats(attributes.get(f"WEIGHTS_{group}"), 4)
        if len(numbers) != count or len(weights) != count or (count and numbers.max() >= len(joints)):
            raise InputError("joints of vertices that do not fit; export it again")
        for column in range(4):
            blended += weights[:, column, None, None] * matrices[numbers[:, column], :3]
            total += weights[:, column]
    held = total > 1e-6
    blended[held] /= total[held, None, None]
    blended[~held] = np.eye(4)[:3]
    return blended[:, :, :3], blended[:, :, 3]


def _global_matrices(document: GltfDocument) -> Iterator[tuple[int, Matrix]]:
    """Yield every node of the scene with its matrix, parents first; every node once."""
    nodes = document.items("nodes")
    scene = document.json.get("scene", 0)
    scenes = document.items("scenes")
    children = {child for node in nodes for child in _numbers(node.get("children", []))}
    roots = (
        _numbers(document.item("scenes", scene).get("nodes", []))
        if scenes
        else sorted(set(range(len(nodes))) - children)
    )
    stack = [(root, np.eye(4), 0) for root in reversed(roots)]
    seen: set[int] = set()
    while stack:
        number, parent, depth = stack.pop()
        node = document.item("nodes", number)
        if number in seen or depth > DEEPEST:
            raise InputError(f"node {number} is in the scene twice, or too deep; export it again")
        seen.add(number)
        matrix = parent @ _local_matrix(node)
        yield number, matrix
        stack += [(child, matrix, depth + 1) for child in reversed(_numbers(node.get("children", [])))]


def _local_matrix(node: dict[str, Any]) -> Matrix:
    if "matrix" in node:
        return _vector(node["matrix"], 16).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = _vector(node.get("rotation", [0, 0, 0, 1]), 4)
    matrix[:3, :3] = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ) * _vector(node.get("scale", [1, 1, 1]), 3)
    matrix[:3, 3] = _vector(node.get("translation", [0, 0, 0]), 3)
    return matrix


def _vector(value: Any, size: int) -> Matrix:
    try:
        vector = np.array(value, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{shortened(repr(value))} is no list of {size} numbers; export it again") from error
    if vector.shape != (size,) or not np.isfinite(vector).all() or np.abs(vector).max() > 1e9:
        raise InputError(f"{shortened(repr(value))} is no list of {size} plausible numbers; export it again")
    return vector


def _numbers(value: Any) -> list[int]:
    if not isinstance(value, list) or not all(isinstance(each, int) and not isinstance(each, bool) for each in value):
        raise InputError(f"{shortened(repr(value))} is no list of nodes; export it again")
    return value


def target_names(mesh: dict[str, Any], primitive: dict[str, Any], count: int) -> list[str]:
    """Return the names of morph targets; those without a name are numbered."""
    for holder in (mesh, primitive):
        extras = holder.get("extras")
        names = extras.get("targetNames") if isinstance(extras, dict) else None
        if isinstance(names, list) and len(names) >= count and len({_text(each) for each in names}) == len(names):
            return [_text(name) or f"target {number}" for number, name in enumerate(names[:count])]
    return [f"target {number}" for number in range(count)]


def _unused(owner: str, material: str, surface: _Surface) -> str:
    """Return a name for a part that no other part has."""
    taken = {name for name, _ in surface.parts}
    if owner not in taken:
        return owner
    base = f"{owner} {material}".strip()
    return next(name for name in (base, *(f"{base} {n}" for n in range(2, len(taken) + 3))) if name not in taken)


def _text(value: Any) -> str:
    return " ".join(str(value).split()) if isinstance(value, str | int) else ""
