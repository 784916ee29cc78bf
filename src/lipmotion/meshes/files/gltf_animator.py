"""A user's own ``.glb`` with one animation more: everything else in it, textures and bones, stays as it is."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.files.gltf_container import GltfDocument, read_gltf_document, write_container
from lipmotion.meshes.files.gltf_scene import name_mesh_targets
from lipmotion.meshes.files.gltf_writer import sound_extras
from lipmotion.meshes.model.keys import EVERY_KEY, Thinning, place_keys
from lipmotion.types import Motion

FLOAT = 5126


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
    if binary is None or "uri" in document.items("buffers")[0] or len(document.buffers) > 1 or not len(weights.values):
        return False
    moved = _moved_nodes(document, weights)
    if not set(weights.names) <= {name for _, names in moved for name in names}:
        return False
    json = document.json
    body = bytearray(binary[: document.items("buffers")[0].get("byteLength", len(binary))])
    chosen = [name in stepped for name in weights.names]
    time_s, rows = place_keys(weights.time_s, weights.values.astype(np.float64), chosen, thinning)
    times = _added(json, body, time_s, limits=True)
    samplers: dict[tuple[str, ...], dict[str, Any]] = {}
    channels: list[dict[str, Any]] = []
    for node, names in moved:
        if names not in samplers:
            document.budget.spend("morph targets", len(names))
            table = np.zeros((len(rows), len(names)))
            for column, name in enumerate(names):
                if name in weights.names:
                    table[:, column] = rows[:, weights.column(name)]
            output = _added(json, body, table.reshape(-1))
            samplers[names] = {"input": times, "output": output, "interpolation": "LINEAR"}
        channels.append({"sampler": list(samplers).index(names), "target": {"node": node, "path": "weights"}})
    animation = {"name": "speech", "channels": channels, "samplers": [*samplers.values()]}
    json.setdefault("animations", []).insert(0, animation)
    json["buffers"][0]["byteLength"] = len(body)
    if sound:
        shown = json["scenes"][json.get("scene", 0)] if json.get("scenes") else json
        extras = shown.get("extras")
        shown["extras"] = (extras if isinstance(extras, dict) else {}) | sound_extras(sound, sound_s)
    write_container(path, json, bytes(body))
    return True


def _moved_nodes(document: GltfDocument, weights: Motion) -> list[tuple[int, tuple[str, ...]]]:
    """Return the nodes whose mesh has morph targets that move, with the names of all of its targets."""
    found = []
    for number, node in enumerate(document.items("nodes")):
        mesh = document.items("meshes")[node["mesh"]] if "mesh" in node else {}
        names = name_mesh_targets(document, mesh)
        if set(names) & set(weights.names):
            found.append((number, names))
    return found


def _added(json: dict[str, Any], body: bytearray, values: NDArray[np.float64], *, limits: bool = False) -> int:
    """Add numbers [shape=(N,)] to the buffer and return the number of their accessor."""
    stored = np.ascontiguousarray(values, "<f4")
    body += b"\0" * (-len(body) % 4)
    views, accessors = json.setdefault("bufferViews", []), json.setdefault("accessors", [])
    views.append({"buffer": 0, "byteOffset": len(body), "byteLength": stored.nbytes})
    body += stored.tobytes()
    accessor = {"bufferView": len(views) - 1, "componentType": FLOAT, "count": len(stored), "type": "SCALAR"}
    if limits:
        accessor |= {"min": [float(stored.min())], "max": [float(stored.max())]}
    accessors.append(accessor)
    return len(accessors) - 1
