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

from lipmotion.errors import InputError, shorten
from lipmotion.meshes.files.gltf_schema import ASSET, gltf_schema
from lipmotion.meshes.model.file_limits import Budget
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.types.values import SchemaError

MAGIC, VERSION = b"glTF", 2
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
MOST_CHUNKS = 100
LONGEST_NAME_CHARACTERS = 1000
READABLE = {
    *("KHR_mesh_quantization", "EXT_meshopt_compression", "KHR_meshopt_compression"),
    *("KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "KHR_texture_transform"),
    *("KHR_materials_unlit", "KHR_lights_punctual", "VRM", "VRMC_vrm", "VRMC_springBone", "VRMC_node_constraint"),
    *("VRMC_materials_mtoon", "KHR_xmp_json_ld", "KHR_animation_pointer", "VRMC_vrm_animation"),
}
"""Extensions that a file may require: they are read, or change nothing about the surface. All of the materials'
extensions are accepted as well."""


@dataclass(frozen=True, eq=False)
class GltfDocument:
    """The JSON of a glTF file, and its buffers.

    json    : the document as it was written
    parts   : what is used of it, of the types and in the ranges of ``gltf_schema``
    folder  : where the files are that the document names
    budget  : what has been read so far
    buffers : by number; a buffer that only the extension for compression could use is missing
    """

    json: dict[str, Any]
    parts: Mapping[str, Any]
    folder: Path
    budget: Budget
    buffers: dict[int, memoryview] = field(default_factory=dict)

    def items(self, name: str) -> list[dict[str, Any]]:
        """Return a list of objects of the document; none if it is missing."""
        return self.parts.get(name, [])

    def linked(self, uri: str, kind: str) -> bytes:
        """Return what an address in the document stands for: bytes inside of it, or a file in the same folder.

        kind : what it should be, for messages
        Raises InputError: no such file, a file elsewhere, too large, or damaged.
        """
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
        return self.budget.file_bytes(self.folder / name, kind)


def read_gltf_document(path: Path) -> GltfDocument:
    """Return the document and the buffers of a ``.glb``, ``.vrm`` or ``.gltf`` file.

    Buffers in files of their own are read only from the folder of the file.
    Raises InputError: damaged, too large, version 1, or it requires an extension that is not known.
    """
    budget = Budget()
    content = memoryview(budget.file_bytes(path, "mesh"))
    text, binary = _chunks(content) if content[:4] == MAGIC else (content, None)
    budget.spend("bytes of a document", len(text))
    json = _json(bytes(text).rstrip(b"\0 "), budget)
    try:
        version = ASSET(json)["asset"]["version"]
    except SchemaError as error:
        raise InputError(f"no glTF document: {error}; give a .glb, .gltf or .vrm file") from error
    if version.split(".", maxsplit=1)[0] != str(VERSION):
        raise InputError(f"glTF version {version!r}, required 2.0; export it again")
    try:
        document = GltfDocument(json, gltf_schema(json)(json), path.parent, budget)
    except SchemaError as error:
        raise InputError(f"{error}; export it again") from error
    for name in document.parts.get("extensionsRequired", []):
        if name == "KHR_draco_mesh_compression":
            raise InputError("it is compressed by Draco, which is not read; export it without, or with meshopt")
        if name not in READABLE and not name.startswith("KHR_materials_"):
            raise InputError(f"it requires the extension {shorten(name)!r}, which is not read; export without it")
    for number, buffer in enumerate(document.items("buffers")):
        if "uri" in buffer:
            document.buffers[number] = memoryview(document.linked(buffer["uri"], "buffer"))
        elif number == 0 and binary is not None:
            document.buffers[number] = binary
    return document


def plain_name(name: str) -> str:
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


def _chunks(content: memoryview) -> tuple[memoryview, memoryview | None]:
    """Return the document and the bytes of a GLB."""
    if len(content) < 20:
        raise InputError(f"{len(content)} bytes, required a whole .glb; copy it again")
    _, version, length = struct.unpack_from("<4sII", content)
    if version != VERSION:
        raise InputError(f"a .glb of version {version}, required {VERSION}; export it again")
    if length > len(content):
        raise InputError(f"{len(content)} bytes, required {length} as its header says; copy it again")
    chunks: dict[int, memoryview] = {}
    position = 12
    for _ in range(MOST_CHUNKS):
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


def _json(text: bytes, budget: Budget) -> Any:
    """Return the content of JSON text. Raises InputError: it is damaged, or has too many values."""
    budget.spend("values in a document", sum(text.count(mark) for mark in (b",", b"[", b"{")))
    try:
        return from_json(text)
    except ValueError as error:
        raise InputError(f"no glTF document ({shorten(str(error))}); give a .glb, .gltf or .vrm file") from error
