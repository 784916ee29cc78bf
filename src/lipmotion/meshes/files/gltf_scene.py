"""glTF scenes: nodes, skins at rest and primitives, as one mesh."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.meshes.files.gltf_accessors import GltfArrays
from lipmotion.meshes.files.gltf_container import GltfDocument, plain_name, read_gltf_document
from lipmotion.meshes.files.gltf_nodes import PlacedNode, placed_nodes
from lipmotion.meshes.files.gltf_schema import COMPONENTS, LARGEST_NUMBER, MOST_GROUPS, WIDTHS
from lipmotion.meshes.files.vrm import expression_shapes, looks_backwards
from lipmotion.meshes.model.bones import Bone, merged_bones
from lipmotion.meshes.model.mesh import OPAQUE, Blendshape, Material, Mesh, MeshPart, PartNames
from lipmotion.meshes.model.textures import Texture, linear, read_texture

Colours = NDArray[np.float64]

UNKNOWN = (0.8, 0.72, 0.66)
"""The colour (sRGB) of a material whose texture cannot be read: a pale skin, rather than the white that is usually
multiplied by the texture."""


class GltfMaterials:
    """The materials of a document; every picture is read once."""

    def __init__(self, document: GltfDocument, arrays: GltfArrays) -> None:
        self._document, self._arrays = document, arrays
        self._textures: dict[str | int, Texture | None] = {}
        self._materials: dict[int, Material] = {}

    def material(self, number: int | None) -> Material:
        """Return a material: its base colour as sRGB, its texture, its gloss from its roughness.

        number : of the document; None: the default material
        A texture that cannot be read gives a warning and the colour ``UNKNOWN``.
        """
        if number is None:
            return Material()
        if number not in self._materials:
            self._materials[number] = self._read(self._document.items("materials")[number])
        return self._materials[number]

    def moved(self, number: int | None, uv: Colours) -> Colours:
        """Return places in a material's texture as its extension ``KHR_texture_transform`` moves them.

        uv : v downwards [shape=(N, 2)]
        """
        look = {} if number is None else self._document.items("materials")[number].get("pbrMetallicRoughness", {})
        how = look.get("baseColorTexture", {}).get("extensions", {}).get("KHR_texture_transform")
        if not how:
            return uv
        angle = how.get("rotation", 0.0)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return (uv * how.get("scale", (1.0, 1.0))) @ turn + how.get("offset", (0.0, 0.0))

    def _read(self, found: dict[str, Any]) -> Material:
        look = found.get("pbrMetallicRoughness", {})
        factor = np.clip(look.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)), 0, 1)
        linear = factor[:3]
        coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        alpha = found.get("alphaMode", OPAQUE)
        texture = None
        if "baseColorTexture" in look:
            texture = self._texture(self._document.items("textures")[look["baseColorTexture"]["index"]])
            if texture is None:
                coded = np.array(UNKNOWN)
        red, green, blue = np.clip(coded, 0, 1).tolist()
        return Material(
            plain_name(found.get("name", "")),
            (red, green, blue),
            1 - min(max(look.get("roughnessFactor", 1.0), 0.0), 1.0),
            1.0 if alpha == OPAQUE else float(factor[3]),
            texture,
            alpha,
            min(max(found.get("alphaCutoff", 0.5), 0.0), 1.0),
            found.get("doubleSided", False),
        )

    def _texture(self, texture: dict[str, Any]) -> Texture | None:
        source = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source")
        if source is None:
            _warn("is in a format (KTX2, AVIF) that is not read; export it as PNG or JPEG")
            return None
        image = self._document.items("images")[source]
        place = image.get("bufferView", image.get("uri", ""))
        if place not in self._textures:
            self._textures[place] = self._picture(place)
        return self._textures[place]

    def _picture(self, place: int | str) -> Texture | None:
        try:
            if isinstance(place, str):
                content: bytes | memoryview = self._document.linked(place, "picture")
            else:
                content = self._arrays.bytes_of(place)
            self._document.budget.spend("bytes of pictures", len(content))
            texture = read_texture(content, self._document.budget)
        except InputError as error:
            _warn(f"cannot be read: {error}")
            return None
        if texture is None:
            _warn("is damaged, too large, or no PNG, JPEG or WebP; export it again")
        return texture


def _warn(what: str) -> None:
    warnings.warn(f"a texture of the character {what}. Its surface has one colour", UserWarning, stacklevel=2)


Array = NDArray[np.float64]
WHITE = (1.0, 1.0, 1.0)
"""The colour of a primitive that has colours of vertices and no material."""


def vertex_tints(document: GltfDocument, arrays: GltfArrays, number: int, count: int) -> Array:
    """Return the light and the opacity by which those of a material are multiplied, 0 to 1 [shape=(N, 4)].

    number : of the accessor of ``COLOR_0``: three or four numbers, of floats or of bytes or shorts without a sign;
             whole numbers count as parts of the largest one, also where the file does not say so
    count  : of the vertices
    Raises InputError: another kind of numbers, another number of vertices, or as ``GltfArrays.floats``.
    """
    accessor = document.items("accessors")[number]
    width, kind = WIDTHS[accessor["type"]], np.dtype(COMPONENTS[accessor["componentType"]])
    if width not in {3, 4} or not (kind.kind == "f" or (kind.kind == "u" and kind.itemsize < 4)):
        raise InputError(
            f"colours of vertices are {accessor['type']!r} of {accessor['componentType']!r}, required VEC3 or VEC4 of "
            "floats, unsigned bytes or unsigned shorts; export it again"
        )
    values = arrays.floats(number, width, count)
    if kind.kind == "u" and not accessor.get("normalized"):
        values = values / np.iinfo(kind).max
    tints = np.ones((count, 4))
    tints[:, :width] = np.clip(values, 0, 1)
    return tints


def counted(tints: Array, material: Material) -> Array:
    """Return tints [shape=(N, 4)] as a material counts them: where it hides what is behind, their opacity is 1."""
    if material.alpha != OPAQUE:
        return tints
    return np.concatenate([tints[:, :3], np.ones((len(tints), 1))], axis=1)


def tinted(colours: Array, tints: Array) -> Array:
    """Return colours, sRGB, 0 to 1 [shape=(N, 3)], whose light is multiplied by tints [shape=(N, 4)]."""
    light = linear(colours) * tints[:, :3]
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


Matrix = NDArray[np.float64]
Numbers = NDArray[np.int64]
LEAST_WEIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class GltfSkin:
    """The joints of a skin.

    joints   : their nodes, in the order of the skin [J]
    matrices : where each takes what follows it [shape=(J, 3, 4)]
    """

    joints: tuple[PlacedNode, ...]
    matrices: Matrix


def read_skin(document: GltfDocument, number: int, arrays: GltfArrays, nodes: Mapping[int, PlacedNode]) -> GltfSkin:
    """Return a skin of a document at rest. Raises InputError: a joint is not in the scene, or matrices are missing."""
    skin = document.items("skins")[number]
    listed, inverse = skin["joints"], skin.get("inverseBindMatrices")
    count = len(listed) if inverse is None else arrays.count(inverse)
    document.budget.spend("joints", max(count, len(listed)))
    if not all(joint in nodes for joint in listed):
        raise InputError("a skin with joints that are not in the scene; export it again")
    if count < len(listed):
        raise InputError(f"{count} matrices of {len(listed)} joints; export it again")
    joints = tuple(nodes[joint] for joint in listed)
    matrices = np.array([joint.matrix for joint in joints])
    if inverse is not None:
        matrices = matrices @ arrays.floats(inverse, 16)[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    return GltfSkin(joints, matrices[:, :3])


def skin_weights(
    skin: GltfSkin, arrays: GltfArrays, attributes: Mapping[str, int], count: int
) -> tuple[Numbers, Matrix]:
    """Return the joints that every vertex follows, as rows of the skin's list, and how far [shape=(N, W), both].

    count : of the vertices
    Raises InputError: the numbers do not fit.
    """
    joints, weights = [np.zeros((count, 0), np.int64)], [np.zeros((count, 0))]
    for group in range(MOST_GROUPS):
        if f"JOINTS_{group}" not in attributes or f"WEIGHTS_{group}" not in attributes:
            break
        numbers = arrays.whole(attributes[f"JOINTS_{group}"], 4, count)
        if count and not 0 <= numbers.min() <= numbers.max() < len(skin.joints):
            raise InputError(f"vertices follow joint {numbers.max()} of {len(skin.joints)}; export it again")
        joints.append(numbers)
        weights.append(arrays.floats(attributes[f"WEIGHTS_{group}"], 4, count))
    return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)


def skinned_frames(skin: GltfSkin, joints: Numbers, weights: Matrix) -> tuple[Matrix, Matrix]:
    """Return how a skin at rest maps every vertex: matrices [shape=(N, 3, 3)] and shifts [shape=(N, 3)].

    joints, weights : as of ``skin_weights``
    """
    blended = np.zeros((len(weights), 3, 4))
    for column in range(weights.shape[1]):
        blended += weights[:, column, None, None] * skin.matrices[joints[:, column]]
    total = weights.sum(axis=1)
    held = total > LEAST_WEIGHT
    blended[held] /= total[held, None, None]
    blended[~held] = np.eye(4)[:3]
    if not (np.abs(blended) <= LARGEST_NUMBER).all():
        raise InputError(f"a skin takes vertices beyond ±{LARGEST_NUMBER:g}; export it again")
    return blended[:, :, :3], blended[:, :, 3]


def head_bones(
    skin: GltfSkin, joints: Numbers, weights: Matrix, nodes: Mapping[int, PlacedNode], first: int
) -> Iterator[Bone]:
    """Yield the bones of the head that vertices follow, or whose parts they follow.

    joints, weights : as of ``skin_weights``;  first : number of the first vertex in the whole mesh
    """
    total = np.maximum(weights.sum(axis=1), LEAST_WEIGHT)
    for kind in sorted({kind for joint in skin.joints for kind in joint.kinds}):
        member = np.array([kind in joint.kinds for joint in skin.joints])
        shares = np.clip((weights * member[joints]).sum(axis=1) / total, 0, 1)
        rows = np.flatnonzero(shares > 0)
        if len(rows):
            node = next(joint.kinds[kind] for joint in skin.joints if kind in joint.kinds)
            yield Bone(kind, nodes[node].matrix[:3, 3], rows + first, shares[rows])


def held_bones(node: PlacedNode, nodes: Mapping[int, PlacedNode], first: int, count: int) -> Iterator[Bone]:
    """Yield the bones that a mesh without skin hangs on; all of its vertices follow.

    first, count : its first vertex in the whole mesh, and how many
    """
    for kind, above in sorted(node.kinds.items()):
        if count:
            yield Bone(kind, nodes[above].matrix[:3, 3], np.arange(first, first + count), np.ones(count))


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
                mesh = self._document.items("meshes")[node["mesh"]]
                name = plain_name(node.get("name") or mesh.get("name", "")) or f"mesh {node['mesh']}"
                self._budget.spend("parts", len(mesh["primitives"]))
                for primitive in mesh["primitives"]:
                    if primitive.get("mode", TRIANGLES) == TRIANGLES and "POSITION" in primitive["attributes"]:
                        attributes = primitive["attributes"]
                        moved = tuple(target.get("POSITION") for target in primitive.get("targets", []))
                        shared = (number, attributes["POSITION"], attributes.get("COLOR_0"), moved)
                        if shared not in self._blocks:
                            self._blocks[shared] = self._block(
                                number, primitive, target_names(self._document, mesh, primitive)
                            )
                        self._add_primitive(primitive, name, self._blocks[shared])
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

    def _add_primitive(self, primitive: dict[str, Any], name: str, block: _SharedVertices) -> None:
        attributes, count = primitive["attributes"], len(block.vertices)
        size = self._arrays.count(primitive["indices"]) if "indices" in primitive else count
        self._budget.spend("triangles", -(-size // 3))
        corners = self._arrays.whole(primitive["indices"], 1)[:, 0] if "indices" in primitive else np.arange(count)
        if size % 3 or (size and not 0 <= corners.min() <= corners.max() < count):
            raise InputError(f"triangles of vertices up to {corners.max(initial=0)} of {count}; export it again")
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
                raise InputError(f"the target {shorten(name)!r} moves {found} of {count} vertices; export it again")
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
