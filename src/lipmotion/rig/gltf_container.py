"""The container of glTF 2.0: ``.glb``, ``.gltf`` and ``.vrm`` files as a JSON document and buffers of bytes."""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from lipmotion.errors import InputError, shortened
from lipmotion.rig.limits import LARGEST_FILE, file_bytes
from lipmotion.storage.files import whole_file
from lipmotion.storage.json_text import as_json, from_json

MAGIC, VERSION = b"glTF", 2
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
LARGEST_DOCUMENT = 1 << 25
"""Most bytes of the JSON document."""
READABLE = {
    *("KHR_mesh_quantization", "EXT_meshopt_compression", "KHR_meshopt_compression"),
    *("KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "KHR_texture_transform"),
    *("KHR_materials_unlit", "KHR_lights_punctual", "VRM", "VRMC_vrm", "VRMC_springBone", "VRMC_node_constraint"),
    *("VRMC_materials_mtoon", "KHR_xmp_json_ld", "KHR_animation_pointer"),
}
"""Extensions that a file may require: they are read, or change nothing about the surface. All of the materials'
extensions are accepted as well."""


@dataclass(frozen=True, eq=False)
class GltfDocument:
    """The JSON of a glTF file, and its buffers.

    json    : the document, an object
    buffers : by number; a buffer that only the extension for compression could use is missing
    folder  : where the files are that the document names; None: it may name none
    """

    json: Mapping[str, Any]
    buffers: Mapping[int, bytes] = field(default_factory=dict)
    folder: Path | None = None

    def items(self, name: str) -> list[dict[str, Any]]:
        """Return a list of objects of the document; none if it is missing. Raises InputError: it is something else."""
        found = self.json.get(name, [])
        if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
            raise InputError(f"its {name!r} is no list of objects; export it again")
        return found

    def item(self, name: str, number: Any) -> dict[str, Any]:
        """Return one object of such a list. Raises InputError: there is none of this number."""
        found = self.items(name)
        if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < len(found):
            raise InputError(f"it refers to {name} {shortened(repr(number))} of {len(found)}; export it again")
        return found[number]

    def linked(self, uri: Any, kind: str) -> bytes:
        """Return what an address in the document stands for: bytes inside of it, or a file in the same folder.

        kind : what it should be, for messages
        Raises InputError: no such file, a file elsewhere, too large, or damaged.
        """
        if not isinstance(uri, str) or self.folder is None:
            raise InputError(f"its {kind} has no address; export it again")
        if uri.startswith("data:"):
            return _data(uri)
        name = unquote(uri)
        if not name or Path(name).name != name or "\\" in name or "\0" in name:
            raise InputError(f"its {kind} is {shortened(repr(name))}, required a file in the same folder")
        return file_bytes(self.folder / name, kind)


def read_gltf_document(path: Path) -> GltfDocument:
    """Return the document and the buffers of a ``.glb``, ``.vrm`` or ``.gltf`` file.

    Buffers in files of their own are read only from the folder of the file.
    Raises InputError: damaged, too large, version 1, or it requires an extension that is not known.
    """
    content = file_bytes(path, "mesh")
    text, binary = _chunks(content) if content[:4] == MAGIC else (content, None)
    if len(text) > LARGEST_DOCUMENT:
        raise InputError(f"a document of {len(text)} bytes, required at most {LARGEST_DOCUMENT}; reduce it")
    try:
        json = from_json(text.rstrip(b"\0 "))
    except (ValueError, RecursionError) as error:
        raise InputError(f"no glTF document ({shortened(str(error))}); give a .glb, .gltf or .vrm file") from error
    if not isinstance(json, dict) or not isinstance(json.get("asset"), dict):
        raise InputError("no glTF document: it names no asset; give a .glb, .gltf or .vrm file")
    version = str(json["asset"].get("version", ""))
    if version.split(".", maxsplit=1)[0] != str(VERSION):
        raise InputError(f"glTF version {shortened(version)!r}, required 2.0; export it again")
    _check_extensions(json.get("extensionsRequired", []))
    document = GltfDocument(json, folder=path.parent)
    return GltfDocument(json, _buffers(document, binary), path.parent)


def write_container(path: Path, json: dict[str, Any], body: bytes) -> None:
    """Write a ``.glb`` of a document and one buffer. Raises ExportError: the file cannot be written."""
    text = as_json(json, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    padded = body + b"\0" * (-len(body) % 4)
    with whole_file(path) as unfinished, unfinished.open("wb") as file:
        file.write(struct.pack("<4sII", MAGIC, VERSION, 28 + len(text) + len(padded)))
        file.write(struct.pack("<II", len(text), JSON_CHUNK) + text)
        file.write(struct.pack("<II", len(padded), BINARY_CHUNK) + padded)


def _chunks(content: bytes) -> tuple[bytes, bytes | None]:
    """Return the document and the bytes of a GLB."""
    if len(content) < 20:
        raise InputError(f"{len(content)} bytes, required a whole .glb; copy it again")
    _, version, length = struct.unpack_from("<4sII", content)
    if version != VERSION:
        raise InputError(f"a .glb of version {version}, required {VERSION}; export it again")
    if length > len(content):
        raise InputError(f"{len(content)} bytes, required {length} as its header says; copy it again")
    chunks: dict[int, bytes] = {}
    position = 12
    while position + 8 <= length:
        size, kind = struct.unpack_from("<II", content, position)
        if position + 8 + size > length:
            raise InputError(f"a part of {size} bytes at {position}, required at most {length - position - 8} bytes")
        chunks.setdefault(kind, content[position + 8 : position + 8 + size])
        position += 8 + size + -size % 4
    if JSON_CHUNK not in chunks:
        raise InputError("a .glb without a document; export it again")
    return chunks[JSON_CHUNK], chunks.get(BINARY_CHUNK)


def _check_extensions(required: Any) -> None:
    for name in required if isinstance(required, list) else []:
        if name == "KHR_draco_mesh_compression":
            raise InputError("it is compressed by Draco, which is not read; export it without, or with meshopt")
        if name not in READABLE and not str(name).startswith("KHR_materials_"):
            raise InputError(
                f"it requires the extension {shortened(str(name))!r}, which is not read; export without it"
            )


def _buffers(document: GltfDocument, binary: bytes | None) -> dict[int, bytes]:
    buffers: dict[int, bytes] = {}
    total = 0
    for number, buffer in enumerate(document.items("buffers")):
        uri = buffer.get("uri")
        if uri is None:
            if number == 0 and binary is not None:
                buffers[number] = binary
        elif isinstance(uri, str):
            buffers[number] = document.linked(uri, "buffer")
        total += len(buffers.get(number, b""))
        if total > LARGEST_FILE:
            raise InputError(f"buffers of {total} bytes, required at most {LARGEST_FILE}; reduce the mesh")
    return buffers


def _data(uri: str) -> bytes:
    head, _, body = uri.partition(",")
    if not head.endswith(";base64"):
        raise InputError(f"a buffer {shortened(head)!r}, required base64; export as .glb")
    try:
        return base64.b64decode(body, validate=True)
    except (binascii.Error, ValueError) as error:
        raise InputError(f"a buffer that is no base64 ({error}); export as .glb") from error
