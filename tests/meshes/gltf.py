"""glTF files for tests, written by hand: a square of two triangles with two morph targets."""

import base64
import json
import struct

import numpy as np

POSITIONS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
INDICES = np.array([0, 1, 2, 0, 2, 3], "<u2")
OPEN = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0.5, 0], [0, 0.25, 0]], "<f4")
WIDE = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]], "<f4")


def document() -> tuple[dict, bytes]:
    arrays = [POSITIONS, OPEN, WIDE, INDICES]
    views, offset = [], 0
    for array in arrays:
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": array.nbytes})
        offset += array.nbytes
    accessors = [{"bufferView": n, "componentType": 5126, "count": 4, "type": "VEC3"} for n in range(3)]
    accessors.append({"bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR"})
    primitive = {"attributes": {"POSITION": 0}, "indices": 3, "targets": [{"POSITION": 1}, {"POSITION": 2}]}
    content = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"name": "head", "mesh": 0}],
        "meshes": [{"primitives": [primitive], "extras": {"targetNames": ["jawOpen", "mouthWide"]}}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": offset}],
    }  # fmt: skip
    return content, b"".join(array.tobytes() for array in arrays)


def with_array(content: dict, binary: bytes, array: np.ndarray, form: str, **more: object) -> tuple[bytes, int]:
    kind = {"f4": 5126, "u1": 5121, "u2": 5123, "i2": 5122}[array.dtype.str[1:]]
    width = 1 if form == "SCALAR" else int(form[-1])
    content["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": array.nbytes})
    accessor = {"bufferView": len(content["bufferViews"]) - 1, "componentType": kind, "count": array.size // width}
    content["accessors"].append(accessor | {"type": form} | more)
    return binary + array.tobytes(), len(content["accessors"]) - 1


def with_skin(content: dict, binary: bytes, joints: np.ndarray, weights: np.ndarray) -> bytes:
    binary, first = with_array(content, binary, joints, "VEC4")
    binary, second = with_array(content, binary, weights, "VEC4")
    content["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": first, "WEIGHTS_0": second}
    return binary


UV = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], "<f4")  # of the square, v goes down


def textured_document(picture: bytes, material=None, extension=None) -> tuple[dict, bytes]:
    content, binary = document()
    binary, number = with_array(content, binary, UV, "VEC2")
    content["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(picture)})
    content["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = number
    content["meshes"][0]["primitives"][0]["material"] = 0
    place = {"index": 0} | ({"extensions": extension} if extension else {})
    content["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": place}} | (material or {})]
    content["textures"], content["images"] = [{"source": 0}], [{"bufferView": 5, "mimeType": "image/png"}]
    return content, binary + picture


def with_colours(content: dict, binary: bytes, colours: np.ndarray, *, normalised: bool = False) -> tuple[dict, bytes]:
    width = colours.shape[1]
    step = -(-width * colours.itemsize // 4) * 4
    padded = np.zeros((4, step), np.uint8)
    padded[:, : width * colours.itemsize] = np.ascontiguousarray(colours).view(np.uint8).reshape(4, -1)
    binary += b"\0" * (-len(binary) % 4)
    view = {"buffer": 0, "byteOffset": len(binary), "byteLength": padded.nbytes, "byteStride": step}
    kind = {"f4": 5126, "u1": 5121, "u2": 5123, "i2": 5122}[colours.dtype.str[1:]]
    content["bufferViews"].append(view)
    accessor = {"bufferView": len(content["bufferViews"]) - 1, "componentType": kind, "count": 4, "type": f"VEC{width}"}
    content["accessors"].append(accessor | ({"normalized": True} if normalised else {}))
    content["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = len(content["accessors"]) - 1
    return content, binary + padded.tobytes()


def animated_document(time_s: list[float], values, kind: str = "LINEAR", target=None) -> tuple[dict, bytes]:
    content, binary = document()
    rows = np.array(values, "<f4")
    binary, _ = with_array(content, binary, np.array(time_s, "<f4"), "SCALAR")
    binary, _ = with_array(content, binary, rows, f"VEC{rows.shape[-1]}" if target else "SCALAR")
    sampler = {"input": 4, "output": 5, "interpolation": kind}
    channels = [{"sampler": 0, "target": target or {"node": 0, "path": "weights"}}]
    ignored = {"channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}], "samplers": [sampler]}
    content["animations"] = [ignored, {"name": "talk", "channels": channels, "samplers": [sampler]}]
    content["buffers"] = [{"byteLength": len(binary)}]
    if target:
        content["nodes"].append({"name": "aa"})
        expressions = {"preset": {"blink": {"node": 1}}, "custom": {"none": {}}}
        content["extensions"] = {"VRMC_vrm_animation": {"specVersion": "1.0", "expressions": expressions}}
    return content, binary


def glb(content: dict, binary: bytes) -> bytes:
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    length = 12 + 8 + len(text) + 8 + len(binary)
    head = struct.pack("<4sII", b"glTF", 2, length) + struct.pack("<II", len(text), 0x4E4F534A)
    return head + text + struct.pack("<II", len(binary), 0x004E4942) + binary


def data_uri(binary: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
