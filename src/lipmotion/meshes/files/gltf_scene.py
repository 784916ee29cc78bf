"""glTF scenes: nodes, skins at rest and primitives, as one mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened
from lipmotion.meshes.files.gltf_accessors import GltfArrays
from lipmotion.meshes.files.gltf_colours import WHITE, counted, tinted, vertex_tints
from lipmotion.meshes.files.gltf_container import GltfDocument, plain_name, read_gltf_document
from lipmotion.meshes.files.gltf_nodes import placed_nodes
from lipmotion.meshes.files.gltf_schema import LARGEST_NUMBER
from lipmotion.meshes.files.gltf_skins import GltfSkin, head_bones, held_bones, read_skin, skin_weights, skinned_frames
from lipmotion.meshes.files.gltf_textures import GltfMaterials
from lipmotion.meshes.files.vrm import expression_shapes, looks_backwards
from lipmotion.meshes.model.bones import Bone, merged_bones
from lipmotion.meshes.model.mesh import Blendshape, Material, Mesh, MeshPart, PartNames

Matrix = NDArray[np.float64]
TRIANGLES = 4
"""The mode of primitives that are lists of triangles; strips, fans, lines and points are not read."""
LEAST_DISPLACEMENT = 1e-9
"""Vertices that a morph target moves by no more than this, in the unit of the file, are not stored."""


def read_gltf(path: Path) -> Mesh:
    """Return all meshes of a ``.glb``, ``.gltf`` or ``.vrm`` file as one, in the place where its scene has them at
    rest.

    Every primitive becomes a part. Morph targets become blendshapes; those of one name in several primitives become
    one. Expressions of a VRM become blendshapes as well (``aa``, ``ih``, ...), after the targets.
    Raises InputError: damaged, too large, or without triangles.
    """
    try:
        return _SceneSurface(read_gltf_document(path)).mesh()
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from error


@dataclass(frozen=True, eq=False)
class _SharedVertices:
    """Vertices that primitives of a node share: the number of the first one, and how they look."""

    first: int
    vertices: Matrix
    colours: Matrix
    tints: Matrix


class _SceneSurface:
    """The surface of a scene, primitive by primitive."""

    def __init__(self, document: GltfDocument) -> None:
        self._document, self._budget = document, document.budget
        self._arrays = GltfArrays(document)
        self._materials = GltfMaterials(document, self._arrays)
        self._nodes = placed_nodes(document)
        self._skins: dict[int, GltfSkin] = {}
        self._blocks: dict[Any, _SharedVertices] = {}
        self._triangles: list[NDArray[np.int64]] = []
        self._uv: list[Matrix] = []
        self._parts: list[tuple[str, Material]] = []
        self._names = PartNames()
        self._moved: dict[str, list[tuple[NDArray[np.int64], Matrix]]] = {}
        self._targets: dict[tuple[int, int], str] = {}
        self._bones: list[Bone] = []
        self._mapped = self._tinted = False
        self._count = 0

    def mesh(self) -> Mesh:
        """Return the whole surface. Raises InputError: it is damaged or too large, or there are no triangles."""
        for number in sorted(self._nodes):
            node = self._document.items("nodes")[number]
            if "mesh" in node:
                self._add_node(number, node, self._document.items("meshes")[node["mesh"]])
        if not self._triangles:
            raise InputError("there are no triangles in it; export the surface")
        turn = np.array([-1.0, 1.0, -1.0]) if looks_backwards(self._document) else np.ones(3)
        shapes = [self._shape(name, turn) for name in list(self._moved)]
        shapes += expression_shapes(self._document, self._targets, shapes)
        stops = np.cumsum([0, *map(len, self._triangles)])
        parts = tuple(
            MeshPart(name, int(first), int(stop), material)
            for (name, material), first, stop in zip(self._parts, stops, stops[1:], strict=False)
        )
        blocks = list(self._blocks.values())
        return Mesh(
            np.concatenate([block.vertices for block in blocks]) * turn,
            np.concatenate(self._triangles).astype(np.int32),
            parts,
            tuple(shapes),
            np.concatenate(self._uv) if self._mapped else None,
            np.concatenate([block.colours for block in blocks]),
            tuple(replace(bone, place=bone.place * turn) for bone in merged_bones(self._bones)),
            np.concatenate([block.tints for block in blocks]) if self._tinted else None,
        )

    def _shape(self, name: str, turn: Matrix) -> Blendshape:
        rows, moved = zip(*self._moved.pop(name), strict=True)
        return Blendshape(name, np.concatenate(rows), np.concatenate(moved) * turn)

    def _add_node(self, number: int, node: dict[str, Any], mesh: dict[str, Any]) -> None:
        name = plain_name(node.get("name") or mesh.get("name", "")) or f"mesh {node['mesh']}"
        self._budget.spend("parts", len(mesh["primitives"]))
        for primitive in mesh["primitives"]:
            if primitive.get("mode", TRIANGLES) == TRIANGLES and "POSITION" in primitive["attributes"]:
                attributes = primitive["attributes"]
                moved = tuple(target.get("POSITION") for target in primitive.get("targets", []))
                shared = (number, attributes["POSITION"], attributes.get("COLOR_0"), moved)
                if shared not in self._blocks:
                    self._blocks[shared] = self._block(number, primitive, target_names(self._document, mesh, primitive))
                self._add_primitive(primitive, name, self._blocks[shared])

    def _add_primitive(self, primitive: dict[str, Any], name: str, block: _SharedVertices) -> None:
        attributes, count = primitive["attributes"], len(block.vertices)
        corners = self._corners(primitive, count)
        if not corners.size:
            return
        material = self._materials.material(primitive.get("material"))
        used = np.unique(corners)
        tints = None
        if "COLOR_0" in attributes:
            material = material if "material" in primitive else replace(material, colour=WHITE)
            tints = counted(vertex_tints(self._document, self._arrays, attributes["COLOR_0"], count)[used], material)
            block.tints[used] = tints
            self._tinted = True
        colours = np.tile(material.colour, (len(used), 1))
        mapped = np.zeros((corners.size // 3, 3, 2))
        if "TEXCOORD_0" in attributes:
            in_texture = self._arrays.floats(attributes["TEXCOORD_0"], 2, count)
            in_texture = self._materials.moved(primitive.get("material"), in_texture)
            mapped = (in_texture * (1.0, -1.0) + (0.0, 1.0))[corners].reshape(-1, 3, 2)
            self._mapped = True
            if material.texture is not None:
                colours = material.texture.at(in_texture[used])[:, :3] * material.colour
        block.colours[used] = colours if tints is None else tinted(colours, tints)
        self._triangles.append(corners.reshape(-1, 3) + block.first)
        self._parts.append((self._names.unused(name, material.name), material))
        self._uv.append(mapped)

    def _corners(self, primitive: dict[str, Any], count: int) -> NDArray[np.int64]:
        """Return the vertices of the corners of triangles, counted in their block [shape=(3 · F,)]."""
        size = self._arrays.count(primitive["indices"]) if "indices" in primitive else count
        self._budget.spend("triangles", -(-size // 3))
        corners = self._arrays.whole(primitive["indices"], 1)[:, 0] if "indices" in primitive else np.arange(count)
        if size % 3 or (size and not 0 <= corners.min() <= corners.max() < count):
            raise InputError(f"triangles of vertices up to {corners.max(initial=0)} of {count}; export it again")
        return corners

    def _block(self, number: int, primitive: dict[str, Any], names: list[str]) -> _SharedVertices:
        """Return the vertices of a primitive at their places in the scene; keep its bones and morph targets."""
        node, attributes = self._document.items("nodes")[number], primitive["attributes"]
        count = self._arrays.count(attributes["POSITION"])
        self._budget.spend("vertices", count)
        vertices = self._arrays.floats(attributes["POSITION"], 3)
        if "skin" in node:
            skin = self._skin(node["skin"])
            joints, weights = skin_weights(skin, self._arrays, attributes, count)
            linear, shift = skinned_frames(skin, joints, weights)
            self._bones += head_bones(skin, joints, weights, self._nodes, self._count)
        else:
            placed = self._nodes[number]
            linear, shift = placed.matrix[:3, :3], placed.matrix[:3, 3]
            self._bones += held_bones(placed, self._nodes, self._count, count)
        self._add_targets(node["mesh"], primitive.get("targets", []), names, linear, count)
        block = _SharedVertices(
            self._count, _mapped(linear, vertices) + shift, np.zeros((count, 3)), np.ones((count, 4))
        )
        block.colours[:] = self._materials.material(primitive.get("material")).colour
        self._count += count
        return block

    def _skin(self, number: int) -> GltfSkin:
        if number not in self._skins:
            self._skins[number] = read_skin(self._document, number, self._arrays, self._nodes)
        return self._skins[number]

    def _add_targets(
        self, mesh: int, targets: list[dict[str, Any]], names: list[str], linear: Matrix, count: int
    ) -> None:
        self._budget.spend("morph targets", len(targets))
        for number, (name, target) in enumerate(zip(names, targets, strict=True)):
            self._targets[(mesh, number)] = name
            if name not in self._moved:
                self._budget.spend("blendshapes", 1)
            kept = self._moved.setdefault(name, [])
            if "POSITION" not in target:
                kept.append((np.zeros(0, np.int64), np.zeros((0, 3))))
                continue
            if self._arrays.count(target["POSITION"]) != count:
                found = self._arrays.count(target["POSITION"])
                raise InputError(f"the target {shortened(name)!r} moves {found} of {count} vertices; export it again")
            moved = _mapped(linear, self._arrays.floats(target["POSITION"], 3))
            rows = np.flatnonzero(np.abs(moved).max(axis=1, initial=0.0) > LEAST_DISPLACEMENT)
            self._budget.spend("displacements", len(rows))
            kept.append((rows + self._count, moved[rows]))


def _mapped(linear: Matrix, vectors: Matrix) -> Matrix:
    """Return vectors [shape=(N, 3)] under one matrix [shape=(3, 3)], or one each [shape=(N, 3, 3)]."""
    mapped = vectors @ linear.T if linear.ndim == 2 else np.einsum("nij,nj->ni", linear, vectors)
    if not (np.abs(mapped) <= LARGEST_NUMBER).all():
        raise InputError(f"it has vertices beyond ±{LARGEST_NUMBER:g}; scale it down")
    return mapped


def target_names(document: GltfDocument, mesh: Mapping[str, Any], primitive: Mapping[str, Any]) -> list[str]:
    """Return the names of the morph targets of a primitive: those of the mesh, or else of its arrays.

    Targets without a name, or with that of another before, are numbered.
    """
    targets = primitive.get("targets", [])
    accessors = document.items("accessors")
    arrays = [accessors[target["POSITION"]].get("name", "") if "POSITION" in target else "" for target in targets]
    holders = [holder.get("extras", {}).get("targetNames", []) for holder in (mesh, primitive)]
    given: list[str] = next((names for names in (*holders, arrays) if any(names)), [])
    names: list[str] = []
    for number in range(len(targets)):
        name = plain_name(given[number]) if number < len(given) else ""
        names.append(name if name and name not in names else f"target {number}")
    return names


def mesh_target_names(document: GltfDocument, mesh: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the morph targets of a mesh; some of its primitives may have none."""
    named = [target_names(document, mesh, primitive) for primitive in mesh.get("primitives", [])]
    longest = max(named, key=len, default=[])
    return tuple(longest)
