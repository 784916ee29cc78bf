import re
from pathlib import Path

import numpy as np
import pytest

from formats.examples import generation, written
from lipmotion.errors import ExportError

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
        ("a.tres", "headYaw", "no blendshapes"),
        ("a.anim", "headYaw", "no blendshapes, or no two frames"),
    ],
)
def test_names_that_no_path_has_and_motion_without_weights_are_refused(
    tmp_path: Path, name: str, channel: str, message: str
) -> None:
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
        again = np.interp(talking.motion.time_s, times_s, values)
        assert again == pytest.approx(100 * talking.motion[name], abs=0.02)
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
