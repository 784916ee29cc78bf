import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from PIL import Image

import lipmotion
from faces.test_cut_out import draw
from lipmotion import Delivery
from lipmotion.articulation.cue_sheets import list_frame_shapes
from lipmotion.errors import ExportError, InputError, MissingDependencyError
from lipmotion.types import Audio, Channel, Generation, Motion, Pin, Timeline
from lipmotion_faces import Staging
from lipmotion_faces.characters import fbx
from lipmotion_faces.characters.gltf_document import GltfArrays, read_gltf_document
from lipmotion_faces.characters.scene import Scene
from lipmotion_faces.head.skin import VISIBLE_RINGS
from lipmotion_faces.head.stage import build_head_mesh, make_figure
from lipmotion_faces.outputs.scenes import build_character_scene, build_head_scene, build_scene, write_scene
from meshes.heads import head, write_glb
from pipeline.made import in_mood, performed, read_character
from programs import gltf_report, gltf_validator, python_with, run_with

TIMES_S = (0.0, 0.31, 0.555, 0.75, 0.95, 1.15, 1.62, 2.0)
"""Times at which other programs are asked for values; most lie between two keys."""


@pytest.fixture(scope="module")
def own_head(generation: Generation) -> Scene:
    return build_head_scene(generation)


@pytest.fixture(scope="module")
def character(generation: Generation, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("character") / "head.glb"
    write_glb(path, head())
    return build_character_scene(generation, read_character(path))


@pytest.fixture(scope="module", params=["own_head", "character"])
def scene(request: pytest.FixtureRequest) -> Scene:
    made: Scene = request.getfixturevalue(request.param)
    return made


def test_the_head_closes_its_lips_in_m_and_p_and_opens_them_in_aa(own_head):
    table, mesh = own_head.tabulate(), own_head.mesh
    ring = make_figure().skin.list_lip_rows()[VISIBLE_RINGS - 1]
    upper, lower = ring[20], ring[60]
    places = mesh.vertices[[upper, lower], 1]
    gaps = places + np.einsum("ts,sv->tv", table, mesh.displacements(np.array([upper, lower]))[:, :, 1])
    gap = (gaps[:, 0] - gaps[:, 1]) / 0.09
    at_rest = float((places[0] - places[1]) / 0.09)
    time_s = own_head.weights.time_s
    for start_s, end_s in ((0.5, 0.6), (0.9, 1.0)):
        said = (time_s >= start_s) & (time_s <= end_s)
        assert abs(gap[said].min() - at_rest) < 1e-6
    assert gap[(time_s > 0.7) & (time_s < 0.8)].max() > 0.15


@pytest.mark.parametrize("own", [False, True], ids=["head", "character"])
@pytest.mark.parametrize("mood", [pytest.param("", marks=pytest.mark.long), "angry:0.8, surprised at 1.0"])
def test_some_frames_are_those_of_the_whole(generation, mood, own, tmp_path):
    """What they need of the whole motion, as its pose at rest and its phrases, they have."""
    values, spans, each_s = np.tile(generation.motion.values, (3, 1)), list(generation.units), 2.01
    units = [replace(s, start_s=s.start_s + n * each_s, end_s=s.end_s + n * each_s) for n in range(3) for s in spans]
    moved = replace(generation.motion, values=values)
    moved = in_mood(moved, mood) if mood else moved
    long = replace(generation, motion=moved, units=Timeline(tuple(units)), spread=np.zeros(moved.values.shape))
    long = replace(long, curve_edits=(Pin(2.7, "jawOpen", 0.4),))
    scene = build_head_scene
    if own:
        write_glb(tmp_path / "own.glb", head())
        scene = partial(build_character_scene, character=read_character(tmp_path / "own.glb"))
    whole = scene(long)
    for frames in (slice(0, 30), slice(250, 310), slice(len(values) - 20, len(values))):
        part = scene(long, frames=frames)
        assert part.weights.names == whole.weights.names
        assert np.abs(part.weights.values - whole.weights.values[frames]).max() < 0.01
        if part.turn is not None and whole.turn is not None:
            assert np.abs(part.turn.rotations - whole.turn.rotations[frames]).max() < 1e-9


@pytest.mark.parametrize(
    ("sound_s", "lines"),
    [(0.5, ["uniform timecode startTime = 12"]), (0.0, ["uniform timecode startTime = 0"]),
     (-0.5, ["uniform double mediaOffset = 0.5", "uniform timecode startTime = 0"])],
)  # fmt: skip
def test_when_the_sound_begins_in_the_animation(sound_s, lines, character, tmp_path):
    moved = replace(character, sound_s=sound_s)
    write_glb(tmp_path / "head.glb", head())
    for name, scene in (("a.glb", moved), ("b.glb", replace(moved, original=None))):
        write_scene(tmp_path / name, scene, tmp_path / "said.wav")
        stored = read_gltf_document(tmp_path / name).json["scenes"][0]
        assert stored["extras"] == {"audio": {"uri": "said.wav", "start_s": sound_s}}
    write_scene(tmp_path / "b.glb", character)
    assert "extras" not in read_gltf_document(tmp_path / "b.glb").json["scenes"][0]
    write_scene(tmp_path / "a.usda", moved, tmp_path / "said.wav")
    written = [line.strip() for line in (tmp_path / "a.usda").read_text().splitlines()]
    assert [line for line in written if "mediaOffset" in line or "startTime " in line] == lines


def test_held_weights_change_at_once_and_others_do_not(character, tmp_path):
    assert character.weights is not None
    names, mesh = ("jawOpen", "eyeBlinkLeft"), character.mesh
    channels = tuple(Channel(name, "weight") for name in names)
    weights = Motion(np.array([[0, 0], [0, 0.5], [1, 1], [1, 0]], float), 10.0, channels)
    mesh = replace(mesh, shapes=tuple(replace(mesh.shapes[0], name=name) for name in names))
    scene = Scene(mesh, weights, stepped=("jawOpen",))
    time_s, table = scene.list_keys()
    assert time_s == pytest.approx([0, 0.1, 0.199, 0.2, 0.3])
    assert table[:, 0] == pytest.approx([0, 0, 0, 1, 1])
    assert table[:, 1] == pytest.approx([0, 0.5, 0.995, 1, 0])
    write_scene(tmp_path / "a.usda", scene)
    assert "        1.99: [0, 0.995]," in (tmp_path / "a.usda").read_text()
    write_scene(tmp_path / "a.glb", scene)
    (sampler,) = read_gltf_document(tmp_path / "a.glb").json["animations"][0]["samplers"]
    stored = GltfArrays(read_gltf_document(tmp_path / "a.glb"))
    assert stored.read_floats(sampler["input"], 1)[:, 0] == pytest.approx(time_s)
    assert stored.read_floats(sampler["output"], 1)[:, 0] == pytest.approx(table.reshape(-1))


def test_keys_that_others_give_are_left_out(generation, tmp_path):
    scene = build_scene(performed(generation, "head", delivery=Delivery(key_tolerance=0.02)))
    assert scene.thinning.tolerance == 0.02
    assert len(scene.thinning.closed_s) == 2  # m and p
    write_scene(tmp_path / "a.glb", scene)
    stored, rotation = GltfArrays(read_gltf_document(tmp_path / "a.glb")), len(scene.tabulate())
    weights, turned = read_gltf_document(tmp_path / "a.glb").json["animations"][0]["samplers"]
    time_s = stored.read_floats(weights["input"], 1)[:, 0]
    values = stored.read_floats(weights["output"], 1).reshape(len(time_s), -1)
    turns = len(stored.read_floats(turned["input"], 1)), len(stored.read_floats(turned["output"], 4))
    assert len(time_s) < rotation == turns[0] == turns[1]
    shown = np.stack([np.interp(scene.weights.time_s, time_s, column) for column in values.T], axis=1)
    assert np.abs(shown - scene.tabulate()).max() < 0.0201
    closed = [round(each_s * scene.weights.rate_hz) for each_s in scene.thinning.closed_s]
    assert closed
    assert shown[closed] == pytest.approx(scene.tabulate()[closed], abs=1e-6)


def test_the_shapes_of_the_head_are_those_of_its_mesh_and_the_rate_is_that_of_the_keys(generation, own_head):
    assert own_head.mesh.shape_names == build_head_mesh(make_figure()).shape_names
    assert set(own_head.weights.names) == set(own_head.mesh.shape_names)
    slow = build_head_scene(generation, 30.0).weights
    assert (slow.rate_hz, len(slow.values)) == (pytest.approx(30.0), 61)
    with pytest.raises(InputError, match="no channel 'opening'"):
        build_head_scene(generation.selected(["x_13"]))


@pytest.mark.skipif(gltf_validator() is None, reason="needs Khronos' gltf-validator (tests/programs)")
@pytest.mark.long
def test_khronos_finds_no_error_and_no_warning(scene, tmp_path):
    write_scene(tmp_path / "a.glb", scene, tmp_path / "a.wav")
    report = gltf_report(tmp_path / "a.glb")
    assert (report["numErrors"], report["numWarnings"]) == (0, 0), report["messages"]


@pytest.mark.skipif(python_with("pxr") is None, reason="needs usd-core (tests/programs)")
@pytest.mark.long
def test_openusd_finds_no_error_and_reads_the_same_values(scene, tmp_path):
    (tmp_path / "a b.wav").write_bytes(b"")
    write_scene(tmp_path / "a.usda", scene, tmp_path / "a b.wav")
    found = run_with("pxr", "usd_scene.py", tmp_path / "a.usda", *(24 * time_s for time_s in TIMES_S))
    assert found["errors"] == []
    assert found["sound"] == "./a b.wav"
    assert (found["rate"], found["end"]) == pytest.approx((24.0, 48.0))
    assert found["shapes"] == list(scene.mesh.shape_names)
    assert found["joints"] == (["body"] if scene.turn is None else ["body", "body/head"])
    assert largest_error(scene, found["values"]) < 1e-5


@pytest.mark.skipif(python_with("bpy") is None, reason="needs bpy (tests/programs)")
@pytest.mark.long
@pytest.mark.parametrize("suffix", [".glb", ".usda"])
def test_blender_plays_the_same_values(scene, suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    write_scene(path, scene)
    found = run_with("bpy", "blender_scene.py", path, *TIMES_S)
    assert largest_error(scene, found["values"]) < 2e-4
    assert np.ptp(np.array(found["moved"]), axis=0).max() > 1e-3
    if scene.turn is not None and scene.weights is not None:
        rotations = scene.turn.rotations[[round(time_s * 100) for time_s in TIMES_S]]
        angles = 2 * np.arccos(np.clip(np.abs(rotations[:, 3]), 0, 1))
        turned = 2 * np.arccos(np.clip(np.abs(np.array(found["turns"])[:, 0]), 0, 1))
        assert turned == pytest.approx(angles, abs=2e-3)


@pytest.mark.skipif(python_with("bpy") is None, reason="needs bpy (tests/programs)")
@pytest.mark.long
def test_blender_makes_fbx_of_it(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(fbx, "find_blender", lambda: [python_with("bpy"), "-c", fbx.SCRIPT])
    write_scene(tmp_path / "a.fbx", scene)
    times_s = [frame / 60 for frame in (0, 18, 45, 97)]
    found = run_with("bpy", "blender_scene.py", tmp_path / "a.fbx", *times_s)
    for wanted, values in zip(scene.weights.at(np.array(times_s)), found["values"], strict=True):
        held = dict(zip(scene.weights.names, wanted, strict=True))
        assert max(abs(values[name] - held[name]) for name in values if name in held) < 2e-3


@pytest.mark.skipif(sys.platform == "win32", reason="its programs are no scripts")
@pytest.mark.parametrize(
    ("lines", "error"),
    [(None, MissingDependencyError), ("echo no room >&2; exit 1", ExportError), ("exit 0", ExportError)],
)
def test_an_fbx_that_blender_cannot_make_is_refused_and_leaves_no_file(own_head, lines, error, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "bpy", None)
    monkeypatch.setenv("PATH", str(tmp_path))
    program, target = tmp_path / "blender", tmp_path / "out" / "a.fbx"
    target.parent.mkdir()
    if lines is not None:
        program.write_text(f"#!/bin/sh\n{lines}\n")
        program.chmod(0o755)
    with pytest.raises(error, match="no room" if lines and "room" in lines else "Blender"):
        write_scene(target, own_head)
    assert not list(target.parent.iterdir())


def largest_error(scene: Scene, values: list[dict[str, float]]) -> float:
    """Return how far the values that a program gives are from those of the scene."""
    wanted = scene.weights.at(np.array(TIMES_S))
    named = dict(zip(scene.weights.names, wanted.T, strict=True))
    return max(abs(float(named[name][row]) - at[name]) for row, at in enumerate(values) for name in named)


LETTERS = "A B C D E F G H X"
SOUND = Audio(np.zeros(34_000, np.float32), 16_000)


def test_every_picture_is_that_of_its_cue(generation, tmp_path):
    drawings = draw(tmp_path / "chart", LETTERS)
    lipmotion.write(generation, tmp_path / "a%05d.png", speech=SOUND, face=drawings, fps=24)
    shown = list_frame_shapes(lipmotion.cues(generation, fps=24))
    pictures = sorted(tmp_path.glob("a*.png"))
    greys = [int(np.asarray(Image.open(path).convert("RGB"))[-1, 0, 0]) for path in pictures]
    expected = [10 + 10 * LETTERS.split().index(shape) for shape in shown]
    assert len(greys) == int(generation.motion.time_s[-1] * 24 + 1e-9) + 1
    assert greys == [*expected, expected[-1]][: len(greys)]
    assert {10, 90} <= {*greys}


def test_what_drawings_cannot_show_is_refused(generation, tmp_path):
    drawings = draw(tmp_path / "chart", "A B C D E F")
    silent, clear = replace(generation, units=Timeline(())), Staging(background="transparent")
    for given, names, options, error, message in (
        (silent, ["a.json", "a.webm"], {}, ExportError, "has no phones, from which drawings are chosen"),
        (generation, ["a.webm"], {"fps": 101}, InputError, "the frame rate is 101"),
        (generation, ["a.mp4"], {"staging": clear}, ExportError, "cannot be transparent"),
    ):
        with pytest.raises(error, match=message):
            lipmotion.write(given, [tmp_path / name for name in names], speech=SOUND, face=drawings, **options)
        assert not (tmp_path / names[0]).exists()
