"""Writing of glTF: a mesh with its blendshapes, and their weights over time, as one ``.glb`` file."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError
from lipmotion.rig.gltf_container import BINARY_CHUNK, JSON_CHUNK, MAGIC, VERSION
from lipmotion.rig.mesh import Mesh, MeshPart
from lipmotion.storage.files import whole_file
from lipmotion.storage.json_text import as_json
from lipmotion.types import Motion

FLOAT, UNSIGNED = 5126, 5125
VERTICES, INDICES = 34962, 34963
"""Uses of buffer views, as viewers want them named."""


class _Buffer:
    """Arrays so far, and their descriptions."""

    def __init__(self) -> None:
        self.chunks: list[bytes] = []
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.size = 0

    def add(self, values: NDArray[Any], kind: str, *, target: int | None = None, limits: bool = False) -> int:
        """Add an array [shape=(N,) or (N, width)] and return the number of its accessor."""
        stored = np.ascontiguousarray(values, "<u4" if values.dtype.kind in "iu" else "<f4")
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": stored.nbytes}
        accessor: dict[str, Any] = {
            "bufferView": len(self.views),
            "componentType": UNSIGNED if stored.dtype.kind == "u" else FLOAT,
            "count": len(stored),
            "type": kind,
        }
        if target is not None:
            view["target"] = target
        if limits and len(stored):
            rows = stored.reshape(len(stored), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self.chunks.append(stored.tobytes())
        self.size += stored.nbytes
        self.views.append(view)
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def add_few(self, values: NDArray[np.float64]) -> int:
        """Add displacements [shape=(N, 3)] of which most are 0, as a sparse array; return the number of its
        accessor."""
        rows = np.flatnonzero(values.any(axis=1))
        if 2 * len(rows) > len(values):
            return self.add(values, "VEC3", target=VERTICES, limits=True)
        few = values[rows].astype("<f4").astype(np.float64)
        ends = np.concatenate([few, np.zeros((1, 3))])
        accessor: dict[str, Any] = {"componentType": FLOAT, "count": len(values), "type": "VEC3"}
        accessor |= {"min": ends.min(axis=0).tolist(), "max": ends.max(axis=0).tolist()}
        if len(rows):
            numbers, moved = self.add(rows, "SCALAR"), self.add(few, "VEC3")
            accessor["sparse"] = {
                "count": len(rows),
                "indices": {"bufferView": self.accessors[numbers]["bufferView"], "componentType": UNSIGNED},
                "values": {"bufferView": self.accessors[moved]["bufferView"]},
            }
            del self.accessors[numbers:]
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def write_glb(path: Path, mesh: Mesh, weights: Motion | None = None) -> None:
    """Write a mesh with its blendshapes as ``.glb``, and their weights over time as its animation.

    weights : channels by the names of the blendshapes; shapes without a channel stay at 0; None: no animation
    Every part becomes a primitive of one mesh with its own vertices; textures are not written, colours of vertices are.
    Raises ExportError: a channel that is no blendshape, or the file cannot be written.
    """
    unknown = [name for name in (weights.names if weights else ()) if name not in mesh.shape_names]
    if unknown:
        raise ExportError(f"{path}: the mesh has no blendshape {unknown[0]!r}; write the weights as .json")
    buffer = _Buffer()
    materials: list[dict[str, Any]] = []
    primitives = [_primitive(buffer, materials, mesh, part) for part in mesh.parts if part.stop > part.first]
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "lipmotion"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "character", "mesh": 0}],
        "meshes": [{"name": "character", "primitives": primitives}],
        "materials": materials,
    }
    if mesh.shapes:
        document["meshes"][0] |= {
            "weights": [0.0] * len(mesh.shapes),
            "extras": {"targetNames": list(mesh.shape_names)},
        }
    if weights is not None and mesh.shapes and len(weights.values):
        document["animations"] = [_animation(buffer, mesh, weights)]
    document |= {
        "buffers": [{"byteLength": buffer.size}],
        "bufferViews": buffer.views,
        "accessors": buffer.accessors,
    }
    text = as_json(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(buffer.chunks)
    with whole_file(path) as unfinished, unfinished.open("wb") as file:
        file.write(struct.pack("<4sII", MAGIC, VERSION, 28 + len(text) + len(body)))
        file.write(struct.pack("<II", len(text), JSON_CHUNK) + text)
        file.write(struct.pack("<II", len(body), BINARY_CHUNK) + body)


def _primitive(buffer: _Buffer, materials: list[dict[str, Any]], mesh: Mesh, part: MeshPart) -> dict[str, Any]:
    triangles = mesh.triangles[part.first : part.stop]
    rows, corners = np.unique(triangles, return_inverse=True)
    attributes = {"POSITION": buffer.add(mesh.vertices[rows], "VEC3", target=VERTICES, limits=True)}
    colour = np.array(part.material.colour) if mesh.colours is None else np.ones(3)
    if mesh.colours is not None:
        attributes["COLOR_0"] = buffer.add(_linear(mesh.colours[rows]), "VEC3", target=VERTICES)
    moved = np.zeros((len(mesh.vertices), 3))
    targets = []
    for shape in mesh.shapes:
        moved[shape.rows] = shape.displacements
        targets.append({"POSITION": buffer.add_few(moved[rows])})
        moved[shape.rows] = 0.0
    look = {
        "baseColorFactor": [*_linear(colour).tolist(), 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 1.0 - part.material.gloss,
    }
    materials.append({"name": part.name or part.material.name or "part", "pbrMetallicRoughness": look})
    primitive: dict[str, Any] = {
        "attributes": attributes,
        "indices": buffer.add(corners.reshape(-1), "SCALAR", target=INDICES),
        "material": len(materials) - 1,
    }
    return primitive | ({"targets": targets} if targets else {})


def _animation(buffer: _Buffer, mesh: Mesh, weights: Motion) -> dict[str, Any]:
    values = np.zeros((len(weights.values), len(mesh.shapes)))
    for column, name in enumerate(weights.names):
        values[:, mesh.shape_names.index(name)] = weights.values[:, column]
    times = buffer.add(weights.time_s, "SCALAR", limits=True)
    sampler = {"input": times, "output": buffer.add(values.reshape(-1), "SCALAR"), "interpolation": "LINEAR"}
    return {
        "name": "speech",
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
        "samplers": [sampler],
    }


def _linear(colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the light of sRGB colours."""
    return np.where(colour <= 0.04045, colour / 12.92, ((np.clip(colour, 0, 1) + 0.055) / 1.055) ** 2.4)
