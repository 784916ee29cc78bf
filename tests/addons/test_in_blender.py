import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import write
from lipmotion.formats.game_engines import write_addon
from lipmotion.pipeline.outputs.curve_sets import with_curves
from lipmotion.types import Audio, Generation
from lipmotion_blender.curves import at_frames
from pipeline.conftest import generation
from programs import python_with, run_with

__all__ = ["generation"]
pytestmark = [pytest.mark.skipif(python_with("bpy") is None, reason="needs bpy (tests/programs)"), pytest.mark.long]
ROUNDED = 6e-5  # the frames that show a closure are chosen among values of five decimals, or of six
RIG = "jaw.master.rotation.x,jawOpen,25\njaw.master[open],opening,1\n[lips],opening,2\n"


@pytest.fixture(scope="module")
def wanted(generation: Generation) -> dict[str, list[float]]:
    """What Blender should evaluate at 24 frames a second, for shape keys."""
    curves, names = with_curves(generation, "face")
    values = {name: np.round(curves.motion[name], 5).tolist() for name in names}
    return at_frames(values, generation.motion.time_s.tolist(), 24.0)


@pytest.fixture(scope="module")
def names(wanted: dict[str, list[float]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("names") / "names.json"
    path.write_text(json.dumps([name for name in wanted if not name.startswith("head")]))
    return path


@pytest.fixture(scope="module")
def sound() -> Audio:
    return Audio(np.zeros(2 * 48_000, np.float32), 48_000)


def of_mouth(found: dict[str, Any], wanted: dict[str, list[float]], names: Path) -> float:
    """Return the largest difference of the mouth in all frames."""
    listed = json.loads(names.read_text())
    mouth = [name for name in listed if name.startswith(("jaw", "mouth"))]
    values = np.array([[frame["face"][listed.index(name)] for name in mouth] for frame in found["frames"]])
    return float(np.abs(values - np.array([wanted[name] for name in mouth]).T).max())


def compare(found: dict[str, Any], wanted: dict[str, list[float]], names: Path, least: float) -> None:
    """Compare all frames of both faces; the earlier keys at frames 2 and 500 are gone."""
    listed = json.loads(names.read_text())
    assert found["fps"] == 24
    assert found["last"] == len(wanted["jawOpen"])
    for which in ("face", "other"):
        values = np.array([frame[which] for frame in found["frames"]])
        assert np.abs(values - np.array([wanted[name] for name in listed]).T).max() < least
    assert np.ptp([frame["face"][listed.index("jawOpen")] for frame in found["frames"]]) > 0.2
    assert found["strips"] == ["lipmotion sound"] * found["plays_sound"]
    assert found["end"] >= found["last"]


@pytest.mark.parametrize("kind", ["legacy", "extension"])
def test_the_addon_keys_a_face(kind, generation, wanted, names, sound, tmp_path):
    write_addon("blender", tmp_path / "addon.zip")
    curves, chosen = with_curves(generation, "face")
    write(curves, [tmp_path / "a.json", tmp_path / "a.wav"], speech=sound, channels=chosen)
    files = (tmp_path / "addon.zip", tmp_path / "a.json", tmp_path / "a.wav", names)
    found = run_with("bpy", "blender_keys.py", kind, *files, folder=tmp_path / "user")
    assert found["answer"] == ["FINISHED"]
    compare(found, wanted, names, 1e-5)


def test_the_addon_keys_from_a_take_of_live_link_face(generation, wanted, names, sound, tmp_path):
    write_addon("blender", tmp_path / "addon.zip")
    write(generation, [tmp_path / "a.livelink.csv", tmp_path / "a.wav"], speech=sound, rate_hz=100.0)
    files = (tmp_path / "addon.zip", tmp_path / "a.livelink.csv", tmp_path / "a.wav", names)
    found = run_with("bpy", "blender_keys.py", "legacy", *files, folder=tmp_path / "user")
    assert of_mouth(found, wanted, names) < ROUNDED


def test_the_script_keys_a_face(generation, names, sound, wanted, tmp_path):
    write(generation, [tmp_path / "a.blender.py", tmp_path / "a.wav"], speech=sound)
    found = run_with("bpy", "blender_keys.py", "script", tmp_path / "a.blender.py", names)
    assert of_mouth(found, wanted, names) < ROUNDED
    assert found["strips"] == ["lipmotion sound"] * found["plays_sound"]


def test_the_script_keys_bones_and_properties(generation, names, sound, tmp_path):
    (tmp_path / "rig.csv").write_text("control,source,gain\n" + RIG)
    curves, chosen = with_curves(generation, tmp_path / "rig.csv")
    write(curves, tmp_path / "a.blender.py", speech=sound, channels=chosen)
    found = run_with("bpy", "blender_keys.py", "script", tmp_path / "a.blender.py", names)
    time_s = np.arange(len(found["frames"])) / 24
    for name, field in (("jaw.master.rotation.x", "jaw"), ("jaw.master[open]", "open"), ("[lips]", "lips")):
        curve = np.interp(time_s, curves.motion.time_s, curves.motion[name])
        got = [frame[field] for frame in found["frames"]]
        assert got[: len(time_s)] == pytest.approx(curve.tolist(), abs=2e-4)
        assert max(got) > 0.1
