"""Characters: glTF with everything that is read of it, OBJ, tables of lip points and weights, bindings, rig tables."""

from __future__ import annotations

import tempfile
from itertools import islice
from pathlib import Path

import numpy as np

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import require
from lipmotion.pipeline.characters import curves_of
from lipmotion.rig.binding_files import save_binding, write_weights
from lipmotion.rig.driven import driven_character
from lipmotion.rig.gltf_writer import write_glb
from lipmotion.rig.obj_files import write_obj
from rig.gltf import data_uri, document, glb, packed_attributes
from rig.heads import head, lip_points
from rig.speech import motion, units

TABLE = "control,source,gain,offset,low,high\nJaw,jawOpen,-25,,-20,0\nLips,viseme_oh,0.5\n"


def seeds(_: Good) -> list[Files]:
    """Return a head in every format, with every table."""
    whole, plain = head(), head(shapes=False)
    named = "point,vertex\n" + "".join(f"{point},{vertex}\n" for point, vertex in lip_points(plain).items())
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        write_glb(folder / "head.glb", whole)
        write_obj(folder / "head.obj", plain)
        (folder / "points.csv").write_text(named)
        bound = driven_character(folder / "head.obj", points=folder / "points.csv")
        assert bound.binding is not None
        save_binding(folder / "head.binding", bound.binding, bound.mesh)
        write_weights(folder / "weights.csv", bound.binding)
        files = {path.name: path.read_bytes() for path in folder.iterdir()}
    content, binary = document()
    packed = packed_attributes(np.frombuffer(binary[:48], np.uint8).reshape(4, 12))
    small = content | {"buffers": [{"uri": data_uri(binary + packed), "byteLength": len(binary + packed)}]}
    extension = {"buffer": 0, "byteOffset": len(binary), "byteLength": len(packed), "byteStride": 12, "count": 4}
    squeezed = [dict(view) for view in content["bufferViews"]]
    squeezed[0]["extensions"] = {"EXT_meshopt_compression": extension | {"mode": "ATTRIBUTES"}}
    return [
        {"head.glb": files["head.glb"]},
        {"head.obj": files["head.obj"], "points.csv": files["points.csv"]},
        {"head.obj": files["head.obj"], "head.binding": files["head.binding"]},
        {"head.obj": files["head.obj"], "points.csv": files["points.csv"], "weights.csv": files["weights.csv"]},
        {"head.glb": files["head.glb"], "rig.csv": TABLE.encode()},
        {"head.glb": glb(small | {"bufferViews": squeezed}, b"")},
        {"head.glb": glb(content, binary)},
    ]


def read(folder: Path, _: Good) -> None:
    """Read a character and move it; read a table of controls and fill it."""
    found = {path.name: path for path in folder.iterdir()}
    if "rig.csv" in found:
        controls = curves_of(motion(), units(), found["rig.csv"])
        require(bool(np.isfinite(controls.values).all()), "controls that are not finite")
    path = found.get("head.glb") or found["head.obj"]
    binding = found.get("head.binding") or found.get("weights.csv")
    character = driven_character(path, points=found.get("points.csv"), binding=binding)
    for vertices in islice(character.vertices(motion(), units(), np.array([0.55, 0.75, 1.15])), 3):
        require(bool(np.isfinite(vertices).all()), "vertices that are not finite")
    if character.shapes is not None:
        weights = character.weights(motion(), units()).values
        require(bool((weights >= 0).all() and (weights <= 1).all()), "weights beyond 0 to 1")
