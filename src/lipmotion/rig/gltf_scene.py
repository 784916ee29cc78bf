"""glTF scenes: nodes, skins at rest and primitives, as one mesh."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened
from lipmotion.rig.bones import Bone, merged_bones
from lipmotion.rig.gltf_accessors import GltfArrays
from lipmotion.rig.gltf_colours import WHITE, counted, tinted, vertex_tints
from lipmotion.rig.gltf_container import GltfDocument, read_gltf_document
from lipmotion.rig.gltf_skins import head_bones, held_bones, kinds_of_nodes, skin_weights
from lipmotion.rig.gltf_textures import GltfMaterials
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
DEEPEST = 256
"""Most levels of nodes."""
LEAST = 1e-9
"""Vertices that a morph target moves by no more than this, in the unit of the file, are not stored."""


@dataclass
class _Surface:
    """What the primitives have given so far."""

    materials: GltfMaterials
    vertices: list[Matrix] = field(default_factory=list)
    triangles: list[NDArray[np.int64]] = field(default_factory=list)
    uv: list[Matrix] = field(default_factory=list)
    mapped: bool = False
    colours: list[Matrix] = field(default_factory=list)
    tints: list[Matrix] = field(default_factory=list)
    tinted: bool = False
    parts: list[tuple[str, Material]] = field(default_factory=list)
    moved: dict[str, list[tuple[NDArray[np.int64], Matrix]]] = field(default_factory=dict)
    targets: dict[tuple[int, int], str] = field(default_factory=dict)
    first: dict[Any, int] = field(default_factory=dict)
    blocks: dict[Any, int] = field(default_factory=dict)
    bones: list[Bone] = field(default_factory=list)
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
    surface = _Surface(GltfMaterials(document, arrays))
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
    return Mesh(
        vertices * turn,
        np.concatenate(surface.triangles).astype(np.int32),
        parts,
        tuple(shapes),
        np.concatenate(surface.uv) if surface.mapped else None,
        np.concatenate(surface.colours),
        tuple(replace(bone, place=bone.place * turn) for bone in merged_bones(surface.bones)),
        np.concatenate(surface.tints) if surface.tinted else None,
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
    moved = tuple(target.get("POSITION") for target in targets)
    shared = (id(node), attributes.get("POSITION"), attributes.get("COLOR_0"), moved)
    if shared not in surface.first:
        surface.first[shared], surface.blocks[shared] = surface.count, len(surface.vertices)
        _add_vertices(surface, document, arrays, node, primitive, owner[0], matrix, places)
    first = surface.first[shared]
    count = len(arrays.floats(attributes.get("POSITION"), 3))
    corners = arrays.whole(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
    if corners.size % 3 or (corners.size and not 0 <= corners.min() <= corners.max() < count):
        raise InputError(f"triangles of vertices up to {corners.max(initial=0)} of {count}; export it again")
    material = surface.materials.material(primitive.get("material"))
    check_count("triangles", sum(map(len, surface.triangles)) + corners.size // 3, MOST_TRIANGLES)
    used, block = np.unique(corners), surface.colours[surface.blocks[shared]]
    tints = None
    if "COLOR_0" in attributes:
        material = material if "material" in primitive else replace(material, colour=WHITE)
        tints = counted(vertex_tints(document, arrays, attributes["COLOR_0"], count)[used], material)
        surface.tints[surface.blocks[shared]][used] = tints
        surface.tinted = True
    block[used] = material.colour
    mapped = np.zeros((corners.size // 3, 3, 2))
    if "TEXCOORD_0" in attributes:
        in_texture = arrays.floats(attributes["TEXCOORD_0"], 2)
        if len(in_texture) != count:
            raise InputError("texture coordinates of another number of vertices; export it again")
        in_texture = surface.materials.moved(primitive.get("material"), in_texture)
        mapped = (in_texture * (1.0, -1.0) + (0.0, 1.0))[corners].reshape(-1, 3, 2)
        surface.mapped = True
        if material.texture is not None:
            block[used] = material.texture.at(in_texture[used])[:, :3] * material.colour
    if tints is not None:
        block[used] = tinted(block[used], tints)
    if corners.size:
        surface.triangles.append(corners.reshape(-1, 3) + first)
        surface.parts.append((_unused(owner[1], material.name, surface), material))
        surface.uv.append(mapped)


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
        joints, weights = skin_weights(document, arrays, node["skin"], primitive["attributes"], len(vertices))
        linear, shift = _skinned(document, arrays, node["skin"], joints, weights, places)
        surface.bones += head_bones(document, node["skin"], joints, weights, places, surface.count)
        surface.vertices.append(np.einsum("nij,nj->ni", linear, vertices) + shift)
    else:
        linear = np.broadcast_to(matrix[:3, :3], (len(vertices), 3, 3))
        surface.vertices.append(vertices @ matrix[:3, :3].T + matrix[:3, 3])
        surface.bones += held_bones(kinds_of_nodes(document).get(id(node), {}), places, surface.count, len(vertices))
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
    colour = surface.materials.material(primitive.get("material")).colour
    surface.colours.append(np.tile(colour, (len(vertices), 1)))
    surface.tints.append(np.ones((len(vertices), 4)))
    surface.count += len(vertices)


def _skinned(
    document: GltfDocument,
    arrays: GltfArrays,
    skin_number: Any,
    joints: NDArray[np.int64],
    weights: Matrix,
    places: dict[int, Matrix],
) -> tuple[Matrix, Matrix]:
    """Return how a skin at rest maps every vertex: matrices [shape=(N, 3, 3)] and shifts [shape=(N, 3)]."""
    skin = document.item("skins", skin_number)
    listed = skin["joints"]
    if not all(joint in places for joint in listed if isinstance(joint, int)):
        raise InputError("a skin with joints that are not in the scene; export it again")
    matrices = np.array([places.get(joint, np.eye(4)) for joint in listed])
    if "inverseBindMatrices" in skin:
        inverse = arrays.floats(skin["inverseBindMatrices"], 16).reshape(-1, 4, 4).transpose(0, 2, 1)
        if len(inverse) < len(listed):
            raise InputError(f"{len(inverse)} matrices of {len(listed)} joints; export it again")
        matrices = matrices @ inverse[: len(listed)]
    count = len(weights)
    blended = np.zeros((count, 3, 4))
    for column in range(weights.shape[1]):
        blended += weights[:, column, None, None] * matrices[joints[:, column], :3]
    total = weights.sum(axis=1)
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
