"""glTF scenes as one mesh: nodes, skins at rest, primitives, and the expressions of VRM as blendshapes.

Source: the specifications of VRM 0.x (glTF extension ``VRM``) and VRM 1.0 (``VRMC_vrm``), by the VRM Consortium.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.meshes.model.mesh import OPAQUE, Blendshape, Bone, Material, Mesh, MeshPart, Texture
from lipmotion.meshes.model.shape_names import is_known
from lipmotion_faces.characters.gltf_document import (
    COMPONENTS,
    LARGEST_NUMBER,
    MAX_GROUPS,
    WIDTHS,
    GltfArrays,
    GltfDocument,
    PlacedNode,
    clean_name,
    place_nodes,
    read_gltf_document,
)
from lipmotion_faces.characters.textures import decode_srgb, encode_srgb, find_pixels, read_texture

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

UNKNOWN = (0.8, 0.72, 0.66)
"""The colour (sRGB) of a material whose texture cannot be read: a pale skin, rather than the white that is usually
multiplied by the texture."""
WHITE = (1.0, 1.0, 1.0)  # the colour of a primitive that has colours of vertices and no material
MIN_WEIGHT = 1e-6
TRIANGLES, STRIP, FAN = 4, 5, 6  # modes of primitives; lines and points are no surface
MIN_DISPLACEMENT = 1e-9
"""Vertices that a morph target moves by no more than this, in the unit of the file, are not stored."""
PRESETS = {"a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh", "joy": "happy", "sorrow": "sad", "fun": "relaxed"}
"""Names of presets of VRM 0.x in the words of VRM 1.0; all others are the same in both."""
FULL_WEIGHT = 100.0  # weights of VRM 0.x are per cent
AT_REST = {"basis", "base", "neutral", "default"}  # names of the mesh itself, which Blender and others list first
Bind = tuple[int, int, float]  # a mesh of the document, one of its morph targets, and the weight of it


class _Materials:
    """The materials of a document; every picture is read once."""

    def __init__(self, document: GltfDocument, arrays: GltfArrays) -> None:
        self._document, self._arrays = document, arrays
        self._textures: dict[str | int, Texture | None] = {}
        self._materials: dict[int, Material] = {}

    def read_material(self, number: int | None) -> Material:
        """Return a material (None: the default one): base colour, texture (unreadable: ``UNKNOWN``), gloss."""
        if number is None:
            return Material()
        if number not in self._materials:
            stored = self._document.get("materials")[number]
            look, alpha = stored.get("pbrMetallicRoughness", {}), stored.get("alphaMode", OPAQUE)
            factor = np.clip(look.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)), 0, 1)
            colour, texture = encode_srgb(factor[:3]), None
            if "baseColorTexture" in look:
                texture = self._read_texture(self._document.get("textures")[look["baseColorTexture"]["index"]])
                colour = colour if texture else np.array(UNKNOWN)
            red, green, blue = np.clip(colour, 0, 1).tolist()
            self._materials[number] = Material(
                clean_name(stored.get("name", "")),
                (red, green, blue),
                1 - min(max(look.get("roughnessFactor", 1.0), 0.0), 1.0),
                1.0 if alpha == OPAQUE else float(factor[3]),
                texture,
                alpha,
                min(max(stored.get("alphaCutoff", 0.5), 0.0), 1.0),
                stored.get("doubleSided", False),
            )
        return self._materials[number]

    def move_uv(self, number: int | None, uv: Array) -> Array:
        """Return places in a material's texture, v down [shape=(N, 2)], as ``KHR_texture_transform`` moves them."""
        look = {} if number is None else self._document.get("materials")[number].get("pbrMetallicRoughness", {})
        how = look.get("baseColorTexture", {}).get("extensions", {}).get("KHR_texture_transform")
        if not how:
            return uv
        angle = how.get("rotation", 0.0)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return (uv * how.get("scale", (1.0, 1.0))) @ turn + how.get("offset", (0.0, 0.0))

    def _read_texture(self, texture: dict[str, Any]) -> Texture | None:
        source = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source")
        if source is None:
            _warn("is in a format (KTX2, AVIF) that is not read; export it as PNG or JPEG")
            return None
        image = self._document.get("images")[source]
        place = image.get("bufferView", image.get("uri", ""))
        if place not in self._textures:
            self._textures[place] = None
            try:
                content: bytes | memoryview
                if isinstance(place, str):
                    content = self._document.read_link(place, "picture")
                else:
                    content, _ = self._arrays.read_view(place)
                self._document.budget.spend("bytes of pictures", len(content))
                self._textures[place] = read_texture(content, self._document.budget)
                if self._textures[place] is None:
                    _warn("is damaged, too large, or no PNG, JPEG or WebP; export it again")
            except InputError as error:
                _warn(f"cannot be read: {error}")
        return self._textures[place]


def _warn(what: str) -> None:
    warnings.warn(f"a texture of the character {what}. Its surface has one colour", UserWarning, stacklevel=2)


def _read_tints(document: GltfDocument, arrays: GltfArrays, number: int, count: int) -> Array:
    """Return the light and the opacity by which those of a material are multiplied, 0 to 1 [shape=(N, 4)]."""
    accessor = document.get("accessors")[number]
    width, kind = WIDTHS[accessor["type"]], np.dtype(COMPONENTS[accessor["componentType"]])
    if width not in {3, 4} or not (kind.kind == "f" or (kind.kind == "u" and kind.itemsize < 4)):
        raise InputError(
            f"colours of vertices are {accessor['type']!r} of {accessor['componentType']!r}, required VEC3 or VEC4 of "
            "floats, unsigned bytes or unsigned shorts; export it again"
        )
    values = arrays.read_floats(number, width, count)
    if kind.kind == "u" and not accessor.get("normalized"):  # parts of the largest number, also where that is not said
        values = values / np.iinfo(kind).max
    tints = np.ones((count, 4))
    tints[:, :width] = np.clip(values, 0, 1)
    return tints


@dataclass(frozen=True, eq=False)
class _Skin:
    """The joints of a skin [J], and where each takes what follows it [shape=(J, 3, 4)]."""

    joints: tuple[PlacedNode, ...]
    matrices: Array

    def weigh(self, arrays: GltfArrays, attributes: Mapping[str, int], count: int) -> tuple[Rows, Array]:
        """Return the joints that every vertex follows, as rows of the skin's list, and how far [shape=(N, W), both]."""
        joints, weights = [np.zeros((count, 0), np.int64)], [np.zeros((count, 0))]
        for group in range(MAX_GROUPS):
            if f"JOINTS_{group}" not in attributes or f"WEIGHTS_{group}" not in attributes:
                break
            numbers = arrays.read_ints(attributes[f"JOINTS_{group}"], 4, count)
            if count and not 0 <= numbers.min() <= numbers.max() < len(self.joints):
                raise InputError(f"vertices follow joint {numbers.max()} of {len(self.joints)}; export it again")
            joints.append(numbers)
            weights.append(arrays.read_floats(attributes[f"WEIGHTS_{group}"], 4, count))
        return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)

    def blend(self, joints: Rows, weights: Array) -> tuple[Array, Array]:
        """Return how the skin at rest maps every vertex: matrices [shape=(N, 3, 3)] and shifts [shape=(N, 3)]."""
        blended = np.zeros((len(weights), 3, 4))
        for column in range(weights.shape[1]):
            blended += weights[:, column, None, None] * self.matrices[joints[:, column]]
        total = weights.sum(axis=1)
        held = total > MIN_WEIGHT
        blended[held] /= total[held, None, None]
        blended[~held] = np.eye(4)[:3]
        if not (np.abs(blended) <= LARGEST_NUMBER).all():
            raise InputError(f"a skin takes vertices beyond ±{LARGEST_NUMBER:g}; export it again")
        return blended[:, :, :3], blended[:, :, 3]

    def find_head_bones(
        self, joints: Rows, weights: Array, nodes: Mapping[int, PlacedNode], first: int
    ) -> Iterator[Bone]:
        """Yield the bones of the head that vertices follow, or whose parts they follow; arguments as of ``weigh``."""
        total = np.maximum(weights.sum(axis=1), MIN_WEIGHT)
        for kind in sorted({kind for joint in self.joints for kind in joint.kinds}):
            member = np.array([kind in joint.kinds for joint in self.joints])
            shares = np.clip((weights * member[joints]).sum(axis=1) / total, 0, 1)
            rows = np.flatnonzero(shares > 0)
            if len(rows):
                node = next(joint.kinds[kind] for joint in self.joints if kind in joint.kinds)
                yield Bone(kind, nodes[node].matrix[:3, 3], rows + first, shares[rows])


def read_gltf(path: Path) -> Mesh:
    """Return all meshes of a ``.glb``, ``.gltf`` or ``.vrm`` file as one, where its scene has them at rest.

    Every primitive becomes a part. Morph targets become blendshapes; those of one name in several primitives become
    one. Expressions of a VRM become blendshapes as well (``aa``, ``ih``, ...), after the targets.
    Raises InputError: damaged, too large, or without triangles.
    """
    try:
        return _SceneSurface(read_gltf_document(path)).build_mesh()
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from error


@dataclass(frozen=True, eq=False)
class _SharedVertices:
    """Vertices that primitives of a node share: the number of the first one, whether mirrored, and how they look."""

    first: int
    mirrored: bool
    vertices: Array
    colours: Array
    tints: Array


class _SceneSurface:
    def __init__(self, document: GltfDocument) -> None:
        self._document, self._budget = document, document.budget
        self._arrays = GltfArrays(document)
        self._materials = _Materials(document, self._arrays)
        self._nodes = place_nodes(document)
        self._skins: dict[int, _Skin] = {}
        self._blocks: dict[Any, _SharedVertices] = {}
        self._triangles: list[Rows] = []
        self._uv: list[Array] = []
        self._parts: list[tuple[str, Material]] = []
        self._names: dict[str, int] = {}
        self._moved: dict[str, list[tuple[Rows, Array]]] = {}
        self._targets: dict[tuple[int, int], str] = {}
        self._bones: list[Bone] = []
        self._mapped = self._tinted = False
        self._count = 0

    def build_mesh(self) -> Mesh:
        """Return the whole surface. Raises InputError: it is damaged or too large, or there are no triangles."""
        for number in sorted(self._nodes):
            node = self._document.get("nodes")[number]
            if "mesh" in node:
                mesh = self._document.get("meshes")[node["mesh"]]
                name = clean_name(node.get("name") or mesh.get("name", "")) or f"mesh {node['mesh']}"
                self._budget.spend("parts", len(mesh["primitives"]))
                for primitive in mesh["primitives"]:
                    if primitive.get("mode", TRIANGLES) >= TRIANGLES and "POSITION" in primitive["attributes"]:
                        self._add_primitive(primitive, name, self._share_vertices(number, mesh, primitive))
        if not self._triangles:
            raise InputError("there are no triangles in it; export the surface")
        # characters of VRM 0.x look along −z, all others along +z
        turn = np.array([-1.0, 1.0, -1.0]) if "VRM" in self._document.parts.get("extensions", {}) else np.ones(3)
        shapes = []
        for name in list(self._moved):
            rows, moved = zip(*self._moved.pop(name), strict=True)
            shapes.append(Blendshape(name, np.concatenate(rows), np.concatenate(moved) * turn))
        shapes += _build_expression_shapes(self._document, self._targets, shapes)
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
            tuple(replace(bone, place=bone.place * turn) for bone in merge_bones(self._bones)),
            np.concatenate([block.tints for block in blocks]) if self._tinted else None,
        )

    def _add_primitive(self, primitive: dict[str, Any], name: str, block: _SharedVertices) -> None:
        attributes, count = primitive["attributes"], len(block.vertices)
        size = self._arrays.count(primitive["indices"]) if "indices" in primitive else count
        mode = primitive.get("mode", TRIANGLES)
        self._budget.spend("triangles", -(-size // 3) if mode == TRIANGLES else size)
        corners = self._arrays.read_ints(primitive["indices"], 1)[:, 0] if "indices" in primitive else np.arange(count)
        corners = corners if mode == TRIANGLES else _divide_strip(corners, fan=mode == FAN)
        if corners.size % 3 or (corners.size and not 0 <= corners.min() <= corners.max() < count):
            raise InputError(f"triangles of vertices up to {corners.max(initial=0)} of {count}; export it again")
        if not corners.size:
            return
        if block.mirrored:
            corners = corners.reshape(-1, 3)[:, ::-1].reshape(-1)
        material = self._materials.read_material(primitive.get("material"))
        if "COLOR_0" in attributes and "material" not in primitive:
            material = replace(material, colour=WHITE)
        used = np.unique(corners)
        colours = np.tile(material.colour, (len(used), 1))
        mapped = np.zeros((corners.size // 3, 3, 2))
        if "TEXCOORD_0" in attributes:
            uv = self._materials.move_uv(
                primitive.get("material"), self._arrays.read_floats(attributes["TEXCOORD_0"], 2, count)
            )
            mapped = (uv * (1.0, -1.0) + (0.0, 1.0))[corners].reshape(-1, 3, 2)
            self._mapped = True
            if material.texture is not None:
                colours = find_pixels(material.texture, uv[used])[:, :3] * material.colour
        if "COLOR_0" in attributes:
            tints = _read_tints(self._document, self._arrays, attributes["COLOR_0"], count)[used]
            if material.alpha == OPAQUE:
                tints[:, 3] = 1.0
            block.tints[used] = tints
            colours = encode_srgb(decode_srgb(colours) * tints[:, :3])
            self._tinted = True
        block.colours[used] = colours
        self._triangles.append(corners.reshape(-1, 3) + block.first)
        self._parts.append((self._name_part(name, material.name), material))
        self._uv.append(mapped)

    def _name_part(self, owner: str, material: str) -> str:
        """Return the name of the owner, with that of the material where it is taken, and a number where both are."""
        both = f"{owner} {material}".strip()
        name = owner if owner not in self._names else both
        while name in self._names:
            self._names[both] += 1
            name = f"{both} {self._names[both]}"
        self._names[name] = 1
        return name

    def _share_vertices(self, number: int, mesh: dict[str, Any], primitive: dict[str, Any]) -> _SharedVertices:
        """Return the vertices of a primitive at their places in the scene; keep its bones and morph targets."""
        node, attributes = self._document.get("nodes")[number], primitive["attributes"]
        moved = tuple(target.get("POSITION") for target in primitive.get("targets", []))
        shared = (number, attributes["POSITION"], attributes.get("COLOR_0"), moved)
        if shared in self._blocks:
            return self._blocks[shared]
        count = self._arrays.count(attributes["POSITION"])
        self._budget.spend("vertices", count)
        vertices = self._arrays.read_floats(attributes["POSITION"], 3)
        if "skin" in node:
            skin = self._read_skin(node["skin"])
            joints, weights = skin.weigh(self._arrays, attributes, count)
            linear, shift = skin.blend(joints, weights)
            self._bones += skin.find_head_bones(joints, weights, self._nodes, self._count)
        else:  # all vertices follow the bones that the node hangs on
            placed, rows = self._nodes[number], np.arange(self._count, self._count + count)
            linear, shift = placed.matrix[:3, :3], placed.matrix[:3, 3]
            for kind, above in sorted(placed.kinds.items()):
                self._bones.append(Bone(kind, self._nodes[above].matrix[:3, 3], rows, np.ones(count)))
        shift = shift + self._add_targets(node, mesh, primitive, linear, count)
        colours = np.tile(self._materials.read_material(primitive.get("material")).colour, (count, 1))
        mirrored = bool(count and np.median(np.linalg.det(linear)) < 0)  # faces then look inwards
        vertices = _map_vectors(linear, vertices) + shift
        block = _SharedVertices(self._count, mirrored, vertices, colours, np.ones((count, 4)))
        self._blocks[shared] = block
        self._count += count
        return block

    def _read_skin(self, number: int) -> _Skin:
        """Return a skin at rest. Raises InputError: a joint is not in the scene, or matrices are missing."""
        if number not in self._skins:
            skin = self._document.get("skins")[number]
            listed, inverse = skin["joints"], skin.get("inverseBindMatrices")
            count = len(listed) if inverse is None else self._arrays.count(inverse)
            self._budget.spend("joints", max(count, len(listed)))
            if not all(joint in self._nodes for joint in listed):
                raise InputError("a skin with joints that are not in the scene; export it again")
            if count < len(listed):
                raise InputError(f"{count} matrices of {len(listed)} joints; export it again")
            joints = tuple(self._nodes[joint] for joint in listed)
            matrices = np.array([joint.matrix for joint in joints])
            if inverse is not None:
                inverses = self._arrays.read_floats(inverse, 16)[: len(joints)].reshape(-1, 4, 4)
                matrices = matrices @ inverses.transpose(0, 2, 1)
            self._skins[number] = _Skin(joints, matrices[:, :3])
        return self._skins[number]

    def _add_targets(
        self, node: dict[str, Any], mesh: dict[str, Any], primitive: dict[str, Any], linear: Array, count: int
    ) -> Array:
        """Keep the morph targets of a primitive; return how far they move its vertices at rest [shape=(N, 3)]."""
        targets, rest = primitive.get("targets", []), np.zeros((count, 3))
        self._budget.spend("morph targets", len(targets))
        names = name_targets(self._document, mesh, primitive)
        weights = list_rest_weights(names, node, mesh)
        for column, (name, weight, target) in enumerate(zip(names, weights, targets, strict=True)):
            self._targets[(node["mesh"], column)] = name
            if name not in self._moved:
                self._budget.spend("blendshapes", 1)
            displacements = self._moved.setdefault(name, [])
            if "POSITION" not in target:
                displacements.append((np.zeros(0, np.int64), np.zeros((0, 3))))
                continue
            size = self._arrays.count(target["POSITION"])
            if size != count:
                raise InputError(f"the target {shorten(name)!r} moves {size} of {count} vertices; export it again")
            moved = _map_vectors(linear, self._arrays.read_floats(target["POSITION"], 3))
            rest += weight * moved
            rows = np.flatnonzero(np.abs(moved).max(axis=1, initial=0.0) > MIN_DISPLACEMENT)
            self._budget.spend("displacements", len(rows))
            displacements.append((rows + self._count, moved[rows]))
        return rest


def list_rest_weights(names: Sequence[str], node: Mapping[str, Any], mesh: Mapping[str, Any]) -> list[float]:
    """Return the weights at rest of morph targets: those of the file; 0 for movements of a face, left from a pose."""
    stored = node.get("weights", mesh.get("weights", []))
    return [0.0 if is_known(name) or n >= len(stored) else float(stored[n]) for n, name in enumerate(names)]


def _divide_strip(corners: Rows, *, fan: bool) -> Rows:
    """Return the corners of the triangles of a strip or a fan (glTF 2.0, §3.7.2.1), without those that have no area."""
    first = np.arange(max(len(corners) - 2, 0))
    odd = first % 2
    order = [first + 1, first + 2, 0 * first] if fan else [first, first + 1 + odd, first + 2 - odd]
    triangles = corners[np.stack(order, axis=1)]
    same = triangles == np.roll(triangles, 1, axis=1)
    return triangles[~same.any(axis=1)].reshape(-1)


def _map_vectors(linear: Array, vectors: Array) -> Array:
    """Return vectors [shape=(N, 3)] under one matrix [shape=(3, 3)], or one each [shape=(N, 3, 3)]."""
    mapped = vectors @ linear.T if linear.ndim == 2 else np.einsum("nij,nj->ni", linear, vectors)
    if not (np.abs(mapped) <= LARGEST_NUMBER).all():
        raise InputError(f"it has vertices beyond ±{LARGEST_NUMBER:g}; scale it down")
    return mapped


def name_targets(document: GltfDocument, mesh: Mapping[str, Any], primitive: Mapping[str, Any]) -> list[str]:
    """Return the names of the targets of a primitive, of its mesh or arrays; missing and repeated ones are numbered."""
    targets = primitive.get("targets", [])
    accessors = document.get("accessors")
    arrays = [accessors[target["POSITION"]].get("name", "") if "POSITION" in target else "" for target in targets]
    holders = [holder.get("extras", {}).get("targetNames", []) for holder in (mesh, primitive)]
    stored: list[str] = next((names for names in (*holders, arrays) if any(names)), [])
    if len(stored) == len(targets) + 1 and stored[0].lower() in AT_REST:
        stored = stored[1:]
    elif len(stored) > len(targets) > 0:
        what = f"{len(stored)} names of {len(targets)} blendshapes, required as many: the first ones are taken"
        warnings.warn(f"{what}; export the names again", stacklevel=2)
    names: list[str] = []
    for number in range(len(targets)):
        name = clean_name(stored[number]) if number < len(stored) else ""
        names.append(name if name and name not in names else f"target {number}")
    return names


def name_mesh_targets(document: GltfDocument, mesh: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the morph targets of a mesh; some of its primitives may have none."""
    named = [name_targets(document, mesh, primitive) for primitive in mesh.get("primitives", [])]
    longest: list[str] = max(named, key=len, default=[])
    return tuple(longest)


def _build_expression_shapes(
    document: GltfDocument, targets: Mapping[tuple[int, int], str], shapes: Sequence[Blendshape]
) -> Iterator[Blendshape]:
    """Yield the expressions of a VRM as blendshapes, by the names of VRM 1.0; none for other files."""
    extensions, expressions = document.parts.get("extensions", {}), dict[str, list[Bind]]()
    for group in extensions.get("VRM", {}).get("blendShapeMaster", {}).get("blendShapeGroups", []):
        preset = clean_name(group.get("presetName", "")).lower()
        name = PRESETS.get(preset, preset) if preset not in {"", "unknown"} else clean_name(group.get("name", ""))
        expressions[name] = [_read_bind(each["mesh"], each, FULL_WEIGHT) for each in group.get("binds", [])]
    kinds = extensions.get("VRMC_vrm", {}).get("expressions", {})
    meshes = dict(enumerate(node.get("mesh", -1) for node in document.get("nodes")))
    for kind in ("preset", "custom"):
        for name, expression in kinds.get(kind, {}).items():
            binds = expression.get("morphTargetBinds", [])
            expressions[clean_name(name)] = [_read_bind(meshes.get(each["node"], -1), each, 1.0) for each in binds]
    by_name = {shape.name: shape for shape in shapes}
    for name, bound in expressions.items():
        used = [(by_name[targets[bind[:2]]], bind[2]) for bind in bound if bind[:2] in targets]
        if used and name and name not in by_name:
            document.budget.spend("blendshapes", 1)
            document.budget.spend("displacements", sum(len(shape.rows) for shape, _ in used))
            rows = np.unique(np.concatenate([shape.rows for shape, _ in used]))
            moved = np.zeros((len(rows), 3))
            for shape, weight in used:
                moved[np.searchsorted(rows, shape.rows)] += weight * shape.displacements
            yield Blendshape(name, rows, moved)


def _read_bind(mesh: int, bind: Mapping[str, float], full: float) -> Bind:
    return mesh, int(bind["index"]), min(max(bind["weight"] / full, 0.0), 1.0)


def merge_bones(bones: Iterable[Bone]) -> tuple[Bone, ...]:
    """Return one bone of each kind: its vertices are those of all bones of this kind, its place that of the first."""
    by_kind: dict[str, list[Bone]] = {}
    for bone in bones:
        if len(bone.rows):
            by_kind.setdefault(bone.kind, []).append(bone)
    merged = []
    for kind, same in by_kind.items():
        rows, inverse = np.unique(np.concatenate([bone.rows for bone in same]), return_inverse=True)
        shares = np.zeros(len(rows))
        np.maximum.at(shares, inverse.reshape(-1), np.concatenate([bone.shares for bone in same]))
        merged.append(Bone(kind, same[0].place, rows, shares))
    return tuple(merged)
