"""Readers of videos, filmed faces, drawings, characters and motion that is supplied beside recordings."""

import io
import json
import math
import tempfile
import warnings
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faces.test_cut_out import draw
from formats.examples import of_motion, written
from fuzz.inputs import Files, Good, Reader, require, short_speech
from lipmotion import Corpus, CueSheet, load_face, save_face
from lipmotion.formats.c3d import C3dFile, write_c3d
from lipmotion.formats.cues import CUE_FORMATS
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.types import WEIGHT, Channel, Motion, Span, Timeline
from lipmotion.units.phones import SHAPES
from lipmotion_faces import Staging, stage_face
from lipmotion_faces.characters.binding import save_binding, write_weights
from lipmotion_faces.characters.character_files import load_character, read_character
from lipmotion_faces.corpus.captured_faces import read_channels
from lipmotion_faces.corpus.source_recordings import MotionFile
from lipmotion_faces.corpus.supplied import read_supplied_track
from lipmotion_faces.cut_out import read_cut_out
from lipmotion_faces.film.filmed_video import make_film
from lipmotion_faces.mesh import MeshStage
from lipmotion_faces.rendering.drawn_surface import prepare_surface
from lipmotion_faces.tracking.frames import find_nominal_rate, open_video
from meshes import flame, gltf
from meshes.gltf import data_uri, document, glb, textured_document, with_colours
from meshes.heads import head, lip_points, write_glb, write_obj
from meshes.live_link_app import write_take
from meshes.speech import motion, units
from robustness.case import npy
from robustness.motion_cases import GOOD
from speech.sounds import tone, write_pictures, write_sound
from testing.toy_face import toy_face

CODECS = {
    **{"mp4": ("libx264", "yuv420p"), "mkv": ("libx264", "yuv420p"), "webm": ("libvpx", "yuv420p")},
    **{
        "avi": ("mpeg4", "yuv420p"),
        "gif": ("gif", "rgb8"),
        "mov": ("mjpeg", "yuvj420p"),
        "mpg": ("mpeg2video", "yuv420p"),
    },
    **{"ts": ("mpeg2video", "yuv420p"), "y4m": ("rawvideo", "yuv420p")},
}
VIDEO_FRAMES = 6
MAX_PIXELS = 1 << 26  # twice those of the largest video that anybody records


def seed_video(_: Good) -> list[Files]:
    """Return a few grey pictures in many containers, with varying frame times, and with sound."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        paths = [_pictures(Path(folder) / f"a.{name}", *codec) for name, codec in CODECS.items()]
        paths.append(write_pictures(Path(folder) / "long.mp4"))
        paths.append(write_sound(Path(folder) / "both.mp4", tone(16_000, 0.3), 16_000, "aac", video=True, cover=True))
        found += [{path.name: path.read_bytes()} for path in paths]
    return found


def _pictures(path: Path, codec: str, form: str) -> Path:
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, form
        for n in range(VIDEO_FRAMES):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 40 * n, np.uint8), format="rgb24").reformat(
                format=form
            )
            frame.pts, frame.time_base = n, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def check_video(folder: Path, _: Good) -> None:
    """Check every picture, and the frame rate."""
    (path,) = folder.iterdir()
    times_s: list[float] = []
    with open_video(path) as video:
        for frame in video.frames:
            height, width, colours = frame.image.shape
            require(colours == 3 and min(height, width) > 0, "a picture of another shape")
            require(height * width <= MAX_PIXELS, "a picture that is too large")
            require(0 <= frame.time_s < math.inf, "a picture without a time, or before the beginning")
            times_s.append(frame.time_s)
        rate_hz = find_nominal_rate(np.array(times_s), video.stated_rates_hz)
    require(bool((np.diff(times_s) > 0).all()), "times that do not rise")
    require(0 < rate_hz < math.inf, "a frame rate that is none")


FACE_FRAMES = 3
FEW = slice(6)  # candidates of the good face: a small file is changed in more places
CODES = 1e6  # largest plausible coefficient of a picture, grey levels


def seed_face(_: Good) -> list[Files]:
    """Return a face with few candidates."""
    return [{"a.face": _small()}]


@cache
def _small() -> bytes:
    face = toy_face(3)
    whole = face.appearance
    few = {
        name: getattr(whole, name)[FEW] for name in ("mouths", "mouth_codes", "mouth_distances", "jaws", "jaw_codes")
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.face"
        save_face(replace(face, appearance=replace(whole, **few), takes=face.takes[:1]), path)
        return path.read_bytes()


def check_face(folder: Path, _: Good) -> None:
    """Load a face, describe it, and make a few frames of motion that its own channels can hold."""
    face = load_face(folder / "a.face")
    require(all(len(line) < 10_000 for line in face.summary.values()), "a description that is too long")
    needed = face.appearance.from_motion
    poses = needed.mean + np.linspace(-1, 1, FACE_FRAMES)[:, None] * needed.scale
    channels = face.takes[0].motion.channels if face.takes else ()
    known = {channel.name: channel for channel in channels}
    if any(name not in known for name in needed.names):
        return
    motion = Motion(poses, 25.0, tuple(known[name] for name in needed.names))
    codes = face.appearance.predict_codes(motion)
    for values in (codes.mouth, codes.jaw, codes.chin_px):
        require(bool(np.isfinite(values).all()), "codes that are not finite")
        require(float(np.abs(values).max(initial=0.0)) <= CODES, "codes that are absurd")
    height, width = face.background.video.size
    for frame in islice(make_film(face, motion, fps=25.0).frames, FACE_FRAMES):
        require(frame.shape == (height, width, 3) and frame.dtype == np.uint8, "a frame of another shape")


ROBOT = Path(__file__).parents[3] / "examples" / "robot.svg"
SMALL = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 40"><g id="head" transform="rotate(5) scale(1.1 1)">
<path d="M5 5C8 2 30 2 35 9S30 30 20 35Q5 30 4 20T5 5A9 6 30 0 1 9 9zm4 4h9v-3l2 2" fill="#fa8" stroke="navy"/>
<g id="mouth-rest" style="fill:none;stroke:rgb(9,9,9);stroke-width:2"><line x1="10" y1="25" x2="30" y2="25"/></g>
<g id="mouth-aa" opacity=".9"><ellipse cx="20" cy="25" rx="8" ry="6" fill-opacity="0.8"/></g>
<g id="eyes-open"><circle cx="12" cy="12" r="3"/><polygon points="25,10 31,10 28,15" fill-rule="evenodd"/></g></g></svg>
"""


def seed_drawing(_: Good) -> list[Files]:
    """Return the example, a small drawing with every kind of shape, and a picture of every mouth shape."""
    with tempfile.TemporaryDirectory() as folder:
        charts = draw(Path(folder), "A B C D E F G H X")
        chart = {path.name: path.read_bytes() for path in sorted(charts.iterdir())}
    return [{"face.svg": ROBOT.read_bytes()}, {"face.svg": SMALL.encode()}, chart]


def check_drawing(folder: Path, _: Good) -> None:
    """Read a drawing; draw two frames."""
    if not (folder / "face.svg").exists():
        for frame in read_cut_out(folder).draw("A", Staging(size=64)):
            require(frame.shape[0] == 64 and frame.shape[2] == 3, "a frame of another shape")
        return
    motion = Motion(np.array([[0.0], [0.2]]), 25.0, (Channel("opening"),))
    for frame in stage_face(str(folder / "face.svg"), Staging(size=64)).render(motion, Timeline(()), fps=25.0):
        require(frame.ndim == 3 and frame.shape[0] == 64 and frame.shape[2] == 3, "a frame of another shape")


HEADS = ("head.glb", "head.gltf", "head.obj", "head.vrm")
TABLE = "control,source,gain,offset,low,high\nJaw,jawOpen,-25,,-20,0\nLips,viseme_oh,0.5\n"


def seed_character(_: Good) -> list[Files]:
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
    files = {"head.gltf": json.dumps(linked).encode(), "head.bin": binary, "skin.png": _picture()}
    return [{"head.vrm": glb(content, binary)}, files]


def _picture() -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.random.default_rng(1).integers(0, 256, (8, 8, 4)).astype(np.uint8)).save(file, "PNG")
    return file.getvalue()


def _skinned() -> tuple[dict, bytes]:
    """The square on a neck, a head and a jaw."""
    content, binary = document()
    joints, weights = np.tile(np.array([0, 1, 2, 0], np.uint8), (4, 1)), np.full((4, 4), 0.25, "<f4")
    names = [{"name": "Neck", "children": [2]}, {"name": "Head", "children": [3]}, {"name": "JawBone"}]
    content["nodes"] = [{"mesh": 0, "skin": 0}, *names]
    content["scenes"], content["skins"] = [{"nodes": [0, 1]}], [{"joints": [1, 2, 3]}]
    del content["meshes"][0]["extras"]
    return content, gltf.with_skin(content, binary, joints, weights)


def check_character(folder: Path, _: Good) -> None:
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


NAMES, VALUES = "x_bs_name.npy", "bs_value_a.npy"
CURVES_FRAMES, RATE_HZ = 23, 30.0  # as long as the short speech


def seed_curves(_: Good) -> list[Files]:
    """Return the same motion in every format."""
    values = np.linspace(0, 0.3, 2 * CURVES_FRAMES).reshape(CURVES_FRAMES, 2)
    channels = [{"name": name, "unit": WEIGHT} for name in ("opening", "width")]
    document = GOOD | {"rate_hz": RATE_HZ, "channels": channels, "values": values.tolist()}
    rows = [f"{n / RATE_HZ:.9f},{first},{second}" for n, (first, second) in enumerate(values)]
    archive = io.BytesIO()
    np.savez(archive, values=values, document=np.array(json.dumps(document | {"values": None})))
    return [
        *_captures(),
        {"a.csv": "\n".join(["time_s,opening,width", *rows]).encode()},
        {"a.json": json.dumps(document).encode()},
        {"a.npz": archive.getvalue()},
        {"a.jsonl": _azure(values)},
        {
            "d.csv": "\n".join(
                ["frame;timestamp_ms;jawOpen", *(f"{n};{33 * n};0,1" for n in range(CURVES_FRAMES))]
            ).encode()
        },
        {"a.000001.ply": flame.head(5, "<")},
        {VALUES: npy(values), NAMES: npy(np.array(["opening", "width"]))},
    ]


def _azure(values: NDArray[np.float64]) -> bytes:
    """Return frames of 55 weights as events of Azure's voices, one a line."""
    halves = [{"FrameIndex": n, "BlendShapes": np.tile(values[n : n + 12, :1], 55).tolist()} for n in (0, 12)]
    return "\n".join(json.dumps({"AudioOffset": 0, "Animation": json.dumps(half)}) for half in halves).encode()


def _captures() -> list[Files]:
    """Return the same second of motion as programs of motion capture write it."""
    values = np.linspace(0, 0.3, 3 * CURVES_FRAMES).reshape(CURVES_FRAMES, 3)
    names = ("x_13", "y_13", "z_13")
    moving = of_motion(Motion(values, RATE_HZ, tuple(map(Channel, names))))
    weights = Motion(values[:, :1], RATE_HZ, (Channel("jawOpen", WEIGHT),))
    fap = (Channel("fap3_open_jaw", "fap"), Channel("fap4", "fap"))
    parameters = of_motion(Motion(np.rint(900 * values[:, :2]), RATE_HZ, fap))
    markers = C3dFile(("EYE_L", "EYE_R", "chin"), np.stack([values + 45, values - 45, 2 * values], axis=1), RATE_HZ)
    cues = Timeline((Span(0.0, 0.3, "X"), Span(0.3, 0.5, "A"), Span(0.5, 0.75, "E")))
    frames_s = [n / RATE_HZ for n in range(CURVES_FRAMES)]
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name, form in CUE_FORMATS.items():
            sheet = CueSheet(cues, 24.0, "".join(SHAPES), Timeline((Span(0.3, 0.7, "moth"),)))
            if form.parse:
                (folder / f"c.{name}").write_text(form.text(sheet, "c.wav"), encoding="utf-8")
        (folder / "a.glb").write_bytes(gltf.glb(*gltf.animated_document(frames_s, values[:, :2])))
        expression = {"node": 1, "path": "translation"}
        (folder / "a.vrma").write_bytes(gltf.glb(*gltf.animated_document(frames_s, values, target=expression)))
        write_take(folder / "a.csv", weights)
        written(folder / "a.c3d", moving)
        write_c3d(folder / "b.c3d", markers)
        written(folder / "a.fap", parameters)
        vowels = (Channel("aa", WEIGHT), Channel("eyeBlinkLeft", WEIGHT), Channel("eyeBlinkRight", WEIGHT))
        written(folder / "a.vmd", of_motion(Motion(values, RATE_HZ, vowels)))
        written(folder / "a.a2f.json", of_motion(weights))
        rows = [f"{1000 * n / RATE_HZ:.1f},{row[0]}" for n, row in enumerate(values)]
        (folder / "c.csv").write_text("\n".join(["time_ms,jawOpen", *rows]))
        return [{path.name: path.read_bytes()} for path in sorted(folder.iterdir())]


def check_curves(folder: Path, good: Good) -> None:
    """Read motion; store it in a corpus, and read it again from there."""
    names = folder / NAMES
    path = folder / VALUES if names.exists() else next(folder.iterdir())
    rate_hz = RATE_HZ / CURVES_FRAMES if path.suffix == ".ply" else RATE_HZ  # one mesh is all of the motion
    curves = MotionFile(path, rate_hz, read_channels(names) if names.exists() else ())
    track = read_supplied_track(curves, short_speech(good).duration_s)
    require(bool(np.isfinite(track.motion.values).all()), "values that are not finite")
    corpus = Corpus.open(good.corpus)
    utterance = replace(corpus.utterance(corpus.names()[0]), track=track)
    with tempfile.TemporaryDirectory() as kept:
        Corpus.create(Path(kept) / "c").add(utterance)
        Corpus.open(Path(kept) / "c").utterance(utterance.name)


READERS = {
    "video": Reader("video", seed_video, check_video),
    "face": Reader("face", seed_face, check_face),
    "drawing": Reader("drawing", seed_drawing, check_drawing),
    "curves": Reader("curves", seed_curves, check_curves),
    "character": Reader("character", seed_character, check_character),
}
