import ast
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.examples import generation, of_motion, written
from lipmotion.articulation.contact import opening_to_gap
from lipmotion.errors import ExportError
from lipmotion.formats import read_motion
from lipmotion.formats.fap import FAP, MOUTH_TO_NOSE, PARAMETERS, STEPS, move_faps
from lipmotion.formats.game_engines import write_addon
from lipmotion.types import WEIGHT, Channel, Generation, Motion
from meshes.speech import motion, units

TRACK = re.compile(
    r'tracks/(\d+)/type = "blend_shape"\ntracks/\1/imported = false\ntracks/\1/enabled = true\n'
    r'tracks/\1/path = NodePath\("\.:(\w+)"\)\ntracks/\1/interp = ([01])\ntracks/\1/loop_wrap = false\n'
    r"tracks/\1/keys = PackedFloat32Array\(([^)]*)\)\n"
)


def test_a_resource_has_the_tracks_of_the_motion(tmp_path: Path) -> None:
    talking = generation("jawOpen", "viseme_PP", "headYaw", stepped=("viseme_PP",))
    text = written(tmp_path / "a.tres", talking).read_text(encoding="utf-8")
    head = '[gd_resource type="Animation" format=3]\n\n[resource]\nresource_name = "speech"\n'
    head += "length = 1\nstep = 0.0333333\n"
    assert text.startswith(head)
    found = TRACK.findall(text)
    assert [match[:3] for match in found] == [("0", "jawOpen", "1"), ("1", "viseme_PP", "0")]
    assert head + "".join(match[0] for match in TRACK.finditer(text)) == text
    keys = [np.array([float(number) for number in each[3].split(",")]).reshape(-1, 3) for each in found]
    assert {*keys[0][:, 1]} == {1.0}
    again = np.interp(talking.motion.time_s, keys[0][:, 0], keys[0][:, 2])
    assert again == pytest.approx(talking.motion["jawOpen"], abs=2e-4)
    assert keys[1][:, 2].tolist() == [0.25, 0.75, 0.5, 0.5]


def test_times_after_three_hours_stay_apart(tmp_path: Path) -> None:
    late = of_motion(Motion(np.array([[0.0], [1.0]]), 1 / 10800.04, (Channel("jawOpen", WEIGHT),)))
    assert "length = 10800.04\n" in (text := written(tmp_path / "a.tres", late).read_text(encoding="utf-8"))
    assert "PackedFloat32Array(0, 1, 0, 10800.04, 1, 1)" in text


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_godot_parser_reads_the_same_tracks(tmp_path: Path) -> None:
    godot_parser = pytest.importorskip("godot_parser")
    talking = generation("jawOpen", "viseme_PP", "headYaw", stepped=("viseme_PP",))
    read = godot_parser.load(str(written(tmp_path / "a.tres", talking)))
    (resource,) = read.get_sections("resource")
    kind = read.find_section("gd_resource").header.attributes["type"]
    assert (kind, resource["resource_name"]) == ("Animation", "speech")
    assert [str(resource[f"tracks/{n}/path"].path) for n in range(2)] == [".:jawOpen", ".:viseme_PP"]
    keys = np.array(resource["tracks/0/keys"].args, float).reshape(-1, 3)
    again = np.interp(talking.motion.time_s, keys[:, 0], keys[:, 2])
    assert again == pytest.approx(talking.motion["jawOpen"], abs=2e-4)


@pytest.mark.parametrize(
    ("name", "channel", "message"),
    [
        ("a.tres", "Face.jawOpen", r"'Face\.jawOpen' has one of the letters"),
        ("a.tres", "headYaw", "required 1 or more of weight"),
        ("a.anim", "headYaw", "required 2 or more of weight"),
    ],
)
def test_names_and_motion_without_weights_are_refused(tmp_path: Path, name: str, channel: str, message: str) -> None:
    with pytest.raises(ExportError, match=message):
        written(tmp_path / name, generation(channel))


HEAD = "%YAML 1.1\n%TAG !u! tag:unity3d.com,2011:\n--- !u!74 &7400000\nAnimationClip:\n  m_ObjectHideFlags: 0\n"
CURVE = re.compile(
    r"  - curve:\n      serializedVersion: 2\n      m_Curve:\n((?:      .*\n|        .*\n)+?)      m_PreInfinity: 2\n"
    r"      m_PostInfinity: 2\n      m_RotationOrder: 4\n    attribute: (.*)\n    path: \n    classID: 137\n"
)
FIELD = re.compile(r"(time|value|inSlope|outSlope|tangentMode): (\S+)")


def curves(text: str, part: str) -> dict[str, list[dict[str, float]]]:
    """Return the keys of each curve of one list of a clip."""
    found = {}
    section = re.split(r"^  (?=m_)", text.split(f"  {part}:\n")[1], flags=re.MULTILINE)[0]
    for match in CURVE.finditer(section):
        numbers = [(name, float(value)) for name, value in FIELD.findall(match[1])]
        found[match[2]] = [dict(numbers[n : n + 5]) for n in range(0, len(numbers), 5)]
    return found


def test_a_clip_has_the_curves_of_the_motion(tmp_path: Path) -> None:
    talking = generation("jawOpen", "Mund auf", "headYaw")
    text = written(tmp_path / "a.anim", talking).read_text(encoding="utf-8")
    assert text.startswith(HEAD)
    assert "\n  m_SampleRate: 30\n" in text
    assert "\n    m_StopTime: 1.000000\n" in text
    found = curves(text, "m_FloatCurves")
    assert found == curves(text, "m_EditorCurves")
    assert [*found] == ["blendShape.jawOpen", '"blendShape.Mund auf"']
    for name, keys in zip(("jawOpen", "Mund auf"), found.values(), strict=True):
        times_s, values = ([key[field] for key in keys] for field in ("time", "value"))
        expected = pytest.approx(100 * talking.motion[name], abs=0.02)
        assert np.interp(talking.motion.time_s, times_s, values) == expected
        assert (times_s[0], times_s[1]) == (0, pytest.approx(0.3, abs=1e-5))
        slopes = np.diff(values) / np.diff(times_s)
        assert [key["outSlope"] for key in keys[:-1]] == pytest.approx(slopes, rel=1e-3, abs=0.1)
        assert [key["inSlope"] for key in keys[1:]] == pytest.approx(slopes, rel=1e-3, abs=0.1)
        assert {key["tangentMode"] for key in keys} == {69}


def test_unityparser_reads_the_same_clip(tmp_path: Path) -> None:
    unityparser = pytest.importorskip("unityparser")
    talking = generation("jawOpen", "Mund auf", "aa", stepped=("aa",))
    path = written(tmp_path / "a.anim", talking, path="lines/Anna 1.wav")
    clip = unityparser.UnityDocument.load_yaml(str(path)).entry
    assert (clip.anchor, clip.m_Name, clip.m_AnimationClipSettings["m_StopTime"]) == ("7400000", "Anna 1", "1.000000")
    assert clip.m_FloatCurves == clip.m_EditorCurves
    names = [curve["attribute"] for curve in clip.m_FloatCurves]
    assert names == ["blendShape.jawOpen", "blendShape.Mund auf", "blendShape.aa"]
    for name, curve in zip(talking.motion.names[:2], clip.m_FloatCurves[:2], strict=True):
        times_s, values = ([float(key[field]) for key in curve["curve"]["m_Curve"]] for field in ("time", "value"))
        again = np.interp(talking.motion.time_s, times_s, values)
        assert again == pytest.approx(100 * talking.motion[name], abs=0.02)


def test_held_poses_have_constant_tangents(tmp_path: Path) -> None:
    text = written(tmp_path / "a.anim", generation("aa", stepped=("aa",))).read_text()
    keys = curves(text, "m_FloatCurves")["blendShape.aa"]
    assert [(round(key["time"], 3), key["value"]) for key in keys] == [(0, 25), (0.333, 75), (0.667, 50), (1, 50)]
    assert {(key["inSlope"], key["outSlope"], key["tangentMode"]) for key in keys} == {(np.inf, np.inf, 103)}


def fap_generation(frames: int = 50, rate_hz: float = 25.0) -> Generation:
    values = np.rint(np.random.default_rng(5).normal(0, 200, (frames, len(PARAMETERS))))
    channels = tuple(Channel(f"fap{number}_{name}", FAP) for number, name, *_ in PARAMETERS)
    return of_motion(Motion(values, rate_hz, channels))


@pytest.mark.parametrize("rate_hz", [25.0, 29.97, 100.0])
def test_parameters_come_back(tmp_path, rate_hz):
    made = fap_generation(rate_hz=rate_hz)
    path = written(tmp_path / "a.fap", made, file="my talk.wav")
    motion, units = read_motion(path)
    assert (motion.channels, motion.rate_hz, len(units)) == (made.motion.channels, rate_hz, 0)
    np.testing.assert_array_equal(motion.values, made.motion.values)
    assert path.read_text().splitlines()[0] == f"2.1 my_talk {rate_hz:g} 50"


def marks(*numbers: int) -> str:
    return " ".join("1" if number in numbers else "0" for number in range(1, 69))


def read(tmp_path: Path, *lines: str) -> Motion:
    (tmp_path / "a.fap").write_text("\n".join(lines))
    return read_motion(tmp_path / "a.fap")[0]


def test_files_of_others(tmp_path):
    """Visemes and expressions are passed over, other parameters named by their number; what is not given stays."""
    motion = read(
        tmp_path,
        *("# a comment", "2.1 face.fap 25 3"),
        *(marks(1, 2, 3, 19), "0 7 0 0 0 1 0 0 0 0 0 11 22"),
        *(marks(3), "1 33"),
        *(marks(), "2"),
    )
    assert motion.names == ("fap3_open_jaw", "fap19")
    assert motion.values.tolist() == [[11, 22], [33, 22], [33, 22]]


def test_what_is_no_parameter_is_refused(tmp_path):
    other = replace(fap_generation(), motion=Motion(np.zeros((2, 1)), 25.0, (Channel("opening"),)))
    with pytest.raises(ExportError, match="no parameters of MPEG-4 but opening"):
        written(tmp_path / "a.fap", other)


def test_lips_rest_at_0_meet_in_p_and_m_and_go_as_the_standard_says():
    """Values are whole; a gap is its share of the unit."""
    parameters = move_faps(motion(), units())
    np.testing.assert_allclose(parameters.values, np.rint(parameters.values), atol=1e-12)
    assert np.abs(parameters.values[5:30]).max() <= 1
    apart = -(parameters["fap4_lower_t_midlip"] + parameters["fap5_raise_b_midlip"])
    assert np.abs(apart[[55, 95]]).max() <= 1
    gap = opening_to_gap(motion()["opening"][75:76].astype(np.float64))
    assert apart[75] / STEPS * MOUTH_TO_NOSE == pytest.approx(float(gap[0]), abs=0.002)
    assert parameters["fap3_open_jaw"][75] > 0
    assert parameters["fap5_raise_b_midlip"][75] < 0
    assert parameters["fap4_lower_t_midlip"][75] < 0
    assert parameters["fap6_stretch_l_cornerlip"][115] < 0  # oo is narrow
    assert parameters["fap7_stretch_r_cornerlip"][115] < 0


def run(path: Path) -> dict[str, Any]:
    """Return what the script defines, without running it as a program."""
    names: dict[str, Any] = {"__name__": "script", "__file__": str(path)}
    exec(compile(path.read_text(), str(path), "exec"), names)  # noqa: S102
    return names


@pytest.fixture
def path(tmp_path: Path) -> Path:
    names = ("jawOpen", 'odd "name"\\')
    moved = Motion(np.random.default_rng(5).random((7, 2)), 100.0, tuple(Channel(name, WEIGHT) for name in names))
    made = of_motion(moved, stepped=("jawOpen", "width"))
    return written(tmp_path / "a.blender.py", made, file="a.wav", path="../a 'b'.wav", start_s="0.25")


def test_it_holds_curves_rate_and_sound(path: Path) -> None:
    names = run(path)
    assert names["RATE_HZ"] == pytest.approx(100.0)
    assert names["SOUND"] == "../a 'b'.wav"
    assert names["STEPPED"] == ("jawOpen",)
    assert names["SOUND_S"] == pytest.approx(0.25)
    assert list(names["MOTION"]) == ["jawOpen", 'odd "name"\\']
    assert names["spelling"]("mouthSmile_L") == "mouthsmileleft"
    assert {"key_frames", "key_shapes", "at_frames", "main"} <= set(names)
    assert names["MOTION"]["jawOpen"] == pytest.approx(np.random.default_rng(5).random((7, 2))[:, 0].tolist(), abs=1e-5)


def test_the_archive_has_one_folder_with_code_and_manifest(tmp_path: Path) -> None:
    for name in ("a.zip", "b.zip"):
        write_addon("blender", tmp_path / name)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        names = archive.namelist()
        texts = {name: archive.read(name).decode() for name in names}
    assert {Path(name).parts[0] for name in names} == {"lipmotion_blender"}
    manifest = texts["lipmotion_blender/blender_manifest.toml"]
    assert 'blender_version_min = "4.2.0"' in manifest
    assert re.search(r'^version = "\d+\.\d+\.\d+"$', manifest, re.MULTILINE)
    assert "bl_info" in texts["lipmotion_blender/__init__.py"]
    for name, text in texts.items():
        if name.endswith(".py"):
            imported = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
            named = [each.names[0].name if isinstance(each, ast.Import) else each.module or "" for each in imported]
            assert not [each for each in named if each.startswith(("lipmotion", "numpy"))]
