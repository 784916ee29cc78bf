"""Characters: glTF with everything that is read of it, OBJ, tables of lip points and weights, bindings, rig tables."""

import io
import json
import tempfile
import warnings
from itertools import islice
from pathlib import Path

import numpy as np
from PIL import Image

from fuzz.inputs import Files, Good
from fuzz.plausible import require
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion_faces.characters.binding import save_binding, write_weights
from lipmotion_faces.characters.character_files import load_character, read_character
from lipmotion_faces.mesh import MeshStage
from lipmotion_faces.rendering.drawn_surface import prepare_surface
from meshes.gltf import data_uri, document, glb, packed_attributes, textured_document, with_colours
from meshes.heads import head, lip_points, write_glb, write_obj
from meshes.speech import motion, units

HEADS = ("head.glb", "head.gltf", "head.obj", "head.vrm")
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
        bound = load_character(folder / "head.obj", points=folder / "points.csv")
        assert bound.binding is not None
        save_binding(folder / "head.binding", bound.binding, bound.mesh)
        write_weights(folder / "weights.csv", bound.binding)
        files = {path.name: path.read_bytes() for path in folder.iterdir()}
    content, binary = document()
    skinned, joints = _skinned()
    picture = _picture()
    library = b"newmtl skin\nKd 0.9 0.8 0.7\nmap_Kd skin.png\n"
    mapped = b"mtllib head.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl skin\n" + files["head.obj"].replace(b"usemtl", b"#")
    return [
        {"head.glb": files["head.glb"]},
        {"head.obj": files["head.obj"], "points.csv": files["points.csv"]},
        {"head.obj": files["head.obj"], "head.binding": files["head.binding"]},
        {"head.obj": files["head.obj"], "points.csv": files["points.csv"], "weights.csv": files["weights.csv"]},
        {"head.glb": files["head.glb"], "rig.csv": TABLE.encode()},
        {"head.gltf": json.dumps(content | {"buffers": [{"uri": data_uri(binary)}]}).encode()},
        {"head.obj": mapped, "head.mtl": library, "skin.png": picture, "points.csv": files["points.csv"]},
        {"head.glb": glb(skinned, joints)},
        *_whole(),
    ]


def _whole() -> list[Files]:
    """The square with all that is read of glTF and VRM, in one file and in several."""
    colours = np.linspace(0, 255, 16).reshape(4, 4).astype(np.uint8)
    moved = {"KHR_texture_transform": {"offset": [0.5, 0.25], "scale": [2, 2], "rotation": 0.3}}
    content, binary = with_colours(*textured_document(_picture(), extension=moved), colours, normalised=True)
    packed = packed_attributes(np.frombuffer(binary[:48], np.uint8).reshape(4, 12))
    place = {"buffer": 0, "byteOffset": len(binary), "byteLength": len(packed), "byteStride": 12, "count": 4}
    content["bufferViews"][0]["extensions"] = {"KHR_meshopt_compression": place | {"mode": "ATTRIBUTES"}}
    content["bufferViews"].append({"buffer": 0, "byteOffset": 0, "byteLength": 16})
    rows = {"bufferView": len(content["bufferViews"]) - 1, "componentType": 5121}
    content["accessors"][2] |= {"sparse": {"count": 1, "indices": rows, "values": {"bufferView": 0}}}
    content["skins"] = [{"joints": [1], "inverseBindMatrices": len(content["accessors"])}]
    content["accessors"].append({"componentType": 5126, "count": 1, "type": "MAT4"})
    content["nodes"].append({"name": "Head", "rotation": [0, 0, 0, 1], "scale": [1, 1, 1], "translation": [0, 1, 0]})
    content["scenes"] = [{"nodes": [0, 1]}]
    content["materials"][0] |= {"alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": True, "name": "skin"}
    content["materials"][0]["pbrMetallicRoughness"] |= {"baseColorFactor": [1, 0.5, 1, 1], "roughnessFactor": 0.5}
    bind = {"node": 0, "index": 0, "weight": 0.5}
    old = {"name": "A", "presetName": "a", "binds": [{"mesh": 0, "index": 1, "weight": 100}]}
    content["extensions"] = {
        "VRM": {"blendShapeMaster": {"blendShapeGroups": [old]}},
        "VRMC_vrm": {"expressions": {"preset": {"oh": {"morphTargetBinds": [bind]}}, "custom": {}}},
    }
    content["extensionsRequired"] = ["KHR_mesh_quantization"]
    content["animations"] = [{"channels": [], "samplers": []}]
    linked = content | {"buffers": [{"uri": "head.bin", "byteLength": len(binary)}]}
    linked["images"] = [{"uri": "skin.png"}]
    files = {"head.gltf": json.dumps(linked).encode(), "head.bin": binary + packed, "skin.png": _picture()}
    return [{"head.vrm": glb(content, binary + packed)}, files]


def _picture() -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.random.default_rng(1).integers(0, 256, (8, 8, 4)).astype(np.uint8)).save(file, "PNG")
    return file.getvalue()


def _skinned() -> tuple[dict, bytes]:
    """The square on a neck, a head and a jaw."""
    content, binary = document()
    joints, weights = np.tile(np.array([0, 1, 2, 0], np.uint8), (4, 1)), np.full((4, 4), 0.25, "<f4")
    content["nodes"] = [
        {"mesh": 0, "skin": 0},
        {"name": "Neck", "children": [2]},
        {"name": "Head", "children": [3]},
        {"name": "JawBone"},
    ]
    content["scenes"], content["skins"] = [{"nodes": [0, 1]}], [{"joints": [1, 2, 3]}]
    views: list[dict] = [{"buffer": 0, "byteOffset": len(binary), "byteLength": 16}]
    views.append({"buffer": 0, "byteOffset": len(binary) + 16, "byteLength": 64})
    content["bufferViews"] += views
    content["accessors"] += [
        {"bufferView": 4, "componentType": 5121, "count": 4, "type": "VEC4"},
        {"bufferView": 5, "componentType": 5126, "count": 4, "type": "VEC4"},
    ]
    content["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": 4, "WEIGHTS_0": 5}
    del content["meshes"][0]["extras"]
    return content, binary + joints.tobytes() + weights.tobytes()


def read(folder: Path, _: Good) -> None:
    """Read a character and move it; read a table of controls and fill it."""
    warnings.filterwarnings("ignore", ".*texture of the character.*")  # the surface then has one colour
    found = {path.name: path for path in folder.iterdir()}
    if "rig.csv" in found:
        controls = make_curves(motion(), units(), found["rig.csv"])
        require(bool(np.isfinite(controls.values).all()), "controls that are not finite")
    path = next(path for name, path in sorted(found.items()) if name in HEADS)
    binding = found.get("head.binding") or found.get("weights.csv")
    mesh = read_character(path)
    surface = prepare_surface(mesh, np.ones(len(mesh.triangles), bool), 1.0)
    require(len(surface.triangles.levels) > surface.triangles.looks[:, 0].max(initial=-1), "a texture that is missing")
    character = load_character(path, points=found.get("points.csv"), binding=binding)
    for vertices in islice(character.vertices(motion(), units(), np.array([0.55, 0.75, 1.15])), 3):
        require(bool(np.isfinite(vertices).all()), "vertices that are not finite")
    picture = MeshStage(character, 64, 64).draw(character.mesh.vertices, (0.1, 0.05, 0.0), (0.1, 0.0))
    require(picture.shape == (64, 64, 3), "a picture of another size")
    if character.shapes is not None:
        weights = character.weights(motion(), units()).values
        require(bool((weights >= 0).all() and (weights <= 1).all()), "weights beyond 0 to 1")
