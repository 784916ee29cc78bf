"""Animation clips of Unity: the lines of a clip that Unity saved, and curves that are those of the motion."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from export.motion.curve_examples import generation
from lipmotion.errors import ExportError
from lipmotion.export import write_motion

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
    write_motion(tmp_path / "a.anim", talking, source={}, model={})
    text = (tmp_path / "a.anim").read_text(encoding="utf-8")
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
    write_motion(tmp_path / "a.anim", talking, source={"path": "lines/Anna 1.wav"}, model={})
    clip = unityparser.UnityDocument.load_yaml(str(tmp_path / "a.anim")).entry
    assert (clip.anchor, clip.m_Name, clip.m_AnimationClipSettings["m_StopTime"]) == ("7400000", "Anna 1", "1.000000")
    assert clip.m_FloatCurves == clip.m_EditorCurves
    names = [curve["attribute"] for curve in clip.m_FloatCurves]
    assert names == ["blendShape.jawOpen", "blendShape.Mund auf", "blendShape.aa"]
    for name, curve in zip(talking.motion.names[:2], clip.m_FloatCurves[:2], strict=True):
        times_s, values = ([float(key[field]) for key in curve["curve"]["m_Curve"]] for field in ("time", "value"))
        again = np.interp(talking.motion.time_s, times_s, values)
        assert again == pytest.approx(100 * talking.motion[name], abs=0.02)


def test_held_poses_have_constant_tangents(tmp_path: Path) -> None:
    write_motion(tmp_path / "a.anim", generation("aa", stepped=("aa",)), source={}, model={})
    keys = curves((tmp_path / "a.anim").read_text(), "m_FloatCurves")["blendShape.aa"]
    assert [(round(key["time"], 3), key["value"]) for key in keys] == [(0, 25), (0.333, 75), (0.667, 50), (1, 50)]
    assert {(key["inSlope"], key["outSlope"], key["tangentMode"]) for key in keys} == {(np.inf, np.inf, 103)}


def test_motion_without_weights_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="no blendshapes, or no two frames"):
        write_motion(tmp_path / "a.anim", generation("headYaw"), source={}, model={})
