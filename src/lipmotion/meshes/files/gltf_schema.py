"""What is used of a glTF 2.0 document, as a table: types, ranges, and what refers to what.

Source: glTF 2.0 Specification (Khronos, ISO/IEC 12113), its extensions EXT_meshopt_compression, EXT_texture_webp and
KHR_texture_transform; VRM 0.x and 1.0, VRMC_vrm_animation 1.0 (VRM Consortium). Deviations: names, extras, animations
and binds of VRM that do not fit are left out, as viewers do; what else is wrong is refused, and what stands in no table
is not looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lipmotion.meshes.model.file_limits import ALLOWANCE
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

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
COMPRESSION = ("EXT_meshopt_compression", "KHR_meshopt_compression")
LARGEST_NUMBER = 1e9
"""Largest plausible number of a file: a place, a factor."""
MOST_GROUPS = 8
"""Most groups of four joints a vertex."""
_LISTS = (
    *("accessors", "animations", "buffers", "bufferViews", "images", "materials", "meshes", "nodes", "scenes", "skins"),
    "textures",
)
_LARGEST_INTEGER = 1 << 53
_NAME = if_fits(text(1000))
_WORD = text(1000)
_SIZE = whole(0, _LARGEST_INTEGER)
_NUMBER = number(-LARGEST_NUMBER, LARGEST_NUMBER)
ASSET = members({"asset": members({"version": text(20)}, ["version"])}, ["asset"])
"""What a document of any version has."""


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


def gltf_schema(json: Mapping[str, Any]) -> Schema:
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

    def vector(size: int) -> Schema:
        return items(_NUMBER, size, size)

    target = members({"POSITION": to("accessors")})
    groups = [f"{kind}_{group}" for kind in ("JOINTS", "WEIGHTS") for group in range(MOST_GROUPS)]
    primitive = {
        "attributes": members({name: to("accessors") for name in ("POSITION", "TEXCOORD_0", "COLOR_0", *groups)}),
        "indices": to("accessors"),
        "material": to("materials"),
        "mode": whole(0, 6),
        "targets": items(target, most=ALLOWANCE["blendshapes"]),
        "extras": if_fits(members({"targetNames": items(_WORD)})),
    }
    mesh = {"name": _NAME, "primitives": items(members(primitive, ["attributes"])), "extras": primitive["extras"]}
    node = {
        **{"name": _NAME, "mesh": to("meshes"), "skin": to("skins"), "children": items(to("nodes"))},
        **{"matrix": vector(16), "translation": vector(3), "rotation": vector(4), "scale": vector(3)},
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
        "animations": if_fits(members(_animation(to("nodes"), to("accessors")))),
        "buffers": members({"uri": text(_LARGEST_INTEGER), "byteLength": _SIZE}),
        "bufferViews": members(_view(to("buffers")), ["buffer", "byteLength"]),
        "images": members({"uri": text(_LARGEST_INTEGER), "bufferView": to("bufferViews")}),
        "materials": members(_material(to("textures"), vector)),
        "meshes": members(mesh, ["primitives"]),
        "nodes": members(node),
        "scenes": members({"nodes": items(to("nodes"))}),
        "skins": members({"joints": items(to("nodes"), 1), "inverseBindMatrices": to("accessors")}, ["joints"]),
        "textures": members({"source": to("images"), "extensions": members({"EXT_texture_webp": webp})}),
    }
    table = {name: items(each, most=ALLOWANCE["nodes"] if name == "nodes" else None) for name, each in lists.items()}
    others = {"scene": to("scenes"), "extensionsRequired": items(_WORD), "extensions": members(_VRM)}
    return members(table | others)


def _animation(node: Schema, accessor: Schema) -> dict[str, Schema]:
    """Return what is used of an animation; channels of other kinds are left out."""
    pointer = members({"KHR_animation_pointer": members({"pointer": _WORD})})
    target = members({"node": node, "path": _WORD, "extensions": if_fits(pointer)})
    channel = members({"sampler": _SIZE, "target": target}, ["sampler", "target"])
    return {
        "name": _NAME,
        "channels": items(if_fits(channel)),
        "samplers": items(members({"input": accessor, "output": accessor, "interpolation": _WORD})),
    }


def _view(buffer: Schema) -> dict[str, Schema]:
    place = {"buffer": buffer, "byteOffset": _SIZE, "byteLength": _SIZE}
    packed = {
        **{**place, "byteStride": whole(1, 256), "count": _SIZE, "filter": _WORD},
        "mode": one_of(["ATTRIBUTES", "TRIANGLES", "INDICES"]),
    }
    needed = ["buffer", "byteLength", "byteStride", "count", "mode"]
    return {
        **{**place, "byteStride": whole(0, 1 << 16)},
        "extensions": members(dict.fromkeys(COMPRESSION, members(packed, needed))),
    }


def _material(texture: Schema, vector: Any) -> dict[str, Schema]:
    moved = members({"offset": vector(2), "scale": vector(2), "rotation": _NUMBER})
    placed = {"index": texture, "extensions": members({"KHR_texture_transform": moved})}
    look = {
        **{"baseColorFactor": vector(4), "roughnessFactor": _NUMBER},
        "baseColorTexture": members(placed, ["index"]),
    }
    return {
        **{"name": _NAME, "pbrMetallicRoughness": members(look), "doubleSided": truth},
        **{"alphaMode": one_of(["OPAQUE", "MASK", "BLEND"]), "alphaCutoff": _NUMBER},
    }
