"""Writing of ``.glb``: a mesh with its blendshapes and weights over time, or a user's file with one animation more."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from lipmotion.formats.base import Thinning
from lipmotion.meshes.model.mesh import Blendshape, MeshPart
from lipmotion.storage.files import as_text
from lipmotion.types import Motion
from lipmotion_faces.characters.gltf_document import read_gltf_document, write_container
from lipmotion_faces.characters.gltf_scene import list_rest_weights, name_mesh_targets
from lipmotion_faces.characters.scene import (
    EVERY_KEY,
    HeadTurn,
    Scene,
    ShadingNormals,
    compute_shading_normals,
    place_keys,
)
from lipmotion_faces.characters.textures import decode_srgb

AUDIO = "audio"
SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:|//")
"""With this a URI begins that is no path from the folder of the file."""
LATEST_S = 86_400.0


def describe_sound(sound: str, start_s: float) -> dict[str, Any]:
    """Return what a scene says of its sound: a URI, as those of buffers and pictures, and when the sound begins.

    sound   : a path from the folder of the file, with slashes
    start_s : where the sound begins, in seconds of the animation
    """
    return {AUDIO: {"uri": quote(as_text(sound), safe="/"), "start_s": start_s}}


def find_named_sound(path: Path) -> tuple[Path, float] | None:
    """Return the path of the sound that a glTF file names, and where it begins, in seconds; None: it names none.

    Only paths from the folder of the file count; whether the sound is there is not looked at.
    Raises InputError: the file is no glTF.
    """
    json: Any = read_gltf_document(path).json
    json = json["scenes"][json.get("scene", 0)] if json.get("scenes") else json
    for key in ("extras", AUDIO):
        json = json.get(key) if isinstance(json, dict) else None
    stored = json if isinstance(json, dict) else {}
    uri, start_s = stored.get("uri"), stored.get("start_s", 0.0)
    if not isinstance(uri, str) or not uri or not isinstance(start_s, int | float) or not abs(start_s) <= LATEST_S:
        return None
    name = unquote(uri)
    if "\0" in name or SCHEME.match(uri) or Path(name).is_absolute():
        return None
    return path.parent / name, float(start_s)


FLOAT, UNSIGNED, UNSIGNED_BYTE = 5126, 5125, 5121
VERTICES, INDICES = 34962, 34963  # uses of buffer views, as viewers want them named


class GltfBuffer:
    """Arrays so far, and their descriptions."""

    def __init__(
        self, views: list[dict[str, Any]] | None = None, accessors: list[dict[str, Any]] | None = None
    ) -> None:
        self.chunks: list[bytes] = []
        self.views = [] if views is None else views
        self.accessors = [] if accessors is None else accessors
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
        """Add displacements [shape=(N, 3)], most of them 0, as a sparse array; return the number of its accessor."""
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


def write_gltf_scene(path: Path, scene: Scene) -> None:
    """Write a scene as ``.glb``: its mesh with blendshapes, and their weights over time as its animation.

    Every part becomes a primitive with its own vertices; those that no blendshape moves are a mesh of their own.
    Textures are not written, colours of vertices are. A sound is named as ``extras`` of the scene (``describe_sound``).
    Raises ExportError: the file cannot be written.
    """
    buffer, normals = GltfBuffer(), compute_shading_normals(scene.mesh, split=scene.split)
    mesh = scene.mesh
    moved = np.zeros(len(mesh.vertices), bool)
    for shape in mesh.shapes:
        moved[shape.rows] = True
    materials: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    nodes: list[dict[str, Any]] = []
    shown = [part for part in mesh.parts if part.stop > part.first]
    moving = [part for part in shown if moved[mesh.triangles[part.first : part.stop]].any()] or shown[:1]
    for name, parts, shapes in (
        ("character", moving, mesh.shapes),
        ("still", [part for part in shown if part not in moving], ()),
    ):
        if parts:
            primitives = [_add_primitive(buffer, materials, scene, part, normals, shapes) for part in parts]
            meshes.append({"name": name, "primitives": primitives})
            nodes.append({"name": name, "mesh": len(meshes) - 1})
    if mesh.shapes:
        meshes[0] |= {"weights": [0.0] * len(mesh.shapes), "extras": {"targetNames": list(mesh.shape_names)}}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "lipmotion"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
    }
    if scene.sound:
        document["scenes"][0]["extras"] = describe_sound(scene.sound, scene.sound_s)
    if scene.turn is not None:
        _add_joints(document, buffer, scene.turn)
    if scene.weights is not None and len(scene.weights.values) and (mesh.shapes or scene.turn):
        document["animations"] = [_add_animation(buffer, scene, len(nodes) - 1)]
    arrays = {"buffers": [{"byteLength": buffer.size}], "bufferViews": buffer.views, "accessors": buffer.accessors}
    write_container(path, document | arrays, b"".join(buffer.chunks))


def _add_primitive(
    buffer: GltfBuffer,
    materials: list[dict[str, Any]],
    scene: Scene,
    part: MeshPart,
    normals: ShadingNormals,
    shapes: tuple[Blendshape, ...],
) -> dict[str, Any]:
    mesh = scene.mesh
    rows, corners = np.unique(mesh.triangles[part.first : part.stop], return_inverse=True)
    attributes = {
        "POSITION": buffer.add(mesh.vertices[rows], "VEC3", target=VERTICES, limits=True),
        "NORMAL": buffer.add(normals.rest[rows], "VEC3", target=VERTICES),
    }
    colour = np.array(part.material.colour) if mesh.colours is None else np.ones(3)
    if mesh.colours is not None:
        attributes["COLOR_0"] = buffer.add(decode_srgb(mesh.colours[rows]), "VEC3", target=VERTICES)
    if scene.turn is not None:
        share = scene.turn.share[rows].astype("<f4").astype(np.float64)
        weights = np.pad(np.stack([1 - share, share], axis=1), ((0, 0), (0, 2)))
        joints = (weights > 0).astype(np.uint8) * np.array([0, 1, 0, 0], np.uint8)
        number = buffer.add(joints.view("<u4").reshape(-1), "VEC4", target=VERTICES)  # four bytes each
        buffer.accessors[number] |= {"componentType": UNSIGNED_BYTE, "count": len(joints)}
        attributes |= {"JOINTS_0": number, "WEIGHTS_0": buffer.add(weights, "VEC4", target=VERTICES)}
    moved = np.zeros((len(mesh.vertices), 3))
    targets = []
    for shape, (turned, change) in zip(shapes, normals.turned, strict=False):
        target = {}
        for name, which, values in (("POSITION", shape.rows, shape.displacements), ("NORMAL", turned, change)):
            moved[which] = values
            target[name] = buffer.add_few(moved[rows])
            moved[which] = 0.0
        targets.append(target)
    look = {
        "baseColorFactor": [*decode_srgb(colour).tolist(), 1.0],
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


def _add_joints(document: dict[str, Any], buffer: GltfBuffer, turn: HeadTurn) -> None:
    nodes, pivot = document["nodes"], turn.pivot.astype("<f4").astype(np.float64)
    first = len(nodes)
    for node in nodes:
        node["skin"] = 0
    nodes += [
        {"name": "body", "children": [first + 1]},
        {"name": "head", "translation": pivot.tolist(), "rotation": [0.0, 0.0, 0.0, 1.0]},
    ]
    document["scenes"][0]["nodes"].append(first)
    bound = np.tile(np.eye(4), (2, 1, 1))
    bound[1, :3, 3] = -pivot
    matrices = buffer.add(bound.transpose(0, 2, 1).reshape(2, 16), "MAT4")
    document["skins"] = [{"joints": [first, first + 1], "skeleton": first, "inverseBindMatrices": matrices}]


def _add_animation(buffer: GltfBuffer, scene: Scene, head: int) -> dict[str, Any]:
    time_s, table = scene.list_keys()
    frames_s = scene.weights.time_s if scene.weights else np.zeros(0)
    times = buffer.add(time_s, "SCALAR", limits=True)
    curves: list[tuple[int, str, int, int]] = []
    if scene.mesh.shapes:
        curves.append((0, "weights", times, buffer.add(table.reshape(-1), "SCALAR")))
    if scene.turn is not None:
        if not np.array_equal(frames_s, time_s):
            times = buffer.add(frames_s, "SCALAR", limits=True)
        curves.append((head, "rotation", times, buffer.add(scene.turn.rotations, "VEC4")))
    return {
        "name": "speech",
        "channels": [
            {"sampler": number, "target": {"node": node, "path": path}}
            for number, (node, path, *_) in enumerate(curves)
        ],
        "samplers": [{"input": times, "output": output, "interpolation": "LINEAR"} for *_, times, output in curves],
    }


def write_animated_gltf(
    path: Path,
    original: Path,
    weights: Motion,
    sound: str = "",
    *,
    sound_s: float = 0.0,
    stepped: Collection[str] = (),
    thinning: Thinning = EVERY_KEY,
) -> bool:
    """Write a ``.glb`` or ``.vrm`` again, with the weights of its morph targets as its first animation, ``speech``.

    weights : channels by the names of the morph targets, in all meshes that have them
    sound, sound_s, stepped, thinning : as of ``Scene``
    Returns False, and writes nothing, where the file is no single ``.glb``, or a channel is none of its morph targets
    (an expression of a VRM file is several of them).
    Raises InputError: the original cannot be read. Raises ExportError: the file cannot be written.
    """
    document = read_gltf_document(original)
    binary = document.buffers.get(0)
    if binary is None or "uri" in document.get("buffers")[0] or len(document.buffers) > 1 or not len(weights.values):
        return False
    moved: dict[int, tuple[tuple[str, float], ...]] = {}
    """The nodes whose mesh has morph targets that move, with names and weights at rest of all its targets."""
    for number, node in enumerate(document.get("nodes")):
        mesh = document.get("meshes")[node["mesh"]] if "mesh" in node else {}
        names = name_mesh_targets(document, mesh)
        if set(names) & set(weights.names):
            moved[number] = tuple(zip(names, list_rest_weights(names, node, mesh), strict=True))
    if not set(weights.names) <= {name for targets in moved.values() for name, _ in targets}:
        return False
    json, body = document.json, bytes(binary[: document.get("buffers")[0].get("byteLength", len(binary))])
    buffer = GltfBuffer(json.setdefault("bufferViews", []), json.setdefault("accessors", []))
    buffer.chunks = [body + b"\0" * (-len(body) % 4)]
    buffer.size = len(buffer.chunks[0])
    chosen = [name in stepped for name in weights.names]
    time_s, rows = place_keys(weights.time_s, weights.values.astype(np.float64), chosen, thinning)
    times = buffer.add(time_s, "SCALAR", limits=True)
    samplers: dict[tuple[tuple[str, float], ...], dict[str, Any]] = {}
    channels: list[dict[str, Any]] = []
    for node_number, targets in moved.items():
        if targets not in samplers:
            document.budget.spend("morph targets", len(targets))
            table = np.tile([rest for _, rest in targets], (len(rows), 1))
            for column, (name, _) in enumerate(targets):
                if name in weights.names:
                    table[:, column] += rows[:, weights.column(name)]
            output = buffer.add(table.reshape(-1), "SCALAR")
            samplers[targets] = {"input": times, "output": output, "interpolation": "LINEAR"}
        channels.append({"sampler": list(samplers).index(targets), "target": {"node": node_number, "path": "weights"}})
    animation = {"name": "speech", "channels": channels, "samplers": [*samplers.values()]}
    json.setdefault("animations", []).insert(0, animation)
    json["buffers"][0]["byteLength"] = buffer.size
    if sound:
        shown = json["scenes"][json.get("scene", 0)] if json.get("scenes") else json
        extras = shown.get("extras")
        shown["extras"] = (extras if isinstance(extras, dict) else {}) | describe_sound(sound, sound_s)
    write_container(path, json, b"".join(buffer.chunks))
    return True
