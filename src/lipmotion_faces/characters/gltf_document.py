"""A glTF 2.0 document (``.glb``, ``.gltf``, ``.vrm``): its schema, JSON, buffers, the arrays in them, its nodes."""

from __future__ import annotations

import base64
import binascii
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.meshes.model.mesh import HEAD, JAW, LEFT_EYE, NECK, RIGHT_EYE
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types.values import (
    Schema,
    SchemaError,
    any_members,
    if_fits,
    items,
    members,
    number,
    one_of,
    text,
    truth,
    whole,
)
from lipmotion_faces.characters.file_limits import ALLOWANCE, Budget

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
LARGEST_NUMBER = 1e9  # largest plausible number of a file: a place, a factor
MAX_GROUPS = 8  # most groups of four joints a vertex
_LISTS = (
    *("accessors", "animations", "buffers", "bufferViews", "images", "materials", "meshes", "nodes", "scenes", "skins"),
    "textures",
)
_LARGEST_INTEGER = 1 << 53
_NAME = if_fits(text(1000))
_WORD = text(1000)
_SIZE = whole(0, _LARGEST_INTEGER)
_NUMBER = number(-LARGEST_NUMBER, LARGEST_NUMBER)
ASSET = members({"asset": members({"version": text(20)}, ["version"])}, ["asset"])  # what a document of any version has
_ANY_NUMBER = whole(-_LARGEST_INTEGER, _LARGEST_INTEGER)
_OLD_BIND = {"mesh": _ANY_NUMBER, "index": _ANY_NUMBER, "weight": _NUMBER}
_OLD_BINDS = items(if_fits(members(_OLD_BIND, list(_OLD_BIND))))
_NEW_BIND = {"node": _ANY_NUMBER, "index": _ANY_NUMBER, "weight": _NUMBER}
_NEW_BINDS = any_members(members({"morphTargetBinds": items(if_fits(members(_NEW_BIND, list(_NEW_BIND))))}))
_GROUP = members({"name": _NAME, "presetName": _NAME, "binds": _OLD_BINDS})
_MOVED = any_members(if_fits(members({"node": whole(0, _LARGEST_INTEGER)}, ["node"])))
_VRM = {
    "VRMC_vrm_animation": if_fits(members({"expressions": members({"preset": _MOVED, "custom": _MOVED})})),
    "VRM": members({"blendShapeMaster": members({"blendShapeGroups": items(_GROUP)})}),
    "VRMC_vrm": members({"expressions": members({"preset": _NEW_BINDS, "custom": _NEW_BINDS})}),
}
"""What is used of VRM 0.x and of VRM 1.0."""


def build_schema(json: Mapping[str, Any]) -> Schema:
    """Return the schema of one document: its references must be to items that it has."""
    counts = {name: len(listed) for name in _LISTS if isinstance(listed := json.get(name), list)}

    def to(name: str) -> Schema:
        count = counts.get(name, 0)
        exists = whole(0, count - 1)

        def check(value: Any) -> int:
            try:
                return int(exists(value))
            except SchemaError as error:
                raise SchemaError(error.found, f"the number of one of its {count} {name}") from None

        return check

    def list_of(size: int) -> Schema:
        return items(_NUMBER, size, size)

    target = members({"POSITION": to("accessors")})
    groups = [f"{kind}_{group}" for kind in ("JOINTS", "WEIGHTS") for group in range(MAX_GROUPS)]
    primitive = {
        "attributes": members({name: to("accessors") for name in ("POSITION", "TEXCOORD_0", "COLOR_0", *groups)}),
        "indices": to("accessors"),
        "material": to("materials"),
        "mode": whole(0, 6),
        "targets": items(target, most=ALLOWANCE["blendshapes"]),
        "extras": if_fits(members({"targetNames": items(_WORD)})),
    }
    named = {"name": _NAME, "weights": items(_NUMBER)}
    mesh = {**named, "primitives": items(members(primitive, ["attributes"])), "extras": primitive["extras"]}
    node = {
        **{**named, "mesh": to("meshes"), "skin": to("skins"), "children": items(to("nodes"))},
        **{"matrix": list_of(16), "translation": list_of(3), "rotation": list_of(4), "scale": list_of(3)},
    }
    place = {"bufferView": to("bufferViews"), "byteOffset": _SIZE}
    indices = {**place, "componentType": one_of([5121, 5123, 5125])}
    sparse = {
        "count": _SIZE,
        "indices": members(indices, ["bufferView", "componentType"]),
        "values": members(place, ["bufferView"]),
    }
    accessor = {
        **{**place, "componentType": one_of(COMPONENTS), "count": _SIZE, "type": one_of(WIDTHS), "normalized": truth},
        **{"name": _NAME, "sparse": members(sparse, list(sparse))},
    }
    webp = members({"source": to("images")}, ["source"])
    lists = {
        "accessors": members(accessor, ["componentType", "count", "type"]),
        "animations": if_fits(members(_build_animation_schema(to("nodes"), to("accessors")))),
        "buffers": members({"uri": text(_LARGEST_INTEGER), "byteLength": _SIZE}),
        "bufferViews": members(
            {"buffer": to("buffers"), "byteOffset": _SIZE, "byteLength": _SIZE, "byteStride": whole(0, 1 << 16)},
            ["buffer", "byteLength"],
        ),
        "images": members({"uri": text(_LARGEST_INTEGER), "bufferView": to("bufferViews")}),
        "materials": members(_build_material_schema(to("textures"), list_of)),
        "meshes": members(mesh, ["primitives"]),
        "nodes": members(node),
        "scenes": members({"nodes": items(to("nodes"))}),
        "skins": members({"joints": items(to("nodes"), 1), "inverseBindMatrices": to("accessors")}, ["joints"]),
        "textures": members({"source": to("images"), "extensions": members({"EXT_texture_webp": webp})}),
    }
    table = {name: items(each, most=ALLOWANCE["nodes"] if name == "nodes" else None) for name, each in lists.items()}
    others = {"scene": to("scenes"), "extensionsRequired": items(_WORD), "extensions": members(_VRM)}
    return members(table | others)


def _build_animation_schema(node: Schema, accessor: Schema) -> dict[str, Schema]:
    """Return what is used of an animation; channels of other kinds are left out."""
    pointer = members({"KHR_animation_pointer": members({"pointer": _WORD})})
    target = members({"node": node, "path": _WORD, "extensions": if_fits(pointer)})
    channel = members({"sampler": _SIZE, "target": target}, ["sampler", "target"])
    return {
        "name": _NAME,
        "channels": items(if_fits(channel)),
        "samplers": items(members({"input": accessor, "output": accessor, "interpolation": _WORD})),
    }


def _build_material_schema(texture: Schema, list_of: Any) -> dict[str, Schema]:
    moved = members({"offset": list_of(2), "scale": list_of(2), "rotation": _NUMBER})
    placed = {"index": texture, "extensions": members({"KHR_texture_transform": moved})}
    look = {
        **{"baseColorFactor": list_of(4), "roughnessFactor": _NUMBER},
        "baseColorTexture": members(placed, ["index"]),
    }
    return {
        **{"name": _NAME, "pbrMetallicRoughness": members(look), "doubleSided": truth},
        **{"alphaMode": one_of(["OPAQUE", "MASK", "BLEND"]), "alphaCutoff": _NUMBER},
    }


MAGIC, VERSION = b"glTF", 2
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
MAX_CHUNKS = 100
LONGEST_NAME_CHARACTERS = 1000
_EXTENSIONS = read_shipped_table("lipmotion_faces.characters", "gltf_extensions.csv")
EXTENSIONS = {row["extension"]: row["is"] for row in _EXTENSIONS}
"""Those that a file may require are readable: they are read, or change nothing about the surface, as the materials'."""


@dataclass(frozen=True, eq=False)
class GltfDocument:
    """The JSON of a glTF file, and its buffers."""

    json: dict[str, Any]
    parts: Mapping[str, Any]  # what is used of it, of the types and in the ranges of ``build_schema``
    folder: Path
    budget: Budget  # what has been read so far
    buffers: dict[int, memoryview] = field(default_factory=dict)  # by number

    def get(self, name: str) -> list[dict[str, Any]]:
        """Return a list of objects of the document; none if it is missing."""
        return self.parts.get(name, [])

    def read_link(self, uri: str, kind: str) -> bytes:
        """Return the bytes of an address, or of a file beside it. Raises InputError: none, elsewhere, damaged."""
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            if not head.endswith(";base64"):
                raise InputError(f"its {kind} is {shorten(head)!r}, required base64; export as .glb")
            try:
                return base64.b64decode(body, validate=True)
            except (binascii.Error, ValueError) as error:
                raise InputError(f"its {kind} is no base64 ({error}); export as .glb") from error
        name = unquote(uri) if len(uri) <= LONGEST_NAME_CHARACTERS else uri
        if not name or len(name) > LONGEST_NAME_CHARACTERS or Path(name).name != name or "\\" in name or "\0" in name:
            raise InputError(f"its {kind} is {shorten(repr(name))}, required a file in the same folder")
        return self.budget.read_bytes(self.folder / name, kind)


def read_gltf_document(path: Path) -> GltfDocument:
    """Return the document and the buffers of a ``.glb``, ``.vrm`` or ``.gltf`` file.

    Buffers in files of their own are read only from the folder of the file.
    Raises InputError: damaged, too large, version 1, or it requires an extension that is not known.
    """
    budget = Budget()
    content = memoryview(budget.read_bytes(path, "mesh"))
    text, binary = _split_chunks(content) if content[:4] == MAGIC else (content, None)
    budget.spend("bytes of a document", len(text))
    plain = bytes(text).rstrip(b"\0 ")
    budget.spend("values in a document", sum(plain.count(mark) for mark in (b",", b"[", b"{")))
    try:
        json: Any = from_json(plain)
    except ValueError as error:
        raise InputError(f"no glTF document ({shorten(str(error))}); give a .glb, .gltf or .vrm file") from error
    try:
        version = ASSET(json)["asset"]["version"]
    except SchemaError as error:
        raise InputError(f"no glTF document: {error}; give a .glb, .gltf or .vrm file") from error
    if version.split(".", maxsplit=1)[0] != str(VERSION):
        raise InputError(f"glTF version {version!r}, required 2.0; export it again")
    try:
        document = GltfDocument(json, build_schema(json)(json), path.parent, budget)
    except SchemaError as error:
        raise InputError(f"{error}; export it again") from error
    for name in document.parts.get("extensionsRequired", []):
        if EXTENSIONS.get(name) == "compressed":
            raise InputError(f"it is compressed ({name}), which is not read; export it without compression")
        if name not in EXTENSIONS and not name.startswith("KHR_materials_"):
            raise InputError(f"it requires the extension {shorten(name)!r}, which is not read; export without it")
    for index, buffer in enumerate(document.get("buffers")):
        if "uri" in buffer:
            document.buffers[index] = memoryview(document.read_link(buffer["uri"], "buffer"))
        elif index == 0 and binary is not None:
            document.buffers[index] = binary
    return document


def _split_chunks(content: memoryview) -> tuple[memoryview, memoryview | None]:
    if len(content) < 20:
        raise InputError(f"{len(content)} bytes, required a whole .glb; copy it again")
    _, version, length = struct.unpack_from("<4sII", content)
    if version != VERSION:
        raise InputError(f"a .glb of version {version}, required {VERSION}; export it again")
    if length > len(content):
        raise InputError(f"{len(content)} bytes, required {length} as its header says; copy it again")
    chunks: dict[int, memoryview] = {}
    position = 12
    for _ in range(MAX_CHUNKS):
        if position + 8 > length:
            break
        size, kind = struct.unpack_from("<II", content, position)
        if position + 8 + size > length:
            raise InputError(f"a part of {size} bytes at {position}, required at most {length - position - 8} bytes")
        chunks.setdefault(kind, content[position + 8 : position + 8 + size])
        position += 8 + size + -size % 4
    if JSON_CHUNK not in chunks:
        raise InputError("a .glb without a document; export it again")
    return chunks[JSON_CHUNK], chunks.get(BINARY_CHUNK)


def clean_name(name: str) -> str:
    """Return a name, or its beginning, on one line, which UTF-8 can encode."""
    return " ".join(name[:LONGEST_NAME_CHARACTERS].encode("utf-8", "replace").decode().split())


def write_container(path: Path, json: dict[str, Any], body: bytes) -> None:
    """Write a ``.glb`` of a document and one buffer. Raises ExportError: the file cannot be written."""
    text = as_json(json, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    padded = body + b"\0" * (-len(body) % 4)
    with atomic_file(path) as unfinished, unfinished.open("wb") as file:
        file.write(struct.pack("<4sII", MAGIC, VERSION, 28 + len(text) + len(padded)))
        file.write(struct.pack("<II", len(text), JSON_CHUNK) + text)
        file.write(struct.pack("<II", len(padded), BINARY_CHUNK) + padded)


class GltfArrays:
    """Reads the accessors of a document."""

    def __init__(self, document: GltfDocument) -> None:
        self._document = document

    def count(self, number: int) -> int:
        """Return the number of elements of an accessor, as the document says."""
        return int(self._document.get("accessors")[number]["count"])

    def read_floats(self, number: int, width: int, count: int | None = None) -> NDArray[np.float64]:
        """Return an accessor as numbers [shape=(N, width)]; normalised whole numbers become -1 to 1 or 0 to 1.

        count : the elements that it must have; None: any
        Raises InputError: it has another width or count, it leads out of its buffer, or values are not finite.
        """
        raw = self._read_raw(number, width, count)
        with np.errstate(invalid="ignore"):  # signalling NaN; refused below
            values = raw.astype(np.float64)
        if self._document.get("accessors")[number].get("normalized") and raw.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(raw.dtype).max, -1.0)
        if not (np.abs(values) <= LARGEST_NUMBER).all():
            raise InputError(f"it has numbers that are not finite, or beyond ±{LARGEST_NUMBER:g}; export it again")
        return values

    def read_ints(self, number: int, width: int, count: int | None = None) -> NDArray[np.int64]:
        """Return an accessor of whole numbers [shape=(N, width)]. Raises InputError: as ``read_floats``; fractions."""
        raw = self._read_raw(number, width, count)
        if raw.dtype.kind not in "iu":
            raise InputError("it counts vertices in fractions; export it again")
        return raw.astype(np.int64)

    def _read_raw(self, number: int, width: int, wanted: int | None) -> NDArray[Any]:
        accessor = self._document.get("accessors")[number]
        count, kind = accessor["count"], accessor["type"]
        if WIDTHS[kind] != width:
            raise InputError(f"an array of {kind}, required {width} numbers each; export it again")
        if wanted is not None and count != wanted:
            raise InputError(f"an array of {count} elements, required {wanted}; export it again")
        self._document.budget.spend("numbers", count * width)
        dtype = np.dtype(COMPONENTS[accessor["componentType"]])
        values = self._read_elements(accessor, dtype, count, width)
        if "sparse" not in accessor:
            return values
        few, where = accessor["sparse"]["count"], accessor["sparse"]["indices"]
        if few > len(values):
            raise InputError(f"a sparse array changes {few} of {len(values)} elements; export it again")
        rows = self._read_elements(where, np.dtype(COMPONENTS[where["componentType"]]), few, 1)[:, 0]
        if few and rows.max() >= len(values):
            raise InputError("a sparse array that leads out of its array; export it again")
        changed = values.copy()
        changed[rows] = self._read_elements(accessor["sparse"]["values"], dtype, few, width)
        return changed

    def _read_elements(self, place: dict[str, Any], dtype: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        """Return what an accessor, or a part of a sparse one, places in a view; zeros if it names none."""
        if "bufferView" not in place:
            return np.zeros((count, width), dtype)
        data, stride = self.read_view(place["bufferView"])
        offset, size = place.get("byteOffset", 0), dtype.itemsize * width
        stride = stride or size
        if stride < size or (count and offset + (count - 1) * stride + size > len(data)):
            raise InputError(
                f"an array of {count} elements of {size} bytes leads out of its {len(data)} bytes; export it again"
            )
        if not count:
            return np.zeros((0, width), dtype)
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def read_view(self, number: int) -> tuple[memoryview, int]:
        """Return the bytes of a buffer view, and the stride of its elements (0: packed).

        Raises InputError: it leads out of its buffer.
        """
        view = self._document.get("bufferViews")[number]
        number, offset, length = view["buffer"], view.get("byteOffset", 0), view["byteLength"]
        buffer = self._document.buffers.get(number, memoryview(b""))
        if offset + length > len(buffer):
            raise InputError(
                f"it refers to bytes {offset} to {offset + length} of buffer {number} with {len(buffer)} bytes; "
                "copy it again, with its buffers; or export it without compression"
            )
        return buffer[offset : offset + length], view.get("byteStride", 0)


Matrix = NDArray[np.float64]
DEEPEST_NESTING = 256  # most levels of nodes


@dataclass(frozen=True, eq=False)
class PlacedNode:
    """A node of a scene, and the nearest node to the root of each kind of bone that it is or hangs on."""

    matrix: Matrix
    kinds: Mapping[str, int]


def place_nodes(document: GltfDocument) -> dict[int, PlacedNode]:
    """Return the nodes of the scene, or all roots', by number. Raises InputError: one is twice, too deep, too far."""
    from scipy.spatial.transform import Rotation

    nodes, scenes = document.get("nodes"), document.get("scenes")
    if scenes:
        roots = scenes[document.parts.get("scene", 0)].get("nodes", [])
    else:
        roots = sorted(set(range(len(nodes))).difference(*(node.get("children", []) for node in nodes)))
    waiting = [(root, PlacedNode(np.eye(4), {}), 0) for root in roots]
    placed: dict[int, PlacedNode] = {}
    while waiting:
        number, parent, depth = waiting.pop()
        node = nodes[number]
        if number in placed or depth > DEEPEST_NESTING:
            raise InputError(f"node {number} is in the scene twice, or too deep; export it again")
        local = np.eye(4)
        if "matrix" in node:
            local = np.array(node["matrix"]).reshape(4, 4).T
        else:
            if any(node.get("rotation", ())):
                local[:3, :3] = Rotation.from_quat(node["rotation"]).as_matrix()
            local[:3, :3] *= node.get("scale", (1.0, 1.0, 1.0))
            local[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
        matrix = parent.matrix @ local
        if not np.abs(matrix).max() <= LARGEST_NUMBER:
            raise InputError(f"node {number} is beyond ±{LARGEST_NUMBER:g}, with those that it hangs on; scale it down")
        kind = find_bone_kind(node.get("name", ""))
        kinds = parent.kinds if kind is None else {kind: number, **parent.kinds}
        placed[number] = PlacedNode(matrix, kinds)
        waiting += [(child, placed[number], depth + 1) for child in node.get("children", [])]
    return placed


_SIDES = {"l": LEFT_EYE, "left": LEFT_EYE, "r": RIGHT_EYE, "right": RIGHT_EYE}
_ENDS = {"top", "end", "nub", "tip", "target", "ctrl"}


def find_bone_kind(name: str) -> str | None:
    """Return which bone of the head a name stands for, or None: ``mixamorig:Head``, ``J_Bip_C_Neck``, ``JawBone``."""
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]
    words = [re.sub(r"^mixamorig", "", word) or word for word in words]
    plain = {re.sub(r"(bone|root|joint)$", "", word) or word for word in words}
    if plain & _ENDS:
        return None
    if plain & {"eye", "eyeball"}:
        return next((_SIDES[word] for word in words if word in _SIDES), None)
    return next((kind for kind in (JAW, HEAD, NECK) if kind in plain), None)
